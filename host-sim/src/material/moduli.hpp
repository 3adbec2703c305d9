// Moduli that follow from Young's modulus and Poisson's ratio, Pa.
#pragma once

#include "haptic/sim/material.hpp"

namespace haptic::sim {

[[nodiscard]] inline double shear_modulus(const SolidMaterial& m) noexcept {
    return m.young_modulus / (2.0 * (1.0 + m.poisson_ratio));
}

[[nodiscard]] inline double bulk_modulus(const SolidMaterial& m) noexcept {
    return m.young_modulus / (3.0 * (1.0 - 2.0 * m.poisson_ratio));
}

}  // namespace haptic::sim
