// The particles of a model as colliders.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <glm/geometric.hpp>
#include <initializer_list>
#include <vector>

#include "haptic/sim/particles.hpp"
#include "haptic/types.hpp"
#include "simd/collider_rows.hpp"
#include "simd/ellipsoid_lanes.hpp"

namespace haptic::sim {

/// Constant data of a particle.
struct Collider {
    double size;          // m, mean semi-axis
    double reach;         // m, largest semi-axis
    double inverse_mass;  // 1/kg; 0: pinned
    std::uint32_t body;
};

/// Keeps two particles apart: n.(x1 - x2) >= min_separation.
struct SeparatingPlane {
    Vec3 normal;            // unit, toward the first
    double min_separation;  // m
};

/// Data of all particles, also as structure of arrays for the kernels.
class Colliders {
  public:
    /// `bodies`: those of the model.
    Colliders(const ParticleModel& model, const std::vector<ParticleRange>& bodies);

    [[nodiscard]] std::size_t size() const noexcept { return collider_.size(); }
    [[nodiscard]] const Collider& operator[](std::size_t particle) const noexcept { return collider_[particle]; }
    /// Constant rows; find_path_boxes() and find_ellipsoid_boxes() fill the others in each sub-step.
    [[nodiscard]] ColliderRows rows() noexcept { return {number_.data(), length_}; }
    [[nodiscard]] double at(std::size_t row, std::size_t particle) const noexcept {
        return number_[row * length_ + particle];
    }
    [[nodiscard]] Vec3 vector(std::size_t row, std::size_t particle) const noexcept {
        return {at(row, particle), at(row + 1, particle), at(row + 2, particle)};
    }
    /// The plane of two particles whose centres have the offset `from` at the start of the sub-step and are on their
    /// way to the offset `to`, both first from second, m. An initial overlap is kept, less what `push_out` permits.
    [[nodiscard]] SeparatingPlane fit_plane(std::uint32_t first, std::uint32_t second, const Vec3& from, const Vec3& to,
                                            const PushOut& push_out) const noexcept;
    /// m, from the centre of an ellipsoid to where it reaches farthest along a unit normal, as it is predicted to be
    /// rotated at the end of the sub-step.
    [[nodiscard]] Vec3 farthest(std::uint32_t particle, const Vec3& normal) const noexcept;

    static constexpr std::size_t kMaxLanes = 8;

  private:
    void set(std::size_t row, std::size_t particle, std::initializer_list<double> numbers);
    [[nodiscard]] LaneSymmetric<double> shape(std::size_t particle) const noexcept;

    std::vector<Collider> collider_;
    std::size_t length_;
    std::vector<double> number_;
};

/// Coulomb limit (M. Macklin et al. 2014, equation 24) on the displacement `wanted` by friction where the normal one is
/// `push`: unchanged inside the cone of sticking, scaled to that of sliding outside.
[[nodiscard]] inline Vec3 clamp_to_cone(const Vec3& wanted, double push, FrictionCoefficients friction) noexcept {
    const double square = glm::dot(wanted, wanted);
    const double limit = friction.sticking * push;
    if (square <= limit * limit) {
        return wanted;
    }
    return (friction.sliding * push / std::sqrt(square)) * wanted;
}

}  // namespace haptic::sim
