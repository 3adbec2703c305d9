#include "haptic/sim/hostile_hand.hpp"

#include <glm/geometric.hpp>

namespace haptic::sim {
namespace {

// How far beyond a vertex it aims, as a part of the way to it: over a tenth of the way to twice the way, so that it
// stops short, on the surface, and far behind.
constexpr double kShortest = 0.9;
constexpr double kFurthest = 2.0;
constexpr double kLongestAimS = 1.0;
constexpr double kRestsOutOf = 0.2;  // part of the aims that are to stay where it is

}  // namespace

HostileHand::HostileHand(std::uint64_t seed, double most_speed, const Vec3& start) noexcept
    : state_(seed), most_speed_(most_speed), position_(start), aim_(start) {}

double HostileHand::random() noexcept {
    // SplitMix64 (G. Steele, D. Lea, C. Flood, "Fast Splittable Pseudorandom Number Generators", 2014).
    state_ += 0x9e3779b97f4a7c15u;
    std::uint64_t z = state_;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    z ^= z >> 31;
    return static_cast<double>(z >> 11) * 0x1.0p-53;
}

void HostileHand::choose(std::span<const Vec3> vertices) noexcept {
    left_s_ = kLongestAimS * random();
    speed_ = most_speed_ * random();
    if (vertices.empty() || random() < kRestsOutOf) {
        aim_ = position_;
        return;
    }
    const auto which = static_cast<std::size_t>(random() * static_cast<double>(vertices.size()));
    const double how_far = kShortest + (kFurthest - kShortest) * random();
    aim_ = position_ + how_far * (vertices[which] - position_);
}

Vec3 HostileHand::after(double dt, std::span<const Vec3> vertices) noexcept {
    if (!(left_s_ > 0.0)) {
        choose(vertices);
    }
    left_s_ -= dt;
    const Vec3 way = aim_ - position_;
    const double distance = glm::length(way);
    const double move = speed_ * dt;
    position_ = distance > move ? position_ + (move / distance) * way : aim_;
    return position_;
}

}  // namespace haptic::sim
