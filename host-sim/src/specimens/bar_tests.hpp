// Virtual tests of a solid material on a bar of square section, by the solver that the scenes use: what a bar of this
// material, of this many particles and with these sub-steps, answers to a load, against the textbook.
#pragma once

#include <cstddef>
#include <cstdint>

#include "haptic/sim/material.hpp"
#include "haptic/sim/solver.hpp"

namespace haptic::sim {

struct BarTest {
    SolidMaterial material;
    double length = 0.4;          // m
    double side = 0.05;           // m, of the section
    std::size_t particles = 500;  // of the whole bar
    std::size_t neighbours = 16;
    double step = 0.01;  // s
    int substeps = 0;    // 0: chosen from the material
};

/// Modulus that the bar was measured to have, Pa, and whether it came to rest.
struct Measured {
    double modulus = 0.0;
    double poisson_ratio = 0.0;  // of tension
    int substeps = 0;            // of a step, used
    double simulated_s = 0.0;
    bool at_rest = false;
};

/// Young's modulus and Poisson's ratio: both ends are pulled, the strain is that of the middle half.
[[nodiscard]] Measured measure_tension(const BarTest& test);
/// Young's modulus: one end is held, the bar sags by its own weight. The line of Timoshenko (1921) is fitted.
[[nodiscard]] Measured measure_bending(const BarTest& test);
/// Shear modulus: one end is held, the other twisted. The twist is that of the middle half, the section's torsion
/// constant 0.1406 side^4 (Timoshenko & Goodier 1951).
[[nodiscard]] Measured measure_torsion(const BarTest& test);

}  // namespace haptic::sim
