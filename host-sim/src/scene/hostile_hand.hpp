// A hand that tries to get through: it darts at random points of the scene's surfaces and past them, stops dead, jumps
// aside and comes back, turns over meanwhile, as fast as it is allowed to, and opens and closes. Contact has to hold
// against it.
#pragma once

#include <cstdint>
#include <span>

#include <haptic/types.hpp>

namespace haptic::sim {

class HostileHand {
  public:
    /// The hand starts at `start` (m, scene), not turned, and never moves faster than `most_speed` (m/s) nor turns
    /// faster than `most_turn` (rad/s). The same seed gives the same way, given the same surfaces.
    HostileHand(std::uint64_t seed, double most_speed, double most_turn, const Vec3& start) noexcept;

    /// Where the hand is `dt` seconds later. `vertices` (m, scene) are what it aims at; with none it stays.
    [[nodiscard]] Vec3 after(double dt, std::span<const Vec3> vertices) noexcept;
    /// How it is turned then: scene_from_grip.
    [[nodiscard]] const Quat& orientation() const noexcept { return orientation_; }
    /// How far it is closed then, 0..1: as fast as fingers are. For a tool that can close.
    [[nodiscard]] double curl() const noexcept { return curl_; }

  private:
    /// Uniform numbers in [0, 1).
    class Random {
      public:
        explicit Random(std::uint64_t seed) noexcept : state_(seed) {}
        [[nodiscard]] double next() noexcept;

      private:
        std::uint64_t state_;
    };

    void choose(std::span<const Vec3> vertices) noexcept;
    void choose_turn() noexcept;
    void choose_curl() noexcept;
    void turn(double dt) noexcept;

    Random way_;
    Random turns_;  // numbers of its own: how it turns does not change its way
    Random curls_;  // likewise
    double most_speed_;
    double most_turn_;
    Vec3 position_;
    Vec3 aim_;
    double speed_ = 0.0;   // m/s, toward the aim
    double left_s_ = 0.0;  // until the next aim is chosen, at the latest
    Quat orientation_{1.0, 0.0, 0.0, 0.0};
    Quat turn_aim_{1.0, 0.0, 0.0, 0.0};
    double turn_speed_ = 0.0;  // rad/s
    double curl_ = 0.0;
    double curl_aim_ = 0.0;
    double curl_speed_ = 0.0;  // 1/s
};

}  // namespace haptic::sim
