// Loads of a scene: forces and pressures on regions of its bodies, as the solver takes them.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "haptic/sim/deformable.hpp"
#include "haptic/sim/solver.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

struct Assembly;

class SceneLoads final : public SolverForces {
  public:
    /// Takes copies of the assembly's loads, and the memory that steps need.
    explicit SceneLoads(const Assembly& assembly);

    /// The next step begins at now_s.
    void begin_step(double now_s) noexcept { now_s_ = now_s; }
    [[nodiscard]] std::span<const Vec3> at(const ParticleModel& start, const ParticleRange& body, double elapsed,
                                           double h) noexcept override;

  private:
    struct BodyLoad {
        Load load;
        std::size_t first_particle = 0;
    };

    std::vector<BodyLoad> loads_;
    double now_s_ = 0.0;
    // Scratch, per particle; empty if there are no loads.
    std::vector<Vec3> middle_;  // m, positions in the middle of a sub-step
    std::vector<Vec3> force_;   // N
};

}  // namespace haptic::sim
