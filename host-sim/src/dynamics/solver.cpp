#include "haptic/sim/solver.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <stdexcept>
#include <string>
#include <utility>

#include "dynamics/constraint_batches.hpp"
#include "dynamics/elastic_bodies.hpp"
#include "dynamics/model_bodies.hpp"
#include "dynamics/rotation.hpp"
#include "dynamics/rows.hpp"
#include "dynamics/workers.hpp"
#include "haptic/setting.hpp"
#include "simd/kernels.hpp"

namespace haptic::sim {
namespace {

// Sub-steps chosen for bodies with a material, s. The shortest bounds the time of a step.
constexpr double kShortestChosen = 2.5e-4;
// 10 ms are 5 sub-steps of 2 ms, whatever rounding makes of the quotient.
constexpr double kRounding = 1e-12;

// s: the tool may still owe a body something for half as long after it has left it.
constexpr double kLeastSleepAfter = 0.2;

void check(const SolverSettings& s) {
    const auto refuse = [](const std::string& why) { throw std::invalid_argument("solver: " + why); };
    if (!(s.step > 0.0) || !std::isfinite(s.step)) {
        refuse("step must be positive");
    }
    if (s.substeps < 0 || s.iterations < 0 || s.rotation_iterations < 1) {
        refuse("rotation_iterations must be at least 1, substeps and iterations at least 0");
    }
    if (s.threads < 0 || s.threads > Workers::kMaxThreads) {
        refuse("threads must be in 0.." + std::to_string(Workers::kMaxThreads));
    }
    if (!(s.drag >= 0.0) || !(s.drag * s.step < 1.0)) {
        refuse("drag must be at least 0 and less than 1 / step");
    }
    if (!(s.shape_damping >= 0.0) || !(s.shape_damping * s.step <= 1.0)) {
        refuse("shape_damping must be at least 0 and at most 1 / step");
    }
    if (s.sleep_after != 0.0 && !(s.sleep_after >= kLeastSleepAfter)) {
        refuse("sleep_after must be 0 or at least 0.2 s");
    }
}

// The layout that the motion kernels read and write.
static_assert(sizeof(Vec3) == 3 * sizeof(double) && offsetof(Vec3, x) == 0);
static_assert(sizeof(Quat) == 4 * sizeof(double) && offsetof(Quat, x) == 0 && offsetof(Quat, w) == 3 * sizeof(double));

/// Throws std::invalid_argument for a number of lanes that this machine does not have.
const ProjectionKernels& choose_projection(std::size_t lanes) {
    static_assert(ParticleSolver::kWidest == kWidestLanes);
    if (const ProjectionKernels* const kernels = find_kernels(&Kernels::projection, lanes)) {
        return *kernels;
    }
    throw std::invalid_argument("solver: this machine has no vectors of " + std::to_string(lanes) +
                                " lanes; ParticleSolver::usable_lanes() lists the numbers it has");
}

/// The same forces in every sub-step; none for any particle, or one for each.
class ConstantForces final : public SolverForces {
  public:
    explicit ConstantForces(std::span<const Vec3> force) : force_(force) {}
    [[nodiscard]] std::span<const Vec3> at(const ParticleModel& /*start*/, const ParticleRange& body,
                                           double /*elapsed*/, double /*h*/) noexcept override {
        return force_.empty() ? force_ : force_.subspan(body.begin, body.end - body.begin);
    }

  private:
    std::span<const Vec3> force_;
};

}  // namespace

/// The constraints in batches, and the particles in the form in which they are projected.
struct ParticleSolver::ProjectionState {
    ProjectionState(const ParticleModel& model, std::size_t lanes, Workers& workers)
        : projection(choose_projection(lanes)),
          motion(*find_kernels(&Kernels::motion, projection.lanes)),
          batches(model, projection.lanes),
          links(batches.links()),
          springs(batches.springs()),
          groups(batches.groups()),
          elastic(model, (projection.lanes + 1) / 2, &workers),
          position(batches.padded_particles()),
          start(model.size()),
          f32(batches.padded_particles()),
          scratch(kMaxBatchesInRun * batches.max_slots() * kFloatsPerSlot * projection.lanes),
          pushed(model.size()),
          before(batches.whole_vectors()),
          orientation(batches.whole_vectors(), Row{{1.0, 0.0, 0.0, 0.0}}),
          rotation(batches.whole_vectors()),
          angular_velocity(batches.whole_vectors()) {
        for (std::size_t i = 0; i < model.size(); ++i) {
            position[i].number[3] = spin_mass(model, i);
        }
    }

    void set_orientation(std::size_t particle, const Quat& q) {
        orientation[particle] = {{q.w, q.x, q.y, q.z}};
        for (std::size_t k = 0; k < 4; ++k) {
            f32[particle].orientation.number[k] = static_cast<float>(orientation[particle].number[k]);
        }
    }

    [[nodiscard]] Quat orientation_of(std::size_t particle) const {
        const Row& q = orientation[particle];
        return Quat(q.number[0], q.number[1], q.number[2], q.number[3]);
    }

    /// By the rotation vectors in `rotation`.
    void rotate_particles(const ParticleModel& model, const ParticleRange& body) {
        const std::size_t first = body.begin;
        projection.rotate_particles(body.end - first, &rotation[first], &orientation[first], &f32[first]);
        // Rotation by 0 normalises, which may change a bit: restore the particles that do not rotate.
        for (std::size_t i = first; i < body.end; ++i) {
            if (model.pinned[i] != 0 && model.angular_velocity[i] == Vec3(0.0)) {
                set_orientation(i, model.orientation[i]);
            }
        }
    }

    /// Bodies with a material, from where all forces lead them to the end of the sub-step. Calls moved(particles) after
    /// moving each free solid. `beside` happens meanwhile.
    template <class Moved, class Beside>
    void move_elastic_bodies(const ParticleModel& model, double drag_factor, const Moved& moved, const Beside& beside) {
        if (elastic.empty()) {
            beside();
            return;
        }
        elastic.step({model, drag_factor, position.data(), orientation.data()}, moved, beside);
        if (!has_constraints()) {
            return;
        }
        // Constraints count displacements, and rotations from the rounded orientations.
        round_displacements();
        for (const std::uint32_t particle : elastic.turning()) {
            set_orientation(particle, orientation_of(particle));
        }
    }

    [[nodiscard]] MovingParticles moving() { return {position.data(), f32.data(), scratch.data(), pushed.data()}; }

    void find_angular_velocities(const ParticleRange& body, double h) {
        const std::size_t first = body.begin;
        projection.find_angular_velocities(body.end - first, &before[first], has_constraints() ? &f32[first] : nullptr,
                                           h, &orientation[first], &angular_velocity[first]);
    }

    [[nodiscard]] bool has_constraints() const noexcept {
        return links.count > 0 || springs.count > 0 || groups.batches > 0;
    }

    /// One Gauss-Seidel pass over all constraints.
    void sweep(bool forward, int rotation_iterations) {
        const MovingParticles particles = moving();
        projection.project_links(links, forward, particles);
        if (springs.count > 0) {  // springs move positions, in double
            apply_displacements();
            projection.project_springs(springs, forward, particles);
            round_displacements();
        }
        projection.project_groups(groups, forward, rotation_iterations, particles);
    }

    /// After the prediction of a sub-step of length h, s.
    void begin_substep(double h) {
        if (!has_constraints()) {
            return;
        }
        batches.begin_substep(h);
        for (std::size_t i = 0; i < start.size(); ++i) {
            start[i] = position[i];
            start[i].number[3] = 0.0;
        }
        round_displacements();
        projection.begin_substep(links, groups, position.data());
    }
    // Only constraints count displacements within a sub-step.
    void round_displacements() {
        if (!has_constraints()) {
            return;
        }
        projection.round_displacements(start.size(), position.data(), start.data(), f32.data());
    }
    void apply_displacements() {
        if (!has_constraints()) {
            return;
        }
        projection.apply_displacements(start.size(), f32.data(), start.data(), position.data());
    }

    const ProjectionKernels& projection;
    const MotionKernels& motion;
    ConstraintBatches batches;
    LinkBatches links;
    SpringBatches springs;
    GroupBatches groups;
    ElasticBodies elastic;
    // See MovingParticles.
    LaneArray<Row> position;
    LaneArray<Row> start;  // predicted position at the start of the sub-step; fourth number 0
    LaneArray<ParticleF32> f32;
    LaneArray<float> scratch;
    LaneArray<Row> pushed;            // 0 but between the contacts' pushes and the velocities
    LaneArray<Row> before;            // orientation at the start of the sub-step
    LaneArray<Row> orientation;       // predicted, then final orientation of the sub-step
    LaneArray<Row> rotation;          // h w
    LaneArray<Row> angular_velocity;  // w at the end of the sub-step
};

TooStiff::TooStiff(std::uint32_t particle, double substep_s)
    : std::invalid_argument(
          "the body is too stiff for its mass with sub-steps of " + toml_value(1e3 * substep_s) +
          " ms: the digits of a number do not hold both. Lower its modulus, raise its density, or take "
          "a shorter solver.step or more solver.substeps"),
      particle_(particle) {}

ParticleSolver::ParticleSolver(const ParticleModel& model, const SolverSettings& settings, std::size_t lanes)
    : settings_(settings), faithful_step_(faithful_step(model)) {
    check(settings);
    model.check();
    for (const ParticleRange& body : bodies_of(model)) {
        bodies_.push_back({body, has_no_pinned(model, body)});
    }
    workers_ = std::make_unique<Workers>(settings.threads > 0 ? settings.threads
                                                              : std::min(usable_processors(), Workers::kMaxChosen));
    state_ = std::make_unique<ProjectionState>(model, lanes, *workers_);
    state_->elastic.prepare(settings.step / substeps());
    predicted_.resize(model.size());
}

ParticleSolver::ParticleSolver(ParticleSolver&&) noexcept = default;
ParticleSolver& ParticleSolver::operator=(ParticleSolver&&) noexcept = default;
ParticleSolver::~ParticleSolver() = default;

std::vector<std::size_t> ParticleSolver::usable_lanes() {
    return lanes_of(&Kernels::projection);
}

std::size_t ParticleSolver::lanes() const noexcept {
    return state_->projection.lanes;
}
std::size_t ParticleSolver::group_colours() const noexcept {
    return state_->batches.group_colours();
}
std::size_t ParticleSolver::link_colours() const noexcept {
    return state_->batches.link_colours();
}

int ParticleSolver::substeps() const noexcept {
    if (settings_.substeps > 0) {
        return settings_.substeps;
    }
    const double longest = std::max(faithful_step_, kShortestChosen);
    return std::isinf(longest) ? 1 : static_cast<int>(std::ceil(settings_.step / longest * (1.0 - kRounding)));
}

bool ParticleSolver::iterates() const noexcept {
    return state_->has_constraints() || !state_->elastic.have_all();
}

void ParticleSolver::step(ParticleModel& model, std::span<const Vec3> force,
                          std::initializer_list<SolverContacts*> contacts) {
    ConstantForces forces(force);
    step(model, forces, contacts);
}

void ParticleSolver::step(ParticleModel& model, SolverForces& forces, std::initializer_list<SolverContacts*> contacts,
                          const BodyFunction& at_end) {
    const auto for_each = [&](auto&& call) {
        for (SolverContacts* const c : contacts) {  // NOLINT(misc-const-correctness): some calls change it
            if (c != nullptr) {
                call(*c);
            }
        }
    };
    // Sub-steps: as configured, or more if contacts need them.
    int substeps = this->substeps();
    int sets = 0;
    const SolverContacts* last_set = nullptr;
    for_each([&](const SolverContacts& c) {
        ++sets;
        last_set = &c;
        substeps = std::max(substeps, c.substeps(model, settings_.step));
    });
    const double h = settings_.step / substeps;
    const bool constrained = state_->has_constraints();
    const int iterations = iterates() ? settings_.iterations : 1;
    bool secured = false;
    for_each([&](const SolverContacts& c) { secured = secured || c.secures(); });
    state_->elastic.prepare(h);
    // v <- v + h (f / m + g), u <- x + h v, orientations rotated by h w.
    const auto begin_substep = [&](std::size_t b, int s) {
        const ParticleRange& body = bodies_[b].particles;
        if (!is_asleep(model, body)) {
            predict(model, body, forces.at(model, body, s * h, h), h);
        } else if (s == 0) {
            stay(model, body);
        }
    };
    workers_->for_each(bodies_.size(), [&](std::size_t b) { begin_substep(b, 0); });
    for (int s = 0; s < substeps; ++s) {
        for_each([&](SolverContacts& c) { c.begin(model, state_->elastic, state_->moving(), h); });
        state_->begin_substep(h);
        // Algorithm 3, line 15: contacts along the paths x to u.
        const PredictedMotion predicted{predicted_.empty() ? nullptr : &predicted_.front().x, state_->f32.data()};
        // A free solid gets back the momenta that its elastic step has lost before contacts act, which change them by
        // their forces alone: what came back later would move what friction holds.
        state_->move_elastic_bodies(
            model, 1.0 - h * settings_.drag,
            [&](const ParticleRange& solid) { restore_momenta(model, solid, h, nullptr); },
            [&] { for_each([&](SolverContacts& c) { c.search(model, predicted, h); }); });
        // Gauss-Seidel, alternately forward and backward, so that the order prefers no direction. Where all bodies are
        // elastic solids, finish() is all that the last set of contacts needs after the others.
        const bool solids = !constrained && state_->elastic.all_are_solid();
        for (int i = 0; i < iterations && !(solids && sets < 2); ++i) {
            if (constrained) {
                state_->sweep(i % 2 == 0, settings_.rotation_iterations);
            }
            if (sets > 0) {
                const SolverContacts* const left_out = solids ? last_set : nullptr;
                state_->apply_displacements();
                for_each([&](SolverContacts& c) {
                    if (&c != left_out) {
                        c.project(model, state_->moving(), h);
                    }
                });
                state_->round_displacements();
            }
        }
        if (sets > 0) {
            // Contacts may push further, and change momentum: what is restored later must not undo that.
            for_each([&](SolverContacts& c) { c.finish(model, state_->moving(), h); });
        } else {
            // With contacts, each iteration has applied the displacements already.
            state_->apply_displacements();
        }
        // v <- (u - x) / h, w <- rotation / h, with the corrections of momentum; then x <- u, and the damping.
        // What is next for a body follows at once, on the thread whose cache has it.
        const auto end_substep = [&](std::size_t b) {
            if (!is_asleep(model, bodies_[b].particles)) {
                take_positions_of(model, bodies_[b], h);
            }
            if (s + 1 < substeps) {
                begin_substep(b, s + 1);
            } else if (at_end) {
                at_end(b);
            }
        };
        workers_->for_each(bodies_.size(), [&](std::size_t b) {
            if (!is_asleep(model, bodies_[b].particles)) {
                find_velocities_of(model, bodies_[b], h);
            }
            if (!secured) {
                end_substep(b);
            }
        });
        if (secured) {
            for_each([&](SolverContacts& c) { take_secured(model, c.secure(model, state_->moving(), h), h); });
            workers_->for_each(bodies_.size(), end_substep);
        }
    }
}

void ParticleSolver::set_steps(double step, int substeps, int iterations) {
    SolverSettings next = settings_;
    next.step = step;
    next.substeps = substeps;
    next.iterations = iterations;
    check(next);
    settings_ = next;
}

/// `force`, N: per particle of the body, or nothing.
void ParticleSolver::predict(const ParticleModel& model, const ParticleRange& body, std::span<const Vec3> force,
                             double h) {
    const std::size_t first = body.begin;
    state_->motion.predict({.count = body.end - first,
                            .step = h,
                            .drag_factor = 1.0 - h * settings_.drag,
                            .gravity = &settings_.gravity.x,
                            .pinned = &model.pinned[first],
                            .mass = &model.mass[first],
                            .force = force.empty() ? nullptr : &force[0].x,
                            .start = &model.position[first].x,
                            .velocity = &model.velocity[first].x,
                            .angular_velocity = &model.angular_velocity[first].x,
                            .orientation = &model.orientation[first].x,
                            .predicted = &predicted_[first].x,
                            .position = &state_->position[first],
                            .before = &state_->before[first],
                            .turning = &state_->orientation[first],
                            .rotation = &state_->rotation[first]});
    // q <- rotation(h w) q.
    state_->rotate_particles(model, body);
}

/// The prediction of a body that sleeps, for contacts that look at it.
void ParticleSolver::stay(const ParticleModel& model, const ParticleRange& body) {
    for (std::size_t i = body.begin; i < body.end; ++i) {
        set_vector(state_->position[i], model.position[i]);
        state_->set_orientation(i, model.orientation[i]);
        predicted_[i] = Vec3(0.0);
    }
}

/// Gives a free body the momenta of the predicted velocities as a rigid motion. `velocity`, m/s: those of its
/// particles, to be corrected too, or null.
void ParticleSolver::restore_momenta(const ParticleModel& model, const ParticleRange& body, double h,
                                     Vec3* velocity) noexcept {
    const std::size_t first = body.begin;
    state_->motion.restore_momenta({.count = body.end - first,
                                    .step = h,
                                    .keep_angular_momentum = settings_.keep_angular_momentum,
                                    .mass = &model.mass[first],
                                    .start = &model.position[first].x,
                                    .predicted = &predicted_[first].x,
                                    .velocity = velocity == nullptr ? nullptr : &velocity->x,
                                    .position = &state_->position[first]});
}

void ParticleSolver::find_velocities_of(ParticleModel& model, const Body& body, double h) {
    const ParticleRange& range = body.particles;
    const std::size_t first = range.begin;
    // w <- rotation / h, from the orientations before and after the projections.
    state_->find_angular_velocities(range, h);
    // v <- (u - x) / h, w and orientations. Pinned particles keep the velocities that were set.
    state_->motion.find_velocities({.count = range.end - first,
                                    .step = h,
                                    .pinned = &model.pinned[first],
                                    .start = &model.position[first].x,
                                    .position = &state_->position[first],
                                    .angular_velocity = &state_->angular_velocity[first],
                                    .pushed = &state_->pushed[first],
                                    .predicted = &predicted_[first].x,
                                    .velocity = &model.velocity[first].x,
                                    .new_angular_velocity = &model.angular_velocity[first].x,
                                    .orientation = &state_->orientation[first],
                                    .new_orientation = &model.orientation[first].x});
    if (body.is_free && !state_->elastic.is_of_free_solid(range.begin)) {
        restore_momenta(model, range, h, &model.velocity[first]);
    }
}

/// Velocities of the particles that contacts have moved last; the lost momenta of their bodies return as velocity only,
/// because the positions are secured.
void ParticleSolver::take_secured(ParticleModel& model, std::span<const std::uint32_t> moved, double h) {
    if (moved.empty()) {
        return;
    }
    for (const std::uint32_t i : moved) {
        predicted_[i] += vector_of(std::exchange(state_->pushed[i], Row{})) / h;
        if (model.pinned[i] == 0) {
            model.velocity[i] = (vector_of(state_->position[i]) - model.position[i]) / h;
        }
    }
    for (const Body& body : bodies_) {
        const auto belongs = [&](std::uint32_t i) { return i >= body.particles.begin && i < body.particles.end; };
        if (!body.is_free || std::ranges::none_of(moved, belongs)) {
            continue;
        }
        restore_secured(model, body.particles);
    }
}

/// Gives a body the momenta that it had after the prediction and the contacts, at its final positions u.
void ParticleSolver::restore_secured(ParticleModel& model, const ParticleRange& body) {
    // About the origin: sums of m v_predicted and x x m v_predicted, less those of v at u.
    double mass = 0.0;
    Vec3 centre(0.0);
    Vec3 linear(0.0);
    Vec3 angular(0.0);
    const auto end = [&](std::size_t i) { return vector_of(state_->position[i]); };
    for (std::size_t i = body.begin; i < body.end; ++i) {
        const double m = model.mass[i];
        mass += m;
        centre += m * end(i);
        linear += m * (predicted_[i] - model.velocity[i]);
        angular += m * (glm::cross(model.position[i], predicted_[i]) - glm::cross(end(i), model.velocity[i]));
    }
    centre /= mass;
    angular -= glm::cross(centre, linear);
    Mat3 scatter(0.0);
    for (std::size_t i = body.begin; i < body.end; ++i) {
        add_outer(scatter, model.mass[i], end(i) - centre, end(i) - centre);
    }
    const Vec3 omega = settings_.keep_angular_momentum ? solve_inertia(scatter, angular) : Vec3(0.0);
    for (std::size_t i = body.begin; i < body.end; ++i) {
        model.velocity[i] += linear / mass + glm::cross(omega, end(i) - centre);
    }
}

void ParticleSolver::take_positions_of(ParticleModel& model, const Body& body, double h) {
    const ParticleRange& range = body.particles;
    // x <- u.
    for (std::size_t i = range.begin; i < range.end; ++i) {
        model.position[i] = vector_of(state_->position[i]);
    }
    // Last: damping keeps the restored momenta, about the final positions.
    if (settings_.shape_damping > 0.0) {
        damp_shape(model, range, h);
    }
}

void ParticleSolver::damp_shape(ParticleModel& model, const ParticleRange& body, double h) const {
    // Rigid motion with the body's momenta: v_c = P / M, w = I^-1 L (Müller et al. 2007, section 3.5).
    const Vec3 centre = centre_of_mass(model, body);
    double mass = 0.0;
    Vec3 linear(0.0);
    Vec3 angular(0.0);
    Mat3 scatter(0.0);
    for (std::size_t i = body.begin; i < body.end; ++i) {
        // Sums for M, P, L and the scatter matrix sum m p p^T, from which I follows.
        const Vec3 p = model.position[i] - centre;
        mass += model.mass[i];
        linear += model.mass[i] * model.velocity[i];
        angular += model.mass[i] * glm::cross(p, model.velocity[i]);
        add_outer(scatter, model.mass[i], p, p);
    }
    // v_c and w; the rigid velocity of a particle is v_c + w x p.
    linear /= mass;
    const Vec3 omega = solve_inertia(scatter, angular);
    // Blend each free particle's velocity toward the rigid one.
    const double fraction = h * settings_.shape_damping;
    for (std::size_t i = body.begin; i < body.end; ++i) {
        if (model.pinned[i] == 0) {
            const Vec3 rigid = linear + glm::cross(omega, model.position[i] - centre);
            model.velocity[i] += fraction * (rigid - model.velocity[i]);
        }
    }
}

}  // namespace haptic::sim
