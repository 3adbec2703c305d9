// Materials of deformable bodies, in the units of a data sheet.
//
// A solid is linearly elastic in the frame that turns with it (co-rotated), isotropic and viscous (Kelvin and Voigt).
// A sheet is a thin, isotropic skin with separate stiffnesses against stretching and bending; both are per length, so
// that no thickness is needed. Stiffness belongs to the material alone: neither the step, nor sub-steps or iterations,
// nor the number of particles is part of it.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace haptic::sim {

/// Solids' Poisson's ratios are at most this; above it a body of particles locks.
inline constexpr double kMaxPoissonRatio = 0.48;

enum class MaterialKind : std::uint8_t { Solid, Sheet };

struct SolidMaterial {
    double young_modulus = 3e4;  // Pa, positive
    double poisson_ratio = 0.4;  // 0..kMaxPoissonRatio
    double density = 1000.0;     // kg/m^3, positive
    double damping = 0.0;        // s, retardation time: stress = C (strain + damping * strain rate)
};

struct SheetMaterial {
    double membrane_stiffness = 1000.0;  // N/m, Young's modulus times thickness; positive
    double bending_stiffness = 1e-5;     // N m, moment per length and curvature; at least 0
    double poisson_ratio = 0.3;          // 0..kMaxPoissonRatio, in the plane
    double areal_density = 0.1;          // kg/m^2, positive
    double damping = 0.0;                // s, as above, for stretching and bending
};

/// A material by name, with where its figures are from.
struct NamedMaterial {
    std::string_view name;  // lower case, as in the key model.material
    MaterialKind kind;
    SolidMaterial solid;  // of a solid
    SheetMaterial sheet;  // of a sheet
    std::string_view source;
};

/// All named materials, solids first, each kind in alphabetical order.
[[nodiscard]] std::span<const NamedMaterial> named_materials() noexcept;

/// Their names, in the same order.
[[nodiscard]] std::vector<std::string> material_names();

/// Throws std::invalid_argument that lists the names.
[[nodiscard]] const NamedMaterial& find_material(std::string_view name);

/// Throw std::invalid_argument that names the wrong value and its range.
void check(const SolidMaterial& material);
void check(const SheetMaterial& material);

}  // namespace haptic::sim
