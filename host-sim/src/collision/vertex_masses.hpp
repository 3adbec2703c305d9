// Masses of the vertices of surfaces, and what impulses between points of their features do.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "collision/feature_pairs.hpp"
#include "dynamics/rows.hpp"
#include "haptic/sim/particles.hpp"

namespace haptic::sim {

class VertexMasses {
  public:
    /// Of the particles; pinned ones do not move.
    explicit VertexMasses(const ParticleModel& model) {
        inverse_.reserve(model.size());
        for (std::size_t i = 0; i < model.size(); ++i) {
            inverse_.push_back(inverse_mass(model, i));
        }
    }

    /// 1/kg.
    [[nodiscard]] double inverse(std::uint32_t vertex) const noexcept { return inverse_[vertex]; }
    /// 1/kg, of two points of the features relative to each other. Weights of the second are negative. At least a tenth
    /// of that of a vertex that moves them: where nearly all of a feature is pinned, moving its point would throw the
    /// rest.
    [[nodiscard]] double inverse(const PairVertices& vertex, const std::array<double, 4>& weight) const noexcept {
        double sum = 0.0;
        double most = 0.0;
        for (std::size_t k = 0; k < 4; ++k) {
            sum += weight[k] * weight[k] * inverse_[vertex[k]];
            most = weight[k] != 0.0 ? std::max(most, inverse_[vertex[k]]) : most;
        }
        return std::max(sum, 0.1 * most);
    }
    /// Adds the displacements of vertices that move alone by an impulse between these points, times the length of the
    /// sub-step, kg m.
    void displace(const PairVertices& vertex, const std::array<double, 4>& weight, const Vec3& impulse,
                  Row* rows) const noexcept {
        for (std::size_t k = 0; k < 4; ++k) {
            if (weight[k] != 0.0) {
                add_vector(rows[vertex[k]], weight[k] * inverse_[vertex[k]] * impulse);
            }
        }
    }

  private:
    std::vector<double> inverse_;  // per particle
};

}  // namespace haptic::sim
