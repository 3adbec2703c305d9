// One scene in motion: models, proxy, and what the hand is sent after each step.
//
// A step takes the device as it is at a time t and
//   1. finds the secure position of the standing proxy among the surfaces as they moved until t (CCD), and pops it out
//      of what still clips it;
//   2. moves the proxy toward the device among the surfaces at t;
//   3. pushes the touched particles with the coupling's force, and steps the models to t + dt;
//   4. makes the contact frame: planes at t, with the velocity that takes each surface to where it is at t + dt. So a
//      haptic loop that moves the planes on between t and t + dt interpolates; it extrapolates only beyond.
// The proxy comes first so that the scheme stays semi-implicit (thesis, section 3.3 and Algorithm 3).
//
// The result depends on the sequence of inputs only, bit for bit: no clock, no random numbers, no libm but sqrt.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "haptic/frames.hpp"
#include "haptic/sim/mesh.hpp"
#include "haptic/sim/particles.hpp"
#include "haptic/sim/scene.hpp"
#include "haptic/sim/workspace.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

/// The device at the beginning of a step.
struct StepInput {
    std::int64_t time_ns = 0;          // beginning of the step; the planes of the frame hold then
    Pose device;                       // device frame
    std::uint32_t buttons = 0;         // bit k: button k is held
    std::uint64_t state_sequence = 0;  // of the device state that this is; 0 if of none
    std::int64_t state_time_ns = 0;    // its latch time
};

/// The input that a device state stands for.
[[nodiscard]] StepInput input_from(const DeviceState& state, std::int64_t time_ns) noexcept;

/// Durations of the parts of a step; all 0 without a clock.
struct StageTimes {
    std::int64_t ccd_ns = 0;  // refit of the tree and secure position
    std::int64_t popout_ns = 0;
    std::int64_t proxy_ns = 0;    // virtual proxy, planes in reach, contact force
    std::int64_t collide_ns = 0;  // bodies among themselves and with the ground
    std::int64_t deform_ns = 0;   // forces, constraints, integration
    std::int64_t skin_ns = 0;
    std::int64_t total_ns = 0;  // of the step without its verification
};

struct StepResult {
    Vec3 proxy{0.0};       // m, scene
    Vec3 hip{0.0};         // m, scene: the device, mapped
    Vec3 force{0.0};       // N, scene, on the tool; its opposite went to the particles
    Vec3 hand_force{0.0};  // N, device frame, as felt at the hand
    double depth = 0.0;    // m, scene, how far the hip is beyond the surface
    bool in_contact = false;
    int rides = 0;               // moves with the surfaces that found the secure position
    int pop_out_iterations = 0;  // moves out of what still clipped the proxy then
    bool squeezed = false;       // less room than the proxy's radius
    bool let_through = false;    // the surfaces left no room at all; one passed
    bool crossed = false;        // verification: the proxy's centre passed through a surface in this step
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

    /// The proxy starts at the scene position of the scripted hand at time 0. Throws std::invalid_argument.
    explicit Simulation(const Scene& scene, ClockFunction clock = nullptr);
    Simulation(Simulation&&) noexcept;
    Simulation& operator=(Simulation&&) noexcept;
    ~Simulation();

    /// Checks each step's path of the proxy with the independent verification; costs some 0.1 ms a step.
    void set_verification(bool on) noexcept;

    /// Changes the mapping between device and scene from the next steps on, as the clutch does (workspace.hpp): the
    /// force fades, the tool stays where it is, and the force begins anew at zero. Throws std::invalid_argument.
    void change_workspace(const WorkspaceSettings& settings);

    /// Advances by Scene::solver.step. Throws std::runtime_error that names the step if the state ceases to be finite.
    /// Does not allocate unless it verifies.
    StepResult step(const StepInput& input);

    /// The input that puts the hand at its scripted place at a time since the start.
    [[nodiscard]] StepInput scripted_input(std::int64_t time_ns) const;

    /// What the step found, for the haptic loop. The ring fills in sequence and session, the publisher its time.
    [[nodiscard]] const ContactFrame& frame() const noexcept;

    [[nodiscard]] const Scene& scene() const noexcept;
    [[nodiscard]] const ParticleModel& model() const noexcept;
    /// Rest mesh of all bodies; its triangles index into the vertices below.
    [[nodiscard]] const TriangleMesh& mesh() const noexcept;
    /// Objects by their number in SurfacePoint.
    [[nodiscard]] const std::vector<SceneBody>& bodies() const noexcept;
    /// At the start of the next step.
    [[nodiscard]] const std::vector<Vec3>& vertices() const noexcept;
    [[nodiscard]] const Vec3& proxy() const noexcept;
    [[nodiscard]] const Workspace& workspace() const noexcept;
    [[nodiscard]] std::uint64_t steps() const noexcept;

    /// FNV-1a (Fowler, Noll, Vo) of the bits of the whole state: particles and proxy.
    [[nodiscard]] std::uint64_t state_hash() const noexcept;

  private:
    struct State;
    std::unique_ptr<State> state_;
};

}  // namespace haptic::sim
