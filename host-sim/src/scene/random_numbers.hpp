// Random numbers that are the same for the same seed, everywhere.
// @source SplitMix64: G. Steele, D. Lea, C. Flood, "Fast Splittable Pseudorandom Number Generators", 2014
#pragma once

#include <cstdint>

namespace haptic::sim {

class RandomNumbers {
  public:
    explicit RandomNumbers(std::uint64_t seed) noexcept : state_(seed) {}
    /// Uniform in [0, 1).
    [[nodiscard]] double next() noexcept {
        state_ += 0x9e3779b97f4a7c15u;
        std::uint64_t z = state_;
        z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
        z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
        z ^= z >> 31;
        return static_cast<double>(z >> 11) * 0x1.0p-53;
    }

  private:
    std::uint64_t state_;
};

}  // namespace haptic::sim
