// Virtual tests of a sheet material, by the solver that the scenes use: a square that is pulled, a strip that sags, and
// the drape of a disc over a smaller support, as textile laboratories measure it.
// @source British Standard 3356 (cantilever); G. E. Cusick, "The dependence of fabric drape on bending and shear
// stiffness", 1965, for the drape test
#pragma once

#include <cstdint>

#include "haptic/sim/material.hpp"
#include "haptic/sim/mesh.hpp"

namespace haptic::sim {

struct SheetTest {
    static constexpr std::uint32_t kFewestPerSide = 9;

    SheetMaterial material;
    std::uint32_t vertices_per_side = 33;  // of the square; at least kFewestPerSide
    double side = 0.3;                     // m, of the square
    double strip = 0.1;                    // m, length of the strip
    double step = 0.01;                    // s
    int substeps = 0;                      // 0: chosen from the material
};

struct SheetMeasured {
    double value = 0.0;          // N/m or N m
    double poisson_ratio = 0.0;  // of the membrane
    double areal_density = 0.0;  // kg/m^2, of the body made
    int substeps = 0;
    double simulated_s = 0.0;
    bool at_rest = false;
};

/// Membrane stiffness and Poisson's ratio: two opposite edges are pulled, the strain is that of the middle half.
[[nodiscard]] SheetMeasured measure_membrane(const SheetTest& test);
/// Bending stiffness: a strip, held at one end, sags by its own weight, which is chosen so that it does by 1 %.
/// Precondition: a bending stiffness above 0.
[[nodiscard]] SheetMeasured measure_sheet_bending(const SheetTest& test);

struct Drape {
    static constexpr double kDisc = 0.15;     // m, radius of the sheet
    static constexpr double kSupport = 0.09;  // m, radius of the support, on which the sheet is held

    double coefficient = 0.0;  // (area of the shadow - support) / (disc - support)
    int folds = 0;             // maxima of the height along the edge
    double simulated_s = 0.0;
    bool at_rest = false;
    TriangleMesh mesh{};  // as it hangs
};

/// Drapes a disc under its own weight. The sheet does not collide with itself or with the support.
[[nodiscard]] Drape measure_drape(const SheetTest& test);

/// Area, m^2, that the mesh covers seen along y.
[[nodiscard]] double shadow_area(const TriangleMesh& mesh);

}  // namespace haptic::sim
