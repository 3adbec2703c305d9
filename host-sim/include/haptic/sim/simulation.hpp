// Simulation: one scene in motion. Each step moves the bodies and the tool, and makes the contact frame for the haptic
// loop.
//
// A step takes the device's pose at a time t and
//   1. finds secure positions of the tool's proxies among the surfaces as they moved until t (CCD), and pops them
//      out of remaining overlap;
//   2. moves the proxies to the tool's equilibrium among the surfaces at t (tool_proxies.hpp);
//   3. steps the bodies to t + dt, with the coupling to the tool among their constraints (contact_coupling.hpp);
//   4. makes the contact frame: planes at t, with the velocities that take the surfaces to t + dt. The haptic loop thus
//      interpolates between t and t + dt and extrapolates only beyond.
// The tool comes first, so that the scheme is semi-implicit (thesis, section 3.3, Algorithms 3 and 4).
//
// The result depends on the sequence of inputs only, bit for bit: no clock, no random numbers, no libm but sqrt.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "haptic/frames.hpp"
#include "haptic/sim/contact.hpp"
#include "haptic/sim/live_settings.hpp"
#include "haptic/sim/mesh.hpp"
#include "haptic/sim/particles.hpp"
#include "haptic/sim/progress.hpp"
#include "haptic/sim/scene.hpp"
#include "haptic/sim/scene_body.hpp"
#include "haptic/sim/workspace.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

class ToolProxies;

/// What the device has rendered of the contact frames (frames.h). Device frame.
struct DeviceFeedback {
    double stiffness = 0.0;          // N/m, of the coupling after the device's limits
    double scale = 0.0;              // 0..1, part of the frame's wrench that is rendered
    Vec3 impulse{0.0};               // N*s, at the hand since the device's process began
    bool stiffness_limited = false;  // the frame asks for more than `stiffness`
};

/// State of the device at the beginning of a step.
struct StepInput {
    std::int64_t time_ns = 0;          // beginning of the step, at which the frame's planes hold
    Pose device;                       // device frame
    std::uint32_t buttons = 0;         // bit k: button k is pressed
    std::optional<double> curl;        // 0..1, for a tool that can close; nullopt: by its button (ToolSettings)
    std::uint64_t state_sequence = 0;  // of the device state it comes from; 0: none
    std::int64_t state_time_ns = 0;    // latch time of that device state
    /// nullopt: there is no device, and the hand feels the whole force.
    std::optional<DeviceFeedback> feedback;
};

/// Input from a device state.
[[nodiscard]] StepInput input_from(const DeviceState& state, std::int64_t time_ns) noexcept;

/// Duration of each stage of a step; 0 without a clock.
struct StageTimes {
    std::int64_t ccd_ns = 0;  // secure positions, refit of the trees for the next step
    std::int64_t popout_ns = 0;
    std::int64_t proxy_ns = 0;    // speculative planes, contact coupling
    std::int64_t tool_ns = 0;     // the tool's equilibrium: contact problem, moves of the proxies
    std::int64_t collide_ns = 0;  // collisions between bodies and with the ground, and of surfaces
    std::int64_t deform_ns = 0;   // forces, constraints, integration
    std::int64_t skin_ns = 0;
    std::int64_t total_ns = 0;  // without verification
};

/// Crossings of the surfaces at the end of a step, by verification (verification/surface_crossings.hpp). `sheets` is
/// without what touches or crosses at rest. Sheets are bodies whose vertices are their particles, with
/// collisions.surfaces.
struct SurfaceCrossingCounts {
    std::size_t sheets = 0;        // edges of sheets that pierce a triangle of their own or another sheet
    std::size_t solids = 0;        // edges through a triangle from which they are kept apart, one of them of a solid
    std::size_t others = 0;        // other edges that pierce a triangle
    std::size_t below_ground = 0;  // vertices of bodies that can move, if collisions.ground is on
    double ground_depth = 0.0;     // m, of the deepest
};

/// Result of a step. With several proxies, counts and depths are the maximum over all, flags are set by any.
struct StepResult {
    double time = 0.0;                           // s, since the start: beginning of the step
    double step = 0.0;                           // s, its length
    Vec3 proxy{0.0};                             // m, scene: tool's origin, fitted to its particles
    Quat proxy_orientation{1.0, 0.0, 0.0, 0.0};  // scene_from_tool, fitted alike
    Vec3 hip{0.0};                               // m, scene: the device's position, mapped
    Quat hip_orientation{1.0, 0.0, 0.0, 0.0};    // scene_from_tool at the hip
    Vec3 force{0.0};                             // N, scene, on the tool; the bodies received its opposite
    Vec3 torque{0.0};                            // N*m, scene, on the tool about the hip
    Vec3 hand_force{0.0};                        // N, device frame, at the hand
    Vec3 hand_torque{0.0};                       // N*m, device frame, at the hand
    Vec3 hand_impulse{0.0};                      // N*s, device frame: received by the hand since the last step
    Vec3 body_impulse{0.0};                      // N*s, device frame: opposite of what the bodies received in this step
    double curl = 0.0;                           // 0..1
    double depth = 0.0;                          // m, scene, of a proxy's goal beyond the surface
    bool in_contact = false;
    std::size_t collided = 0;        // proxies in contact
    int advances = 0;                // moves of the secure-position search
    int pop_out_iterations = 0;      // moves of the pop-out
    bool overconstrained = false;    // a proxy has less room than its radius; where it has none, surfaces stand still
    bool stood_still = false;        // a body was put back to where it was before its last motion
    std::size_t asleep = 0;          // bodies that sleep: they stay in place until something comes near
    double equilibrium_error = 0.0;  // m, of a proxy from where the tool's equilibrium has it
    bool crossed = false;            // by verification: a proxy's centre crossed a surface in this step
    std::size_t crossings = 0;       // number of such proxies
    SurfaceCrossingCounts surfaces;
    StageTimes times;
};

class Simulation {
  public:
    /// Monotonic clock, ns, to time the stages.
    using ClockFunction = std::int64_t (*)();

    /// The tool starts at the scripted hand's pose and curl at time 0. `progress` is that of building, which takes
    /// seconds for large bodies. Throws std::invalid_argument.
    explicit Simulation(const Scene& scene, ClockFunction clock = nullptr, const Progress& progress = {});
    /// With a tool that replaces the scene's.
    Simulation(const Scene& scene, const ToolModel& tool, ClockFunction clock = nullptr);
    Simulation(Simulation&&) noexcept;
    Simulation& operator=(Simulation&&) noexcept;
    ~Simulation();

    /// Checks in every step, by an independent method, the path of every proxy and whether surfaces pass through
    /// themselves, one another or the ground. Allocates.
    void set_verification(bool on);

    /// Changes the mapping between device and scene over the next steps, by way of the clutch (workspace.hpp): the
    /// force fades out, the tool stays in place, and the force restarts at zero. Throws std::invalid_argument.
    void change_workspace(const WorkspaceSettings& settings);

    /// Changes settings from the next step on, without a jump of the force (live_settings.hpp); scene() has their
    /// current values. The radius applies to a tool of one sphere of proxy.radius. Throws std::invalid_argument for a
    /// value out of range, and then changes nothing.
    void change_settings(const LiveSettings& settings);
    /// The settings last requested, or the scene's own.
    [[nodiscard]] const LiveSettings& settings() const noexcept;

    /// Takes steps of another length from the next one on, s, each in `substeps` equal parts. Without a transition: for
    /// parts of the same length, whose bodies stay as stiff. Throws std::invalid_argument as the solver does.
    void change_rate(double step, int substeps);

    /// Uncouples hand and tool at once and couples them again within WorkspaceSettings::clutch_fade, for a hand that
    /// has jumped.
    void recouple() noexcept;

    /// Advances by Scene::solver.step. Throws std::runtime_error with the step's number if the state is no longer
    /// finite. No allocation, unless verification is on.
    StepResult step(const StepInput& input);

    /// Scripted pose and curl of the hand, time_ns after the start, with the button that closes it as far.
    [[nodiscard]] StepInput scripted_input(std::int64_t time_ns) const;

    /// Contact frame of the last step. The ring sets sequence and session, the publisher its time.
    [[nodiscard]] const ContactFrame& frame() const noexcept;

    /// Scene with its current settings.
    [[nodiscard]] const Scene& scene() const noexcept;
    [[nodiscard]] const ParticleModel& model() const noexcept;
    /// Rest mesh of all bodies; its triangles index vertices().
    [[nodiscard]] const TriangleMesh& mesh() const noexcept;
    /// Bodies; SurfacePoint::object is an index into them.
    [[nodiscard]] const std::vector<SceneBody>& bodies() const noexcept;
    /// m, scene: at the beginning of the next step. They stay at the same address, as do the vectors of model().
    [[nodiscard]] const std::vector<Vec3>& vertices() const noexcept;
    /// m, scene: the tool's origin.
    [[nodiscard]] const Vec3& proxy() const noexcept;
    [[nodiscard]] const ToolProxies& tool() const noexcept;
    /// Scene: what touched or pressed on the tool in the last step. Empty while nothing couples it to the bodies.
    [[nodiscard]] std::span<const SurfaceForce> surface_forces() const noexcept;
    [[nodiscard]] const Workspace& workspace() const noexcept;
    /// Equal parts into which a step is divided, unless contacts ask for more.
    [[nodiscard]] int substeps() const noexcept;
    /// Whether any body lacks a material, or has constraints, so that solver.iterations counts.
    [[nodiscard]] bool iterates() const noexcept;
    [[nodiscard]] std::uint64_t steps() const noexcept;
    /// s, since the start: beginning of the next step.
    [[nodiscard]] double time() const noexcept;

    /// FNV-1a hash of the bits of the state: particles and proxies.
    [[nodiscard]] std::uint64_t state_hash() const noexcept;

  private:
    struct State;
    std::unique_ptr<State> state_;
};

}  // namespace haptic::sim
