// Tool elasticity: how far the particles of a tool in the hand's springs yield to forces on them.
//
// Let u be the displacements of the N particles from their rest positions, in the grip frame. Their energy is
//     E = 1/2 u^T K u + 1/2 u^T (Cs x I) u,   Cs = (k_t / N) I + (k - k_t) / N^2 1 1^T
// with K the stiffness of the tool's material and Cs that of the springs to the hand: k (N/m) against a common
// displacement, k_t (N/m) against all others (thesis, section 5.2.2). The compliance is C = (K + Cs x I)^-1, m/N:
// C_ij f is the displacement of particle i by a force f on particle j while the hand stands still.
//
// K is the sum over the tool's shape-matching groups. Each is one linear finite element, without a mesh:
//   * Strain: with q_a the rest offsets of the members from their mean and A = sum q_a q_a^T, the deformation gradient
//     is 1 + sum u_a b_a^T, b_a = A^+ q_a, and e its symmetric part. The energy is V (mu |e|^2 + lambda_d / 2 tr(e)^2),
//     mu = E / (2 (1 + nu)), lambda_d = E nu / ((1 + nu) (1 - (d - 1) nu)). A has d directions: a direction in which
//     the moments are below kFlat of the largest has no strain, so that a row is under uniaxial and a sheet under plane
//     stress, which this lambda_d gives.
//   * Bending and all that the group's rigid motions and strains leave over: kappa / 2 |residual|^2,
//     kappa = E V r^2 / S, with S = |residual of q q^T|^2 / d. For a row bent to the curvature c this is the energy of
//     a round beam of the sphere's radius r, E I c^2 / 2 per length.
// V (m^3) is the part of the volume that belongs to the group's centre particle, so that all V add up to the tool's
// volume. E is Young's modulus, Pa; nu is Poisson's ratio. K is linear about the rest shape and, where the groups hang
// together, has exactly the tool's rigid motions (linear in the angle) as its null space.
//
// Limits, both exact: E = 0 leaves the springs, C = Cs^-1 x I, and for k_t = k independent springs k / N as in the
// thesis; E = infinity gives the rigid tool, C = U = G (G^T (Cs x I) G)^-1 G^T, with the rigid motions as the columns
// of G.
//
// In between the rigid motions separate. With G orthonormal, the translations first and the rotations about the mean, K
// G = 0 and (Cs x I) G = G diag(k / N, k_t / N); all displacements orthogonal to G have a sum of 0 and the springs k_t
// / N. Hence U = G diag(N / k, N / k_t) G^T, and
//     C = U + X - G G^T / (k_t / N + g),   X = (K + k_t / N + g G G^T)^-1
// for any g. With g like the material's stiffness, X has the material's condition number, and C keeps the digits of U,
// however stiff the material is.
//
// The rest shape of a tool with joints follows one number, its curl. U is then that of the present shape, so that a
// stiff tool stays one; the rest, how the tool deforms, is interpolated linearly between the shapes of a table. Both
// are positive semidefinite, and so is their sum. An inverse in each step in which fingers close would cost more than
// the contacts do.
//
// A sphere of a tool that is not limp turns with the tool: by phi = J^-1 sum (o_i - mean) x u_i, the rotation of G that
// is nearest to the displacements, with J the moment of inertia of unit masses. A moment on a sphere is therefore one
// on the whole tool. The rotations of G are eigenvectors of C, so it turns the tool by (N / k_t) J^-1 per N m, and
// deforms nothing.
//
// @source M. Müller, N. Chentanez, "Solid Simulation with Oriented Particles", 2011 (groups, moment matrix); M. Müller
// et al., "Point Based Animation of Elastic, Plastic and Melting Objects", 2004 (deformation gradient of a
// neighbourhood). Differs: linear, flat directions carry no strain, and the residual has the stiffness of a beam.
#pragma once

#include <array>
#include <cstddef>
#include <functional>
#include <glm/geometric.hpp>
#include <span>
#include <vector>

#include "haptic/sim/particles.hpp"
#include "haptic/sim/tool_material.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

class ToolElasticity {
  public:
    /// The tool in its rest shape. Offsets in m, grip frame.
    struct Shape {
        std::span<const Vec3> rest_offset;  // per particle
        std::span<const double> volume;     // m^3, per particle; parts of the tool's volume
        std::span<const double> radius;     // m, per particle
        std::span<const Group> groups;
    };
    /// Springs to the hand, N/m, of the whole tool.
    struct Springs {
        double stiffness = 20.0;        // positive
        double torque_stiffness = 0.0;  // 0: the same as `stiffness`

        bool operator==(const Springs&) const = default;
    };

    /// Copies groups, volumes and radii. Throws std::invalid_argument: spans of different lengths, an unknown member, a
    /// material out of range.
    ToolElasticity(const Shape& shape, const ToolMaterial& material, const Springs& springs);

    /// Writes the rest offsets at a curl in 0..1, m, grip frame, one per particle.
    using ShapeOfCurl = std::function<void(double curl, std::span<Vec3> rest_offset)>;
    /// Fills the table of the shapes between which set_curl() interpolates: 13 ms for 37 particles. Allocates. A limp
    /// or rigid tool needs none.
    void tabulate(const ShapeOfCurl& shape);
    /// Takes over the rest shape at a curl in 0..1, one offset per particle. With a table, compliances are within 0.1 %
    /// of the largest, or, where a group of the exact shape becomes flat and its stiffness jumps, within that jump. No
    /// allocation.
    void set_curl(double curl, std::span<const Vec3> rest_offset) noexcept;
    /// Takes over other springs; a stiffness of 0 counts as kMinStiffness. 0.15 ms for 37 particles; with a table 0.2
    /// ms for each of the two shapes about the present one, and for each other that set_curl() needs later. No
    /// allocation.
    void set_springs(const Springs& springs) noexcept;

    /// C_ij, m/N, grip frame: displacement of particle i per force on particle j.
    [[nodiscard]] const Mat3& compliance(std::size_t i, std::size_t j) const { return compliance_[i * count() + j]; }
    /// A force of 1 N on a particle, and a moment on its sphere, which turns with the tool. Grip frame.
    struct Push {
        std::size_t particle = 0;
        Vec3 direction{0.0};  // unit
        Vec3 moment{0.0};     // m; 0 for a limp tool, whose spheres turn freely
    };
    /// m/N, rad/N: displacement of a particle, and rotation of the tool, by a push.
    [[nodiscard]] Vec3 displacement(std::size_t particle, const Push& by) const noexcept {
        return compliance(particle, by.particle) * by.direction + turned(particle, turn_compliance_ * by.moment);
    }
    [[nodiscard]] Vec3 turn(const Push& by) const noexcept {
        return turn_compliance_ * (glm::cross(rest_offset_[by.particle] - mean_, by.direction) + by.moment);
    }
    /// m/N: how far the place of one push yields along it to another. Symmetric but for rounding.
    [[nodiscard]] double compliance(const Push& of, const Push& by) const noexcept {
        return glm::dot(of.direction, displacement(of.particle, by)) + glm::dot(of.moment, turn(by));
    }
    /// m: displacement of a particle by a rotation of the tool about its mean, rad.
    [[nodiscard]] Vec3 turned(std::size_t particle, const Vec3& rotation) const noexcept {
        return glm::cross(rotation, rest_offset_[particle] - mean_);
    }
    /// rad/(N m), grip frame: rotation of the tool per moment on its spheres; 0 for a limp tool or one sphere.
    [[nodiscard]] const Mat3& turn_compliance() const noexcept { return turn_compliance_; }
    /// m, grip frame: displacements u = C (Cs x I) v of the particles if the springs' ends move by v_i = gradient *
    /// o_i, with o_i the rest offsets, without contact. One element per particle. No allocation.
    void follow_springs(const Mat3& gradient, std::span<Vec3> u) noexcept;
    /// K_ij, N/m, grip frame; 0 for a rigid tool, whose K is infinite. Not for a tool with a table, which has none.
    [[nodiscard]] Mat3 stiffness(std::size_t i, std::size_t j) const;
    /// Each particle is on a spring of its own: C_ij is 0 for different particles.
    [[nodiscard]] bool independent() const noexcept;
    [[nodiscard]] std::size_t count() const noexcept { return rest_offset_.size(); }
    [[nodiscard]] const Springs& springs() const noexcept { return springs_; }
    [[nodiscard]] const ToolMaterial& material() const noexcept { return material_; }

    static constexpr double kMinStiffness = 1e-6;  // N/m
    static constexpr double kFlat = 0.02;          // part of the largest moment of a group
    static constexpr std::size_t kShapes = 65;     // of the table, at even distances from curl 0 to 1

  private:
    /// A shape of the table.
    struct TabulatedShape {
        std::vector<Vec3> rest_offset;  // m, grip frame, per particle
        std::vector<Mat3> deformation;  // as deformation_
        bool known = false;             // the deformation, with the present springs
    };

    [[nodiscard]] bool is_elastic() const noexcept;
    [[nodiscard]] Springs effective_springs() const noexcept;
    void find_exact_shape() noexcept;
    [[nodiscard]] const std::vector<Mat3>& tabulated_deformation(std::size_t k) noexcept;
    void interpolate_deformation() noexcept;
    void find_rotations() noexcept;
    void assemble_stiffness() noexcept;
    void add_group(const Group& group) noexcept;
    [[nodiscard]] Mat3 rigid_block(std::size_t i, std::size_t j, double translation, double rotation) const noexcept;
    void find_deformation() noexcept;
    void update_compliance() noexcept;
    void find_strain_response() noexcept;
    [[nodiscard]] double invert(double shift) noexcept;

    std::vector<Vec3> rest_offset_;
    std::vector<double> volume_;
    std::vector<double> radius_;
    std::vector<Group> groups_;
    ToolMaterial material_;
    Springs springs_;
    std::vector<Mat3> stiffness_;  // N x N, row by row, of K: the lower half; empty for a limp or rigid tool
    // m/N, of deformations alone, C - U: the lower half, row by row; empty for a limp or rigid tool.
    std::vector<Mat3> deformation_;
    std::vector<Mat3> compliance_;        // N x N, row by row
    std::vector<TabulatedShape> shapes_;  // kShapes, or empty
    double curl_ = 0.0;                   // of the present shape, if there is a table
    std::vector<Mat3> rotation_;          // per particle: three columns of G
    Vec3 mean_{0.0};                      // m, of the rest offsets
    Mat3 turns_per_moment_{0.0};          // 1/m^2, J^-1
    Mat3 turn_compliance_{0.0};
    using StrainResponse = std::array<Vec3, 6>;
    std::vector<StrainResponse>
        strain_response_;                 // per particle, m: under unit strains xx, yy, zz, xy, xz, yz of the ends
    bool strain_response_known_ = false;  // for the present compliance
    std::vector<double> inverse_;         // scratch: 3N x 3N, lower triangle, of X
    std::vector<double> pivot_;           // scratch of the inversion
    std::vector<Vec3> offset_;            // scratch, per member of a group: q_a, m
    std::vector<Vec3> coordinate_;        // scratch, per member of a group: q_a along the principal axes, m
    std::vector<Vec3> gradient_;          // scratch, per member of a group: b_a, 1/m
};

}  // namespace haptic::sim
