#include "scene/hostile_hand.hpp"

#include <algorithm>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>

#include "dynamics/rotation.hpp"

namespace haptic::sim {
namespace {

// How far beyond a vertex it aims, as a part of the way to it: over a tenth of the way to twice the way, so that it
// stops short, on the surface, and far behind.
constexpr double kShortest = 0.9;
constexpr double kFurthest = 2.0;
constexpr double kLongestAimS = 1.0;
constexpr double kMostCurl = 10.0;            // 1/s: from open to closed in a tenth of a second
constexpr double kRestsOutOf = 0.2;           // part of the aims that are to stay where it is
constexpr std::uint64_t kCurls = 0x6375726c;  // makes another sequence of a seed
constexpr double kLeastSquare = 1e-3;         // of a quaternion that says a direction

}  // namespace

HostileHand::HostileHand(std::uint64_t seed, double most_speed, double most_turn, const Vec3& start) noexcept
    : way_(seed),
      turns_(~seed),
      curls_(seed ^ kCurls),
      most_speed_(most_speed),
      most_turn_(most_turn),
      position_(start),
      aim_(start) {}

double HostileHand::Random::next() noexcept {
    // SplitMix64 (G. Steele, D. Lea, C. Flood, "Fast Splittable Pseudorandom Number Generators", 2014).
    state_ += 0x9e3779b97f4a7c15u;
    std::uint64_t z = state_;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    z ^= z >> 31;
    return static_cast<double>(z >> 11) * 0x1.0p-53;
}

void HostileHand::choose(std::span<const Vec3> vertices) noexcept {
    left_s_ = kLongestAimS * way_.next();
    speed_ = most_speed_ * way_.next();
    if (vertices.empty() || way_.next() < kRestsOutOf) {
        aim_ = position_;
        return;
    }
    const auto which = static_cast<std::size_t>(way_.next() * static_cast<double>(vertices.size()));
    const double how_far = kShortest + (kFurthest - kShortest) * way_.next();
    aim_ = position_ + how_far * (vertices[which] - position_);
}

void HostileHand::choose_turn() noexcept {
    turn_speed_ = most_turn_ * turns_.next();
    if (turns_.next() < kRestsOutOf) {
        turn_aim_ = orientation_;
        return;
    }
    // Evenly over all orientations: the direction of a point within the unit ball of four dimensions.
    Quat aim(0.0, 0.0, 0.0, 0.0);
    do {
        const double w = 2.0 * turns_.next() - 1.0;
        const double x = 2.0 * turns_.next() - 1.0;
        const double y = 2.0 * turns_.next() - 1.0;
        aim = Quat(w, x, y, 2.0 * turns_.next() - 1.0);
    } while (glm::dot(aim, aim) < kLeastSquare || glm::dot(aim, aim) > 1.0);
    turn_aim_ = glm::normalize(aim);
}

void HostileHand::choose_curl() noexcept {
    curl_speed_ = kMostCurl * curls_.next();
    curl_aim_ = curls_.next() < kRestsOutOf ? curl_ : curls_.next();
}

void HostileHand::turn(double dt) noexcept {
    const Vec3 way = turn_between(orientation_, turn_aim_);
    const double angle = glm::length(way);  // 2 tan of half the angle: never less than it
    const double most = turn_speed_ * dt;
    if (angle > most) {
        orientation_ = turned(orientation_, (most / angle) * way);
    } else {
        orientation_ = turn_aim_;
    }
}

Vec3 HostileHand::after(double dt, std::span<const Vec3> vertices) noexcept {
    if (!(left_s_ > 0.0)) {
        choose(vertices);
        choose_turn();
        choose_curl();
    }
    left_s_ -= dt;
    turn(dt);
    curl_ += std::clamp(curl_aim_ - curl_, -curl_speed_ * dt, curl_speed_ * dt);
    const Vec3 way = aim_ - position_;
    const double distance = glm::length(way);
    const double move = speed_ * dt;
    position_ = distance > move ? position_ + (move / distance) * way : aim_;
    return position_;
}

}  // namespace haptic::sim
