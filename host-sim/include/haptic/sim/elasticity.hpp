// Elasticity of a body: its energy as a sum of elements and pairs.
//
// An element is a piece of the body, of volume V, whose deformation gradient F = sum x_i b_i^T is linear in the
// positions of its members. Its energy is that of a linear material in the frame R that turns with the element, the
// rotation nearest to F,
//
//     V (mu |e|^2 + lambda / 2 tr(e)^2),   e = sym(R^T F) - N,
//
// with N the projection on the directions in which the members are spread: 1 for a solid, a plane for a triangle.
//
// A pair has the energy k / 2 |x_i - x_j|^2. One by one they pull, but their sum is zero for every affine placement of
// the rest shape: together they are the energy of what no element sees. In a solid that is how the strain changes
// within an element (bending and torsion of thin parts); in a sheet it is its curvature.
//
// Solids: the b_i of a particle with its neighbours are the derivatives of the quadratic function that fits their
// displacements best at the particle (moving least squares, which is exact for quadratic displacements), and the second
// derivatives H of the same fit give the pairs, kGradientStiffness E m2 V |H|^2 / 2 with m2 the second moment of the
// particle's cell. An integral over the cell by its middle alone would miss that part.
// Sheets: b_i are those of the linear triangle; pairs are the quadratic bending energy of two triangles with a common
// edge, for sheets that are flat at rest. Its scale is that of a grid on a cylinder.
// @source T. Belytschko, Y. Lu, L. Gu, "Element-free Galerkin methods", 1994 (moving least squares); S. Nagashima,
// "Node-by-node meshless approach and its applications to structural analyses", 1999 (Taylor terms within a cell); M.
// Bergou, M. Wardetzky, D. Harmon, D. Zorin, E. Grinspun, "A quadratic bending model for inextensible surfaces", 2006.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "haptic/sim/material.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

struct ParticleModel;
struct TriangleMesh;

struct ElasticElement {
    std::uint32_t centre = 0;  // the particle that takes the element's rotation; the first of the members
    std::vector<std::uint32_t> members;
    std::vector<Vec3> gradient{};  // 1/m, b_i, one per member; they sum to 0
    Mat3 spread{1.0};              // N, in the rest frame
    double volume = 0.0;           // m^3; m^2 of a triangle
    double shear_modulus = 0.0;    // Pa, mu; N/m of a triangle
    double lame_modulus = 0.0;     // Pa, lambda; N/m of a triangle
    double max_modulus = 0.0;      // Pa or N/m: largest stress per strain, 2 mu + n lambda in n directions
    double damping = 0.0;          // s
};

struct ElasticPair {
    std::uint32_t first = 0;
    std::uint32_t second = 0;
    double stiffness = 0.0;  // N/m, of either sign
    double damping = 0.0;    // s
};

struct Elasticity {
    std::vector<ElasticElement> elements;
    std::vector<ElasticPair> pairs;  // no two join the same particles
};

/// One of the particles that move a point, or take a force, together; their weights sum to 1.
struct ParticleWeight {
    std::uint32_t particle = 0;
    double weight = 0.0;
};

/// Elements and pairs of a solid body, one element for each of its groups, whose members become those of the element.
/// `material` has one value per particle, for the element about it. Cells' volumes are mass / density. Throws
/// std::invalid_argument for a material that check() refuses, and for groups without neighbours.
[[nodiscard]] Elasticity make_solid(const ParticleModel& model, std::span<const SolidMaterial> material);

/// Changes the gradients of a solid as little as possible so that the sum of V b_i over the elements is particle i's
/// part of the surface of `mesh`, the body at rest (the divergence theorem). A homogeneous stress is then in
/// equilibrium with its tractions, as in a continuum; without it, particles at the surface yield too much. Affine
/// displacements stay exact. No effect unless the mesh is closed.
/// @source J. S. Chen, M. Hillman, M. Rueter, "An arbitrary order variationally consistent integration for Galerkin
/// meshfree methods", 2013
void balance_surface(const ParticleModel& model, const TriangleMesh& mesh, Elasticity& elasticity);

/// The particles whose weighted positions are a point of a solid that is at `at` at rest, m: it moves with the element
/// about the nearest particle, as balance_surface() takes it to. Exact for affine motions in the directions in which
/// the element's members are spread. Take the elements before the balance. Precondition: there are elements.
[[nodiscard]] std::vector<ParticleWeight> carriers_of(const ParticleModel& model, const Elasticity& elasticity,
                                                      const Vec3& at);

/// Elements and pairs of a sheet with a particle at each vertex. Triangles that lie on one another, the faces of a
/// double-faced mesh, count once. Throws std::invalid_argument for a material that check() refuses, and if particles
/// and vertices do not correspond. `material` has one value per particle; that of a triangle's first corner counts.
[[nodiscard]] Elasticity make_sheet(const ParticleModel& model, const TriangleMesh& mesh,
                                    std::span<const SheetMaterial> material);

/// Longest sub-step, s, in which waves that stretch a body pass no more than a quarter of it: its vibrations are then
/// resolved. Longer ones damp them, but do not change the stiffness. Infinite without elements.
[[nodiscard]] double resolved_step(const ParticleModel& model);

/// Longest sub-step, s, that moves every body as its material does: no longer than resolved_step(), nor than the
/// damping of the material, which an implicit step of that length has by itself. A material with less than 2 ms of it
/// is damped as one with 2 ms. At most 5 ms; infinite without elements.
[[nodiscard]] double faithful_step(const ParticleModel& model);

}  // namespace haptic::sim
