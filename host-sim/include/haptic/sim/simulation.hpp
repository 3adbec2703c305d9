// One scene in motion: bodies, tool, and what the hand is sent after each step.
//
// A step takes the device as it is at a time t and
//   1. finds the secure positions of the tool's standing proxies among the surfaces as they moved until t (CCD), and
//      pops them out of what still clips them;
//   2. moves the proxies toward where the device has them among the surfaces at t, and lets the tool's constraints act
//      (tool_proxies.hpp);
//   3. pushes the touched particles with the coupling's force, and steps the bodies to t + dt;
//   4. makes the contact frame: planes at t, with the velocity that takes each surface to where it is at t + dt. So a
//      haptic loop that moves the planes on between t and t + dt interpolates; it extrapolates only beyond.
// The tool comes first so that the scheme stays semi-implicit (thesis, section 3.3, Algorithms 3 and 4).
//
// The result depends on the sequence of inputs only, bit for bit: no clock, no random numbers, no libm but sqrt.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "haptic/frames.hpp"
#include "haptic/sim/live_settings.hpp"
#include "haptic/sim/mesh.hpp"
#include "haptic/sim/particles.hpp"
#include "haptic/sim/scene.hpp"
#include "tool/tool_proxies.hpp"
#include "haptic/sim/workspace.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

/// The device at the beginning of a step.
struct StepInput {
    std::int64_t time_ns = 0;          // beginning of the step; the planes of the frame hold then
    Pose device;                       // device frame
    std::uint32_t buttons = 0;         // bit k: button k is held
    std::optional<double> curl;        // 0..1, of a hand that can close; none: by its button (ToolSettings)
    std::uint64_t state_sequence = 0;  // of the device state that this is; 0 if of none
    std::int64_t state_time_ns = 0;    // its latch time
};

/// The input that a device state stands for.
[[nodiscard]] StepInput input_from(const DeviceState& state, std::int64_t time_ns) noexcept;

/// Durations of the parts of a step; all 0 without a clock.
struct StageTimes {
    std::int64_t ccd_ns = 0;  // refit of the tree and secure position
    std::int64_t popout_ns = 0;
    std::int64_t proxy_ns = 0;    // virtual proxies, planes in reach, contact force
    std::int64_t tool_ns = 0;     // constraints of the tool
    std::int64_t collide_ns = 0;  // bodies among themselves and with the ground
    std::int64_t deform_ns = 0;   // forces, constraints, integration
    std::int64_t skin_ns = 0;
    std::int64_t total_ns = 0;  // of the step without its verification
};

/// Where the step deals with many proxies, numbers are those of the one that is worst off, flags are set by any.
struct StepResult {
    double time = 0.0;                           // s, since the start: when the step began
    double step = 0.0;                           // s, its length
    Vec3 proxy{0.0};                             // m, scene: the tool's origin, where its particles have it
    Quat proxy_orientation{1.0, 0.0, 0.0, 0.0};  // scene_from_tool, likewise
    Vec3 hip{0.0};                               // m, scene: the device, mapped
    Quat hip_orientation{1.0, 0.0, 0.0, 0.0};    // likewise
    Vec3 force{0.0};                             // N, scene, on the tool; its opposite went to the particles
    Vec3 torque{0.0};                            // N*m, scene, on the tool about the hip
    Vec3 hand_force{0.0};                        // N, device frame, as felt at the hand
    Vec3 hand_torque{0.0};                       // N*m, likewise
    double curl = 0.0;                           // 0..1, how far the hand is closed
    double depth = 0.0;                          // m, scene, how far the goal of a proxy is beyond the surface
    bool in_contact = false;
    std::size_t collided = 0;    // proxies in contact
    int rides = 0;               // moves with the surfaces that found the secure position
    int pop_out_iterations = 0;  // moves out of what still clipped a proxy then
    bool squeezed = false;       // less room than the proxy's radius
    bool let_through = false;    // the surfaces left no room at all; one passed
    bool crossed = false;        // verification: a proxy's centre passed through a surface in this step
    std::size_t crossings = 0;   // proxies of which that is true
    StageTimes times;
};

/// One body among all: its mesh at rest, with its own numbering, and where its parts lie among those of all.
struct SceneBody {
    std::string name;
    std::size_t first_vertex = 0;
    std::size_t first_particle = 0;
    TriangleMesh mesh;
};

class Simulation {
  public:
    /// Monotonic nanoseconds, for timing the stages.
    using ClockFunction = std::int64_t (*)();

    /// The tool starts where the scripted hand is at time 0, as far closed. Throws std::invalid_argument.
    explicit Simulation(const Scene& scene, ClockFunction clock = nullptr);
    /// The same with another tool than the scene's.
    Simulation(const Scene& scene, const ToolModel& tool, ClockFunction clock = nullptr);
    Simulation(Simulation&&) noexcept;
    Simulation& operator=(Simulation&&) noexcept;
    ~Simulation();

    /// Checks each step's path of every proxy with the independent verification; costs some 0.1 ms.
    void set_verification(bool on) noexcept;

    /// Changes the mapping between device and scene from the next steps on, as the clutch does (workspace.hpp): the
    /// force fades, the tool stays where it is, and the force begins anew at zero. Throws std::invalid_argument.
    void change_workspace(const WorkspaceSettings& settings);

    /// Changes settings from the next step on, without a jump of the force (live_settings.hpp); scene() says how far
    /// they have come. The radius is that of a tool that is one sphere of the proxy's. Throws std::invalid_argument,
    /// and changes nothing, for what is out of its range.
    void change_settings(const LiveSettings& settings);
    /// What was asked for last, or the scene's own.
    [[nodiscard]] const LiveSettings& settings() const noexcept;

    /// Uncouples hand and tool at once, and couples them again within WorkspaceSettings::clutch_fade: for a hand that
    /// is suddenly elsewhere.
    void couple_anew() noexcept;

    /// Advances by Scene::solver.step. Throws std::runtime_error that names the step if the state ceases to be finite.
    /// Does not allocate unless it verifies.
    StepResult step(const StepInput& input);

    /// The input that puts the hand at its scripted place at a time since the start, as far closed as the script says.
    [[nodiscard]] StepInput scripted_input(std::int64_t time_ns) const;

    /// What the step found, for the haptic loop. The ring fills in sequence and session, the publisher its time.
    [[nodiscard]] const ContactFrame& frame() const noexcept;

    /// With what was changed since.
    [[nodiscard]] const Scene& scene() const noexcept;
    [[nodiscard]] const ParticleModel& model() const noexcept;
    /// Rest mesh of all bodies; its triangles index into the vertices below.
    [[nodiscard]] const TriangleMesh& mesh() const noexcept;
    /// Objects by their number in SurfacePoint.
    [[nodiscard]] const std::vector<SceneBody>& bodies() const noexcept;
    /// At the start of the next step.
    [[nodiscard]] const std::vector<Vec3>& vertices() const noexcept;
    /// m, scene: the tool's origin.
    [[nodiscard]] const Vec3& proxy() const noexcept;
    [[nodiscard]] const ToolProxies& tool() const noexcept;
    [[nodiscard]] const Workspace& workspace() const noexcept;
    [[nodiscard]] std::uint64_t steps() const noexcept;
    /// s, since the start: when the next step begins.
    [[nodiscard]] double time() const noexcept;

    /// FNV-1a (Fowler, Noll, Vo) of the bits of the whole state: particles and proxies.
    [[nodiscard]] std::uint64_t state_hash() const noexcept;

  private:
    struct State;
    std::unique_ptr<State> state_;
};

}  // namespace haptic::sim
