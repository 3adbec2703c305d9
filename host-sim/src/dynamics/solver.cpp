#include <haptic/sim/solver.hpp>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <stdexcept>
#include <string>

#include "dynamics/constraint_batches.hpp"
#include "dynamics/rotation.hpp"
#include "simd/projection.hpp"

namespace haptic::sim {
namespace {

void check(const SolverSettings& s) {
    const auto refuse = [](const std::string& why) { throw std::invalid_argument("solver: " + why); };
    if (!(s.step > 0.0) || !std::isfinite(s.step)) {
        refuse("step must be positive");
    }
    if (s.substeps < 1 || s.iterations < 0 || s.rotation_iterations < 1) {
        refuse("needs at least one sub-step and one rotation iteration, and no negative number of iterations");
    }
    if (!(s.drag >= 0.0) || !(s.drag * s.step < 1.0)) {
        refuse("drag must be at least 0 and less than 1 / step");
    }
    if (!(s.settling >= 0.0) || !(s.settling * s.step <= 1.0)) {
        refuse("settling must be at least 0 and at most 1 / step");
    }
}

/// a += scale * p q^T, where the matrix is stored by columns.
void add_outer(Mat3& a, double scale, const Vec3& p, const Vec3& q) {
    const Vec3 sp = scale * p;
    a[0] += sp * q.x;
    a[1] += sp * q.y;
    a[2] += sp * q.z;
}

Vec3 centre_of_mass(const ParticleModel& model, const ParticleRange& body) {
    double mass = 0.0;
    Vec3 sum(0.0);
    for (std::size_t i = body.begin; i < body.end; ++i) {
        mass += model.mass[i];
        sum += model.mass[i] * model.position[i];
    }
    return sum / mass;
}

std::vector<ParticleRange> bodies_of(const ParticleModel& model) {
    if (!model.bodies.empty() || model.size() == 0) {
        return model.bodies;
    }
    return {{0, static_cast<std::uint32_t>(model.size())}};
}

bool nothing_pinned(const ParticleModel& model, const ParticleRange& body) {
    const auto first = model.pinned.begin();
    return std::all_of(first + body.begin, first + body.end, [](std::uint8_t pin) { return pin == 0; });
}

Vec3 vector_of(const Row& row) {
    return {row.number[0], row.number[1], row.number[2]};
}

void set_vector(Row& row, const Vec3& p) {
    row.number[0] = p.x;
    row.number[1] = p.y;
    row.number[2] = p.z;
}

/// Those that this machine can do, by number of lanes.
std::vector<const Projection*> usable_projections() {
    std::vector<const Projection*> usable{&kOneLane, &kFourLanes};
#if defined(__x86_64__)
    if (__builtin_cpu_supports("avx2") != 0) {
        usable.push_back(&kEightLanes);
    }
    if (__builtin_cpu_supports("avx512f") != 0) {
        usable.push_back(&kSixteenLanes);
    }
#endif
    return usable;
}

const Projection& choose_projection(std::size_t lanes) {
    const std::vector<const Projection*> usable = usable_projections();
    if (lanes == ParticleSolver::kWidest) {
        return *usable.back();
    }
    for (const Projection* projection : usable) {
        if (projection->lanes == lanes) {
            return *projection;
        }
    }
    throw std::invalid_argument("solver: this machine has no vectors of " + std::to_string(lanes) +
                                " lanes; ParticleSolver::usable_lanes() tells those that it has");
}

}  // namespace

struct ParticleSolver::Projecting {
    Projecting(const ParticleModel& model, std::size_t lanes)
        : projection(choose_projection(lanes)),
          batches(model, projection.lanes),
          links(batches.links()),
          springs(batches.springs()),
          groups(batches.groups()),
          place(batches.all_bodies()),
          start(model.size()),
          body(batches.all_bodies()),
          scratch(kMostBatchesInRun * batches.most_slots() * kNumbersOfSlot * projection.lanes),
          pushed(model.size()),
          before(batches.bodies()),
          turn(batches.bodies(), Row{{1.0, 0.0, 0.0, 0.0}}),
          turning(batches.bodies()),
          rate(batches.bodies()) {
        for (std::size_t i = 0; i < model.size(); ++i) {
            place[i].number[3] = spin_mass(model, i);
        }
    }

    void set_orientation(std::size_t particle, const Quat& q) {
        turn[particle] = {{q.w, q.x, q.y, q.z}};
        for (std::size_t k = 0; k < 4; ++k) {
            body[particle].turn.number[k] = static_cast<float>(turn[particle].number[k]);
        }
    }

    [[nodiscard]] Quat orientation(std::size_t particle) const {
        const Row& q = turn[particle];
        return Quat(q.number[0], q.number[1], q.number[2], q.number[3]);
    }

    /// As the rows of `turning` say.
    void turn_bodies(const ParticleModel& model) {
        projection.turn_bodies(turning.size(), turning.data(), turn.data(), body.data());
        for (std::size_t i = 0; i < model.size(); ++i) {
            if (model.pinned[i] != 0 && model.angular_velocity[i] == Vec3(0.0)) {
                set_orientation(i, model.orientation[i]);  // turning by 0 normalises, which may change a bit
            }
        }
    }

    [[nodiscard]] MovingParticles moving() { return {place.data(), body.data(), scratch.data(), pushed.data()}; }

    void find_rates(double h) {
        projection.find_rates(before.size(), before.data(), body.data(), h, turn.data(), rate.data());
    }

    void sweep(bool forward, int rotation_iterations) {
        const MovingParticles particles = moving();
        projection.project_links(links, forward, particles);
        if (springs.count > 0) {  // which move places
            add_moved();
            projection.project_springs(springs, forward, particles);
            find_moved();
        }
        projection.project_groups(groups, forward, rotation_iterations, particles);
    }

    /// After the prediction of a sub-step of length h.
    void begin(double h) {
        batches.begin(h);
        for (std::size_t i = 0; i < start.size(); ++i) {
            start[i] = place[i];
            start[i].number[3] = 0.0;
        }
        find_moved();
        projection.begin(links, groups, place.data());
    }
    void find_moved() { projection.find_moved(start.size(), place.data(), start.data(), body.data()); }
    void add_moved() { projection.add_moved(start.size(), body.data(), start.data(), place.data()); }

    const Projection& projection;
    ConstraintBatches batches;
    LinkBatches links;
    SpringBatches springs;
    GroupBatches groups;
    // See MovingParticles.
    LaneArray<Row> place;
    LaneArray<Row> start;  // place when the sub-step began, and 0
    LaneArray<Body> body;
    LaneArray<float> scratch;
    LaneArray<Row> pushed;
    LaneArray<Row> before;   // turn at the start of the sub-step
    LaneArray<Row> turn;     // as predicted, then at the end of the sub-step
    LaneArray<Row> turning;  // h w
    LaneArray<Row> rate;     // w at the end of the sub-step
};

ParticleSolver::ParticleSolver(const ParticleModel& model, const SolverSettings& settings, std::size_t lanes)
    : settings_(settings) {
    check(settings);
    model.check();
    for (const ParticleRange& body : bodies_of(model)) {
        bodies_.push_back({body, nothing_pinned(model, body)});
    }
    now_ = std::make_unique<Projecting>(model, lanes);
    predicted_.resize(model.size());
}

ParticleSolver::ParticleSolver(ParticleSolver&&) noexcept = default;
ParticleSolver& ParticleSolver::operator=(ParticleSolver&&) noexcept = default;
ParticleSolver::~ParticleSolver() = default;

std::vector<std::size_t> ParticleSolver::usable_lanes() {
    std::vector<std::size_t> lanes;
    for (const Projection* projection : usable_projections()) {
        lanes.push_back(projection->lanes);
    }
    return lanes;
}

std::size_t ParticleSolver::lanes() const noexcept {
    return now_->projection.lanes;
}
std::size_t ParticleSolver::group_colours() const noexcept {
    return now_->batches.group_colours();
}
std::size_t ParticleSolver::link_colours() const noexcept {
    return now_->batches.link_colours();
}

void ParticleSolver::step(ParticleModel& model, std::span<const Vec3> force, SolverContacts* contacts) {
    const int substeps =
        std::max(settings_.substeps, contacts == nullptr ? 1 : contacts->substeps(model, settings_.step));
    const double h = settings_.step / substeps;
    for (int s = 0; s < substeps; ++s) {
        predict(model, force, h);
        now_->begin(h);
        if (contacts != nullptr) {
            contacts->find(model, now_->moving(), h);
        }
        for (int i = 0; i < settings_.iterations; ++i) {
            now_->sweep(
                i % 2 == 0,
                settings_.rotation_iterations);  // there and back, so that no direction of the order is preferred
            if (contacts != nullptr) {
                now_->add_moved();
                contacts->project(model, now_->moving(), h);
                now_->find_moved();
            }
        }
        if (contacts == nullptr) {
            now_->add_moved();
        }
        if (contacts != nullptr) {
            contacts->finish(model, now_->moving(), h);
            count_pushes(h);
        }
        update(model, h);
    }
}

void ParticleSolver::project(ParticleModel& model, std::span<const std::uint8_t> held) {
    for (std::size_t i = 0; i < model.size(); ++i) {
        set_vector(now_->place[i], model.position[i]);
        now_->set_orientation(i, model.orientation[i]);
        now_->before[i] = now_->turn[i];
    }
    now_->begin(settings_.step);
    for (int pass = 0; pass < settings_.iterations; ++pass) {
        now_->sweep(pass % 2 == 0, settings_.rotation_iterations);
        now_->add_moved();
        for (std::size_t i = 0; i < held.size(); ++i) {
            if (held[i] != 0) {
                set_vector(now_->place[i], model.position[i]);
            }
        }
        now_->find_moved();
    }
    now_->find_rates(settings_.step);
    for (std::size_t i = 0; i < model.size(); ++i) {
        model.position[i] = vector_of(now_->place[i]);
        if (model.pinned[i] == 0) {
            model.orientation[i] = now_->orientation(i);
        }
    }
}

void ParticleSolver::set_rest_shape(const ParticleModel& model) noexcept {
    now_->batches.set_rest_shape(model);
}

void ParticleSolver::set_pace(double step, int iterations) {
    SolverSettings next = settings_;
    next.step = step;
    next.iterations = iterations;
    check(next);
    settings_ = next;
}

void ParticleSolver::count_pushes(double h) {
    for (std::size_t i = 0; i < predicted_.size(); ++i) {
        predicted_[i] += vector_of(now_->pushed[i]) / h;
    }
}

void ParticleSolver::predict(ParticleModel& model, std::span<const Vec3> force, double h) {
    const double keep = 1.0 - h * settings_.drag;
    for (std::size_t i = 0; i < model.size(); ++i) {
        const Quat& q = model.orientation[i];
        now_->before[i] = now_->turn[i] = {{q.w, q.x, q.y, q.z}};
        if (model.pinned[i] != 0) {
            predicted_[i] = model.velocity[i];
            const bool still = predicted_[i] == Vec3(0.0);
            set_vector(now_->place[i], still ? model.position[i] : model.position[i] + h * predicted_[i]);
            set_vector(now_->turning[i], h * model.angular_velocity[i]);
            continue;
        }
        Vec3 v = keep * model.velocity[i] + h * settings_.gravity;
        if (!force.empty()) {
            v += (h / model.mass[i]) * force[i];
        }
        predicted_[i] = v;
        set_vector(now_->place[i], model.position[i] + h * v);
        set_vector(now_->turning[i], h * keep * model.angular_velocity[i]);
    }
    now_->turn_bodies(model);
}

void ParticleSolver::update(ParticleModel& model, double h) {
    now_->find_rates(h);
    for (std::size_t i = 0; i < model.size(); ++i) {
        if (model.pinned[i] == 0 || model.angular_velocity[i] != Vec3(0.0)) {
            model.orientation[i] = now_->orientation(i);
        }
        if (model.pinned[i] == 0) {
            model.velocity[i] = (vector_of(now_->place[i]) - model.position[i]) / h;
            model.angular_velocity[i] = vector_of(now_->rate[i]);
        }
    }
    for (const Whole& body : bodies_) {
        if (body.is_free) {
            restore_momenta(model, body.particles, h);
        }
    }
    for (std::size_t i = 0; i < model.size(); ++i) {
        model.position[i] = vector_of(now_->place[i]);
    }
    if (settings_.settling > 0.0) {
        for (const Whole& body : bodies_) {
            settle(model, body.particles, h);
        }
    }
}

void ParticleSolver::restore_momenta(ParticleModel& model, const ParticleRange& body, double h) {
    const Vec3 centre = centre_of_mass(model, body);
    double mass = 0.0;
    Vec3 linear(0.0);
    Vec3 angular(0.0);
    Mat3 scatter(0.0);
    for (std::size_t i = body.begin; i < body.end; ++i) {
        const Vec3 p = model.position[i] - centre;
        const Vec3 lost = model.mass[i] * (predicted_[i] - model.velocity[i]);
        mass += model.mass[i];
        linear += lost;
        angular += glm::cross(p, lost);
        add_outer(scatter, model.mass[i], p, p);
    }
    linear /= mass;
    const Vec3 rate = settings_.keep_angular_momentum ? solve_inertia(scatter, angular) : Vec3(0.0);
    for (std::size_t i = body.begin; i < body.end; ++i) {
        const Vec3 dv = linear + glm::cross(rate, model.position[i] - centre);
        model.velocity[i] += dv;
        set_vector(now_->place[i], vector_of(now_->place[i]) + h * dv);
    }
}

void ParticleSolver::settle(ParticleModel& model, const ParticleRange& body, double h) const {
    const Vec3 centre = centre_of_mass(model, body);
    double mass = 0.0;
    Vec3 linear(0.0);
    Vec3 angular(0.0);
    Mat3 scatter(0.0);
    for (std::size_t i = body.begin; i < body.end; ++i) {
        const Vec3 p = model.position[i] - centre;
        mass += model.mass[i];
        linear += model.mass[i] * model.velocity[i];
        angular += model.mass[i] * glm::cross(p, model.velocity[i]);
        add_outer(scatter, model.mass[i], p, p);
    }
    linear /= mass;
    const Vec3 rate = solve_inertia(scatter, angular);
    const double part = h * settings_.settling;
    for (std::size_t i = body.begin; i < body.end; ++i) {
        if (model.pinned[i] == 0) {
            const Vec3 rigid = linear + glm::cross(rate, model.position[i] - centre);
            model.velocity[i] += part * (rigid - model.velocity[i]);
        }
    }
}

}  // namespace haptic::sim
