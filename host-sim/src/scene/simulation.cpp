#include "haptic/sim/simulation.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include "collision/solid_surfaces.hpp"
#include "collision/surface_contacts.hpp"
#include "contact/verification.hpp"
#include "haptic/denormals.hpp"
#include "haptic/sim/collisions.hpp"
#include "scene/assembly.hpp"
#include "scene/body_surfaces.hpp"
#include "scene/contact_frame_builder.hpp"
#include "scene/hand_balance.hpp"
#include "scene/scene_collisions.hpp"
#include "scene/scene_loads.hpp"
#include "scene/sleeping_bodies.hpp"
#include "scene/state_hash.hpp"
#include "simd/aabb.hpp"
#include "tool/contact_coupling.hpp"
#include "verification/surface_crossings.hpp"

namespace haptic::sim {
namespace {

// Attempts to find room for all proxies, with ever more bodies that stand still, before all of them do.
constexpr int kAttempts = 3;
// Shares of the time of building after which the tool and the bodies are there. The rest is that of the solver.
constexpr double kToolMade = 0.1;
constexpr double kAssembled = 0.5;

/// Stopwatch on the caller's clock; always 0 without one.
class Stopwatch {
  public:
    explicit Stopwatch(Simulation::ClockFunction clock) : clock_(clock), last_(now()) {}
    /// ns, since the last call.
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

/// Bit of the button that closes the tool, if a hand holds it at that time of the script, so that curl and script pass
/// the middle between open and closed together.
std::uint32_t close_button(const Scene& scene, std::int64_t at_ns) {
    if (!scene.tool || scene.tool->close_button < 0) {
        return 0;
    }
    const ToolSettings& tool = *scene.tool;
    const double lead_s = 0.5 * std::abs(tool.close_to - tool.curl) / tool.close_speed;
    const bool held = scene.curl.at(at_ns + nanoseconds(lead_s)) > 0.5 * (tool.curl + tool.close_to);
    return held ? 1u << static_cast<unsigned>(tool.close_button) : 0u;
}

/// Throws ConfigError for a material with which a body cannot be solved.
ParticleSolver make_solver(const Assembly& assembly, const SolverSettings& settings) {
    try {
        return {assembly.model, settings};
    } catch (const TooStiff& body) {
        assembly.place_of(body.particle()).of("material").fail(body.what());
    }
}

ToolProxies make_proxies(const Scene& scene, const ToolModel& tool) {
    return {tool,
            {.contact = scene.contact,
             .reach = scene.proxy.reach,
             .step = scene.solver.step,
             .springs = {scene.coupling.stiffness, scene.coupling.torque_stiffness},
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
            .state_time_ns = state.latch_time_ns,
            .feedback = DeviceFeedback{.stiffness = state.stiffness,
                                       .scale = state.scale,
                                       .impulse = to_vec3(state.impulse),
                                       .stiffness_limited = (state.tick_flags & HAPTIC_TICK_STIFFNESS_LIMITED) != 0}};
}

struct Simulation::State {
    State(const Scene& from, const ToolModel& tool_model, ClockFunction time, const Progress& progress)
        : scene(from),
          clock(time),
          assembly(from, part_of(progress, kToolMade, kAssembled)),
          solver(make_solver(assembly, from.solver)),
          loads(assembly),
          sheet(colliding_sheets(assembly, from.collisions)),
          sleeping(assembly, from.solver, sheet),
          collisions(make_collisions(assembly.model, from.collisions, sheet, time)),
          surface_contacts(make_surface_contacts(assembly, from.collisions, sheet, time)),
          surfaces(scene, assembly, sheet, sleeping, solver.workers(), time),
          workspace(from.workspace),
          tool(make_proxies(from, tool_model)),
          coupling(assembly.model, time),
          settings(live_settings_of(from)),
          proxy_sphere(!from.tool && tool_model.body.particles.size() == 1) {}
    [[nodiscard]] bool clutch_held(std::uint32_t buttons) const {
        const int button = workspace.settings().clutch_button;
        return button >= 0 && ((buttons >> static_cast<unsigned>(button)) & 1u) != 0;
    }
    [[nodiscard]] double now_s() const {
        return step_since_s + static_cast<double>(steps - step_since) * scene.solver.step;
    }

    void apply_settings(const LiveSettings& next);
    [[nodiscard]] double next_curl(const StepInput& input) const;
    void find_contact(const Pose& hip, double curl, StepResult& result, Stopwatch& watch);
    void find_secure_positions();
    [[nodiscard]] bool let_more_stand(bool all);
    [[nodiscard]] LoneTool lone_tool() const;
    void move_bodies(const StepInput& input, StepResult& result);
    void report_force(const StepInput& input, StepResult& result);
    void verify_proxies(StepResult& result) const;
    void verify_surfaces(SurfaceCrossings& crossings, StepResult& result) const;
    [[nodiscard]] bool is_left_alone(const SurfaceCrossing& crossing) const;
    void build_frame(const StepInput& input);

    Scene scene;
    ClockFunction clock;
    Assembly assembly;
    ParticleSolver solver;
    SceneLoads loads;
    std::vector<std::uint8_t> sheet;  // per body: it is a sheet that collides
    SleepingBodies sleeping;
    std::unique_ptr<ParticleCollisions> collisions;     // null if nothing can collide
    std::unique_ptr<SurfaceContacts> surface_contacts;  // null without sheets that collide
    BodySurfaces surfaces;
    Vec3 stopped_momentum{0.0};  // kg m/s, that bodies have lost that stand for the tool
    Workspace workspace;
    Clutch clutch;
    ToolProxies tool;
    ContactCoupling coupling;
    HandBalance balance;
    double body_work = 0.0;  // J, device: work of all steps on the tool
    double last_work = 0.0;  // and of the last one
    ContactFrame frame{};
    SettingsFade settings;
    const bool proxy_sphere;  // the tool is one sphere of proxy.radius
    std::uint64_t steps = 0;
    std::uint64_t step_since = 0;  // step at which solver.step last changed
    double step_since_s = 0.0;     // s, when that step began
    bool verify_steps = false;
    std::optional<SurfaceCrossings> surface_crossings;  // once verification was on
};

Simulation::Simulation(const Scene& scene, ClockFunction clock, const Progress& progress)
    : state_(std::make_unique<State>(
          scene,
          scene.tool ? make_tool(*scene.tool, part_of(progress, 0.0, kToolMade)) : one_sphere(scene.proxy.radius),
          clock, progress)) {}
Simulation::Simulation(const Scene& scene, const ToolModel& tool, ClockFunction clock)
    : state_(std::make_unique<State>(scene, tool, clock, Progress{})) {}
Simulation::Simulation(Simulation&&) noexcept = default;
Simulation& Simulation::operator=(Simulation&&) noexcept = default;
Simulation::~Simulation() = default;

void Simulation::set_verification(bool on) {
    state_->verify_steps = on;
    if (on && !state_->surface_crossings) {
        state_->surface_crossings = make_surface_crossings(state_->assembly);
    }
    state_->tool.keep_paths(on);
}

void Simulation::change_workspace(const WorkspaceSettings& settings) {
    state_->clutch.change_mapping(Workspace(settings));
}

void Simulation::change_settings(const LiveSettings& settings) {
    check(settings);
    state_->settings.go_to(settings);
}

void Simulation::change_rate(double step, int substeps) {
    State& s = *state_;
    s.solver.set_steps(step, substeps, s.scene.solver.iterations);
    s.step_since_s = s.now_s();
    s.step_since = s.steps;
    s.scene.solver.step = step;
    s.scene.solver.substeps = substeps;
    s.settings = SettingsFade(live_settings_of(s.scene));
}

const LiveSettings& Simulation::settings() const noexcept {
    return state_->settings.asked();
}

void Simulation::recouple() noexcept {
    state_->clutch.recouple();
}

void Simulation::State::apply_settings(const LiveSettings& next) {
    // Time is counted from the last change of the step, so that it stays exact.
    if (next.step != scene.solver.step) {
        step_since_s = now_s();
        step_since = steps;
    }
    apply(next, scene);
    solver.set_steps(next.step, scene.solver.substeps, next.iterations);
    // The sphere of a point tool takes its radius from the settings; a multi-sphere tool keeps its own.
    tool.change(scene.contact, {next.stiffness, next.torque_stiffness}, proxy_sphere ? next.radius : 0.0);
}

double Simulation::State::next_curl(const StepInput& input) const {
    // A given curl has priority; without a close button the curl stays.
    if (input.curl) {
        return *input.curl;
    }
    if (!scene.tool || scene.tool->close_button < 0) {
        return tool.curl();
    }
    // While the button is held the tool closes, otherwise it opens, at close_speed.
    const bool pressed = ((input.buttons >> static_cast<unsigned>(scene.tool->close_button)) & 1u) != 0;
    const double max_change = scene.tool->close_speed * scene.solver.step;
    const double aim = pressed ? scene.tool->close_to : scene.tool->curl;
    return tool.curl() + std::clamp(aim - tool.curl(), -max_change, max_change);
}

void Simulation::State::find_contact(const Pose& hip, double curl, StepResult& result, Stopwatch& watch) {
    // Algorithm 4.
    tool.set_goals(hip, curl);
    // Line 5: CCD of each particle with the surfaces' motion in the last step.
    find_secure_positions();
    result.stood_still = surfaces.some_stand();
    result.times.ccd_ns = watch.lap();
    // Line 6: remove remaining overlap.
    tool.pop_out();
    result.times.popout_ns = watch.lap();
    // In place of lines 7 to 19: the equilibrium of the tool's elasticity and the contacts.
    tool.find_equilibrium();
    result.times.tool_ns = watch.lap();
    // Planes for the haptic loop.
    tool.collect_speculative_planes(scene.solver.step);
    result.times.proxy_ns = watch.lap();

    // Outcome: both poses, and what the worst particle went through.
    result.hip = hip.position;
    result.hip_orientation = hip.orientation;
    result.curl = tool.curl();
    result.proxy = tool.pose().position;
    result.proxy_orientation = tool.pose().orientation;
    result.advances = tool.effort().advances;
    result.pop_out_iterations = tool.effort().pop_out_iterations;
    result.overconstrained = tool.effort().overconstrained;
    result.equilibrium_error = tool.effort().equilibrium_error;
}

/// Where a proxy has no room, bodies stand still instead, as if the last step had not moved them. At last all of them
/// do, and then every proxy has the room in which it was.
void Simulation::State::find_secure_positions() {
    surfaces.let_none_stand();
    stopped_momentum = Vec3(0.0);
    int attempts = 0;
    do {
        tool.collect(surfaces.moving());
    } while (!tool.find_secure_positions() && let_more_stand(++attempts == kAttempts));
}

/// Lets those bodies stand still that are in a proxy's way, or all of them. False: all did already.
bool Simulation::State::let_more_stand(bool all) {
    const std::span<const std::uint32_t> none;
    if (!surfaces.let_stand(all ? none : tool.in_the_way(), stopped_momentum)) {
        return false;
    }
    // What they did on the way is undone too; more of it than they had done is no one's loss.
    body_work -= std::max(0.0, std::exchange(last_work, 0.0));
    return true;
}

LoneTool Simulation::State::lone_tool() const {
    LoneTool all;
    const std::span<const ToolProxy> proxies = tool.particles();
    for (const ToolProxy& p : proxies) {
        all.reach.extend(grown(aabb_of_segment(p.position, p.goal, p.radius), scene.proxy.reach));
    }
    if (proxies.size() == 1) {
        all.ball = {proxies.front().position, proxies.front().radius};
    }
    return all;
}

void Simulation::State::move_bodies(const StepInput& input, StepResult& result) {
    // Driven particles move at their prescribed velocities.
    const double step = scene.solver.step;
    assembly.drive(now_s(), step);
    const LoneTool place = lone_tool();
    sleeping.update(assembly, place.reach, surfaces.solids().most_lag(), scene.solver);
    // The bodies receive what the hand receives.
    const HandBalance::Share share =
        balance.begin_step(input.feedback, workspace, scene.coupling.stiffness, clutch.gain(), step, input.time_ns);
    result.hand_impulse = share.hand_impulse;
    // Algorithm 3, lines 9 to 24, with the coupling to the tool among the constraints. Collisions of particles come
    // last: the ground does not yield to solids. Each surface follows as soon as its body has arrived.
    coupling.begin_step(tool,
                        {.coupling = scene.coupling,
                         .contact = scene.contact,
                         .gain = share.gain,
                         .owed_force = share.owed_force,
                         .length = step},
                        {.bodies = assembly.bodies, .masks = assembly.masks}, assembly.model);
    loads.begin_step(now_s());
    surfaces.begin_step();
    solver.step(assembly.model, loads,
                {coupling.is_active() ? &coupling : nullptr, surface_contacts.get(), collisions.get()},
                [this](std::size_t body) { surfaces.move(body); });
    surfaces.keep_apart(place);
    result.stood_still = result.stood_still || surfaces.some_stand();
    result.asleep = static_cast<std::size_t>(std::ranges::count(sleeping.asleep(), 1));
    coupling.end_step(assembly.model);
}

void Simulation::State::report_force(const StepInput& input, StepResult& result) {
    const double step = scene.solver.step;
    const CoupledForce made = coupling.force();
    balance.end_step(made.force, made.collided > 0, step);
    last_work = workspace.work_to_device(coupling.work());
    if (surfaces.some_stand()) {
        last_work = std::min(0.0, last_work);  // what they did on the way is undone
    }
    body_work += last_work;
    // The device gets force and torque in its own axes.
    result.force = made.force;
    result.torque = made.torque;
    result.hand_force = workspace.force_to_device(made.force);
    result.hand_torque = workspace.torque_to_device(made.torque);
    // What stood still has given its momentum too: as a force this would be a blow, which the hand does not get.
    result.body_impulse = step * result.hand_force + workspace.force_to_device(stopped_momentum);
    if (!input.feedback) {
        result.hand_impulse = step * result.hand_force;
    }
    result.depth = made.depth;
    result.collided = made.collided;
    result.in_contact = made.collided > 0;
}

void Simulation::State::verify_proxies(StepResult& result) const {
    // Check the recorded paths against the surfaces' motion; an incomplete path counts as a crossing.
    std::vector<SurfaceMotion> moved;
    moved.reserve(surfaces.moving().size());
    for (const MovingSurface& surface : surfaces.moving()) {
        moved.push_back(surface.motion);
    }
    std::vector<std::span<const PathKnot>> paths;
    paths.reserve(tool.particles().size());
    for (std::size_t i = 0; i < tool.particles().size(); ++i) {
        paths.push_back(tool.path(i).knots());
    }
    // A particle counts once, however many surfaces it crossed.
    const std::vector<std::vector<Crossing>> found = find_crossings(moved, paths);
    for (std::size_t i = 0; i < paths.size(); ++i) {
        result.crossings += !tool.path(i).complete() || !found[i].empty() ? 1u : 0u;
    }
    result.crossed = result.crossings > 0;
}

/// Whether sheets, or a solid and itself, are not kept from this crossing, because they touched or crossed there at the
/// start.
bool Simulation::State::is_left_alone(const SurfaceCrossing& crossing) const {
    const bool of_two = crossing.edge_object != crossing.object;
    const auto left_alone = [&](std::uint32_t body, std::uint32_t vertex) {
        return sheet[body] != 0 ? surface_contacts->leaves_alone(assembly.bodies[body].first_particle + vertex, of_two)
                                : surfaces.solids().leaves_alone(assembly.bodies[body].first_vertex + vertex);
    };
    // They have come there past an edge of the triangle, or an end of the edge.
    const Triangle& triangle = assembly.bodies[crossing.object].mesh.triangles[crossing.triangle];
    const auto of_edge =
        std::ranges::count_if(crossing.edge, [&](auto v) { return left_alone(crossing.edge_object, v); });
    const auto of_triangle = std::ranges::count_if(triangle, [&](auto v) { return left_alone(crossing.object, v); });
    return (of_edge == 2 && of_triangle >= 2) || (of_edge >= 1 && of_triangle == 3);
}

void Simulation::State::verify_surfaces(SurfaceCrossings& crossings, StepResult& result) const {
    SurfaceCrossingCounts& counts = result.surfaces;
    const double rounding = rounding_of(surfaces.end());
    for (const SurfaceCrossing& crossing : crossings.find(surfaces.end(), rounding)) {
        const bool same = crossing.object == crossing.edge_object;
        if (sheet[crossing.edge_object] != 0 && sheet[crossing.object] != 0 &&
            (same || scene.collisions.between_bodies)) {
            counts.sheets += is_left_alone(crossing) ? 0U : 1U;
        } else {
            const bool apart = same ? surfaces.solids().keeps_whole(crossing.object) && !is_left_alone(crossing)
                                    : surfaces.solids().keeps_apart(crossing.edge_object, crossing.object);
            ++(apart ? counts.solids : counts.others);
        }
    }
    // What could not be looked at is not known to be apart.
    counts.solids += crossings.complete() ? 0U : 1U;
    for (std::size_t b = 0; b < assembly.bodies.size() && scene.collisions.ground; ++b) {
        if (assembly.is_movable(b)) {
            const GroundCrossings below =
                find_ground_crossings(surfaces.moving()[b].motion.end, scene.collisions.ground_height, rounding);
            counts.below_ground += below.vertices;
            counts.ground_depth = std::max(counts.ground_depth, below.depth);
        }
    }
}

void Simulation::State::build_frame(const StepInput& input) {
    const ContactFrameSources sources{.input = input,
                                      .scene = scene,
                                      .workspace = workspace,
                                      .clutch = clutch,
                                      .tool = tool,
                                      .coupling = coupling,
                                      .bodies = assembly.bodies,
                                      .start = surfaces.start(),
                                      .end = surfaces.end(),
                                      .body_work = body_work};
    ContactFrameBuilder(sources).build(frame);
}

StepResult Simulation::step(const StepInput& input) {
    State& s = *state_;
    const FlushDenormals flush;  // denormal numbers would slow the step down
    Stopwatch watch(s.clock);
    StepResult result;
    // Live settings fade toward their requested values, one increment per step.
    if (s.settings.moving()) {
        s.apply_settings(s.settings.advance(s.scene.solver.step));
    }
    result.time = s.now_s();
    result.step = s.scene.solver.step;
    // Hip from the device by way of clutch and workspace, then the tool among the surfaces at t.
    const Pose hip =
        s.clutch.engage(s.clutch_held(input.buttons), input.device,
                        {.pose = s.tool.pose(), .in_shape = s.tool.in_shape()}, s.scene.solver.step, s.workspace);
    s.find_contact(hip, s.next_curl(input), result, watch);
    if (s.verify_steps) {
        s.verify_proxies(result);
        (void)watch.lap();
    }
    // Step the bodies to t + dt together with the contact force.
    s.move_bodies(input, result);
    s.report_force(input, result);
    ++s.steps;
    s.tool.set_step(s.scene.solver.step);
    // What runs inside the solver's step has clocks of its own.
    const std::int64_t couple_ns = s.coupling.take_time();
    const BodySurfaces::Times of_surfaces = s.surfaces.take_times();
    result.times.proxy_ns += couple_ns;
    result.times.ccd_ns += of_surfaces.refit_ns;
    result.times.collide_ns = (s.collisions == nullptr ? 0 : s.collisions->take_time()) +
                              (s.surface_contacts == nullptr ? 0 : s.surface_contacts->take_time()) +
                              of_surfaces.apart_ns;
    result.times.skin_ns = of_surfaces.skin_ns;
    result.times.deform_ns =
        watch.lap() - result.times.collide_ns - couple_ns - of_surfaces.refit_ns - result.times.skin_ns;
    // Stop where a state has diverged: so would have the forces of the frame.
    if (s.surfaces.diverged()) {
        throw std::runtime_error("step " + std::to_string(s.steps) + " at t = " + std::to_string(s.now_s()) +
                                 " s: the state of the model has diverged (a body is not finite, or 1e8 m away). Use a "
                                 "smaller solver.step or smaller loads, and a ground for what falls "
                                 "(collisions.ground)");
    }
    // The frame knows where each touched point goes until t + dt.
    s.build_frame(input);
    const std::int64_t frame_ns = watch.lap();
    if (s.verify_steps && s.surface_crossings) {
        s.verify_surfaces(*s.surface_crossings, result);
    }
    // Total of the stages, without the verification.
    const StageTimes& t = result.times;
    result.times.total_ns =
        t.ccd_ns + t.popout_ns + t.proxy_ns + t.tool_ns + t.collide_ns + t.deform_ns + t.skin_ns + frame_ns;
    return result;
}

StepInput Simulation::scripted_input(std::int64_t time_ns) const {
    const Scene& scene = state_->scene;
    // A repeating script starts over after its duration.
    const std::int64_t period_ns = nanoseconds(scene.hand.duration_s());
    const std::int64_t at_ns = scene.hand_repeats && period_ns > 0 ? time_ns % period_ns : time_ns;
    const Pose hand = scene.hand.at(at_ns);
    StepInput input;
    input.time_ns = time_ns;
    // The script moves the hand in the scene; the step expects device coordinates.
    input.device = state_->workspace.to_device(hand);
    if (scene.curl.known()) {
        input.curl = scene.curl.at(at_ns);
        input.buttons = close_button(scene, at_ns);
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
    return state_->assembly.model;
}
const TriangleMesh& Simulation::mesh() const noexcept {
    return state_->assembly.mesh;
}
const std::vector<SceneBody>& Simulation::bodies() const noexcept {
    return state_->assembly.bodies;
}
const std::vector<Vec3>& Simulation::vertices() const noexcept {
    return state_->surfaces.end();
}
const Vec3& Simulation::proxy() const noexcept {
    return state_->tool.pose().position;
}
const ToolProxies& Simulation::tool() const noexcept {
    return state_->tool;
}
std::span<const SurfaceForce> Simulation::surface_forces() const noexcept {
    return state_->coupling.surface_forces();
}

const Workspace& Simulation::workspace() const noexcept {
    return state_->workspace;
}
int Simulation::substeps() const noexcept {
    return state_->solver.substeps();
}
bool Simulation::iterates() const noexcept {
    return state_->solver.iterates();
}
std::uint64_t Simulation::steps() const noexcept {
    return state_->steps;
}

double Simulation::time() const noexcept {
    return state_->now_s();
}

std::uint64_t Simulation::state_hash() const noexcept {
    const ParticleModel& model = state_->assembly.model;
    StateHash hash;
    // Complete state of the bodies, then the positions of the proxies.
    hash.add(std::span<const Vec3>(model.position));
    hash.add(std::span<const Vec3>(model.velocity));
    hash.add(std::span<const Quat>(model.orientation));
    hash.add(std::span<const Vec3>(model.angular_velocity));
    for (const ToolProxy& particle : state_->tool.particles()) {
        hash.add(std::span<const Vec3>(&particle.position, 1));
    }
    return hash.value();
}

}  // namespace haptic::sim
