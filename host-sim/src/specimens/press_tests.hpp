// Virtual test of a solid material by pressing: a rigid, frictionless sphere indents a block that is held below.
//
// The block is one layer of the material, of the given thickness from the held particles to its upper face, and wide
// enough that its sides hardly matter. The sphere is pushed into the middle of the upper face. At rest every vertex j
// of the face satisfies
//
//     g_j = |x_j - c| - R >= 0,   l_j >= 0,   g_j l_j = 0
//
// with c the centre of the sphere and l_j the force on the vertex along the sphere's normal. In each sub-step the rows
// are solved as one exact block with the body's answer A^-1 (elastic_bodies.hpp), so at rest they hold to rounding, and
// the l_j balance the stresses of the material whatever the step. The force on the sphere is the sum of l_j n_j.
//
// A vertex moves with its particles and their elements, as in body_tests.hpp: x_j = sum_i w_ji (x_i + F_i (X_j - X_i))
// with F_i the deformation gradient of the element about particle i. The forces on the particles are its transpose, so
// that the sphere does the work that the body stores.
//
// What it is compared with is in layer_contact.hpp. That theory is for small strains, so the sphere should be large:
// the radius of the contact, about sqrt(R d), against R is about the strain below it.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "specimens/layer_contact.hpp"

namespace haptic::sim {

struct PressTest {
    LayerContact contact{};
    double side = 0.15;            // m, of the square upper face
    std::size_t particles = 1000;  // of the layer; it has half a layer of them more, below the held plane
    std::size_t neighbours = 16;
    double step = 0.01;  // s
    int substeps = 0;    // 0: chosen from the material
};

/// Answer to one depth.
struct PressMeasured {
    double depth = 0.0;        // m
    double force = 0.0;        // N, on the sphere, upward
    double requested = 0.0;    // N, of the layer in theory
    std::size_t touching = 0;  // vertices that carry it
    int substeps = 0;          // of a step, used
    double simulated_s = 0.0;
    bool at_rest = false;
};

/// Presses one block to each depth, m, in turn. Throws std::invalid_argument for depths that are not positive, and if
/// more vertices may touch the sphere than a contact problem has rows.
[[nodiscard]] std::vector<PressMeasured> measure_press(const PressTest& test, std::span<const double> depths);
/// Pa: Young's modulus of the layer that has the measured forces, the mean over the depths.
[[nodiscard]] double fitted_modulus(const PressTest& test, std::span<const PressMeasured> measured);

}  // namespace haptic::sim
