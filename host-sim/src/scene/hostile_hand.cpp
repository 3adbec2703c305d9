#include "scene/hostile_hand.hpp"

#include <algorithm>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>

#include "dynamics/rotation.hpp"

namespace haptic::sim {
namespace {

// Aim as a multiple of the displacement to a vertex: short of the surface, on it, or far behind it.
constexpr double kMinOvershoot = 0.9;
constexpr double kMaxOvershoot = 2.0;
constexpr double kMaxAimS = 1.0;
constexpr double kMaxCurl = 10.0;                // 1/s: open to closed in 0.1 s
constexpr double kStayProbability = 0.2;         // probability that the next aim is to stay
constexpr std::uint64_t kCurlSeed = 0x6375726c;  // derives another sequence from a seed
constexpr double kMinSquare = 1e-3;              // smallest squared length at which a quaternion is normalised

}  // namespace

HostileHand::HostileHand(std::uint64_t seed, double max_speed, double max_turn_rate, const Vec3& start) noexcept
    : path_random_(seed),
      rotation_random_(~seed),
      curl_random_(seed ^ kCurlSeed),
      max_speed_(max_speed),
      max_turn_rate_(max_turn_rate),
      position_(start),
      aim_(start) {}

void HostileHand::choose_aim(std::span<const Vec3> vertices) noexcept {
    left_s_ = kMaxAimS * path_random_.next();
    speed_ = max_speed_ * path_random_.next();
    if (vertices.empty() || path_random_.next() < kStayProbability) {
        aim_ = position_;
        return;
    }
    const auto which = static_cast<std::size_t>(path_random_.next() * static_cast<double>(vertices.size()));
    const double how_far = kMinOvershoot + (kMaxOvershoot - kMinOvershoot) * path_random_.next();
    aim_ = position_ + how_far * (vertices[which] - position_);
}

void HostileHand::choose_orientation_aim() noexcept {
    turn_rate_ = max_turn_rate_ * rotation_random_.next();
    if (rotation_random_.next() < kStayProbability) {
        orientation_aim_ = orientation_;
        return;
    }
    // Uniform over all orientations: direction of a random point in the 4D unit ball, by rejection.
    Quat aim(0.0, 0.0, 0.0, 0.0);
    do {
        const double w = 2.0 * rotation_random_.next() - 1.0;
        const double x = 2.0 * rotation_random_.next() - 1.0;
        const double y = 2.0 * rotation_random_.next() - 1.0;
        aim = Quat(w, x, y, 2.0 * rotation_random_.next() - 1.0);
    } while (glm::dot(aim, aim) < kMinSquare || glm::dot(aim, aim) > 1.0);
    orientation_aim_ = glm::normalize(aim);
}

void HostileHand::choose_curl_aim() noexcept {
    curl_speed_ = kMaxCurl * curl_random_.next();
    curl_aim_ = curl_random_.next() < kStayProbability ? curl_ : curl_random_.next();
}

void HostileHand::rotate(double dt) noexcept {
    const Vec3 rotation = rotation_between(orientation_, orientation_aim_);
    const double angle = glm::length(rotation);  // 2 tan(angle / 2), not less than the angle
    const double max_angle = turn_rate_ * dt;
    if (angle > max_angle) {
        orientation_ = turned(orientation_, (max_angle / angle) * rotation);
    } else {
        orientation_ = orientation_aim_;
    }
}

Vec3 HostileHand::advance(double dt, std::span<const Vec3> vertices) noexcept {
    // New aims when the time of the old ones is over.
    if (!(left_s_ > 0.0)) {
        choose_aim(vertices);
        choose_orientation_aim();
        choose_curl_aim();
    }
    // Advance position, orientation and curl toward their aims at their limited speeds.
    left_s_ -= dt;
    rotate(dt);
    curl_ += std::clamp(curl_aim_ - curl_, -curl_speed_ * dt, curl_speed_ * dt);
    const Vec3 displacement = aim_ - position_;
    const double distance = glm::length(displacement);
    const double move = speed_ * dt;
    position_ = distance > move ? position_ + (move / distance) * displacement : aim_;
    return position_;
}

}  // namespace haptic::sim
