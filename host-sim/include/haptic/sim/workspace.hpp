// The mapping between the device, which moves within centimetres, and the scene, which is metres wide.
//
//     x_device = offset + rotation * (scale * x_scene)            F_hand = force_scale * rotation * F_scene
//
// A spring k in the scene is then felt as k_hand = force_scale * k / scale, a damper likewise, a torque T as
// force_scale * scale * rotation * T. Work at the hand is force_scale * scale times the work in the scene, whatever the
// motion, so that a passive scene is passive at the hand.
//
// The tool is turned with the grip, scene_from_tool = rotation^-1 * device_from_grip * grip_from_tool. The last factor
// is 1 until the clutch lets the grip turn alone; so a turn of the hand about an axis of the room turns the tool about
// the same axis of the scene, however the two lie to one another.
#pragma once

#include <optional>

#include "haptic/frames.hpp"
#include <haptic/sim/contact.hpp>
#include "haptic/types.hpp"

namespace haptic::sim {

struct WorkspaceSettings {
    double scale = 0.03;                // m at the device for each m in the scene; 0.001 .. 10
    Vec3 offset{0.0, 0.0, 0.0};         // m, device frame, where the scene's origin lies
    Quat rotation{1.0, 0.0, 0.0, 0.0};  // device_from_scene
    double force_scale = 0.2;           // N at the hand for each N in the scene; 0 .. 100
    int clutch_button = -1;             // the button that uncouples the grip while it is held; -1: none
    double clutch_fade = 0.1;           // s, in which the force fades out once it is held

    bool operator==(const WorkspaceSettings&) const = default;
};

class Workspace {
  public:
    /// Throws std::invalid_argument for a scale that is not positive or a negative force scale.
    explicit Workspace(const WorkspaceSettings& settings);

    [[nodiscard]] Vec3 to_scene(const Vec3& device_position) const noexcept;
    [[nodiscard]] Vec3 to_device(const Vec3& scene_position) const noexcept;
    [[nodiscard]] Vec3 force_to_device(const Vec3& scene_force) const noexcept;
    [[nodiscard]] Vec3 velocity_to_device(const Vec3& scene_velocity) const noexcept;
    /// Of a spring or a damper.
    [[nodiscard]] double coupling_to_device(double scene_value) const noexcept;
    [[nodiscard]] Vec3 torque_to_device(const Vec3& scene_torque) const noexcept;
    /// scene_from_tool, m in the scene, of device_from_grip, m at the device; and back.
    [[nodiscard]] Pose to_scene(const Pose& grip) const noexcept;
    [[nodiscard]] Pose to_device(const Pose& tool) const noexcept;
    /// m, tool's frame, scene: to m, grip's frame, device.
    [[nodiscard]] Vec3 offset_to_grip(const Vec3& tool_offset) const noexcept;
    /// The plane with its offset and velocity as the device sees them.
    [[nodiscard]] ContactPlane to_device(const SurfacePlane& plane) const noexcept;

    /// Moves the offset, and turns the tool in the grip, so that the two poses coincide.
    void anchor(const Pose& grip, const Pose& tool) noexcept;

    /// Of now: with the offset that anchor() left.
    [[nodiscard]] const WorkspaceSettings& settings() const noexcept { return settings_; }
    /// m, the offset that was asked for.
    [[nodiscard]] const Vec3& asked_offset() const noexcept { return asked_offset_; }

  private:
    WorkspaceSettings settings_;
    Vec3 asked_offset_;
    Mat3 device_from_scene_;  // rotation only
    Quat grip_from_tool_{1.0, 0.0, 0.0, 0.0};
};

/// The clutch: lets the hand travel and turn while the tool in the scene stands, and the mapping change under it.
///
/// While the button is held, the device end of the tool (the hip) stays where it was in the scene, and the coupling
/// fades to nothing. Once it has, the hip is laid onto the tool, so that on release the force begins at zero; both
/// ways the force changes without a jump. A tool of many particles that surfaces keep out of its shape is pulled at
/// however the hip lies; there the coupling comes back as it faded.
///
/// A change of the mapping works the clutch by itself: the coupling fades, the new mapping is taken, and the hip is
/// laid onto the tool, so that the hand goes on from where the tool is. Only where another offset is asked for than
/// before, the tool travels there first, and turns as the grip is turned, as far as the surfaces let it, while nothing
/// is coupled.
class Clutch {
  public:
    /// The tool as the last step left it.
    struct Tool {
        Pose pose;             // scene_from_tool
        bool in_shape = true;  // with the hip there, no particle would be pulled at
    };
    /// Takes the button's state at the beginning of a step and returns the hip in the scene. Moves the workspace's
    /// anchor as long as the grip is not coupled, and changes the mapping once it is uncoupled.
    [[nodiscard]] Pose engage(bool held, const Pose& grip, const Tool& tool, double step_s,
                              Workspace& workspace) noexcept;

    /// Asks for another mapping; the last one asked for counts.
    void change_to(const Workspace& next) noexcept { next_ = next; }
    /// A change is under way: asked for, not yet taken or not yet coupled again.
    [[nodiscard]] bool changing() const noexcept { return next_.has_value() || apart_s_ > 0.0; }

    /// Uncouples at once; the coupling comes back within the fade.
    void begin_anew() noexcept { gain_ = 0.0; }

    /// Factor of the coupling, 0..1.
    [[nodiscard]] double gain() const noexcept { return gain_; }
    [[nodiscard]] bool uncoupled() const noexcept { return gain_ <= 0.0; }

  private:
    void take(const Workspace& next, const Pose& grip, const Pose& tool, Workspace& workspace) noexcept;

    bool held_ = false;
    double gain_ = 1.0;
    Pose hip_;
    std::optional<Workspace> next_;
    double apart_s_ = 0.0;  // s, left until a change of the mapping is coupled again
};

}  // namespace haptic::sim
