// Workspace: the mapping between the device, which moves within centimetres, and the scene, which is metres wide.
//
//     x_device = offset + rotation * (scale * x_scene)            F_hand = force_scale * rotation * F_scene
//
// The hand feels a spring k of the scene as force_scale * k / scale, and a torque T as force_scale * scale * rotation *
// T. Work at the hand is force_scale * scale times the work in the scene for any motion, so a passive scene is passive
// at the hand.
//
// The tool rotates with the grip: scene_from_tool = rotation^-1 * device_from_grip * grip_from_tool. The last factor is
// the identity until the clutch lets the grip rotate alone. A rotation of the hand about an axis of the room thus
// rotates the tool about the same axis of the scene, whatever their relative orientation.
#pragma once

#include <optional>

#include "haptic/frames.hpp"
#include "haptic/sim/contact.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

struct WorkspaceSettings {
    double scale = 0.03;                // m at the device per m in the scene; 0.001 .. 10
    Vec3 offset{0.0, 0.0, 0.0};         // m, device frame: position of the scene's origin
    Quat rotation{1.0, 0.0, 0.0, 0.0};  // device_from_scene
    double force_scale = 0.2;           // N at the hand per N in the scene; 0 .. 100
    int clutch_button = -1;             // button that uncouples the grip while held; -1: none
    double clutch_fade = 0.1;           // s, from pressing the button to zero force

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
    /// Stiffness, N/m.
    [[nodiscard]] double coupling_to_device(double scene_value) const noexcept;
    [[nodiscard]] Vec3 torque_to_device(const Vec3& scene_torque) const noexcept;
    /// Work, J: forces and displacements are scaled.
    [[nodiscard]] double work_to_device(double scene_work) const noexcept;
    /// The inverse; 0 for a force scale of 0, which lets the hand feel nothing.
    [[nodiscard]] Vec3 force_to_scene(const Vec3& device_force) const noexcept;
    [[nodiscard]] double coupling_to_scene(double device_value) const noexcept;
    /// device_from_grip (m, device) to scene_from_tool (m, scene), and back.
    [[nodiscard]] Pose to_scene(const Pose& grip) const noexcept;
    [[nodiscard]] Pose to_device(const Pose& tool) const noexcept;
    /// Offset in the tool frame (m, scene) to the grip frame (m, device).
    [[nodiscard]] Vec3 offset_to_grip(const Vec3& tool_offset) const noexcept;
    /// Plane in the device frame, its offset (m) and velocity (m/s) included.
    [[nodiscard]] ContactPlane to_device(const SurfacePlane& plane) const noexcept;

    /// Adjusts the offset and grip_from_tool so that this grip pose maps to this tool pose.
    void anchor(const Pose& grip, const Pose& tool) noexcept;

    /// Current settings, with the offset that anchor() adjusted.
    [[nodiscard]] const WorkspaceSettings& settings() const noexcept { return settings_; }
    /// m, the offset before any anchor().
    [[nodiscard]] const Vec3& requested_offset() const noexcept { return requested_offset_; }

  private:
    WorkspaceSettings settings_;
    Vec3 requested_offset_;
    Mat3 device_from_scene_;  // rotation part
    Quat grip_from_tool_{1.0, 0.0, 0.0, 0.0};
};

/// Clutch: lets the hand move while the tool stays, and the mapping change without a jump of the force.
/// While the button is held, the hip stays where it was in the scene and the coupling fades to zero. Then the hip is
/// moved to the tool, so that on release the force starts at zero. A tool that surfaces hold out of its rest shape has
/// spring forces for any hip; its coupling fades in again instead. A change of the mapping operates the clutch by
/// itself: the coupling fades out, the new mapping takes effect, and the hip is moved to the tool. If the requested
/// offset differs, the tool first moves to the new pose of the grip, stopped by surfaces, while uncoupled.
class Clutch {
  public:
    /// Tool after the last step.
    struct Tool {
        Pose pose;             // scene_from_tool
        bool in_shape = true;  // with the hip at `pose` no particle has a spring force
    };
    /// To be called at the beginning of each step of step_s (s) with the button's state; returns the hip, scene.
    /// Anchors the workspace while uncoupled, and replaces it when a new mapping is due.
    [[nodiscard]] Pose engage(bool held, const Pose& grip, const Tool& tool, double step_s,
                              Workspace& workspace) noexcept;

    /// Requests another mapping; the last request counts.
    void change_mapping(const Workspace& next) noexcept { next_ = next; }
    /// A requested mapping is not in effect yet, or not coupled again yet.
    [[nodiscard]] bool changing() const noexcept { return next_.has_value() || uncoupled_left_s_ > 0.0; }

    /// Uncouples at once; the coupling fades in again.
    void recouple() noexcept { gain_ = 0.0; }

    /// Factor of the coupling, 0..1.
    [[nodiscard]] double gain() const noexcept { return gain_; }
    [[nodiscard]] bool uncoupled() const noexcept { return gain_ <= 0.0; }

  private:
    void take_mapping(const Workspace& next, const Pose& grip, const Pose& tool, Workspace& workspace) noexcept;

    bool held_ = false;
    double gain_ = 1.0;
    Pose hip_;
    std::optional<Workspace> next_;
    double uncoupled_left_s_ = 0.0;  // s, until the coupling may return after a change of the mapping
};

}  // namespace haptic::sim
