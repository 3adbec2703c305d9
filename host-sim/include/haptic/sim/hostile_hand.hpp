// A hand that tries to get through: it darts at random points of the scene's surfaces and past them, stops dead, jumps
// aside and comes back, as fast as it is allowed to. Contact has to hold against it.
#pragma once

#include <cstdint>
#include <span>

#include "haptic/types.hpp"

namespace haptic::sim {

class HostileHand {
  public:
    /// The hand starts at `start` (m, scene) and never moves faster than `most_speed` (m/s). The same seed gives the
    /// same way, given the same surfaces.
    HostileHand(std::uint64_t seed, double most_speed, const Vec3& start) noexcept;

    /// Where the hand is `dt` seconds later. `vertices` (m, scene) are what it aims at; with none it stays.
    [[nodiscard]] Vec3 after(double dt, std::span<const Vec3> vertices) noexcept;

  private:
    /// Uniform in [0, 1).
    [[nodiscard]] double random() noexcept;
    void choose(std::span<const Vec3> vertices) noexcept;

    std::uint64_t state_;
    double most_speed_;
    Vec3 position_;
    Vec3 aim_;
    double speed_ = 0.0;   // m/s, toward the aim
    double left_s_ = 0.0;  // until the next aim is chosen, at the latest
};

}  // namespace haptic::sim
