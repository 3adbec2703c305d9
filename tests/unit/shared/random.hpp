// Random numbers and vectors for tests, reproducible.
#pragma once

#include <cstdint>
#include <glm/geometric.hpp>
#include <random>

#include "haptic/types.hpp"

namespace haptic::rt::test {

class Random {
  public:
    explicit Random(std::uint64_t seed) : engine_(seed) {}
    double uniform(double least, double most) { return std::uniform_real_distribution<double>(least, most)(engine_); }
    /// Vector of standard normal coordinates.
    Vec3 normal() {
        std::normal_distribution<double> normal;
        const double x = normal(engine_);
        const double y = normal(engine_);
        return {x, y, normal(engine_)};
    }
    Vec3 direction() { return glm::normalize(normal()); }

  private:
    std::mt19937_64 engine_;
};

}  // namespace haptic::rt::test
