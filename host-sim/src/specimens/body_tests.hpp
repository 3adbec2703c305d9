// Virtual tests of a solid body of any shape, by homogeneous stress.
//
// The tractions sigma n of a constant symmetric stress sigma on the surface of any closed body balance, and a body of
// one linear material then has the strain of a test bar everywhere, whatever its shape. So has the linear stress of
// pure bending, c b e_a e_a^T with the coordinates a, b from the centroid, the displacement of a bent beam. The
// measured moduli are those of the body as it is simulated.
//
// A triangle's tractions act on its vertices, and those on the particles by the skin weights w: the vertex j is taken
// to move with its particles and their elements, sum_i w_ji (u_i + G_i (X_j - X_i)), with G_i the displacement gradient
// of the element about particle i. That reproduces every affine displacement, so the forces balance to rounding.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "haptic/sim/deformable.hpp"
#include "haptic/sim/material.hpp"

namespace haptic::sim {

struct BodyTestSettings {
    double step = 0.01;  // s
    int substeps = 0;    // 0: chosen from the material
};

/// One modulus of a body.
struct BodyMeasured {
    double modulus = 0.0;        // Pa
    double poisson_ratio = 0.0;  // of a stretch
    int substeps = 0;
    double simulated_s = 0.0;
    bool at_rest = false;
};

/// Tests one body. Pinned particles are released, motions and the body's damping left out.
class BodyTests {
  public:
    /// `material` scales the loads, which are of about 1 % of strain. Throws std::invalid_argument unless the mesh is
    /// closed and the body has elements of a solid.
    BodyTests(DeformableBody body, const SolidMaterial& material, const BodyTestSettings& settings);

    [[nodiscard]] double volume() const noexcept { return volume_; }                // m^3, of the mesh
    [[nodiscard]] const Vec3& longest_axis() const noexcept { return axes_[0]; }    // unit
    [[nodiscard]] const Vec3& length_along_axes() const noexcept { return size_; }  // m

    /// Young's modulus and Poisson's ratio: uniaxial stress along the longest axis.
    [[nodiscard]] BodyMeasured stretch() const;
    /// Shear modulus: shear stress in the plane of the two longest axes.
    [[nodiscard]] BodyMeasured shear() const;
    /// Bulk modulus: the same tension on all sides. Pressure would buckle thin parts.
    [[nodiscard]] BodyMeasured swell() const;
    /// Young's modulus: stress along the longest axis that grows linearly along the second one.
    [[nodiscard]] BodyMeasured bend() const;

    /// Forces on the particles, N, of the stress constant + (b . x) * linear, with x from the centroid, b the second
    /// axis. For tests.
    [[nodiscard]] std::vector<Vec3> forces_of(const Mat3& constant, const Mat3& linear) const;

  private:
    struct Answer;
    [[nodiscard]] Answer answer(const Mat3& constant, const Mat3& linear) const;

    DeformableBody body_;
    SolidMaterial material_;
    BodyTestSettings settings_;
    double volume_ = 0.0;
    Vec3 centroid_{0.0};
    std::array<Vec3, 3> axes_{};  // principal, by length
    Vec3 size_{0.0};
    std::vector<std::size_t> element_of_;  // per particle: the one about it, or none
};

}  // namespace haptic::sim
