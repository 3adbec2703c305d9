#include "haptic/sim/simulation.hpp"

#include <algorithm>
#include <array>
#include <glm/geometric.hpp>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>

#include "haptic/denormals.hpp"
#include "haptic/sim/collisions.hpp"
#include "haptic/sim/contact/friction.hpp"
#include "haptic/sim/contact/planes_in_reach.hpp"
#include "haptic/sim/contact/pop_out.hpp"
#include "haptic/sim/contact/secure_position.hpp"
#include "haptic/sim/contact/surroundings.hpp"
#include "haptic/sim/contact/swept_tree.hpp"
#include "haptic/sim/contact/verification.hpp"
#include "haptic/sim/contact/virtual_proxy.hpp"
#include "haptic/sim/contact_force.hpp"
#include "haptic/sim/deformable.hpp"
#include "haptic/sim/skin.hpp"
#include "haptic/sim/state_hash.hpp"

namespace haptic::sim {
namespace {

/// kg, per particle: what a force accelerates.
std::vector<double> moved_mass(const ParticleModel& particles) {
    std::vector<double> mass = particles.mass;
    for (std::size_t i = 0; i < mass.size(); ++i) {
        if (particles.pinned[i] != 0) {
            mass[i] = std::numeric_limits<double>::infinity();
        }
    }
    return mass;
}

std::vector<DeformableBody> make_all_bodies(const Scene& scene) {
    std::vector<DeformableBody> bodies = make_bodies(scene.model);
    for (const ModelSettings& object : scene.objects) {
        for (DeformableBody& body : make_bodies(object)) {
            bodies.push_back(std::move(body));
        }
    }
    return bodies;
}

/// All bodies as one: the particles that the solver steps, the mesh that they carry, the skin between the two.
struct Assembly {
    Assembly(std::vector<DeformableBody>&& made, double mask_radius) {
        for (DeformableBody& body : made) {
            const std::size_t vertices = mesh.vertices.size();
            const std::size_t particles = model.size();
            add_mesh(body.mesh);
            for (SkinVertex vertex : body.skin) {
                for (std::uint32_t& carrier : vertex.particle) {
                    carrier += static_cast<std::uint32_t>(particles);
                }
                skin.push_back(vertex);
            }
            model.append(body.particles);
            trees.emplace_back(body.mesh.vertices, body.mesh.triangles);
            masks.emplace_back(body.mesh, body.skin, moved_mass(body.particles), mask_radius);
            motions.push_back(std::move(body.motions));
            bodies.push_back({std::move(body.name), vertices, particles, std::move(body.mesh)});
        }
    }

    void add_mesh(const TriangleMesh& added) {
        const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
        mesh.vertices.insert(mesh.vertices.end(), added.vertices.begin(), added.vertices.end());
        for (const Triangle& t : added.triangles) {
            mesh.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
        }
    }

    // Of all bodies together.
    ParticleModel model;
    TriangleMesh mesh;
    Skin skin;
    // Per body.
    std::vector<SceneBody> bodies;
    std::vector<SweptTree> trees;
    std::vector<PressureMask> masks;
    std::vector<std::vector<Motion>> motions;
};

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

}  // namespace

StepInput input_from(const DeviceState& state, std::int64_t time_ns) noexcept {
    return {time_ns, pose_of(state), state.buttons, state.sequence, state.latch_time_ns};
}

struct Simulation::State {
    State(const Scene& which, ClockFunction time)
        : State(which, time, Assembly(make_all_bodies(which), which.coupling.mask_radius)) {}
    State(const Scene& which, ClockFunction time, Assembly&& assembly)
        : scene(which),
          clock(time),
          all(std::move(assembly)),
          model(all.model),
          solver(model, which.solver),
          collisions(make_collisions(model, which.collisions, time)),
          skinner(all.mesh.vertices, model, all.skin),
          start(all.mesh.vertices),
          end(all.mesh.vertices),
          workspace(which.workspace),
          contact(which.contact),
          force(model.size(), Vec3(0.0)),
          proxy(which.hand.at(0).position) {
        for (const SweptTree& tree : all.trees) {
            surfaces.push_back({{}, &tree});
            moved.emplace_back();
        }
    }

    /// The surfaces as they moved in the last step.
    void describe_motion() {
        for (std::size_t b = 0; b < all.bodies.size(); ++b) {
            const SceneBody& body = all.bodies[b];
            const std::size_t count = body.mesh.vertices.size();
            moved[b] = {std::span(start).subspan(body.first_vertex, count),
                        std::span(end).subspan(body.first_vertex, count), body.mesh.triangles};
            surfaces[b].motion = moved[b];
        }
    }
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
    void lead_motions();
    void skin();
    void verify(StepResult& result) const;
    void build_frame(const StepInput& input, const StepResult& result);

    Scene scene;
    ClockFunction clock;
    Assembly all;          // at rest; its trees are pointed at
    ParticleModel& model;  // in motion: that of the assembly
    ParticleSolver solver;
    std::unique_ptr<ParticleCollisions> collisions;  // if there is anything to collide with
    Skinner skinner;
    std::vector<Vec3> start;  // vertices at the beginning and the end of the last step
    std::vector<Vec3> end;
    std::vector<MovingSurface> surfaces;  // per body
    std::vector<SurfaceMotion> moved;     // per body
    Surroundings surroundings{1};
    Workspace workspace;
    Clutch clutch;
    ContactSettings contact;
    std::vector<Vec3> force;  // N, per particle
    double damping = 0.0;     // N*s/m, of all contacts of the last step, scene
    Vec3 proxy;
    Vec3 last_hip{0.0};
    ProxyPath path;
    ProxyGrip grip;          // of the surfaces, if they are rough
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

void Simulation::change_workspace(const WorkspaceSettings& settings) {
    state_->clutch.change_to(Workspace(settings));
}

void Simulation::State::find_contact(StepResult& result, Stopwatch& watch) {
    const double radius = scene.proxy.radius;
    path.restart(proxy);
    describe_motion();
    for (std::size_t b = 0; b < moved.size(); ++b) {
        all.trees[b].refit(moved[b]);
    }
    const ProxyReach around{.position = proxy, .goal = result.hip, .radius = radius};
    surroundings.collect(surfaces, {&around, 1});
    const NearSurfaces near = surroundings.of(0);
    const SecurePosition secure = secure_position(near, proxy, radius, contact, &path);
    result.times.ccd_ns = watch.lap();

    const PopOut popped = pop_out(near, secure.position, radius, contact, &path);
    result.times.popout_ns = watch.lap();

    const ProxyMove move = move_proxy(near, {.before = proxy, .from = popped.position, .goal = result.hip}, radius,
                                      scene.solver.step, contact, grip, &path);
    proxy = move.position;
    contacts = move.contacts;
    planes = planes_in_reach(
        near, contacts, {.position = proxy, .radius = radius, .reach = scene.proxy.reach, .dt = scene.solver.step});
    result.times.proxy_ns = watch.lap();

    result.proxy = proxy;
    result.in_contact = contacts.count > 0;
    result.rides = secure.rides;
    result.pop_out_iterations = popped.iterations;
    result.squeezed = secure.squeezed || popped.squeezed;
    result.let_through = secure.let_through;
    result.depth = result.in_contact ? glm::length(proxy - result.hip) : 0.0;
}

void Simulation::State::couple(StepResult& result, const Vec3& hip_velocity) {
    std::fill(force.begin(), force.end(), Vec3(0.0));
    damping = 0.0;
    const double stiffness = clutch.gain() * scene.coupling.stiffness;
    const Vec3 spring = stiffness * (proxy - result.hip);
    const ContactShares shares = divide_force(spring, contacts);
    const bool rough = contact.static_friction > 0.0 || contact.dynamic_friction > 0.0;
    const auto friction = rough ? divide_friction(spring, contacts, shares) : FrictionParts{};
    for (std::size_t c = 0; c < contacts.count; ++c) {
        const SurfacePlane& plane = contacts.plane[c];
        PressureMask& mask = all.masks[plane.touched.object];
        const std::size_t first = all.bodies[plane.touched.object].first_particle;
        const PressedPatch patch = mask.lay(plane.touched, std::span(model.velocity).subspan(first));
        const double closing = glm::dot(patch.velocity - hip_velocity, plane.normal);
        const double held = contact_damping(shares[c], patch.mass, scene.solver.step, scene.coupling);
        const double push = contact_push(shares[c], closing, held);
        damping += held;
        Vec3 on_tool = push * plane.normal;
        if (rough && shares[c] > 0.0) {
            on_tool += friction[c] * std::min(1.0, push / shares[c]);  // no more than the normal force can hold
        }
        result.force += on_tool;
        mask.press(-on_tool, std::span(force).subspan(first));
    }
    result.hand_force = workspace.force_to_device(result.force);
}

void Simulation::State::lead_motions() {
    const double step_s = scene.solver.step;
    const double now_s = static_cast<double>(steps) * step_s;
    for (std::size_t b = 0; b < all.bodies.size(); ++b) {
        for (const Motion& motion : all.motions[b]) {
            const Vec3 after = offset_at(motion, now_s + step_s);
            for (const std::uint32_t particle : motion.particles) {
                const std::size_t i = all.bodies[b].first_particle + particle;
                model.velocity[i] = (model.rest_position[i] + after - model.position[i]) / step_s;
            }
        }
    }
}

void Simulation::State::skin() {
    start.swap(end);
    skinner.place(model, end);
}

void Simulation::State::verify(StepResult& result) const {
    result.crossed = !path.complete() || !find_crossings(moved, path.knots()).empty();
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
    frame.static_friction = contact.static_friction;
    frame.dynamic_friction = contact.dynamic_friction;
    frame.proxy_count = 1;
    frame.flags = (result.squeezed ? std::uint32_t{HAPTIC_FRAME_SQUEEZED} : 0u) |
                  (clutch.uncoupled() ? std::uint32_t{HAPTIC_FRAME_CLUTCHED} : 0u);
    ProxyContact& contact_out = frame.proxies[0];
    store(workspace.to_device(proxy), contact_out.position);
    contact_out.in_contact = result.in_contact ? 1 : 0;
    contact_out.plane_count = planes.count;
    Vec3 carried(0.0);  // m, over the step that begins now: what the hand would stick to
    for (std::size_t p = 0; p < planes.count; ++p) {
        SurfacePlane plane = planes.plane[p];
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
        contact_out.planes[p] = workspace.to_device(plane);
        if (p < contacts.count || p == 0) {
            carried += (contacts.count > 0 ? grip.share[p] : 1.0) * travel;
        }
    }
    if (frame.static_friction > 0.0 || frame.dynamic_friction > 0.0) {
        store(workspace.velocity_to_device(carried * inverse_step), contact_out.surface_velocity);
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
    result.times.proxy_ns += watch.lap();
    s.lead_motions();
    s.solver.step(s.model, s.force, s.collisions.get());
    ++s.steps;
    if (!is_finite(s.model)) {
        throw std::runtime_error(
            "step " + std::to_string(s.steps) +
            " at t = " + std::to_string(static_cast<double>(s.steps) * s.scene.solver.step) +
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
    result.times.total_ns = t.ccd_ns + t.popout_ns + t.proxy_ns + t.collide_ns + t.deform_ns + t.skin_ns + frame_ns;
    return result;
}

StepInput Simulation::scripted_input(std::int64_t time_ns) const {
    const Scene& scene = state_->scene;
    const std::int64_t period_ns = nanoseconds(scene.hand.duration_s());
    const Pose hand = scene.hand.at(scene.hand_repeats && period_ns > 0 ? time_ns % period_ns : time_ns);
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
    return state_->all.mesh;
}
const std::vector<SceneBody>& Simulation::bodies() const noexcept {
    return state_->all.bodies;
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
