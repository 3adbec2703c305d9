#include <haptic/sim/collisions.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "simd/collider_rows.hpp"
#include "simd/ellipsoid_lanes.hpp"
#include "simd/projection.hpp"
#include "collision/swept_pairs.hpp"

namespace haptic::sim {
namespace {

// How far constraints may lead a particle beyond its way from x to u, for a pair to be found all the same: this part of
// its mean semi-axis, and of its way.
constexpr double kSlackOfSize = 0.2;
constexpr double kSlackOfWay = 0.25;
// Room for pairs, per particle.
constexpr std::size_t kPairsPerParticle = 64;
constexpr std::size_t kPlanesPerParticle = 32;
// Up to so many bodies, particles that are in no other body's box are left out before the grid is made.
constexpr std::size_t kMostBodiesToClip = 64;
// Passes in finish(), which end when no contact is deeper than this part of the least mean semi-axis, or when there and
// back has left more than that part of the greatest depth: what is squeezed from all sides is for later steps.
constexpr int kMostMorePasses = 8;
constexpr double kDeep = 0.05;
constexpr double kStagnant = 0.75;
// Mean semi-axes by which two bodies may come nearer in a sub-step. With 5 passes over the constraints, clouds of 137
// particles of stiffness 0.9, 0.05 m thick, begin to get through one another at 5, and do not at 4.
constexpr double kMostApproach = 3.0;
// m: beyond any scene; arithmetic with it stays finite.
constexpr double kFarthest = 1e12;

void check(const CollisionSettings& s) {
    const auto refuse = [](const std::string& why) { throw std::invalid_argument("collisions: " + why); };
    if (!std::isfinite(s.ground_height)) {
        refuse("ground_height must be finite");
    }
    if (!(s.static_friction >= 0.0) || !std::isfinite(s.static_friction) || !(s.dynamic_friction >= 0.0) ||
        !(s.dynamic_friction <= s.static_friction)) {
        refuse("friction must be at least 0, and dynamic_friction at most static_friction");
    }
    if (s.most_substeps < 1 || s.most_substeps > 100) {
        refuse("most_substeps must be in 1..100");
    }
    if (!(s.push_out_speed >= 0.0) || !std::isfinite(s.push_out_speed)) {
        refuse("push_out_speed must be at least 0");
    }
}

Vec3 place_of(const Row& row) noexcept {
    return {row.number[0], row.number[1], row.number[2]};
}

void move(Row& row, const Vec3& by) noexcept {
    row.number[0] += by.x;
    row.number[1] += by.y;
    row.number[2] += by.z;
}

/// What does not change.
struct Collider {
    double size;          // m, mean semi-axis
    double reach;         // m, largest semi-axis
    double inverse_mass;  // 1/kg; 0: pinned
    std::uint32_t body;
};

/// How a body moves as a whole, for an estimate.
struct BodyMotion {
    double size = kFarthest;  // m, mean of the particles' mean semi-axes
    Vec3 velocity{0.0};       // m/s, mean
    double unrest = 0.0;      // m/s, greatest deviation from it
    double descent = 0.0;     // m/s, greatest downward
};

/// Between two particles. Fills one cache line: most of them are only looked at.
struct alignas(64) Plane {
    std::uint32_t first;
    std::uint32_t second;
    Vec3 normal;         // toward the first
    double least;        // m, that the first has to be ahead of the second along the normal
    double push;         // m, by which they have been moved apart in this sub-step, at least 0
    double first_share;  // of each displacement
    double second_share;
};

/// What a plane needs when it pushes.
struct PlaneDetail {
    Vec3 from;  // m, the first seen from the second at the start
    Vec3 rub;   // m, displacement by friction, along the plane
};

bool overlap(const Bounds& a, const Bounds& b) noexcept {
    bool both = true;
    for (int k = 0; k < 3; ++k) {
        both = both && a.low[k] <= b.high[k] && b.low[k] <= a.high[k];
    }
    return both;
}

bool usable(const SweptBox& box) noexcept {
    const auto in_range = [](double x) { return x > -kFarthest && x < kFarthest; };
    return in_range(box.low.x) && in_range(box.low.y) && in_range(box.low.z) && in_range(box.high.x) &&
           in_range(box.high.y) && in_range(box.high.z);
}

/// Those that this machine can do, by number of lanes.
std::vector<const ColliderKernels*> usable_kernels() {
    std::vector<const ColliderKernels*> usable{&kColliderOneLane, &kColliderTwoLanes};
#if defined(__x86_64__)
    if (__builtin_cpu_supports("avx2") != 0) {
        usable.push_back(&kColliderFourLanes);
    }
    if (__builtin_cpu_supports("avx512f") != 0) {
        usable.push_back(&kColliderEightLanes);
    }
#endif
    return usable;
}

LaneVec<double> lane(const Vec3& v) noexcept {
    return {v.x, v.y, v.z};
}

/// What is known of each particle, in rows.
class Colliders {
  public:
    explicit Colliders(const ParticleModel& model)
        : length_(model.size() + kMostLanes), number_(collider_row::kCount * length_) {
        using namespace collider_row;
        for (std::size_t i = 0; i < model.size(); ++i) {
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

    static constexpr std::size_t kMostLanes = 8;

  private:
    void set(std::size_t row, std::size_t particle, std::initializer_list<double> numbers) {
        for (const double number : numbers) {
            number_[row++ * length_ + particle] = number;
        }
    }

    std::size_t length_;
    std::vector<double> number_;
};

/// Between particles and the ground; as many as there may be.
class GroundLedger {
  public:
    explicit GroundLedger(std::size_t most)
        : particle_(most),
          least_(most),
          push_(most),
          start_{std::vector<double>(most), std::vector<double>(most)},
          rub_{std::vector<double>(most), std::vector<double>(most)} {}

    void clear() noexcept { pushing_ = others_ = 0; }
    /// Those that are likely to push come first. Which comes when makes no difference but in time.
    void add(std::uint32_t particle, bool likely) noexcept {
        particle_[likely ? pushing_++ : particle_.size() - ++others_] = particle;
    }
    /// When all have been added.
    void begin(const Colliders& colliders) noexcept {
        const auto end = particle_.end();
        std::copy(end - static_cast<std::ptrdiff_t>(others_), end,
                  particle_.begin() + static_cast<std::ptrdiff_t>(pushing_));
        for (std::size_t k = 0; k < size(); ++k) {
            least_[k] = colliders.at(collider_row::kGroundLeast, particle_[k]);
            start_[0][k] = colliders.at(collider_row::kFrom, particle_[k]);
            start_[1][k] = colliders.at(collider_row::kFrom + 2, particle_[k]);
            push_[k] = rub_[0][k] = rub_[1][k] = 0.0;
        }
    }

    [[nodiscard]] std::size_t size() const noexcept { return pushing_ + others_; }
    [[nodiscard]] GroundContacts contacts() noexcept {
        return {size(),        particle_.data(),
                least_.data(), {start_[0].data(), start_[1].data()},
                push_.data(),  {rub_[0].data(), rub_[1].data()}};
    }

  private:
    std::size_t pushing_ = 0;
    std::size_t others_ = 0;
    std::vector<std::uint32_t> particle_;
    std::vector<double> least_;
    std::vector<double> push_;
    std::array<std::vector<double>, 2> start_;
    std::array<std::vector<double>, 2> rub_;
};

/// Planes that are laid together.
class PlaneChunk {
  public:
    static constexpr std::size_t kMost = 256;
    [[nodiscard]] PlaneRows rows() noexcept {
        return {first.data(), second.data(), {x.data(), y.data(), z.data()}, least.data(), clearance.data()};
    }

    template <class Number>
    using Numbers = std::array<Number, kMost + Colliders::kMostLanes>;
    Numbers<std::uint32_t> first{};
    Numbers<std::uint32_t> second{};
    Numbers<double> x{};
    Numbers<double> y{};
    Numbers<double> z{};
    Numbers<double> least{};
    Numbers<double> clearance{};
};

}  // namespace

const ColliderKernels& collider_kernels(std::size_t lanes) {
    const std::vector<const ColliderKernels*> usable = usable_kernels();
    if (lanes == ParticleCollisions::kWidest) {
        return *usable.back();
    }
    for (const ColliderKernels* kernels : usable) {
        if (kernels->lanes == lanes) {
            return *kernels;
        }
    }
    throw std::invalid_argument("collisions: this machine has no vectors of " + std::to_string(lanes) +
                                " lanes; ParticleCollisions::usable_lanes() tells those that it has");
}

struct ParticleCollisions::State {
    /// Adds what it lives to the time spent.
    class Timed {
      public:
        explicit Timed(State& state) : state_(state), since_(state.now()) {}
        Timed(const Timed&) = delete;
        Timed& operator=(const Timed&) = delete;
        ~Timed() { state_.spent_ns += state_.now() - since_; }

      private:
        State& state_;
        std::int64_t since_;
    };

    State(const ParticleModel& model, const CollisionSettings& which, ClockFunction time, std::size_t lanes);

    [[nodiscard]] std::int64_t now() const { return clock == nullptr ? 0 : clock(); }
    [[nodiscard]] int needed_substeps(const ParticleModel& start, double step);
    [[nodiscard]] bool all_are_slow(const ParticleModel& start, double step) const noexcept;
    void find_motions(const ParticleModel& start, double step);
    [[nodiscard]] double greatest_approach(double step) const;
    void find_ways(const ParticleModel& start, const MovingParticles& predicted);
    void mark_near() noexcept;
    void find_shapes(const MovingParticles& predicted) noexcept;
    void find_boxes();
    void lay_planes();
    void lay_chunk(std::size_t count);
    void lay_ground();
    void aim(Plane& to_aim, const PlaneDetail& with, const Vec3& to) const noexcept;
    void press(Plane& on, PlaneDetail& with, Row* place) const noexcept;
    void press_all(Row* place) noexcept;
    [[nodiscard]] Vec3 held_by_friction(const Vec3& wanted, double push) const noexcept;
    [[nodiscard]] double deepest(const Row* place) const noexcept;
    void write_pushes(Row* pushed) noexcept;

    CollisionSettings settings;
    const ColliderKernels& kernels;
    std::vector<ParticleRange> bodies;
    std::vector<Collider> collider;  // per particle
    Colliders colliders;
    ColliderRows rows;
    double greatest_reach = 0.0;         // m
    double least_size = kFarthest;       // m, of those that collide
    double least_body_size = kFarthest;  // m, mean of its particles' mean semi-axes
    bool forward = true;
    CollisionCounts counts;
    ClockFunction clock;
    std::int64_t spent_ns = 0;

    // Of the sub-step.
    double push_out = 0.0;            // m
    std::vector<std::int64_t> near;   // per particle, and a whole vector
    std::vector<Bounds> body_bounds;  // per body, of its ways
    std::vector<BodyMotion> motion;   // per body, of the step
    std::vector<SweptBox> box;        // of particles that other bodies may meet
    SweptPairs finder;
    std::vector<BoxPair> pair;  // as many as there is room for
    PlaneChunk chunk;
    std::vector<Plane> plane;
    std::vector<PlaneDetail> detail;  // per plane
    GroundLedger ground;
};

ParticleCollisions::State::State(const ParticleModel& model, const CollisionSettings& which, ClockFunction time,
                                 std::size_t lanes)
    : settings(which),
      kernels(collider_kernels(lanes)),
      bodies(model.bodies),
      colliders(model),
      rows(colliders.rows()),
      clock(time),
      near(rows.length),
      finder(model.size(), kernels),
      ground(settings.ground ? model.size() : 0) {
    check(which);
    model.check();
    if (bodies.empty()) {
        bodies.push_back({0, static_cast<std::uint32_t>(model.size())});
    }
    body_bounds.resize(bodies.size());
    motion.resize(bodies.size());
    for (std::uint32_t b = 0; b < bodies.size(); ++b) {
        double sum = 0.0;
        int colliding = 0;
        for (std::size_t i = bodies[b].begin; i < bodies[b].end; ++i) {
            const double size = colliders.at(collider_row::kSize, i);
            const double reach = colliders.at(collider_row::kReach, i);
            const double inverse_mass = model.pinned[i] != 0 ? 0.0 : 1.0 / model.mass[i];
            collider.push_back({size, reach, inverse_mass, b});
            greatest_reach = std::max(greatest_reach, reach);
            if (size > 0.0) {
                least_size = std::min(least_size, size);
                sum += size;
                ++colliding;
            }
        }
        if (colliding > 0) {
            motion[b].size = sum / colliding;
            least_body_size = std::min(least_body_size, motion[b].size);
        }
    }
    const bool alone = bodies.size() < 2 || !settings.between_bodies;
    box.reserve(alone ? 0 : model.size());
    pair.resize(kPairsPerParticle * box.capacity());
    plane.reserve(kPlanesPerParticle * box.capacity());
    detail.reserve(plane.capacity());
}

void ParticleCollisions::State::find_motions(const ParticleModel& start, double step) {
    for (std::size_t b = 0; b < bodies.size(); ++b) {
        Vec3 lowest(kFarthest);
        Vec3 highest(-kFarthest);
        Vec3 sum(0.0);
        double descent = 0.0;
        for (std::size_t i = bodies[b].begin; i < bodies[b].end; ++i) {
            const Vec3& from = start.position[i];
            const Vec3 to = from + step * start.velocity[i];
            lowest = glm::min(lowest, glm::min(from, to) - Vec3(collider[i].reach));
            highest = glm::max(highest, glm::max(from, to) + Vec3(collider[i].reach));
            sum += start.velocity[i];
            descent = std::max(descent, -start.velocity[i].y);
        }
        const Vec3 mean = sum / static_cast<double>(bodies[b].end - bodies[b].begin);
        double unrest_squared = 0.0;
        for (std::size_t i = bodies[b].begin; i < bodies[b].end; ++i) {
            const Vec3 off = start.velocity[i] - mean;
            unrest_squared = std::max(unrest_squared, glm::dot(off, off));
        }
        body_bounds[b] = {{lowest.x, lowest.y, lowest.z}, {highest.x, highest.y, highest.z}};
        motion[b] = {motion[b].size, mean, std::sqrt(unrest_squared), descent};
    }
}

/// In a step, in mean semi-axes, of bodies whose boxes meet on their ways.
double ParticleCollisions::State::greatest_approach(double step) const {
    double greatest = 0.0;
    for (std::size_t b = 0; b < bodies.size(); ++b) {
        if (settings.ground && body_bounds[b].low[1] < settings.ground_height) {
            greatest = std::max(greatest, step * motion[b].descent / motion[b].size);
        }
        for (std::size_t other = 0; settings.between_bodies && other < b; ++other) {
            if (overlap(body_bounds[b], body_bounds[other])) {
                const double speed =
                    glm::length(motion[b].velocity - motion[other].velocity) + motion[b].unrest + motion[other].unrest;
                greatest = std::max(greatest, step * speed / std::min(motion[b].size, motion[other].size));
            }
        }
    }
    return greatest;
}

/// Whether all are so slow that one sub-step does, wherever they are: no two bodies come nearer to each other than by
/// the sum of their particles' greatest speeds, and no mean differs from a particle's velocity by more than twice that.
bool ParticleCollisions::State::all_are_slow(const ParticleModel& start, double step) const noexcept {
    double squared = 0.0;
    for (const Vec3& v : start.velocity) {
        squared = std::max(squared, glm::dot(v, v));
    }
    const double approach = 6.0 * step * std::sqrt(squared) / least_body_size;
    return approach < kMostApproach;
}

int ParticleCollisions::State::needed_substeps(const ParticleModel& start, double step) {
    if (all_are_slow(start, step)) {
        return 1;
    }
    find_motions(start, step);
    const double parts = greatest_approach(step) / kMostApproach;
    return parts < settings.most_substeps ? static_cast<int>(parts) + 1 : settings.most_substeps;
}

void ParticleCollisions::State::find_ways(const ParticleModel& start, const MovingParticles& predicted) {
    static_assert(sizeof(Vec3) == 3 * sizeof(double) && sizeof(Row) == 4 * sizeof(double));
    kernels.find_ways(rows, collider.size(), {&start.position[0].x, 3}, {predicted.place[0].number, 4},
                      {.of_size = kSlackOfSize, .of_way = kSlackOfWay});
    for (std::size_t b = 0; b < bodies.size(); ++b) {
        body_bounds[b] = kernels.bounds(rows, bodies[b].begin, bodies[b].end);
    }
}

/// What may meet another body or the ground.
void ParticleCollisions::State::mark_near() noexcept {
    const bool clip = bodies.size() <= kMostBodiesToClip;
    std::fill(near.begin(), near.end(), box.capacity() == 0 || clip ? 0 : kNearBody);
    // Others may press a particle down by as much as it reaches.
    const Bounds low_enough{{-kBeyondAll, -kBeyondAll, -kBeyondAll},
                            {kBeyondAll, settings.ground_height + greatest_reach, kBeyondAll}};
    for (std::size_t b = 0; b < bodies.size(); ++b) {
        const auto mark = [&](const Bounds& bounds, std::int64_t bit) {
            if (overlap(body_bounds[b], bounds)) {
                kernels.mark(rows, bodies[b].begin, bodies[b].end, bounds, bit, near.data());
            }
        };
        for (std::size_t other = 0; clip && box.capacity() > 0 && other < bodies.size(); ++other) {
            if (other != b) {
                mark(body_bounds[other], kNearBody);
            }
        }
        if (settings.ground) {
            mark(low_enough, kNearGround);
        }
    }
}

void ParticleCollisions::State::find_shapes(const MovingParticles& predicted) noexcept {
    for (std::size_t i = 0; i < collider.size(); ++i) {
        if (near[i] != 0) {
            for (std::size_t k = 0; k < 4; ++k) {
                rows[collider_row::kTurn + k][i] = predicted.body[i].turn.number[k];
            }
        }
    }
    kernels.find_shapes(rows, collider.size(), near.data(), {settings.ground_height, push_out});
}

void ParticleCollisions::State::find_boxes() {
    box.clear();
    for (std::size_t i = 0; i < collider.size(); ++i) {
        if ((near[i] & kNearBody) == 0 || !(collider[i].size > 0.0)) {
            continue;
        }
        const SweptBox around{colliders.vector(collider_row::kLow, i), colliders.vector(collider_row::kHigh, i),
                              static_cast<std::uint32_t>(i), collider[i].body};
        if (usable(around)) {
            box.push_back(around);
        }
    }
}

void ParticleCollisions::State::aim(Plane& to_aim, const PlaneDetail& with, const Vec3& to) const noexcept {
    const LaneSymmetric<double> first = colliders.shape(to_aim.first);
    const LaneSymmetric<double> second = colliders.shape(to_aim.second);
    const LaneVec<double> from = lane(with.from);
    const LaneVec<double> normal = lane_parting_normal(
        LanePassage<double>{first, second, collider[to_aim.second].size / collider[to_aim.first].size, from, lane(to)});
    const double reach = lane_reach(first, normal) + lane_reach(second, normal);
    const double gap = dot(normal, from) - reach;
    to_aim.normal = {normal.x, normal.y, normal.z};
    to_aim.least = reach + std::min(0.0, gap + push_out);
}

/// The pairs in the chunk.
void ParticleCollisions::State::lay_chunk(std::size_t count) {
    const PlaneRows laid = chunk.rows();
    kernels.lay_planes(rows, count, laid, push_out);
    for (std::size_t k = 0; k < count; ++k) {
        if (chunk.clearance[k] > 0.0) {
            continue;
        }
        if (plane.size() == plane.capacity()) {
            ++counts.dropped;
            continue;
        }
        const std::uint32_t a = chunk.first[k];
        const std::uint32_t b = chunk.second[k];
        const double yielding = collider[a].inverse_mass + collider[b].inverse_mass;
        plane.push_back({.first = a,
                         .second = b,
                         .normal = {chunk.x[k], chunk.y[k], chunk.z[k]},
                         .least = chunk.least[k],
                         .push = 0.0,
                         .first_share = collider[a].inverse_mass / yielding,
                         .second_share = collider[b].inverse_mass / yielding});
        detail.push_back(
            {colliders.vector(collider_row::kFrom, a) - colliders.vector(collider_row::kFrom, b), Vec3(0.0)});
    }
}

void ParticleCollisions::State::lay_planes() {
    plane.clear();
    detail.clear();
    const std::size_t found = finder.find(box, pair);
    counts.near += found;
    counts.dropped += found - std::min(found, pair.size());
    std::size_t count = 0;
    for (std::size_t k = 0; k < std::min(found, pair.size()); ++k) {
        const std::uint32_t a = box[pair[k].first].particle;
        const std::uint32_t b = box[pair[k].second].particle;
        if (!(collider[a].inverse_mass + collider[b].inverse_mass > 0.0)) {
            continue;
        }
        chunk.first[count] = a;
        chunk.second[count] = b;
        if (++count == PlaneChunk::kMost) {
            lay_chunk(count);
            count = 0;
        }
    }
    lay_chunk(count);
    counts.planes += plane.size();
}

void ParticleCollisions::State::lay_ground() {
    ground.clear();
    const double* least = rows[collider_row::kGroundLeast];
    const double* low = rows[collider_row::kLow + 1];
    const double* to = rows[collider_row::kTo + 1];
    for (std::size_t i = 0; i < collider.size(); ++i) {
        // Others may press it down by as much again.
        if ((near[i] & kNearGround) != 0 && low[i] - collider[i].reach < settings.ground_height &&
            collider[i].inverse_mass > 0.0) {
            ground.add(static_cast<std::uint32_t>(i), to[i] < least[i]);
        }
    }
    ground.begin(colliders);
}

Vec3 ParticleCollisions::State::held_by_friction(const Vec3& wanted, double push) const noexcept {
    const double length = glm::length(wanted);
    if (length <= settings.static_friction * push) {
        return wanted;
    }
    return (settings.dynamic_friction * push / length) * wanted;
}

void ParticleCollisions::State::press(Plane& on, PlaneDetail& with, Row* place) const noexcept {
    Row& a = place[on.first];
    Row& b = place[on.second];
    const Vec3 between = place_of(a) - place_of(b);
    double ahead = glm::dot(on.normal, between) - on.least;
    if (on.push == 0.0) {
        if (ahead >= 0.0) {
            return;
        }
        aim(on, with, between);
        ahead = glm::dot(on.normal, between) - on.least;
        if (ahead >= 0.0) {
            return;
        }
    }
    const double change = std::max(-ahead, -on.push);
    on.push += change;
    Vec3 apart = change * on.normal;
    if (settings.static_friction > 0.0) {
        const Vec3 moved = between - with.from;
        const Vec3 slip = moved - glm::dot(on.normal, moved) * on.normal;
        const Vec3 rub = held_by_friction(with.rub - slip, on.push);
        apart += rub - with.rub;
        with.rub = rub;
    }
    if (on.first_share > 0.0) {
        move(a, on.first_share * apart);
    }
    if (on.second_share > 0.0) {
        move(b, -on.second_share * apart);
    }
}

/// There and back, so that no direction of the order is preferred. The ground, which does not yield, has the last word.
void ParticleCollisions::State::press_all(Row* place) noexcept {
    const std::size_t count = plane.size();
    for (std::size_t k = 0; k < count; ++k) {
        const std::size_t which = forward ? k : count - 1 - k;
        press(plane[which], detail[which], place);
    }
    kernels.press_ground(ground.contacts(), {settings.static_friction, settings.dynamic_friction}, place->number);
    forward = !forward;
}

double ParticleCollisions::State::deepest(const Row* place) const noexcept {
    double least = 0.0;
    for (const Plane& p : plane) {
        least = std::min(least, glm::dot(p.normal, place_of(place[p.first]) - place_of(place[p.second])) - p.least);
    }
    return -least;
}

void ParticleCollisions::State::write_pushes(Row* pushed) noexcept {
    std::fill_n(pushed, collider.size(), Row{});
    for (std::size_t k = 0; k < plane.size(); ++k) {
        const Plane& p = plane[k];
        if (p.push > 0.0) {
            const Vec3 apart = p.push * p.normal + detail[k].rub;
            move(pushed[p.first], p.first_share * apart);
            move(pushed[p.second], -p.second_share * apart);
            ++counts.pressed;
        }
    }
    const GroundContacts below = ground.contacts();
    for (std::size_t k = 0; k < below.count; ++k) {
        if (below.push[k] > 0.0) {
            move(pushed[below.particle[k]], {below.rub[0][k], below.push[k], below.rub[1][k]});
            ++counts.pressed;
        }
    }
}

ParticleCollisions::ParticleCollisions(const ParticleModel& model, const CollisionSettings& settings,
                                       ClockFunction clock, std::size_t lanes)
    : state_(std::make_unique<State>(model, settings, clock, lanes)) {}
ParticleCollisions::~ParticleCollisions() = default;

int ParticleCollisions::substeps(const ParticleModel& start, double step) const {
    const State::Timed timed(*state_);
    return state_->needed_substeps(start, step);
}

void ParticleCollisions::find(const ParticleModel& start, const MovingParticles& predicted, double h) {
    State& s = *state_;
    const State::Timed timed(s);
    s.counts = {};
    s.push_out = h * s.settings.push_out_speed;
    if (s.collider.empty()) {
        return;
    }
    s.find_ways(start, predicted);
    s.mark_near();
    s.find_shapes(predicted);
    if (s.box.capacity() > 0) {
        s.find_boxes();
        s.lay_planes();
    }
    if (s.settings.ground) {
        s.lay_ground();
    }
}

void ParticleCollisions::project(const ParticleModel& /*start*/, const MovingParticles& now, double /*h*/) {
    const State::Timed timed(*state_);
    state_->press_all(now.place);
}

void ParticleCollisions::finish(const ParticleModel& /*start*/, const MovingParticles& now, double /*h*/) {
    State& s = *state_;
    const State::Timed timed(s);
    double before_last = kFarthest;
    double last = kFarthest;
    for (int pass = 0; pass < kMostMorePasses; ++pass) {
        const double depth = s.deepest(now.place);
        if (depth <= kDeep * s.least_size || depth > kStagnant * before_last) {
            break;
        }
        before_last = std::exchange(last, depth);
        s.press_all(now.place);
    }
    s.write_pushes(now.pushed);
}

std::vector<std::size_t> ParticleCollisions::usable_lanes() {
    std::vector<std::size_t> lanes;
    for (const ColliderKernels* kernels : usable_kernels()) {
        lanes.push_back(kernels->lanes);
    }
    return lanes;
}

CollisionCounts ParticleCollisions::counts() const noexcept {
    return state_->counts;
}

std::int64_t ParticleCollisions::take_time() noexcept {
    return std::exchange(state_->spent_ns, 0);
}

}  // namespace haptic::sim
