#include "haptic/sim/material.hpp"

#include <cmath>
#include <stdexcept>

namespace haptic::sim {

void check(const SolidMaterial& m) {
    if (!(m.young_modulus > 0.0) || !(m.density > 0.0) || !(m.poisson_ratio >= 0.0) ||
        !(m.poisson_ratio <= kMaxPoissonRatio) || !(m.damping >= 0.0)) {
        throw std::invalid_argument("material: bad solid");
    }
}
void check(const SheetMaterial& m) {
    if (!(m.membrane_stiffness > 0.0)) {
        throw std::invalid_argument("material: bad sheet");
    }
}

}  // namespace haptic::sim
namespace haptic::sim {
std::span<const NamedMaterial> named_materials() noexcept {
    return {};
}
const NamedMaterial& find_material(std::string_view) {
    throw std::invalid_argument("no named materials yet");
}
}  // namespace haptic::sim
