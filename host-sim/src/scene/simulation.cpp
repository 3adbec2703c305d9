#include <haptic/sim/simulation.hpp>

#include <algorithm>
#include <glm/geometric.hpp>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>

#include "scene/assembly.hpp"
#include <haptic/denormals.hpp>
#include <haptic/sim/collisions.hpp>
#include "contact/verification.hpp"
#include <haptic/sim/skin.hpp>
#include "scene/state_hash.hpp"
#include "tool/tool_force.hpp"

namespace haptic::sim {
namespace {

// A body that has not moved for so many steps need be neither skinned nor refitted: its vertices are where they were at
// both ends of the step, and its tree was fitted to that.
constexpr int kAtRest = 2;

/// Nothing, where nothing can collide.
std::unique_ptr<ParticleCollisions> make_collisions(const ParticleModel& model, const CollisionSettings& settings,
                                                    Simulation::ClockFunction clock) {
    const bool alone = model.bodies.size() < 2 || !settings.between_bodies;
    return alone && !settings.ground ? nullptr : std::make_unique<ParticleCollisions>(model, settings, clock);
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

double first_curl(const Scene& scene) {
    return scene.curl.known() ? scene.curl.at(0) : scene.tool ? scene.tool->curl : 0.0;
}

LiveSettings first_settings(const Scene& scene, const ToolModel& tool) {
    LiveSettings settings = live_settings_of(scene);
    settings.tool_iterations = tool.iterations;
    return settings;
}

ToolProxies make_proxies(const Scene& scene, const ToolModel& tool) {
    return {tool,
            {.contact = scene.contact,
             .reach = scene.proxy.reach,
             .step = scene.solver.step,
             .count_revised = scene.coupling.multi_rate == MultiRate::Positions,
             .closed = scene.tool && scene.tool->close_gaps},
            scene.hand.at(0),
            first_curl(scene)};
}

}  // namespace

StepInput input_from(const DeviceState& state, std::int64_t time_ns) noexcept {
    return {.time_ns = time_ns,
            .device = pose_of(state),
            .buttons = state.buttons,
            .curl = std::nullopt,
            .state_sequence = state.sequence,
            .state_time_ns = state.latch_time_ns};
}

struct Simulation::State {
    State(const Scene& which, const ToolModel& held, ClockFunction time)
        : scene(which),
          clock(time),
          all(which),
          solver(all.model, which.solver),
          collisions(make_collisions(all.model, which.collisions, time)),
          skinner(all.mesh.vertices, all.model, all.skin),
          start(all.mesh.vertices),
          end(all.mesh.vertices),
          workspace(which.workspace),
          tool(make_proxies(which, held)),
          force(all.model.size(), Vec3(0.0)),
          settings(first_settings(which, held)),
          proxy_sphere(!which.tool && held.body.particles.size() == 1) {
        for (std::size_t b = 0; b < all.bodies.size(); ++b) {
            surfaces.push_back({{}, &all.trees[b]});
            standing.push_back(0);
        }
    }

    /// The surfaces as they moved in the last step.
    void describe_motion() {
        for (std::size_t b = 0; b < all.bodies.size(); ++b) {
            const SceneBody& body = all.bodies[b];
            const std::size_t count = body.mesh.vertices.size();
            surfaces[b].motion = {std::span(start).subspan(body.first_vertex, count),
                                  std::span(end).subspan(body.first_vertex, count), body.mesh.triangles};
        }
    }
    [[nodiscard]] bool clutch_held(std::uint32_t buttons) const {
        const int button = workspace.settings().clutch_button;
        return button >= 0 && ((buttons >> static_cast<unsigned>(button)) & 1u) != 0;
    }
    [[nodiscard]] bool rough() const {
        return scene.contact.static_friction > 0.0 || scene.contact.dynamic_friction > 0.0;
    }

    [[nodiscard]] double now_s() const {
        return paced_from_s + static_cast<double>(steps - paced_from) * scene.solver.step;
    }

    void take(const LiveSettings& next);
    [[nodiscard]] double next_curl(const StepInput& input) const;
    void find_contact(const Pose& hip, double curl, StepResult& result, Stopwatch& watch);
    void couple(StepResult& result);
    void skin();
    void verify(StepResult& result) const;
    void build_frame(const StepInput& input, const StepResult& result);
    void tell(const ToolParticle& particle, ProxyContact& out) const;

    Scene scene;
    ClockFunction clock;
    Assembly all;  // its trees are pointed at
    ParticleSolver solver;
    std::unique_ptr<ParticleCollisions> collisions;  // if there is anything to collide with
    Skinner skinner;
    std::vector<Vec3> start;  // vertices at the beginning and the end of the last step
    std::vector<Vec3> end;
    std::vector<MovingSurface> surfaces;  // per body
    std::vector<int> standing;            // per body: skins at which it had not moved, up to kAtRest
    Workspace workspace;
    Clutch clutch;
    ToolProxies tool;
    ToolPress tool_press;
    std::vector<Vec3> force;  // N, per particle
    double damping = 0.0;     // N*s/m, of one proxy's spring in the last step, scene
    ContactFrame frame{};
    SettingsFade settings;
    const bool proxy_sphere;  // the tool is one, of the proxy's radius
    std::uint64_t steps = 0;
    std::uint64_t paced_from = 0;  // step since which solver.step has been what it is
    double paced_from_s = 0.0;     // s, when that began
    bool verifying = false;
};

Simulation::Simulation(const Scene& scene, ClockFunction clock)
    : Simulation(scene, scene.tool ? make_tool(*scene.tool) : one_sphere(scene.proxy.radius), clock) {}
Simulation::Simulation(const Scene& scene, const ToolModel& tool, ClockFunction clock)
    : state_(std::make_unique<State>(scene, tool, clock)) {}
Simulation::Simulation(Simulation&&) noexcept = default;
Simulation& Simulation::operator=(Simulation&&) noexcept = default;
Simulation::~Simulation() = default;

void Simulation::set_verification(bool on) noexcept {
    state_->verifying = on;
    state_->tool.keep_paths(on);
}

void Simulation::change_workspace(const WorkspaceSettings& settings) {
    state_->clutch.change_to(Workspace(settings));
}

void Simulation::change_settings(const LiveSettings& settings) {
    check(settings);
    state_->settings.go_to(settings);
}

const LiveSettings& Simulation::settings() const noexcept {
    return state_->settings.asked();
}

void Simulation::couple_anew() noexcept {
    state_->clutch.begin_anew();
}

void Simulation::State::take(const LiveSettings& next) {
    if (next.step != scene.solver.step) {
        paced_from_s = now_s();
        paced_from = steps;
    }
    apply(next, scene);
    solver.set_pace(next.step, next.iterations);
    tool.change(scene.contact, next.tool_iterations, proxy_sphere ? next.radius : 0.0);
}

double Simulation::State::next_curl(const StepInput& input) const {
    if (input.curl) {
        return *input.curl;
    }
    if (!scene.tool || scene.tool->close_button < 0) {
        return tool.curl();
    }
    const bool held = ((input.buttons >> static_cast<unsigned>(scene.tool->close_button)) & 1u) != 0;
    const double most = scene.tool->close_speed * scene.solver.step;
    const double aim = held ? scene.tool->close_to : scene.tool->curl;
    return tool.curl() + std::clamp(aim - tool.curl(), -most, most);
}

void Simulation::State::find_contact(const Pose& hip, double curl, StepResult& result, Stopwatch& watch) {
    describe_motion();
    for (std::size_t b = 0; b < surfaces.size(); ++b) {
        if (standing[b] < kAtRest) {
            all.trees[b].refit(surfaces[b].motion);
        }
    }
    tool.aim(hip, curl);
    tool.look_round(surfaces);
    tool.secure();
    result.times.ccd_ns = watch.lap();
    tool.pop_out();
    result.times.popout_ns = watch.lap();
    tool.approach();
    result.times.proxy_ns = watch.lap();
    tool.constrain();
    result.times.tool_ns = watch.lap();
    tool.revise();
    tool.look_ahead();
    result.times.proxy_ns += watch.lap();

    result.hip = hip.position;
    result.hip_orientation = hip.orientation;
    result.curl = tool.curl();
    result.proxy = tool.pose().position;
    result.proxy_orientation = tool.pose().orientation;
    result.rides = tool.effort().rides;
    result.pop_out_iterations = tool.effort().pop_out_iterations;
    result.squeezed = tool.effort().squeezed;
    result.let_through = tool.effort().let_through;
}

void Simulation::State::couple(StepResult& result) {
    std::fill(force.begin(), force.end(), Vec3(0.0));
    const ToolForce made = tool_press.press(
        tool, {.coupling = scene.coupling, .gain = clutch.gain(), .rough = rough(), .step = scene.solver.step},
        {.bodies = all.bodies, .masks = all.masks, .velocity = all.model.velocity, .force = force});
    damping = made.damping;
    result.force = made.force;
    result.torque = made.torque;
    result.hand_force = workspace.force_to_device(made.force);
    result.hand_torque = workspace.torque_to_device(made.torque);
    result.depth = made.depth;
    result.collided = made.collided;
    result.in_contact = made.collided > 0;
}

void Simulation::State::skin() {
    start.swap(end);
    for (std::size_t b = 0; b < all.bodies.size(); ++b) {
        const Skinner::Part part = all.part(b);
        if (skinner.has_moved(all.model, part)) {
            skinner.place(all.model, part, end);
            standing[b] = 0;
        } else if (standing[b] < kAtRest) {
            const auto first = static_cast<std::ptrdiff_t>(part.first_vertex);
            std::copy_n(start.begin() + first, part.vertices, end.begin() + first);
            ++standing[b];
        }
    }
}

void Simulation::State::verify(StepResult& result) const {
    std::vector<SurfaceMotion> moved;
    moved.reserve(surfaces.size());
    for (const MovingSurface& surface : surfaces) {
        moved.push_back(surface.motion);
    }
    std::vector<std::span<const PathKnot>> ways;
    ways.reserve(tool.particles().size());
    for (std::size_t i = 0; i < tool.particles().size(); ++i) {
        ways.push_back(tool.path(i).knots());
    }
    const std::vector<std::vector<Crossing>> found = find_crossings(moved, ways);
    for (std::size_t i = 0; i < ways.size(); ++i) {
        result.crossings += !tool.path(i).complete() || !found[i].empty() ? 1u : 0u;
    }
    result.crossed = result.crossings > 0;
}

/// What the haptic loop is told of one proxy, in the device's frame.
void Simulation::State::tell(const ToolParticle& particle, ProxyContact& out) const {
    const double inverse_step = 1.0 / scene.solver.step;
    store(workspace.offset_to_grip(particle.rest_offset), out.rest_offset);
    store(workspace.to_device(particle.position), out.position);
    out.in_contact = (particle.in_contact() ? std::uint32_t{HAPTIC_PROXY_TOUCHES} : 0u) |
                     (particle.sticks() ? std::uint32_t{HAPTIC_PROXY_STICKS} : 0u);
    out.plane_count = particle.planes.count;
    const std::size_t contacts = particle.contacts.count;
    Vec3 carried(0.0);  // m, over the step that begins now: what the hand would stick to
    for (std::size_t p = 0; p < particle.planes.count; ++p) {
        SurfacePlane plane = particle.planes.plane[p];
        // Where the touched point goes in the step that begins now, known by the time the frame is sent.
        const SceneBody& body = all.bodies[plane.touched.object];
        const Triangle& corners = body.mesh.triangles[plane.touched.triangle];
        Vec3 travel(0.0);
        for (std::size_t k = 0; k < 3; ++k) {
            const double weight = plane.touched.weights[static_cast<int>(k)];
            const std::size_t corner = body.first_vertex + corners[k];
            travel += weight * (end[corner] - start[corner]);
        }
        plane.velocity = glm::dot(plane.normal, travel) * inverse_step;
        out.planes[p] = workspace.to_device(plane);
        if (p < contacts || p == 0) {
            carried += (contacts > 0 ? particle.grip.share[p] : 1.0) * travel;
        }
    }
    if (rough()) {
        store(workspace.velocity_to_device(carried * inverse_step), out.surface_velocity);
    }
}

void Simulation::State::build_frame(const StepInput& input, const StepResult& result) {
    frame = {};
    frame.state_sequence = input.state_sequence;
    frame.state_time_ns = input.state_time_ns;
    frame.plane_time_ns = input.time_ns;
    frame.publish_time_ns = input.time_ns;
    frame.step_ns = nanoseconds(scene.solver.step);
    frame.stiffness = clutch.gain() * workspace.coupling_to_device(scene.coupling.stiffness);
    frame.torque_stiffness = clutch.gain() * workspace.coupling_to_device(scene.coupling.torque_stiffness);
    frame.damping = workspace.coupling_to_device(damping);
    frame.static_friction = scene.contact.static_friction;
    frame.dynamic_friction = scene.contact.dynamic_friction;
    frame.flags = (result.squeezed ? std::uint32_t{HAPTIC_FRAME_SQUEEZED} : 0u) |
                  (clutch.uncoupled() ? std::uint32_t{HAPTIC_FRAME_CLUTCHED} : 0u) |
                  (scene.coupling.share == ForceSharing::Series ? std::uint32_t{HAPTIC_FRAME_SERIES_SPRINGS} : 0u) |
                  (scene.coupling.multi_rate == MultiRate::Positions ? std::uint32_t{HAPTIC_FRAME_HOLD_POSITIONS} : 0u);
    for (const ToolParticle& particle : tool.particles()) {
        tell(particle, frame.proxies[frame.proxy_count++]);
    }
}

StepResult Simulation::step(const StepInput& input) {
    State& s = *state_;
    const FlushDenormals flush;
    Stopwatch watch(s.clock);
    StepResult result;
    if (s.settings.moving()) {
        s.take(s.settings.advance(s.scene.solver.step));
    }
    result.time = s.now_s();
    result.step = s.scene.solver.step;
    const Pose hip =
        s.clutch.engage(s.clutch_held(input.buttons), input.device,
                        {.pose = s.tool.pose(), .in_shape = s.tool.in_shape()}, s.scene.solver.step, s.workspace);
    s.find_contact(hip, s.next_curl(input), result, watch);
    if (s.verifying) {
        s.verify(result);
        (void)watch.lap();
    }
    s.couple(result);
    result.times.proxy_ns += watch.lap();
    s.all.lead(s.now_s(), s.scene.solver.step);
    s.solver.step(s.all.model, s.force, s.collisions.get());
    ++s.steps;
    s.tool.set_step(s.scene.solver.step);
    if (!is_finite(s.all.model)) {
        throw std::runtime_error(
            "step " + std::to_string(s.steps) + " at t = " + std::to_string(s.now_s()) +
            " s: the state of the model is no longer finite; a smaller solver.step, a softer coupling.stiffness "
            "or a larger coupling.mask_radius keeps it so");
    }
    result.times.collide_ns = s.collisions == nullptr ? 0 : s.collisions->take_time();
    result.times.deform_ns = watch.lap() - result.times.collide_ns;
    s.skin();
    result.times.skin_ns = watch.lap();
    s.build_frame(input, result);
    const std::int64_t frame_ns = watch.lap();
    const StageTimes& t = result.times;
    result.times.total_ns =
        t.ccd_ns + t.popout_ns + t.proxy_ns + t.tool_ns + t.collide_ns + t.deform_ns + t.skin_ns + frame_ns;
    return result;
}

StepInput Simulation::scripted_input(std::int64_t time_ns) const {
    const Scene& scene = state_->scene;
    const std::int64_t period_ns = nanoseconds(scene.hand.duration_s());
    const std::int64_t at_ns = scene.hand_repeats && period_ns > 0 ? time_ns % period_ns : time_ns;
    const Pose hand = scene.hand.at(at_ns);
    StepInput input;
    input.time_ns = time_ns;
    input.device = state_->workspace.to_device(hand);
    if (scene.curl.known()) {
        input.curl = scene.curl.at(at_ns);
    }
    return input;
}

const ContactFrame& Simulation::frame() const noexcept {
    return state_->frame;
}
const Scene& Simulation::scene() const noexcept {
    return state_->scene;
}
const ParticleModel& Simulation::model() const noexcept {
    return state_->all.model;
}
const TriangleMesh& Simulation::mesh() const noexcept {
    return state_->all.mesh;
}
const std::vector<SceneBody>& Simulation::bodies() const noexcept {
    return state_->all.bodies;
}
const std::vector<Vec3>& Simulation::vertices() const noexcept {
    return state_->end;
}
const Vec3& Simulation::proxy() const noexcept {
    return state_->tool.pose().position;
}
const ToolProxies& Simulation::tool() const noexcept {
    return state_->tool;
}
const Workspace& Simulation::workspace() const noexcept {
    return state_->workspace;
}
std::uint64_t Simulation::steps() const noexcept {
    return state_->steps;
}

double Simulation::time() const noexcept {
    return state_->now_s();
}

std::uint64_t Simulation::state_hash() const noexcept {
    const ParticleModel& model = state_->all.model;
    StateHash hash;
    hash.add(std::span<const Vec3>(model.position));
    hash.add(std::span<const Vec3>(model.velocity));
    hash.add(std::span<const Quat>(model.orientation));
    hash.add(std::span<const Vec3>(model.angular_velocity));
    for (const ToolParticle& particle : state_->tool.particles()) {
        hash.add(std::span<const Vec3>(&particle.position, 1));
    }
    return hash.value();
}

}  // namespace haptic::sim
