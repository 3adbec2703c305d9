#include "haptic/sim/simulation.hpp"

#include <algorithm>
#include <array>
#include <glm/geometric.hpp>
#include <stdexcept>
#include <string>

#include "haptic/denormals.hpp"
#include "haptic/sim/contact/planes_in_reach.hpp"
#include "haptic/sim/contact/pop_out.hpp"
#include "haptic/sim/contact/secure_position.hpp"
#include "haptic/sim/contact/swept_tree.hpp"
#include "haptic/sim/contact/verification.hpp"
#include "haptic/sim/contact/virtual_proxy.hpp"
#include "haptic/sim/contact_force.hpp"
#include "haptic/sim/state_hash.hpp"

namespace haptic::sim {
namespace {

ParticleModel make_model(const Scene& scene) {
    ParticleModel model =
        make_cloth_particles(scene.model.cloth, scene.model.group_stiffness, scene.model.link_stiffness);
    std::fill(model.velocity.begin(), model.velocity.end(), scene.model.velocity);
    return model;
}

/// Time since the last call, by the caller's clock; 0 without one.
class Stopwatch {
  public:
    explicit Stopwatch(Simulation::ClockFunction clock) : clock_(clock), last_(now()) {}
    std::int64_t lap() {
        const std::int64_t before = last_;
        last_ = now();
        return last_ - before;
    }

  private:
    [[nodiscard]] std::int64_t now() const { return clock_ == nullptr ? 0 : clock_(); }
    Simulation::ClockFunction clock_;
    std::int64_t last_;
};

}  // namespace

StepInput input_from(const DeviceState& state, std::int64_t time_ns) noexcept {
    return {time_ns, pose_of(state), state.buttons, state.sequence, state.latch_time_ns};
}

struct Simulation::State {
    State(const Scene& which, ClockFunction time)
        : scene(which),
          clock(time),
          model(make_model(which)),
          solver(model, which.solver),
          mesh(make_cloth_mesh(which.model.cloth)),
          start(mesh.vertices),
          end(mesh.vertices),
          tree(mesh.vertices, mesh.triangles),
          mask(mesh, model.mass, which.coupling.mask_radius),
          workspace(which.workspace),
          contact(which.contact),
          force(model.size(), Vec3(0.0)),
          proxy(which.hand.at(0).position) {}

    [[nodiscard]] SurfaceMotion motion() const { return {start, end, mesh.triangles}; }
    /// Velocity of the hip over the step that ends at its new position.
    [[nodiscard]] Vec3 hip_velocity_to(const Vec3& hip) {
        const Vec3 velocity = steps == 0 ? Vec3(0.0) : (hip - last_hip) / scene.solver.step;
        last_hip = hip;
        return velocity;
    }
    [[nodiscard]] bool clutch_held(std::uint32_t buttons) const {
        const int button = workspace.settings().clutch_button;
        return button >= 0 && ((buttons >> static_cast<unsigned>(button)) & 1u) != 0;
    }

    void find_contact(StepResult& result, Stopwatch& watch);
    void couple(StepResult& result, const Vec3& hip_velocity);
    void skin();
    void verify(StepResult& result) const;
    void build_frame(const StepInput& input, const StepResult& result);

    Scene scene;
    ClockFunction clock;
    ParticleModel model;
    ParticleSolver solver;
    TriangleMesh mesh;
    std::vector<Vec3> start;  // vertices at the beginning and the end of the last step
    std::vector<Vec3> end;
    SweptTree tree;
    PressureMask mask;
    Workspace workspace;
    Clutch clutch;
    ContactSettings contact;
    std::vector<Vec3> force;  // N, per particle
    double damping = 0.0;     // N*s/m, of all contacts of the last step, scene
    Vec3 proxy;
    Vec3 last_hip{0.0};
    ProxyPath path;
    SurfacePlanes contacts;  // that hold the proxy
    SurfacePlanes planes;    // that the haptic loop gets
    ContactFrame frame{};
    std::uint64_t steps = 0;
    bool verifying = false;
};

Simulation::Simulation(const Scene& scene, ClockFunction clock) : state_(std::make_unique<State>(scene, clock)) {}
Simulation::Simulation(Simulation&&) noexcept = default;
Simulation& Simulation::operator=(Simulation&&) noexcept = default;
Simulation::~Simulation() = default;

void Simulation::set_verification(bool on) noexcept {
    state_->verifying = on;
}

void Simulation::State::find_contact(StepResult& result, Stopwatch& watch) {
    const double radius = scene.proxy.radius;
    path.restart(proxy);
    const MovingSurface surface{motion(), &tree};
    const std::span<const MovingSurface> surfaces(&surface, 1);

    tree.refit(surface.motion);
    const SecurePosition secure = secure_position(surfaces, proxy, radius, contact, &path);
    result.times.ccd_ns = watch.lap();

    const PopOut popped = pop_out(surfaces, secure.position, radius, contact, &path);
    result.times.popout_ns = watch.lap();

    const ProxyMove move = move_proxy(surfaces, popped.position, result.hip, radius, scene.solver.step, contact, &path);
    proxy = move.position;
    contacts = move.contacts;
    planes = planes_in_reach(
        surfaces, contacts, {.position = proxy, .radius = radius, .reach = scene.proxy.reach, .dt = scene.solver.step});
    result.times.proxy_ns = watch.lap();

    result.proxy = proxy;
    result.in_contact = contacts.count > 0;
    result.squeezed = secure.squeezed || popped.squeezed;
    result.let_through = secure.let_through;
    result.depth = result.in_contact ? glm::length(proxy - result.hip) : 0.0;
}

void Simulation::State::couple(StepResult& result, const Vec3& hip_velocity) {
    std::fill(force.begin(), force.end(), Vec3(0.0));
    damping = 0.0;
    const double stiffness = clutch.gain() * scene.coupling.stiffness;
    const ContactShares shares = divide_force(stiffness * (proxy - result.hip), contacts);
    for (std::size_t c = 0; c < contacts.count; ++c) {
        const SurfacePlane& plane = contacts.plane[c];
        const PressedPatch patch = mask.lay(plane.touched, model.velocity);
        const double closing = glm::dot(patch.velocity - hip_velocity, plane.normal);
        const double held = contact_damping(shares[c], patch.mass, scene.solver.step, scene.coupling);
        const double push = contact_push(shares[c], closing, held);
        damping += held;
        result.force += push * plane.normal;
        mask.press(-push * plane.normal, force);
    }
    result.hand_force = workspace.force_to_device(result.force);
}

void Simulation::State::skin() {
    start.swap(end);
    end = model.position;
}

void Simulation::State::verify(StepResult& result) const {
    const SurfaceMotion moved = motion();
    result.crossed =
        !path.complete() || !find_crossings(std::span<const SurfaceMotion>(&moved, 1), path.knots()).empty();
}

void Simulation::State::build_frame(const StepInput& input, const StepResult& result) {
    const double inverse_step = 1.0 / scene.solver.step;
    frame = {};
    frame.state_sequence = input.state_sequence;
    frame.state_time_ns = input.state_time_ns;
    frame.plane_time_ns = input.time_ns;
    frame.publish_time_ns = input.time_ns;
    frame.step_ns = nanoseconds(scene.solver.step);
    frame.stiffness = clutch.gain() * workspace.coupling_to_device(scene.coupling.stiffness);
    frame.damping = workspace.coupling_to_device(damping);
    frame.proxy_count = 1;
    frame.flags = (result.squeezed ? std::uint32_t{HAPTIC_FRAME_SQUEEZED} : 0u) |
                  (clutch.uncoupled() ? std::uint32_t{HAPTIC_FRAME_CLUTCHED} : 0u);
    ProxyContact& contact_out = frame.proxies[0];
    store(workspace.to_device(proxy), contact_out.position);
    contact_out.in_contact = result.in_contact ? 1 : 0;
    contact_out.plane_count = planes.count;
    for (std::size_t p = 0; p < planes.count; ++p) {
        SurfacePlane plane = planes.plane[p];
        // Where the touched point goes in the step that begins now, known by the time the frame is sent.
        const Triangle& corners = mesh.triangles[plane.touched.triangle];
        Vec3 travel(0.0);
        for (std::size_t k = 0; k < 3; ++k) {
            const double weight = plane.touched.weights[static_cast<int>(k)];
            travel += weight * (end[corners[k]] - start[corners[k]]);
        }
        plane.velocity = glm::dot(plane.normal, travel) * inverse_step;
        contact_out.planes[p] = workspace.to_device(plane);
    }
}

StepResult Simulation::step(const StepInput& input) {
    State& s = *state_;
    const FlushDenormals flush;
    Stopwatch watch(s.clock);
    StepResult result;
    result.hip =
        s.clutch.engage(s.clutch_held(input.buttons), input.device.position, s.proxy, s.scene.solver.step, s.workspace);
    s.find_contact(result, watch);
    if (s.verifying) {
        s.verify(result);
        (void)watch.lap();
    }
    s.couple(result, s.hip_velocity_to(result.hip));
    result.times.collide_ns = watch.lap();
    s.solver.step(s.model, s.force);
    ++s.steps;
    if (!is_finite(s.model)) {
        throw std::runtime_error(
            "step " + std::to_string(s.steps) +
            " at t = " + std::to_string(static_cast<double>(s.steps) * s.scene.solver.step) +
            " s: the state of the model is no longer finite; a smaller solver.step, a softer coupling.stiffness "
            "or a larger coupling.mask_radius keeps it so");
    }
    result.times.deform_ns = watch.lap();
    s.skin();
    result.times.skin_ns = watch.lap();
    s.build_frame(input, result);
    const std::int64_t frame_ns = watch.lap();
    const StageTimes& t = result.times;
    result.times.total_ns = t.ccd_ns + t.popout_ns + t.proxy_ns + t.collide_ns + t.deform_ns + t.skin_ns + frame_ns;
    return result;
}

StepInput Simulation::scripted_input(std::int64_t time_ns) const {
    const Pose hand = state_->scene.hand.at(time_ns);
    StepInput input;
    input.time_ns = time_ns;
    input.device.position = state_->workspace.to_device(hand.position);
    input.device.orientation = hand.orientation;
    return input;
}

const ContactFrame& Simulation::frame() const noexcept {
    return state_->frame;
}
const Scene& Simulation::scene() const noexcept {
    return state_->scene;
}
const ParticleModel& Simulation::model() const noexcept {
    return state_->model;
}
const TriangleMesh& Simulation::mesh() const noexcept {
    return state_->mesh;
}
const std::vector<Vec3>& Simulation::vertices() const noexcept {
    return state_->end;
}
const Vec3& Simulation::proxy() const noexcept {
    return state_->proxy;
}
const Workspace& Simulation::workspace() const noexcept {
    return state_->workspace;
}
std::uint64_t Simulation::steps() const noexcept {
    return state_->steps;
}

std::uint64_t Simulation::state_hash() const noexcept {
    const ParticleModel& model = state_->model;
    StateHash hash;
    hash.add(std::span<const Vec3>(model.position));
    hash.add(std::span<const Vec3>(model.velocity));
    hash.add(std::span<const Quat>(model.orientation));
    hash.add(std::span<const Vec3>(model.angular_velocity));
    hash.add(std::span<const Vec3>(&state_->proxy, 1));
    return hash.value();
}

}  // namespace haptic::sim
