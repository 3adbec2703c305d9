#include "haptic/sim/collisions.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "collision/swept_pairs.hpp"
#include "dynamics/elastic_pushes.hpp"
#include "dynamics/model_bodies.hpp"
#include "dynamics/stage_clock.hpp"
#include "simd/ellipsoid_lanes.hpp"
#include "simd/kernels.hpp"

namespace haptic::sim {
namespace {

// Slack of the broad phase: a pair is found although constraints move a particle beyond its path from x to u, by this
// share of its mean semi-axis and of its path.
constexpr double kSlackOfSize = 0.2;
constexpr double kSlackOfPath = 0.25;
// Capacity for pairs, per particle.
constexpr std::size_t kPairsPerParticle = 64;
constexpr std::size_t kPlanesPerParticle = 32;
// Up to this number of bodies, particles outside all other bodies' boxes are skipped before the broad phase.
constexpr std::size_t kMaxBodiesToClip = 64;
// Extra passes in finish(). They end when no contact is deeper than kMaxDepth of the smallest mean semi-axis, or when
// two passes reduced the largest error to no less than kStagnation: overconstrained contacts are left to later steps.
constexpr int kMaxExtraPasses = 8;
constexpr double kMaxDepth = 0.05;
constexpr double kStagnation = 0.75;
// The same with elastic bodies. What is left over moves the body in the next sub-step, so less may be.
constexpr int kMaxElasticPasses = 64;
constexpr double kMaxElasticError = 1e-4;
// Largest approach of two bodies in a sub-step, in mean semi-axes. With 5 solver iterations, clouds of 137 particles of
// stiffness 0.9, 0.05 m thick, begin to pass through one another at 5 and do not at 4.
constexpr double kMaxApproach = 3.0;
constexpr Vec3 kUp(0.0, 1.0, 0.0);
// m: beyond any scene; arithmetic with it stays finite.
constexpr double kMaxCoordinate = 1e12;

void check(const CollisionSettings& s) {
    const auto refuse = [](const std::string& why) { throw std::invalid_argument("collisions: " + why); };
    if (!std::isfinite(s.ground_height)) {
        refuse("ground_height must be finite");
    }
    // The dynamic friction cone must lie inside the static one.
    if (!(s.static_friction >= 0.0) || !std::isfinite(s.static_friction) || !(s.dynamic_friction >= 0.0) ||
        !(s.dynamic_friction <= s.static_friction)) {
        refuse("friction must be at least 0, and dynamic_friction at most static_friction");
    }
    if (s.max_substeps < 1 || s.max_substeps > 100) {
        refuse("max_substeps must be in 1..100");
    }
    if (!(s.push_out_speed >= 0.0) || !std::isfinite(s.push_out_speed)) {
        refuse("push_out_speed must be at least 0");
    }
}

Vec3 position_of(const Row& row) noexcept {
    return {row.number[0], row.number[1], row.number[2]};
}

void move(Row& row, const Vec3& by) noexcept {
    row.number[0] += by.x;
    row.number[1] += by.y;
    row.number[2] += by.z;
}

/// Constant data of a particle.
struct Collider {
    double size;          // m, mean semi-axis
    double reach;         // m, largest semi-axis
    double inverse_mass;  // 1/kg; 0: pinned
    std::uint32_t body;
};

/// Rigid estimate of a body's motion.
struct BodyMotion {
    double size = kMaxCoordinate;  // m, mean of the particles' mean semi-axes
    Vec3 velocity{0.0};            // m/s, mean of its particles
    double spread = 0.0;           // m/s, largest deviation from it
    double descent = 0.0;          // m/s, largest downward speed
};

/// Separating plane of a pair. Fills one cache line, because most planes are only read.
struct alignas(64) Plane {
    std::uint32_t first;
    std::uint32_t second;
    Vec3 normal;            // unit, toward the first
    double min_separation;  // m, required distance of the centres along the normal
    double push;            // m, total normal displacement in this sub-step, at least 0
    double first_share;     // of each displacement, by inverse mass
    double second_share;
};

/// Data of a plane that is needed only when it pushes.
struct PlaneDetail {
    Vec3 from;      // m, offset of the centres at the start, second to first
    Vec3 friction;  // m, total tangential displacement by friction
    // If a body is elastic: of both particles together. Known as soon as the plane pushes.
    ElasticPushes::Compliance compliance{};
};

bool overlap(const Bounds& a, const Bounds& b) noexcept {
    bool both = true;
    for (int k = 0; k < 3; ++k) {
        both = both && a.low[k] <= b.high[k] && b.low[k] <= a.high[k];
    }
    return both;
}

bool is_in_range(const Aabb& box) noexcept {
    const auto in_range = [](double x) { return x > -kMaxCoordinate && x < kMaxCoordinate; };
    return in_range(box.min.x) && in_range(box.min.y) && in_range(box.min.z) && in_range(box.max.x) &&
           in_range(box.max.y) && in_range(box.max.z);
}

LaneVec<double> lane(const Vec3& v) noexcept {
    return {v.x, v.y, v.z};
}

/// Data of all particles as structure of arrays, for the kernels.
class Colliders {
  public:
    explicit Colliders(const ParticleModel& model)
        : length_(model.size() + kMaxLanes), number_(collider_row::kCount * length_) {
        using namespace collider_row;
        for (std::size_t i = 0; i < model.size(); ++i) {
            // Constant rows only; find_path_boxes() and find_ellipsoid_boxes() fill the others in each sub-step.
            const Vec3& axes = model.semi_axes[i];
            const Quat& q = model.axes[i];
            set(kSemiAxes, i, {axes.x, axes.y, axes.z});
            set(kAxes, i, {q.w, q.x, q.y, q.z});
            set(kSize, i, {(axes.x + axes.y + axes.z) / 3.0, std::max({axes.x, axes.y, axes.z})});
        }
    }
    [[nodiscard]] ColliderRows rows() noexcept { return {number_.data(), length_}; }
    [[nodiscard]] double at(std::size_t row, std::size_t particle) const noexcept {
        return number_[row * length_ + particle];
    }
    [[nodiscard]] Vec3 vector(std::size_t row, std::size_t particle) const noexcept {
        return {at(row, particle), at(row + 1, particle), at(row + 2, particle)};
    }
    [[nodiscard]] LaneSymmetric<double> shape(std::size_t particle) const noexcept {
        const auto number = [&](std::size_t k) { return at(collider_row::kShape + k, particle); };
        return {number(0), number(1), number(2), number(3), number(4), number(5)};
    }

    static constexpr std::size_t kMaxLanes = 8;

  private:
    void set(std::size_t row, std::size_t particle, std::initializer_list<double> numbers) {
        for (const double number : numbers) {
            number_[row++ * length_ + particle] = number;
        }
    }

    std::size_t length_;
    std::vector<double> number_;
};

/// Contact of the ground with a particle that moves its body along; see GroundContacts.
struct ElasticGroundContact {
    std::uint32_t particle;
    double min_height;                       // m
    Vec3 start;                              // m
    double push = 0.0;                       // m
    Vec3 friction{0.0};                      // m
    ElasticPushes::Compliance compliance{};  // known as soon as it pushes
};

/// Whether the contact pushes with forces on bodies, not with displacements of particles alone.
bool is_elastic(const PlaneDetail& info) noexcept {
    return info.compliance.along > 0.0;
}

/// The force of a contact with these displacements along and across its normal, N.
Vec3 force_of(const ElasticPushes::Compliance& compliance, const Vec3& along, const Vec3& across) noexcept {
    return along / compliance.along + across / compliance.across;
}

/// Contacts of the ground with particles that move alone, in preallocated arrays.
class GroundContactList {
  public:
    explicit GroundContactList(std::size_t capacity)
        : particle_(capacity),
          min_height_(capacity),
          push_(capacity),
          start_{std::vector<double>(capacity), std::vector<double>(capacity)},
          friction_{std::vector<double>(capacity), std::vector<double>(capacity)} {}

    void clear() noexcept { pushing_ = others_ = 0; }
    /// Adds a particle. Those likely to push come first, which only saves time.
    void add(std::uint32_t particle, bool likely) noexcept {
        particle_[likely ? pushing_++ : particle_.size() - ++others_] = particle;
    }
    /// Call after the last add(): closes the gap and initialises the contacts.
    void begin(const Colliders& colliders) noexcept {
        // The list grew from both ends: append the unlikely contacts to the likely ones.
        const auto end = particle_.end();
        std::copy(end - static_cast<std::ptrdiff_t>(others_), end,
                  particle_.begin() + static_cast<std::ptrdiff_t>(pushing_));
        // Start values: permitted height, tangential start position for the slip, no push yet.
        for (std::size_t k = 0; k < size(); ++k) {
            min_height_[k] = colliders.at(collider_row::kGroundHeight, particle_[k]);
            start_[0][k] = colliders.at(collider_row::kFrom, particle_[k]);
            start_[1][k] = colliders.at(collider_row::kFrom + 2, particle_[k]);
            push_[k] = friction_[0][k] = friction_[1][k] = 0.0;
        }
    }

    [[nodiscard]] std::size_t size() const noexcept { return pushing_ + others_; }
    [[nodiscard]] GroundContacts contacts() noexcept {
        return {size(),
                particle_.data(),
                min_height_.data(),
                {start_[0].data(), start_[1].data()},
                push_.data(),
                {friction_[0].data(), friction_[1].data()}};
    }

  private:
    std::size_t pushing_ = 0;
    std::size_t others_ = 0;
    std::vector<std::uint32_t> particle_;
    std::vector<double> min_height_;
    std::vector<double> push_;
    std::array<std::vector<double>, 2> start_;
    std::array<std::vector<double>, 2> friction_;
};

/// Batch of planes computed by one kernel call.
class PlaneChunk {
  public:
    static constexpr std::size_t kMax = 256;
    [[nodiscard]] PlaneRows rows() noexcept {
        return {first.data(), second.data(), {x.data(), y.data(), z.data()}, min_separation.data(), clearance.data()};
    }

    template <class Number>
    using Numbers = std::array<Number, kMax + Colliders::kMaxLanes>;
    Numbers<std::uint32_t> first{};
    Numbers<std::uint32_t> second{};
    Numbers<double> x{};
    Numbers<double> y{};
    Numbers<double> z{};
    Numbers<double> min_separation{};
    Numbers<double> clearance{};
};

}  // namespace

const ColliderKernels& collider_kernels(std::size_t lanes) {
    static_assert(ParticleCollisions::kWidest == kWidestLanes);
    if (const ColliderKernels* const kernels = find_kernels(&Kernels::colliders, lanes)) {
        return *kernels;
    }
    throw std::invalid_argument("collisions: this machine does not support vectors of " + std::to_string(lanes) +
                                " lanes; ParticleCollisions::usable_lanes() lists the supported numbers");
}

struct ParticleCollisions::State {
    State(const ParticleModel& model, const CollisionSettings& given, ClockFunction time, std::size_t lanes);

    [[nodiscard]] int needed_substeps(const ParticleModel& start, double step);
    [[nodiscard]] bool all_are_slow(const ParticleModel& start, double step) const noexcept;
    void estimate_motions(const ParticleModel& start, double step);
    [[nodiscard]] double max_approach(double step) const;
    void sweep_particles(const ParticleModel& start, const MovingParticles& predicted);
    void mark_near() noexcept;
    void find_shapes(const MovingParticles& predicted) noexcept;
    void find_boxes();
    void find_planes();
    void make_planes(std::size_t count);
    void find_ground_contacts();
    void fit_plane(Plane& fitted, const PlaneDetail& info, const Vec3& to) const noexcept;
    void project_plane(Plane& contact, PlaneDetail& info, Row* position) noexcept;
    void project_all(Row* position) noexcept;
    void find_compliance(const Plane& contact, PlaneDetail& info) noexcept;
    void push(std::uint32_t particle, const Vec3& force, Row* position) noexcept;
    void project_ground_contact(ElasticGroundContact& contact, Row* position) noexcept;
    void push_alone(std::uint32_t particle, const Vec3& force, Row* displaced) const noexcept;
    [[nodiscard]] double compliance_alone(std::uint32_t particle) const noexcept;
    [[nodiscard]] Vec3 clamp_to_cone(const Vec3& wanted, double push) const noexcept;
    [[nodiscard]] double max_error(const Row* position) const noexcept;
    void add_pushes(Row* pushed) noexcept;

    CollisionSettings settings;
    const ColliderKernels& kernels;
    std::vector<ParticleRange> bodies;
    std::vector<Collider> collider;  // per particle
    Colliders colliders;
    ColliderRows rows;
    double max_reach = 0.0;                 // m
    double min_size = kMaxCoordinate;       // m, of colliding particles
    double min_body_size = kMaxCoordinate;  // m, smallest mean of a body's mean semi-axes
    bool forward = true;
    CollisionCounts counts;
    StageClock clock;

    // Per sub-step.
    double h = 0.0;                   // s
    double push_out = 0.0;            // m
    std::vector<std::int64_t> near;   // per particle, padded by a whole vector
    std::vector<Bounds> body_bounds;  // per body, over its particles' paths
    std::vector<BodyMotion> motion;   // per body, over the step
    std::vector<SweptBox> box;        // of particles that may meet other bodies
    SweptPairs finder;
    std::vector<BoxPair> pair;  // preallocated
    PlaneChunk chunk;
    std::vector<Plane> plane;
    std::vector<PlaneDetail> detail;  // per plane
    GroundContactList ground;
    std::vector<ElasticGroundContact> elastic_ground;
    ElasticPushes pushes;
};

ParticleCollisions::State::State(const ParticleModel& model, const CollisionSettings& given, ClockFunction time,
                                 std::size_t lanes)
    : settings(given),
      kernels(collider_kernels(lanes)),
      bodies(bodies_of(model)),
      colliders(model),
      rows(colliders.rows()),
      clock(time),
      near(rows.length),
      finder(model.size(), kernels),
      ground(settings.ground ? model.size() : 0),
      pushes(model) {
    check(given);
    model.check();
    // Constant data of particles and bodies.
    body_bounds.resize(bodies.size());
    motion.resize(bodies.size());
    for (std::uint32_t b = 0; b < bodies.size(); ++b) {
        double sum = 0.0;
        int colliding = 0;
        for (std::size_t i = bodies[b].begin; i < bodies[b].end; ++i) {
            const double size = colliders.at(collider_row::kSize, i);
            const double reach = colliders.at(collider_row::kReach, i);
            // Pinned particles get the inverse mass 0: they push but are not pushed.
            const double inverse_mass = model.pinned[i] != 0 ? 0.0 : 1.0 / model.mass[i];
            collider.push_back({size, reach, inverse_mass, b});
            max_reach = std::max(max_reach, reach);
            // Particles of size 0 do not collide: leave them out of the sizes that scale approaches and depths.
            if (size > 0.0) {
                min_size = std::min(min_size, size);
                sum += size;
                ++colliding;
            }
        }
        if (colliding > 0) {
            motion[b].size = sum / colliding;
            min_body_size = std::min(min_body_size, motion[b].size);
        }
    }
    // Capacities.
    const bool alone = bodies.size() < 2 || !settings.between_bodies;
    box.reserve(alone ? 0 : model.size());
    pair.resize(kPairsPerParticle * box.capacity());
    plane.reserve(kPlanesPerParticle * box.capacity());
    detail.reserve(plane.capacity());
    elastic_ground.reserve(settings.ground ? model.size() : 0);
}

/// Estimates each body's mean velocity, its deviation, and its box over the step.
void ParticleCollisions::State::estimate_motions(const ParticleModel& start, double step) {
    for (std::size_t b = 0; b < bodies.size(); ++b) {
        // Box of the body over the step, from balls of the largest semi-axis about both ends of each path.
        Vec3 lowest(kMaxCoordinate);
        Vec3 highest(-kMaxCoordinate);
        Vec3 sum(0.0);
        double descent = 0.0;
        for (std::size_t i = bodies[b].begin; i < bodies[b].end; ++i) {
            const Vec3& from = start.position[i];
            const Vec3 to = from + step * start.velocity[i];
            lowest = glm::min(lowest, glm::min(from, to) - Vec3(collider[i].reach));
            highest = glm::max(highest, glm::max(from, to) + Vec3(collider[i].reach));
            // Sum for the mean velocity, and the fastest fall for the approach to the ground.
            sum += start.velocity[i];
            descent = std::max(descent, -start.velocity[i].y);
        }
        // Largest deviation from the mean velocity.
        const Vec3 mean = sum / static_cast<double>(bodies[b].end - bodies[b].begin);
        double spread_squared = 0.0;
        for (std::size_t i = bodies[b].begin; i < bodies[b].end; ++i) {
            const Vec3 off = start.velocity[i] - mean;
            spread_squared = std::max(spread_squared, glm::dot(off, off));
        }
        // Any two particles of two bodies approach at most at the difference of the means plus both deviations.
        body_bounds[b] = {{lowest.x, lowest.y, lowest.z}, {highest.x, highest.y, highest.z}};
        motion[b] = {motion[b].size, mean, std::sqrt(spread_squared), descent};
    }
}

/// Largest approach in a step, in mean semi-axes, of two bodies whose boxes overlap, or of a body and the ground.
double ParticleCollisions::State::max_approach(double step) const {
    double max_ratio = 0.0;
    for (std::size_t b = 0; b < bodies.size(); ++b) {
        // Ground: fastest fall of a body whose box reaches it.
        if (settings.ground && body_bounds[b].low[1] < settings.ground_height) {
            max_ratio = std::max(max_ratio, step * motion[b].descent / motion[b].size);
        }
        // Pairs of bodies: bound of the relative speed, |v_b - v_o| + spreads, over the thinner body's particle size.
        for (std::size_t other = 0; settings.between_bodies && other < b; ++other) {
            if (overlap(body_bounds[b], body_bounds[other])) {
                const double speed =
                    glm::length(motion[b].velocity - motion[other].velocity) + motion[b].spread + motion[other].spread;
                max_ratio = std::max(max_ratio, step * speed / std::min(motion[b].size, motion[other].size));
            }
        }
    }
    return max_ratio;
}

/// Whether all particles are so slow that one sub-step suffices wherever they are. Two mean velocities differ by at
/// most twice the largest speed, and each deviation is at most twice it: six times in total.
bool ParticleCollisions::State::all_are_slow(const ParticleModel& start, double step) const noexcept {
    double squared = 0.0;
    for (const Vec3& v : start.velocity) {
        squared = std::max(squared, glm::dot(v, v));
    }
    const double approach = 6.0 * step * std::sqrt(squared) / min_body_size;
    return approach < kMaxApproach;
}

/// Sub-steps such that no approach exceeds kMaxApproach mean semi-axes.
int ParticleCollisions::State::needed_substeps(const ParticleModel& start, double step) {
    if (all_are_slow(start, step)) {
        return 1;
    }
    estimate_motions(start, step);
    const double parts = max_approach(step) / kMaxApproach;
    return parts < settings.max_substeps ? static_cast<int>(parts) + 1 : settings.max_substeps;
}

/// Swept boxes of all particles from x to u, as balls with slack, and of all bodies.
void ParticleCollisions::State::sweep_particles(const ParticleModel& start, const MovingParticles& predicted) {
    static_assert(sizeof(Vec3) == 3 * sizeof(double) && sizeof(Row) == 4 * sizeof(double));
    // Per particle: path from x to u, with slack because constraints move u again.
    kernels.find_path_boxes(rows, collider.size(), {&start.position[0].x, 3}, {predicted.position[0].number, 4},
                            {.of_size = kSlackOfSize, .of_path = kSlackOfPath});
    // Per body: box of all its particles, for the culling in mark_near().
    for (std::size_t b = 0; b < bodies.size(); ++b) {
        body_bounds[b] = kernels.bounds(rows, bodies[b].begin, bodies[b].end);
    }
}

/// Marks the particles that may meet another body or the ground.
void ParticleCollisions::State::mark_near() noexcept {
    // Clipping tests all pairs of bodies, so with many bodies every particle goes to the broad phase.
    const bool clip = bodies.size() <= kMaxBodiesToClip;
    std::fill(near.begin(), near.end(), box.capacity() == 0 || clip ? 0 : kNearBody);
    // Other particles may push a particle down by as much as it extends.
    const Bounds low_enough{{-kUnbounded, -kUnbounded, -kUnbounded},
                            {kUnbounded, settings.ground_height + max_reach, kUnbounded}};
    for (std::size_t b = 0; b < bodies.size(); ++b) {
        // Skip whole bodies by their boxes before testing their particles.
        const auto mark = [&](const Bounds& bounds, std::int64_t bit) {
            if (overlap(body_bounds[b], bounds)) {
                kernels.mark(rows, bodies[b].begin, bodies[b].end, bounds, bit, near.data());
            }
        };
        // Particles inside another body's box may meet that body.
        for (std::size_t other = 0; clip && box.capacity() > 0 && other < bodies.size(); ++other) {
            if (other != b) {
                mark(body_bounds[other], kNearBody);
            }
        }
        // Particles low enough may meet the ground.
        if (settings.ground) {
            mark(low_enough, kNearGround);
        }
    }
}

/// Shape matrices and exact boxes of the marked particles, from their predicted orientations.
void ParticleCollisions::State::find_shapes(const MovingParticles& predicted) noexcept {
    for (std::size_t i = 0; i < collider.size(); ++i) {
        // Only marked particles need an orientation; the rest keep their conservative balls.
        if (near[i] != 0) {
            for (std::size_t k = 0; k < 4; ++k) {
                rows[collider_row::kOrientation + k][i] = predicted.f32[i].orientation.number[k];
            }
        }
    }
    kernels.find_ellipsoid_boxes(rows, collider.size(), near.data(), {settings.ground_height, push_out});
}

/// Boxes of the marked particles, for the broad phase.
void ParticleCollisions::State::find_boxes() {
    box.clear();
    for (std::size_t i = 0; i < collider.size(); ++i) {
        // Skip particles that can meet no other body, and those without extent.
        if ((near[i] & kNearBody) == 0 || !(collider[i].size > 0.0)) {
            continue;
        }
        const SweptBox around{{colliders.vector(collider_row::kLow, i), colliders.vector(collider_row::kHigh, i)},
                              static_cast<std::uint32_t>(i),
                              collider[i].body};
        // The broad phase requires finite boxes, so a diverged particle is left out.
        if (is_in_range(around.box)) {
            box.push_back(around);
        }
    }
}

/// Fits the plane of a pair for the path to its present offset.
void ParticleCollisions::State::fit_plane(Plane& fitted, const PlaneDetail& info, const Vec3& to) const noexcept {
    const LaneSymmetric<double> first = colliders.shape(fitted.first);
    const LaneSymmetric<double> second = colliders.shape(fitted.second);
    const LaneVec<double> from = lane(info.from);
    // Normal of M where the path enters it (ellipsoids.hpp).
    const LaneVec<double> normal = lane_separating_normal(
        LaneSweep<double>{first, second, collider[fitted.second].size / collider[fitted.first].size, from, lane(to)});
    // Required separation r + min(0, gap + h push_out_speed): an initial overlap is kept or slowly resolved.
    const double reach = lane_reach(first, normal) + lane_reach(second, normal);
    const double gap = dot(normal, from) - reach;
    fitted.normal = {normal.x, normal.y, normal.z};
    fitted.min_separation = reach + std::min(0.0, gap + push_out);
}

/// Computes the planes of the pairs in the chunk, and keeps those that can be violated.
void ParticleCollisions::State::make_planes(std::size_t count) {
    // Kernel: separating normal, required separation and worst-case clearance of each pair.
    const PlaneRows laid = chunk.rows();
    kernels.find_planes(rows, count, laid, push_out);
    for (std::size_t k = 0; k < count; ++k) {
        // A positive clearance holds wherever both particles stop on their paths: no plane needed.
        if (chunk.clearance[k] > 0.0) {
            continue;
        }
        // No allocation here: a pair beyond the capacity is counted and not kept apart.
        if (plane.size() == plane.capacity()) {
            ++counts.dropped;
            continue;
        }
        // Displacements are in inverse proportion to the masses.
        const std::uint32_t a = chunk.first[k];
        const std::uint32_t b = chunk.second[k];
        const double inverse_mass = collider[a].inverse_mass + collider[b].inverse_mass;
        plane.push_back({.first = a,
                         .second = b,
                         .normal = {chunk.x[k], chunk.y[k], chunk.z[k]},
                         .min_separation = chunk.min_separation[k],
                         .push = 0.0,
                         .first_share = collider[a].inverse_mass / inverse_mass,
                         .second_share = collider[b].inverse_mass / inverse_mass});
        // Offset x1 - x2 at the start, from which friction measures the slip.
        detail.push_back(
            {colliders.vector(collider_row::kFrom, a) - colliders.vector(collider_row::kFrom, b), Vec3(0.0)});
    }
}

/// Broad phase, then planes of all pairs in chunks.
void ParticleCollisions::State::find_planes() {
    plane.clear();
    detail.clear();
    // Broad phase: pairs of different bodies whose swept boxes overlap.
    const std::size_t found = finder.find(box, pair);
    counts.near += found;
    counts.dropped += found - std::min(found, pair.size());
    // Narrow phase: one plane per pair, in chunks of one kernel call. Pairs of pinned particles cannot move.
    std::size_t count = 0;
    for (std::size_t k = 0; k < std::min(found, pair.size()); ++k) {
        const std::uint32_t a = box[pair[k].first].particle;
        const std::uint32_t b = box[pair[k].second].particle;
        if (!(collider[a].inverse_mass + collider[b].inverse_mass > 0.0)) {
            continue;
        }
        chunk.first[count] = a;
        chunk.second[count] = b;
        // The chunk is full: compute its planes and start the next one.
        if (++count == PlaneChunk::kMax) {
            make_planes(count);
            count = 0;
        }
    }
    make_planes(count);
    counts.planes += plane.size();
}

/// Contacts of all particles that the ground may push.
void ParticleCollisions::State::find_ground_contacts() {
    ground.clear();
    elastic_ground.clear();
    // The permitted height already contains the tolerance for an initial overlap (find_ellipsoid_boxes).
    const double* min_height = rows[collider_row::kGroundHeight];
    const double* low = rows[collider_row::kLow + 1];
    const double* to = rows[collider_row::kTo + 1];
    for (std::size_t i = 0; i < collider.size(); ++i) {
        // Other particles may push it down by as much as it extends.
        if ((near[i] & kNearGround) != 0 && low[i] - collider[i].reach < settings.ground_height &&
            collider[i].inverse_mass > 0.0) {
            const auto particle = static_cast<std::uint32_t>(i);
            if (pushes.answers(particle)) {
                elastic_ground.push_back({.particle = particle,
                                          .min_height = min_height[i],
                                          .start = colliders.vector(collider_row::kFrom, i)});
            } else {
                ground.add(particle, to[i] < min_height[i]);
            }
        }
    }
    ground.begin(colliders);
}

/// Coulomb limit (Macklin 2014, equation 24): unchanged inside the static cone, scaled to the dynamic one outside.
Vec3 ParticleCollisions::State::clamp_to_cone(const Vec3& wanted, double push) const noexcept {
    const double length = glm::length(wanted);
    if (length <= settings.static_friction * push) {
        return wanted;
    }
    return (settings.dynamic_friction * push / length) * wanted;
}

/// Finds the compliance of a contact if a body is elastic.
void ParticleCollisions::State::find_compliance(const Plane& contact, PlaneDetail& info) noexcept {
    if (!pushes.answers(contact.first) && !pushes.answers(contact.second)) {
        return;
    }
    info.compliance = {};
    for (const std::uint32_t particle : {contact.first, contact.second}) {
        const double alone = compliance_alone(particle);
        const ElasticPushes::Compliance of = pushes.answers(particle) ? pushes.compliance(particle, contact.normal)
                                                                      : ElasticPushes::Compliance{alone, alone};
        info.compliance.along += of.along;
        info.compliance.across += of.across;
    }
}

/// Moves a particle by a force, and its body along with it if it is elastic.
void ParticleCollisions::State::push(std::uint32_t particle, const Vec3& force, Row* position) noexcept {
    if (pushes.answers(particle)) {
        pushes.push(particle, force, position);
    } else {
        push_alone(particle, force, position);
    }
}

/// Moves a particle by a force as if it had no body. That has the momenta of the motion of its body.
void ParticleCollisions::State::push_alone(std::uint32_t particle, const Vec3& force, Row* displaced) const noexcept {
    move(displaced[particle], compliance_alone(particle) * force);
}

/// m/N, in the sub-step.
double ParticleCollisions::State::compliance_alone(std::uint32_t particle) const noexcept {
    return h * h * collider[particle].inverse_mass;
}

/// As the kernel project_ground().
void ParticleCollisions::State::project_ground_contact(ElasticGroundContact& contact, Row* position) noexcept {
    const Vec3 at = position_of(position[contact.particle]);
    const double change = std::max(contact.min_height - at.y, -contact.push);
    if (change == 0.0 && contact.push == 0.0) {
        return;
    }
    if (contact.push == 0.0) {
        contact.compliance = pushes.compliance(contact.particle, kUp);
    }
    contact.push += change;
    const Vec3 slip(at.x - contact.start.x, 0.0, at.z - contact.start.z);
    const Vec3 friction = clamp_to_cone(contact.friction - slip, contact.push);
    push(contact.particle, force_of(contact.compliance, change * kUp, friction - contact.friction), position);
    contact.friction = friction;
}

/// Projects one plane constraint: PBD with an accumulated displacement that stays non-negative.
void ParticleCollisions::State::project_plane(Plane& contact, PlaneDetail& info, Row* position) noexcept {
    const Vec3 offset = position_of(position[contact.first]) - position_of(position[contact.second]);
    // Constraint value C = n.(u1 - u2) - min_separation; inactive while C >= 0.
    double clearance = glm::dot(contact.normal, offset) - contact.min_separation;
    if (contact.push == 0.0) {
        if (clearance >= 0.0) {
            return;
        }
        // First violation: fit the plane to where the pair is now.
        fit_plane(contact, info, offset);
        clearance = glm::dot(contact.normal, offset) - contact.min_separation;
        if (clearance >= 0.0) {
            return;
        }
        find_compliance(contact, info);
    }
    // Push by -C, but take back no more than was pushed in this sub-step.
    const double change = std::max(-clearance, -contact.push);
    contact.push += change;
    const Vec3 along = change * contact.normal;
    Vec3 across(0.0);
    // Friction: undo the slip of the whole sub-step along the plane, within the friction cone. Apply the change since
    // the last pass.
    if (settings.static_friction > 0.0) {
        const Vec3 moved = offset - info.from;
        const Vec3 slip = moved - glm::dot(contact.normal, moved) * contact.normal;
        const Vec3 friction = clamp_to_cone(info.friction - slip, contact.push);
        across = friction - info.friction;
        info.friction = friction;
    }
    // Momentum-conserving correction: the same force on both, or displacements by inverse mass.
    if (is_elastic(info)) {
        const Vec3 force = force_of(info.compliance, along, across);
        push(contact.first, force, position);
        push(contact.second, -force, position);
        return;
    }
    if (contact.first_share > 0.0) {
        move(position[contact.first], contact.first_share * (along + across));
    }
    if (contact.second_share > 0.0) {
        move(position[contact.second], -contact.second_share * (along + across));
    }
}

/// One pass over all planes, alternately forward and backward, so that the order has no preferred direction. The ground
/// does not yield and comes last.
void ParticleCollisions::State::project_all(Row* position) noexcept {
    const std::size_t count = plane.size();
    for (std::size_t k = 0; k < count; ++k) {
        const std::size_t index = forward ? k : count - 1 - k;
        project_plane(plane[index], detail[index], position);
    }
    kernels.project_ground(ground.contacts(), {settings.static_friction, settings.dynamic_friction}, position->number);
    for (std::size_t k = 0; k < elastic_ground.size(); ++k) {
        project_ground_contact(elastic_ground[forward ? k : elastic_ground.size() - 1 - k], position);
    }
    forward = !forward;
}

/// Largest error of a contact, relative to what may be left over. That of elastic bodies counts in both directions:
/// pushes that came too early leave a contact open, and its body would leave with what it was pushed too far.
double ParticleCollisions::State::max_error(const Row* position) const noexcept {
    double depth = 0.0;
    double elastic = 0.0;
    for (std::size_t k = 0; k < plane.size(); ++k) {
        const Plane& p = plane[k];
        const double clearance =
            glm::dot(p.normal, position_of(position[p.first]) - position_of(position[p.second])) - p.min_separation;
        depth = std::max(depth, -clearance);
        elastic = std::max(elastic, p.push > 0.0 && is_elastic(detail[k]) ? std::abs(clearance) : 0.0);
    }
    for (const ElasticGroundContact& contact : elastic_ground) {
        const double clearance = position[contact.particle].number[1] - contact.min_height;
        elastic = std::max(elastic, contact.push > 0.0 ? std::abs(clearance) : -clearance);
    }
    return std::max(depth / kMaxDepth, elastic / kMaxElasticError) / min_size;
}

/// Adds each particle's total displacement by collisions in this sub-step; that of an elastic body as if it had moved
/// alone.
void ParticleCollisions::State::add_pushes(Row* pushed) noexcept {
    // Total displacement of each pair along and across its normal, shared by inverse mass.
    for (std::size_t k = 0; k < plane.size(); ++k) {
        const Plane& p = plane[k];
        if (p.push > 0.0) {
            ++counts.active;
            if (is_elastic(detail[k])) {
                const Vec3 force = force_of(detail[k].compliance, p.push * p.normal, detail[k].friction);
                push_alone(p.first, force, pushed);
                push_alone(p.second, -force, pushed);
                continue;
            }
            const Vec3 correction = p.push * p.normal + detail[k].friction;
            move(pushed[p.first], p.first_share * correction);
            move(pushed[p.second], -p.second_share * correction);
        }
    }
    // The ground is immovable, so its push goes to the particle alone.
    const GroundContacts below = ground.contacts();
    for (std::size_t k = 0; k < below.count; ++k) {
        if (below.push[k] > 0.0) {
            move(pushed[below.particle[k]], {below.friction[0][k], below.push[k], below.friction[1][k]});
            ++counts.active;
        }
    }
    for (const ElasticGroundContact& contact : elastic_ground) {
        if (contact.push > 0.0) {
            push_alone(contact.particle, force_of(contact.compliance, contact.push * kUp, contact.friction), pushed);
            ++counts.active;
        }
    }
}

ParticleCollisions::ParticleCollisions(const ParticleModel& model, const CollisionSettings& settings,
                                       ClockFunction clock, std::size_t lanes)
    : state_(std::make_unique<State>(model, settings, clock, lanes)) {}
ParticleCollisions::~ParticleCollisions() = default;

int ParticleCollisions::substeps(const ParticleModel& start, double step) const {
    const StageClock::Span timed(state_->clock);
    return state_->needed_substeps(start, step);
}

void ParticleCollisions::find(const ParticleModel& start, const MovingParticles& predicted, ElasticBodies& elastic,
                              double h) {
    State& s = *state_;
    const StageClock::Span timed(s.clock);
    s.counts = {};
    s.h = h;
    s.pushes.begin(start, elastic, h);
    s.push_out = h * s.settings.push_out_speed;
    if (s.collider.empty()) {
        return;
    }
    // Broad phase input: swept boxes, marks, shapes.
    s.sweep_particles(start, predicted);
    s.mark_near();
    s.find_shapes(predicted);
    // Planes between particles, then the ground.
    if (s.box.capacity() > 0) {
        s.find_boxes();
        s.find_planes();
    }
    if (s.settings.ground) {
        s.find_ground_contacts();
    }
}

void ParticleCollisions::project(const ParticleModel& /*start*/, const MovingParticles& now, double /*h*/) {
    const StageClock::Span timed(state_->clock);
    state_->project_all(now.position);
}

void ParticleCollisions::finish(const ParticleModel& /*start*/, const MovingParticles& now, double /*h*/) {
    State& s = *state_;
    const StageClock::Span timed(s.clock);
    // Errors before the last two passes; at first too large to count as stagnation.
    double before_last = kMaxCoordinate;
    double last = kMaxCoordinate;
    // Extra passes while contacts are deep and still improve.
    const int passes = s.pushes.empty() ? kMaxExtraPasses : kMaxElasticPasses;
    for (int pass = 0; pass < passes; ++pass) {
        const double error = s.max_error(now.position);
        // Stop when exact enough, or when two passes did not reduce the error: then contacts conflict.
        if (error <= 1.0 || error > kStagnation * before_last) {
            break;
        }
        before_last = std::exchange(last, error);
        s.project_all(now.position);
    }
    // The solver turns these displacements into velocities.
    s.add_pushes(now.pushed);
}

std::vector<std::size_t> ParticleCollisions::usable_lanes() {
    return lanes_of(&Kernels::colliders);
}

CollisionCounts ParticleCollisions::counts() const noexcept {
    return state_->counts;
}

std::int64_t ParticleCollisions::take_time() noexcept {
    return state_->clock.take();
}

}  // namespace haptic::sim
