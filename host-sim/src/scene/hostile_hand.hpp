// Hostile hand: a random hand that tries to break through surfaces. It darts at random vertices and past them, stops
// dead, rotates, closes and opens, up to given speeds. Contact must hold against it.
#pragma once

#include <cstdint>
#include <span>

#include "haptic/types.hpp"
#include "scene/random_numbers.hpp"

namespace haptic::sim {

class HostileHand {
  public:
    /// Starts at `start` (m, scene), unrotated, and never exceeds `max_speed` (m/s) and `max_turn_rate` (rad/s). The
    /// same seed and surfaces give the same motion.
    HostileHand(std::uint64_t seed, double max_speed, double max_turn_rate, const Vec3& start) noexcept;

    /// Advances by `dt` (s) and returns the position. `vertices` (m, scene) are its targets; without any it stays.
    [[nodiscard]] Vec3 advance(double dt, std::span<const Vec3> vertices) noexcept;
    /// scene_from_grip.
    [[nodiscard]] const Quat& orientation() const noexcept { return orientation_; }
    /// 0..1, for a tool that can close; at most 10/s.
    [[nodiscard]] double curl() const noexcept { return curl_; }

  private:
    void choose_aim(std::span<const Vec3> vertices) noexcept;
    void choose_orientation_aim() noexcept;
    void choose_curl_aim() noexcept;
    void rotate(double dt) noexcept;

    RandomNumbers path_random_;
    RandomNumbers rotation_random_;  // separate generators: rotation and curl do not affect the path
    RandomNumbers curl_random_;
    double max_speed_;
    double max_turn_rate_;
    Vec3 position_;
    Vec3 aim_;
    double speed_ = 0.0;   // m/s, toward the aim
    double left_s_ = 0.0;  // s, until the next aim is chosen
    Quat orientation_{1.0, 0.0, 0.0, 0.0};
    Quat orientation_aim_{1.0, 0.0, 0.0, 0.0};
    double turn_rate_ = 0.0;  // rad/s
    double curl_ = 0.0;
    double curl_aim_ = 0.0;
    double curl_speed_ = 0.0;  // 1/s
};

}  // namespace haptic::sim
