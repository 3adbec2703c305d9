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

#include "collision/body_contacts.hpp"
#include "collision/colliders.hpp"
#include "collision/near_pairs.hpp"
#include "dynamics/model_bodies.hpp"
#include "dynamics/rows.hpp"
#include "dynamics/stage_clock.hpp"
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
// Extra passes in finish(). They end when no contact is deeper than kMaxDepth of the smallest mean semi-axis, or when
// two passes reduced the largest error to no less than kStagnation: overconstrained contacts are left to later steps.
constexpr int kMaxExtraPasses = 8;
constexpr double kMaxDepth = 0.05;
constexpr double kStagnation = 0.75;
// Passes over contacts that move whole bodies; see body_contacts.hpp.
constexpr int kMaxBodyPasses = 64;
// Largest approach of two bodies in a sub-step, in mean semi-axes. With 5 solver iterations, clouds of 137 particles of
// stiffness 0.9, 0.05 m thick, begin to pass through one another at 5 and do not at 4.
constexpr double kMaxApproach = 3.0;
// s, the time constant with which particles come apart that overlap at the start, as those at rest do when they turn:
// what sprang apart would keep the speed with which it did, and a heap would never come to rest. With 0.1 s fewer heaps
// do.
constexpr double kOverlapTime = 0.02;
constexpr Vec3 kUp(0.0, 1.0, 0.0);
// m: beyond any scene; arithmetic with it stays finite.
constexpr double kMaxCoordinate = NearPairs::kMaxCoordinate;

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

/// Rigid estimate of a body's motion.
struct BodyMotion {
    double size = kMaxCoordinate;  // m, mean of the particles' mean semi-axes
    Vec3 velocity{0.0};            // m/s, mean of its particles
    double spread = 0.0;           // m/s, largest deviation from it
    double descent = 0.0;          // m/s, largest downward speed
};

/// Plane between two particles that move alone. Fills one cache line, because most planes are only read.
struct alignas(64) Plane {
    std::uint32_t first;
    std::uint32_t second;
    SeparatingPlane kept;
    double push;         // m, total normal displacement in this sub-step, at least 0
    double first_share;  // of each displacement, by inverse mass
    double second_share;
};

/// Data of a plane that is needed only when it pushes.
struct PlaneDetail {
    Vec3 from;      // m, offset of the centres at the start, second to first
    Vec3 friction;  // m, total tangential displacement by friction
};

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
    Numbers<const NearPairs::Pair*> pair{};
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
    State(const ParticleModel& model, const CollisionSettings& given, ClockFunction time, std::size_t lanes,
          std::span<const ParticleRange> sheets);

    [[nodiscard]] int needed_substeps(const ParticleModel& start, double step);
    [[nodiscard]] bool all_are_slow(const ParticleModel& start, double step) const noexcept;
    void estimate_motions(const ParticleModel& start, double step);
    [[nodiscard]] double max_approach(double step);
    void sweep_particles(const ParticleModel& start, const PredictedMotion& predicted, double h);
    void mark_near() noexcept;
    void find_shapes(const PredictedMotion& predicted) noexcept;
    void find_planes();
    void make_planes(std::size_t count);
    void find_ground_contacts();
    void project_plane(Plane& contact, PlaneDetail& info, Row* position) noexcept;
    void project_all(Row* position) noexcept;
    [[nodiscard]] double max_depth(const Row* position) const noexcept;
    [[nodiscard]] FrictionCoefficients coefficients() const noexcept {
        return {settings.static_friction, settings.dynamic_friction};
    }
    void add_pushes(Row* pushed) noexcept;

    CollisionSettings settings;
    const ColliderKernels& kernels;
    std::vector<ParticleRange> bodies;
    std::vector<std::uint8_t> is_sheet;  // per body: its surface collides with the ground and other sheets
    std::vector<std::uint8_t> of_solid;  // per particle: it belongs to a solid with a material
    Colliders colliders;
    ColliderRows rows;
    double max_reach = 0.0;                 // m
    double min_size = kMaxCoordinate;       // m, of colliding particles
    double min_body_size = kMaxCoordinate;  // m, smallest mean of a body's mean semi-axes
    bool forward = true;
    CollisionCounts counts;
    StageClock clock;

    // Per sub-step.
    PushOut push_out;
    std::vector<std::int64_t> near;   // per particle, padded by a whole vector
    std::vector<Bounds> body_bounds;  // per body, over its particles' paths
    std::vector<BodyMotion> motion;   // per body, over the step
    const bool between_bodies;        // there are several, and they collide
    NearPairs near_pairs;
    std::span<const NearPairs::Pair> near_bodies;
    PlaneChunk chunk;
    std::vector<Plane> plane;
    std::vector<PlaneDetail> detail;  // per plane
    GroundContactList ground;
    std::unique_ptr<BodyContacts> contacts;  // that move whole bodies
};

ParticleCollisions::State::State(const ParticleModel& model, const CollisionSettings& given, ClockFunction time,
                                 std::size_t lanes, std::span<const ParticleRange> sheets)
    : settings(given),
      kernels(collider_kernels(lanes)),
      bodies(bodies_of(model)),
      of_solid(model.size(), 0),
      colliders(model, bodies),
      rows(colliders.rows()),
      clock(time),
      near(rows.length),
      between_bodies(bodies.size() > 1 && given.between_bodies),
      near_pairs(bodies, between_bodies ? kPairsPerParticle * model.size() : 0, kernels),
      ground(settings.ground ? model.size() : 0) {
    check(given);
    model.check();
    for (const ParticleRange& solid : solids_of(model)) {
        std::fill(of_solid.begin() + solid.begin, of_solid.begin() + solid.end, std::uint8_t{1});
    }
    // Constant data of particles and bodies.
    body_bounds.resize(bodies.size());
    motion.resize(bodies.size());
    for (std::uint32_t b = 0; b < bodies.size(); ++b) {
        is_sheet.push_back(has_body_at(sheets, bodies[b].begin) ? 1 : 0);
        double sum = 0.0;
        int colliding = 0;
        for (std::size_t i = bodies[b].begin; i < bodies[b].end; ++i) {
            const double size = colliders[i].size;
            max_reach = std::max(max_reach, colliders[i].reach);
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
    plane.reserve(between_bodies ? kPlanesPerParticle * model.size() : 0);
    detail.reserve(plane.capacity());
    contacts = std::make_unique<BodyContacts>(model, colliders, plane.capacity() + (settings.ground ? model.size() : 0),
                                              coefficients(), min_size);
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
            lowest = glm::min(lowest, glm::min(from, to) - Vec3(colliders[i].reach));
            highest = glm::max(highest, glm::max(from, to) + Vec3(colliders[i].reach));
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
double ParticleCollisions::State::max_approach(double step) {
    double max_ratio = 0.0;
    // Ground: fastest fall of a body whose box reaches it.
    for (std::size_t b = 0; settings.ground && b < bodies.size(); ++b) {
        if (body_bounds[b].low[1] < settings.ground_height) {
            max_ratio = std::max(max_ratio, step * motion[b].descent / motion[b].size);
        }
    }
    // Pairs of bodies: bound of the relative speed, |v_a - v_b| + spreads, over the thinner body's particle size.
    if (between_bodies) {
        for (const auto [a, b] : near_pairs.find_bodies(body_bounds)) {
            const double speed =
                glm::length(motion[a].velocity - motion[b].velocity) + motion[a].spread + motion[b].spread;
            max_ratio = std::max(max_ratio, step * speed / std::min(motion[a].size, motion[b].size));
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
void ParticleCollisions::State::sweep_particles(const ParticleModel& start, const PredictedMotion& predicted,
                                                double h) {
    static_assert(sizeof(Vec3) == 3 * sizeof(double));
    // Per particle: path from x to u, with slack because constraints move u again.
    kernels.find_path_boxes(rows, colliders.size(), {&start.position[0].x, predicted.velocity, h},
                            {.of_size = kSlackOfSize, .of_path = kSlackOfPath});
    // Per body: box of all its particles, for the culling in mark_near().
    for (std::size_t b = 0; b < bodies.size(); ++b) {
        body_bounds[b] = kernels.bounds(rows, bodies[b].begin, bodies[b].end);
        if (is_asleep(start, bodies[b])) {
            // What might touch it would have woken it: an empty box, which nothing overlaps.
            std::ranges::fill(body_bounds[b].high, -kUnbounded);
        }
    }
}

/// Marks the particles that may meet another body or the ground.
void ParticleCollisions::State::mark_near() noexcept {
    std::fill(near.begin(), near.end(), 0);
    // Particles inside another body's box may meet that body.
    near_bodies = {};
    if (between_bodies) {
        near_bodies = near_pairs.find_bodies(body_bounds);
    }
    for (const auto [a, b] : near_bodies) {
        kernels.mark(rows, bodies[a].begin, bodies[a].end, body_bounds[b], kNearBody, near.data());
        kernels.mark(rows, bodies[b].begin, bodies[b].end, body_bounds[a], kNearBody, near.data());
    }
    // Particles low enough may meet the ground. Others may push a particle down by as much as it extends.
    const Bounds low_enough{{-kUnbounded, -kUnbounded, -kUnbounded},
                            {kUnbounded, settings.ground_height + max_reach, kUnbounded}};
    for (std::size_t b = 0; settings.ground && b < bodies.size(); ++b) {
        if (is_sheet[b] == 0 && body_bounds[b].low[1] <= low_enough.high[1] &&
            body_bounds[b].low[1] <= body_bounds[b].high[1]) {
            kernels.mark(rows, bodies[b].begin, bodies[b].end, low_enough, kNearGround, near.data());
        }
    }
}

/// Shape matrices and exact boxes of the marked particles, from their predicted orientations.
void ParticleCollisions::State::find_shapes(const PredictedMotion& predicted) noexcept {
    for (std::size_t i = 0; i < colliders.size(); ++i) {
        // Only marked particles need an orientation; the rest keep their conservative balls.
        if (near[i] != 0) {
            for (std::size_t k = 0; k < 4; ++k) {
                rows[collider_row::kOrientation + k][i] = predicted.f32[i].orientation.number[k];
            }
        }
    }
    kernels.find_ellipsoid_boxes(rows, colliders.size(), near.data(), {settings.ground_height, push_out});
}

/// Computes the planes of the pairs in the chunk, and keeps those that can be violated.
void ParticleCollisions::State::make_planes(std::size_t count) {
    // Kernel: separating normal, required separation and worst-case clearance of each pair.
    const PlaneRows laid = chunk.rows();
    kernels.find_planes(rows, count, laid, push_out);
    for (std::size_t k = 0; k < count; ++k) {
        // A positive clearance holds wherever both particles stop on their paths: no plane needed.
        if (chunk.clearance[k] > 0.0) {
            near_pairs.set_apart(*chunk.pair[k], chunk.clearance[k], rows);
            continue;
        }
        const std::uint32_t a = chunk.first[k];
        const std::uint32_t b = chunk.second[k];
        const SeparatingPlane between{{chunk.x[k], chunk.y[k], chunk.z[k]}, chunk.min_separation[k]};
        // Offset x1 - x2 at the start, from which friction measures the slip.
        const Vec3 from = colliders.vector(collider_row::kFrom, a) - colliders.vector(collider_row::kFrom, b);
        ++counts.planes;
        // No allocation here: a pair beyond the capacity is counted and not kept apart.
        if (contacts->answers(a) || contacts->answers(b)) {
            counts.dropped += contacts->add(a, b, between, from) ? 0U : 1U;
        } else if (plane.size() < plane.capacity()) {
            // Displacements are in inverse proportion to the masses.
            const double inverse_mass = colliders[a].inverse_mass + colliders[b].inverse_mass;
            plane.push_back({.first = a,
                             .second = b,
                             .kept = between,
                             .push = 0.0,
                             .first_share = colliders[a].inverse_mass / inverse_mass,
                             .second_share = colliders[b].inverse_mass / inverse_mass});
            detail.push_back({from, Vec3(0.0)});
        } else {
            ++counts.dropped;
        }
    }
}

/// Broad phase, then planes of all pairs in chunks.
void ParticleCollisions::State::find_planes() {
    // Broad phase: pairs of different bodies whose swept boxes overlap.
    near_pairs.find_particles(rows, near);
    counts.dropped += near_pairs.dropped();
    // Narrow phase: one plane per pair, in chunks of one kernel call. Pairs of pinned particles cannot move; of two
    // sheets the surfaces meet.
    std::size_t count = 0;
    for (std::size_t k = 0; k < near_bodies.size(); ++k) {
        if (is_sheet[near_bodies[k].first] != 0 && is_sheet[near_bodies[k].second] != 0) {
            continue;
        }
        for (const NearPairs::Pair& pair : near_pairs.particles(k)) {
            const auto [a, b] = pair;
            ++counts.near;
            if (!(colliders[a].inverse_mass + colliders[b].inverse_mass > 0.0)) {
                continue;
            }
            chunk.first[count] = a;
            chunk.second[count] = b;
            chunk.pair[count] = &pair;
            // The chunk is full: compute its planes and start the next one.
            if (++count == PlaneChunk::kMax) {
                make_planes(count);
                count = 0;
            }
        }
    }
    make_planes(count);
}

/// Contacts of all particles that the ground may push.
void ParticleCollisions::State::find_ground_contacts() {
    // The permitted height already contains the tolerance for an initial overlap (find_ellipsoid_boxes).
    const double* min_height = rows[collider_row::kGroundHeight];
    const double* low = rows[collider_row::kLow + 1];
    const double* to = rows[collider_row::kTo + 1];
    const double* reach = rows[collider_row::kReach];
    for (std::size_t i = 0; i < colliders.size(); ++i) {
        // Other particles may push it down by as much as it extends.
        if (((near[i] & kNearGround) != 0) & (low[i] - reach[i] < settings.ground_height) &&
            colliders[i].inverse_mass > 0.0) {
            const auto particle = static_cast<std::uint32_t>(i);
            if (of_solid[i] != 0) {
                const SeparatingPlane above{kUp, min_height[i]};
                const Vec3 from = colliders.vector(collider_row::kFrom, i);
                counts.dropped += contacts->add(particle, ContactCandidate::kGround, above, from) ? 0U : 1U;
            } else {
                ground.add(particle, to[i] < min_height[i]);
            }
        }
    }
    ground.begin(colliders);
}

/// Projects one plane constraint: PBD with an accumulated displacement that stays non-negative.
void ParticleCollisions::State::project_plane(Plane& contact, PlaneDetail& info, Row* position) noexcept {
    const Vec3 offset = vector_of(position[contact.first]) - vector_of(position[contact.second]);
    // Constraint value C = n.(u1 - u2) - min_separation; inactive while C >= 0.
    SeparatingPlane& kept = contact.kept;
    double clearance = glm::dot(kept.normal, offset) - kept.min_separation;
    if (contact.push == 0.0) {
        if (clearance >= 0.0) {
            return;
        }
        // First violation: fit the plane to where the pair is now.
        kept = colliders.fit_plane(contact.first, contact.second, info.from, offset, push_out);
        clearance = glm::dot(kept.normal, offset) - kept.min_separation;
        if (clearance >= 0.0) {
            return;
        }
    }
    // Push by -C, but take back no more than was pushed in this sub-step.
    const double change = std::max(-clearance, -contact.push);
    contact.push += change;
    Vec3 correction = change * kept.normal;
    // Friction: undo the slip of the whole sub-step along the plane, within the friction cone. Apply the change since
    // the last pass.
    if (settings.static_friction > 0.0) {
        const Vec3 moved = offset - info.from;
        const Vec3 slip = moved - glm::dot(kept.normal, moved) * kept.normal;
        const Vec3 friction = clamp_to_cone(info.friction - slip, contact.push, coefficients());
        correction += friction - info.friction;
        info.friction = friction;
    }
    // Momentum-conserving correction: displacements by inverse mass.
    if (contact.first_share > 0.0) {
        add_vector(position[contact.first], contact.first_share * correction);
    }
    if (contact.second_share > 0.0) {
        add_vector(position[contact.second], -contact.second_share * correction);
    }
}

/// One pass over all planes between particles that move alone, alternately forward and backward, so that the order has
/// no preferred direction. The ground does not yield and comes last.
void ParticleCollisions::State::project_all(Row* position) noexcept {
    const std::size_t count = plane.size();
    for (std::size_t k = 0; k < count; ++k) {
        const std::size_t index = forward ? k : count - 1 - k;
        project_plane(plane[index], detail[index], position);
    }
    kernels.project_ground(ground.contacts(), coefficients(), position->number);
    forward = !forward;
}

/// Deepest overlap of particles that move alone, m.
double ParticleCollisions::State::max_depth(const Row* position) const noexcept {
    double depth = 0.0;
    for (const Plane& p : plane) {
        const Vec3 offset = vector_of(position[p.first]) - vector_of(position[p.second]);
        depth = std::max(depth, p.kept.min_separation - glm::dot(p.kept.normal, offset));
    }
    return depth;
}

/// Adds each particle's total displacement by collisions in this sub-step.
void ParticleCollisions::State::add_pushes(Row* pushed) noexcept {
    counts.active += contacts->add_pushes(pushed);
    // Total displacement of each pair along and across its normal, shared by inverse mass.
    for (std::size_t k = 0; k < plane.size(); ++k) {
        const Plane& p = plane[k];
        if (p.push > 0.0) {
            ++counts.active;
            const Vec3 correction = p.push * p.kept.normal + detail[k].friction;
            add_vector(pushed[p.first], p.first_share * correction);
            add_vector(pushed[p.second], -p.second_share * correction);
        }
    }
    // The ground is immovable, so its push goes to the particle alone.
    const GroundContacts below = ground.contacts();
    for (std::size_t k = 0; k < below.count; ++k) {
        if (below.push[k] > 0.0) {
            add_vector(pushed[below.particle[k]], {below.friction[0][k], below.push[k], below.friction[1][k]});
            ++counts.active;
        }
    }
}

ParticleCollisions::ParticleCollisions(const ParticleModel& model, const CollisionSettings& settings,
                                       ClockFunction clock, std::size_t lanes, std::span<const ParticleRange> sheets)
    : state_(std::make_unique<State>(model, settings, clock, lanes, sheets)) {}
ParticleCollisions::~ParticleCollisions() = default;

int ParticleCollisions::substeps(const ParticleModel& start, double step) const {
    const StageClock::Span timed(state_->clock);
    return state_->needed_substeps(start, step);
}

void ParticleCollisions::begin(const ParticleModel& start, ElasticBodies& elastic, const MovingParticles& /*now*/,
                               double h) {
    State& s = *state_;
    const StageClock::Span timed(s.clock);
    s.counts = {};
    s.push_out = {.most = h * s.settings.push_out_speed, .share = std::min(1.0, h / kOverlapTime)};
    s.contacts->begin(start, elastic, h, s.push_out);
}

void ParticleCollisions::search(const ParticleModel& start, const PredictedMotion& predicted, double h) {
    State& s = *state_;
    const StageClock::Span timed(s.clock);
    s.plane.clear();
    s.detail.clear();
    s.near_bodies = {};
    s.ground.clear();
    if (std::ranges::all_of(s.bodies, [&](const ParticleRange& body) { return is_asleep(start, body); })) {
        return;
    }
    // Broad phase input: boxes, marks and shapes.
    s.sweep_particles(start, predicted, h);
    s.mark_near();
    s.find_shapes(predicted);
    // Planes between particles, then the ground.
    if (!s.near_bodies.empty()) {
        s.find_planes();
    }
    if (s.settings.ground) {
        s.find_ground_contacts();
    }
}

void ParticleCollisions::project(const ParticleModel& /*start*/, const MovingParticles& now, double /*h*/) {
    const StageClock::Span timed(state_->clock);
    state_->project_all(now.position);
    state_->contacts->solve(now.position, 1);
}

void ParticleCollisions::finish(const ParticleModel& /*start*/, const MovingParticles& now, double /*h*/) {
    State& s = *state_;
    const StageClock::Span timed(s.clock);
    // Extra passes while contacts are deep and still improve. First the errors before the last two passes, at first too
    // large to count as stagnation.
    double before_last = kMaxCoordinate;
    double last = kMaxCoordinate;
    for (int pass = 0; pass < kMaxExtraPasses; ++pass) {
        const double depth = s.max_depth(now.position);
        // Stop when exact enough, or when two passes did not reduce the error: then contacts conflict.
        if (depth <= kMaxDepth * s.min_size || depth > kStagnation * before_last) {
            break;
        }
        before_last = std::exchange(last, depth);
        s.project_all(now.position);
    }
    s.contacts->solve(now.position, kMaxBodyPasses);
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
