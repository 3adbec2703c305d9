#include "haptic/sim/collisions.hpp"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "ellipsoids.hpp"
#include "haptic/sim/rotation.hpp"
#include "projection.hpp"
#include "swept_pairs.hpp"

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
// Passes in finish(), which end when no contact is deeper than this part of the least mean semi-axis.
constexpr int kMostMorePasses = 8;
constexpr double kDeep = 0.05;
// Mean semi-axes by which two bodies may come nearer in a sub-step. With 5 passes over the constraints, clouds of 137
// particles of stiffness 0.9, 0.05 m thick, begin to get through one another at 5, and do not at 4.
constexpr double kMostApproach = 3.0;
// m: beyond any scene; the grid's arithmetic stays finite.
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

Quat turn_of(const Body& body) noexcept {
    return Quat(body.turn.number[0], body.turn.number[1], body.turn.number[2], body.turn.number[3]);
}

/// What does not change.
struct Collider {
    Vec3 semi_axes;
    Quat axes;            // rest_from_ellipsoid
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
    Vec3 from;                // m, the first seen from the second at the start
    Vec3 rub;                 // m, displacement by friction, along the plane
    std::uint32_t first_box;  // indices of boxes, and of shapes
    std::uint32_t second_box;
};

/// Between a particle and the ground.
struct GroundContact {
    std::uint32_t particle;
    double least;  // m, height of the particle's centre
    double push;
    Vec3 start;
    Vec3 rub;
};

/// Around a particle's way as if it were a ball, or around the ways of all of a body's.
struct WayBox {
    Vec3 low{0.0};
    Vec3 high{0.0};
    double slack = 0.0;  // m, of that how much is there in case constraints lead it further
};

bool overlap(const WayBox& a, const WayBox& b) noexcept {
    return a.low.x <= b.high.x && b.low.x <= a.high.x && a.low.y <= b.high.y && b.low.y <= a.high.y &&
           a.low.z <= b.high.z && b.low.z <= a.high.z;
}

bool usable(const WayBox& box) noexcept {
    const auto in_range = [](double x) { return x > -kFarthest && x < kFarthest; };
    return in_range(box.low.x) && in_range(box.low.y) && in_range(box.low.z) && in_range(box.high.x) &&
           in_range(box.high.y) && in_range(box.high.z);
}

}  // namespace

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

    State(const ParticleModel& model, const CollisionSettings& which, ClockFunction time);

    [[nodiscard]] std::int64_t now() const { return clock == nullptr ? 0 : clock(); }
    [[nodiscard]] int needed_substeps(const ParticleModel& start, double step);
    void find_motions(const ParticleModel& start, double step);
    [[nodiscard]] double greatest_approach(double step) const;
    void find_ways(const ParticleModel& start, const MovingParticles& predicted);
    void find_boxes(const ParticleModel& start, const MovingParticles& predicted);
    [[nodiscard]] bool meets_another_body(std::size_t particle) const noexcept;
    void lay_planes(const ParticleModel& start, const MovingParticles& predicted);
    void lay_ground(const ParticleModel& start, const MovingParticles& predicted);
    void aim(Plane& to_aim, const PlaneDetail& with, const Vec3& to) const noexcept;
    void press(Plane& on, PlaneDetail& with, Row* place) const noexcept;
    void press(GroundContact& on, Row* place) const noexcept;
    void press_all(Row* place) noexcept;
    [[nodiscard]] Vec3 held_by_friction(const Vec3& wanted, double push) const noexcept;
    [[nodiscard]] double deepest(const Row* place) const noexcept;
    void write_pushes(Row* pushed) noexcept;

    CollisionSettings settings;
    std::vector<ParticleRange> bodies;
    std::vector<Collider> collider;  // per particle
    double least_size = kFarthest;   // m, of those that collide
    bool forward = true;
    CollisionCounts counts;
    ClockFunction clock;
    std::int64_t spent_ns = 0;

    // Of the sub-step.
    double push_out = 0.0;              // m
    std::vector<WayBox> way;            // per particle
    std::vector<WayBox> body_way;       // per body
    std::vector<BodyMotion> motion;     // per body, of the step
    std::vector<SweptBox> box;          // of particles that other bodies may meet
    std::vector<EllipsoidShape> shape;  // per box
    SweptPairs finder;
    std::vector<BoxPair> pair;  // as many as there is room for
    std::vector<Plane> plane;
    std::vector<PlaneDetail> detail;  // per plane
    std::vector<GroundContact> ground;
};

ParticleCollisions::State::State(const ParticleModel& model, const CollisionSettings& which, ClockFunction time)
    : settings(which), bodies(model.bodies), clock(time), way(model.size()), finder(model.size()) {
    check(which);
    model.check();
    if (bodies.empty()) {
        bodies.push_back({0, static_cast<std::uint32_t>(model.size())});
    }
    body_way.resize(bodies.size());
    motion.resize(bodies.size());
    for (std::uint32_t b = 0; b < bodies.size(); ++b) {
        double sum = 0.0;
        int colliding = 0;
        for (std::size_t i = bodies[b].begin; i < bodies[b].end; ++i) {
            const Vec3& axes = model.semi_axes[i];
            const double size = (axes.x + axes.y + axes.z) / 3.0;
            const double inverse_mass = model.pinned[i] != 0 ? 0.0 : 1.0 / model.mass[i];
            collider.push_back({axes, model.axes[i], size, std::max({axes.x, axes.y, axes.z}), inverse_mass, b});
            if (size > 0.0) {
                least_size = std::min(least_size, size);
                sum += size;
                ++colliding;
            }
        }
        if (colliding > 0) {
            motion[b].size = sum / colliding;
        }
    }
    const bool alone = bodies.size() < 2 || !settings.between_bodies;
    box.reserve(alone ? 0 : model.size());
    shape.reserve(box.capacity());
    pair.resize(kPairsPerParticle * box.capacity());
    plane.reserve(kPlanesPerParticle * box.capacity());
    detail.reserve(plane.capacity());
    ground.reserve(settings.ground ? model.size() : 0);
}

void ParticleCollisions::State::find_motions(const ParticleModel& start, double step) {
    for (std::size_t b = 0; b < bodies.size(); ++b) {
        WayBox whole{Vec3(kFarthest), Vec3(-kFarthest)};
        Vec3 sum(0.0);
        double descent = 0.0;
        for (std::size_t i = bodies[b].begin; i < bodies[b].end; ++i) {
            const Vec3& from = start.position[i];
            const Vec3 to = from + step * start.velocity[i];
            whole.low = glm::min(whole.low, glm::min(from, to) - Vec3(collider[i].reach));
            whole.high = glm::max(whole.high, glm::max(from, to) + Vec3(collider[i].reach));
            sum += start.velocity[i];
            descent = std::max(descent, -start.velocity[i].y);
        }
        const Vec3 mean = sum / static_cast<double>(bodies[b].end - bodies[b].begin);
        double unrest_squared = 0.0;
        for (std::size_t i = bodies[b].begin; i < bodies[b].end; ++i) {
            const Vec3 off = start.velocity[i] - mean;
            unrest_squared = std::max(unrest_squared, glm::dot(off, off));
        }
        body_way[b] = whole;
        motion[b] = {motion[b].size, mean, std::sqrt(unrest_squared), descent};
    }
}

/// In a step, in mean semi-axes, of bodies whose boxes meet on their ways.
double ParticleCollisions::State::greatest_approach(double step) const {
    double greatest = 0.0;
    for (std::size_t b = 0; b < bodies.size(); ++b) {
        if (settings.ground && body_way[b].low.y < settings.ground_height) {
            greatest = std::max(greatest, step * motion[b].descent / motion[b].size);
        }
        for (std::size_t other = 0; settings.between_bodies && other < b; ++other) {
            if (overlap(body_way[b], body_way[other])) {
                const double speed =
                    glm::length(motion[b].velocity - motion[other].velocity) + motion[b].unrest + motion[other].unrest;
                greatest = std::max(greatest, step * speed / std::min(motion[b].size, motion[other].size));
            }
        }
    }
    return greatest;
}

int ParticleCollisions::State::needed_substeps(const ParticleModel& start, double step) {
    find_motions(start, step);
    const double parts = greatest_approach(step) / kMostApproach;
    return parts < settings.most_substeps ? static_cast<int>(parts) + 1 : settings.most_substeps;
}

void ParticleCollisions::State::find_ways(const ParticleModel& start, const MovingParticles& predicted) {
    for (std::size_t b = 0; b < bodies.size(); ++b) {
        WayBox whole{Vec3(kFarthest), Vec3(-kFarthest)};
        for (std::size_t i = bodies[b].begin; i < bodies[b].end; ++i) {
            const Vec3& from = start.position[i];
            const Vec3 to = place_of(predicted.place[i]);
            const Vec3 low = glm::min(from, to);
            const Vec3 high = glm::max(from, to);
            const Vec3 length = high - low;
            const double slack =
                kSlackOfSize * collider[i].size + kSlackOfWay * std::max({length.x, length.y, length.z});
            const Vec3 around(collider[i].reach + slack);
            way[i] = {low - around, high + around, slack};
            whole.low = glm::min(whole.low, way[i].low);
            whole.high = glm::max(whole.high, way[i].high);
        }
        body_way[b] = whole;
    }
}

bool ParticleCollisions::State::meets_another_body(std::size_t particle) const noexcept {
    const std::uint32_t own = collider[particle].body;
    for (std::size_t b = 0; b < bodies.size(); ++b) {
        if (b != own && overlap(way[particle], body_way[b])) {
            return true;
        }
    }
    return false;
}

void ParticleCollisions::State::find_boxes(const ParticleModel& start, const MovingParticles& predicted) {
    box.clear();
    shape.clear();
    const bool many = bodies.size() > kMostBodiesToClip;
    for (std::size_t i = 0; i < collider.size(); ++i) {
        const Collider& what = collider[i];
        if (!(what.size > 0.0) || !usable(way[i]) || !(many || meets_another_body(i))) {
            continue;
        }
        const EllipsoidShape turned_shape = shape_of(what.semi_axes, turn_of(predicted.body[i]) * what.axes);
        const Vec3 extent(std::sqrt(turned_shape.xx), std::sqrt(turned_shape.yy), std::sqrt(turned_shape.zz));
        const Vec3 around = extent + Vec3(way[i].slack);
        const Vec3& from = start.position[i];
        const Vec3 to = place_of(predicted.place[i]);
        box.push_back(
            {glm::min(from, to) - around, glm::max(from, to) + around, static_cast<std::uint32_t>(i), what.body});
        shape.push_back(turned_shape);
    }
}

void ParticleCollisions::State::aim(Plane& to_aim, const PlaneDetail& with, const Vec3& to) const noexcept {
    const EllipsoidShape& first = shape[with.first_box];
    const EllipsoidShape& second = shape[with.second_box];
    to_aim.normal = parting_normal({.first = first,
                                    .second = second,
                                    .size_ratio = collider[to_aim.second].size / collider[to_aim.first].size,
                                    .from = with.from,
                                    .to = to});
    const double reach = reach_of(first, to_aim.normal) + reach_of(second, to_aim.normal);
    const double gap = glm::dot(to_aim.normal, with.from) - reach;
    to_aim.least = reach + std::min(0.0, gap + push_out);
}

void ParticleCollisions::State::lay_planes(const ParticleModel& start, const MovingParticles& predicted) {
    plane.clear();
    detail.clear();
    const std::size_t found = finder.find(box, pair);
    counts.near += found;
    counts.dropped += found - std::min(found, pair.size());
    for (std::size_t k = 0; k < std::min(found, pair.size()); ++k) {
        const std::uint32_t a = box[pair[k].first].particle;
        const std::uint32_t b = box[pair[k].second].particle;
        const double yielding = collider[a].inverse_mass + collider[b].inverse_mass;
        if (!(yielding > 0.0)) {
            continue;
        }
        const Vec3 a_to = place_of(predicted.place[a]);
        const Vec3 b_to = place_of(predicted.place[b]);
        Plane laid{.first = a,
                   .second = b,
                   .normal = {},
                   .least = 0.0,
                   .push = 0.0,
                   .first_share = collider[a].inverse_mass / yielding,
                   .second_share = collider[b].inverse_mass / yielding};
        const PlaneDetail with{start.position[a] - start.position[b], Vec3(0.0), pair[k].first, pair[k].second};
        aim(laid, with, a_to - b_to);
        // Each may stop anywhere on its way.
        const double a_lowest = std::min(glm::dot(laid.normal, start.position[a]), glm::dot(laid.normal, a_to));
        const double b_highest = std::max(glm::dot(laid.normal, start.position[b]), glm::dot(laid.normal, b_to));
        if (a_lowest - b_highest - laid.least > way[a].slack + way[b].slack) {
            continue;
        }
        if (plane.size() == plane.capacity()) {
            ++counts.dropped;
            continue;
        }
        plane.push_back(laid);
        detail.push_back(with);
    }
    counts.planes += plane.size();
}

void ParticleCollisions::State::lay_ground(const ParticleModel& start, const MovingParticles& predicted) {
    ground.clear();
    for (std::size_t i = 0; i < collider.size(); ++i) {
        const Collider& what = collider[i];
        // Others may press it down by as much again.
        if (!(way[i].low.y - what.reach < settings.ground_height) || !(what.inverse_mass > 0.0)) {
            continue;
        }
        const double resting =
            settings.ground_height + reach_up(what.semi_axes, turn_of(predicted.body[i]) * what.axes);
        const double gap = start.position[i].y - resting;
        ground.push_back({static_cast<std::uint32_t>(i), resting + std::min(0.0, gap + push_out), 0.0,
                          start.position[i], Vec3(0.0)});
    }
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

void ParticleCollisions::State::press(GroundContact& on, Row* place) const noexcept {
    Row& row = place[on.particle];
    const double change = std::max(on.least - row.number[1], -on.push);
    on.push += change;
    row.number[1] += change;
    if (settings.static_friction > 0.0) {
        const Vec3 slip(row.number[0] - on.start.x, 0.0, row.number[2] - on.start.z);
        const Vec3 rub = held_by_friction(on.rub - slip, on.push);
        move(row, rub - on.rub);
        on.rub = rub;
    }
}

/// There and back, so that no direction of the order is preferred. The ground, which does not yield, has the last word.
void ParticleCollisions::State::press_all(Row* place) noexcept {
    const std::size_t count = plane.size();
    for (std::size_t k = 0; k < count; ++k) {
        const std::size_t which = forward ? k : count - 1 - k;
        press(plane[which], detail[which], place);
    }
    for (GroundContact& contact : ground) {
        press(contact, place);
    }
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
    for (const GroundContact& contact : ground) {
        if (contact.push > 0.0) {
            move(pushed[contact.particle], contact.rub + Vec3(0.0, contact.push, 0.0));
            ++counts.pressed;
        }
    }
}

ParticleCollisions::ParticleCollisions(const ParticleModel& model, const CollisionSettings& settings,
                                       ClockFunction clock)
    : state_(std::make_unique<State>(model, settings, clock)) {}
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
    s.find_ways(start, predicted);
    if (s.box.capacity() > 0) {
        s.find_boxes(start, predicted);
        s.lay_planes(start, predicted);
    }
    if (s.settings.ground) {
        s.lay_ground(start, predicted);
    }
}

void ParticleCollisions::project(const ParticleModel& /*start*/, const MovingParticles& now, double /*h*/) {
    const State::Timed timed(*state_);
    state_->press_all(now.place);
}

void ParticleCollisions::finish(const ParticleModel& /*start*/, const MovingParticles& now, double /*h*/) {
    State& s = *state_;
    const State::Timed timed(s);
    for (int pass = 0; pass < kMostMorePasses && s.deepest(now.place) > kDeep * s.least_size; ++pass) {
        s.press_all(now.place);
    }
    s.write_pushes(now.pushed);
}

CollisionCounts ParticleCollisions::counts() const noexcept {
    return state_->counts;
}

std::int64_t ParticleCollisions::take_time() noexcept {
    return std::exchange(state_->spent_ns, 0);
}

}  // namespace haptic::sim
