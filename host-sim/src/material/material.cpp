#include "haptic/sim/material.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

#include "haptic/setting.hpp"

namespace haptic::sim {
namespace {

constexpr NamedMaterial solid(std::string_view name, const SolidMaterial& material, std::string_view source) {
    return {.name = name, .kind = MaterialKind::Solid, .solid = material, .sheet = {}, .source = source};
}

constexpr NamedMaterial sheet(std::string_view name, const SheetMaterial& material, std::string_view source) {
    return {.name = name, .kind = MaterialKind::Sheet, .solid = {}, .sheet = material, .source = source};
}

// Small strain, room temperature, slow loading. Where published values differ, one from the middle of their range.
//
// Data sheets of soft silicones give the stress s at 100 % strain. A neo-Hookean solid with Young's modulus E has
// s = E / 3 (2 - 1 / 4) there, so that E = 1.71 s.
//
// Water-like solids hardly change their volume; 0.45 comes near without locking. Damping is from loss factors of some
// percent (gels) to some tenths (tissue) at 10 Hz, tan delta = 2 pi 10 Hz damping.
//
// Bending stiffness of elastomer sheets: E h^3 / (12 (1 - nu^2)), with their thickness h; that of fabrics is measured
// (KES-F; 1 gf cm^2/cm = 9.8e-5 N m), because yarns slide.
constexpr std::array kMaterials{
    solid("agar 1 %", {.young_modulus = 3e4, .poisson_ratio = 0.45, .density = 1010.0, .damping = 5e-4},
          "typical; values range from about 10 to 70 kPa"),
    solid("brain", {.young_modulus = 1.6e3, .poisson_ratio = 0.45, .density = 1040.0, .damping = 0.005},
          "Budday et al. 2015, indentation: grey matter 1.4 kPa, white matter 1.9 kPa"),
    solid("dragon skin 10", {.young_modulus = 2.6e5, .poisson_ratio = 0.45, .density = 1070.0, .damping = 0.001},
          "Smooth-On data sheet: 22 psi at 100 % strain"),
    solid("dragon skin 30", {.young_modulus = 1e6, .poisson_ratio = 0.45, .density = 1080.0, .damping = 0.001},
          "Smooth-On data sheet: 86 psi at 100 % strain"),
    solid("ecoflex 00-10", {.young_modulus = 9.5e4, .poisson_ratio = 0.45, .density = 1040.0, .damping = 0.002},
          "Smooth-On data sheet: 8 psi at 100 % strain"),
    solid("ecoflex 00-30", {.young_modulus = 1.2e5, .poisson_ratio = 0.45, .density = 1070.0, .damping = 0.002},
          "Smooth-On data sheet: 10 psi at 100 % strain"),
    solid("ecoflex 00-50", {.young_modulus = 1.4e5, .poisson_ratio = 0.45, .density = 1070.0, .damping = 0.002},
          "Smooth-On data sheet: 12 psi at 100 % strain"),
    solid("fat", {.young_modulus = 3.25e3, .poisson_ratio = 0.45, .density = 920.0, .damping = 0.005},
          "Samani et al. 2007, breast fat, small strain; values range from about 0.5 to 25 kPa"),
    solid("fish flesh", {.young_modulus = 2e4, .poisson_ratio = 0.45, .density = 1050.0, .damping = 0.005},
          "typical of a raw fillet; values range from about 5 to 100 kPa"),
    solid("foam", {.young_modulus = 5e4, .poisson_ratio = 0.3, .density = 30.0, .damping = 0.003},
          "typical of polyurethane upholstery foam; values range from about 20 to 150 kPa"),
    solid("gelatin 10 %", {.young_modulus = 3e4, .poisson_ratio = 0.45, .density = 1030.0, .damping = 5e-4},
          "typical; values range from about 15 to 100 kPa"),
    solid("gelatin 5 %", {.young_modulus = 8e3, .poisson_ratio = 0.45, .density = 1015.0, .damping = 5e-4},
          "typical; values range from about 3 to 20 kPa"),
    solid("liver", {.young_modulus = 5.5e3, .poisson_ratio = 0.45, .density = 1060.0, .damping = 0.005},
          "Roulot et al. 2008, elastography of 429 healthy subjects: 5.5 +- 1.6 kPa"),
    solid("muscle", {.young_modulus = 2e4, .poisson_ratio = 0.45, .density = 1060.0, .damping = 0.005},
          "typical at rest; values range from about 5 to 200 kPa by method and fibre direction"),
    solid("natural rubber", {.young_modulus = 1.5e6, .poisson_ratio = 0.45, .density = 930.0, .damping = 5e-4},
          "typical without filler; values range from about 1 to 2.5 MPa"),
    solid("skin", {.young_modulus = 1e5, .poisson_ratio = 0.45, .density = 1100.0, .damping = 0.005},
          "typical of suction; Kalra et al. 2016: 5 kPa to 140 MPa by method"),
    solid("sylgard 184", {.young_modulus = 2e6, .poisson_ratio = 0.45, .density = 1030.0, .damping = 5e-4},
          "Johnston et al. 2014: 1.3 to 3.0 MPa, cured at 25 to 200 deg C"),
    sheet("cotton",
          {.membrane_stiffness = 5e3,
           .bending_stiffness = 5e-6,
           .poisson_ratio = 0.2,
           .areal_density = 0.12,
           .damping = 0.002},
          "typical of a shirting; values range from about 2 to 20 kN/m and 3e-6 to 1e-5 N m"),
    sheet("denim",
          {.membrane_stiffness = 1e4,
           .bending_stiffness = 2e-5,
           .poisson_ratio = 0.2,
           .areal_density = 0.4,
           .damping = 0.002},
          "typical; Journal of Textiles 2016, 4614168: 1.4e-5 to 2.2e-5 N m; heavier ones up to 6e-5"),
    sheet("latex",
          {.membrane_stiffness = 260.0,
           .bending_stiffness = 1.1e-6,
           .poisson_ratio = 0.45,
           .areal_density = 0.19,
           .damping = 0.001},
          "typical of a glove of 0.2 mm; moduli range from about 1 to 2 MPa"),
    sheet("nitrile glove",
          {.membrane_stiffness = 500.0,
           .bending_stiffness = 5e-7,
           .poisson_ratio = 0.45,
           .areal_density = 0.1,
           .damping = 0.002},
          "typical of a glove of 0.1 mm; moduli range from about 2 to 10 MPa"),
    sheet("paper",
          {.membrane_stiffness = 4e5,
           .bending_stiffness = 3.5e-4,
           .poisson_ratio = 0.3,
           .areal_density = 0.08,
           .damping = 5e-4},
          "typical of copy paper, 0.1 mm; moduli range from about 2 to 8 GPa by direction"),
    sheet("polyester",
          {.membrane_stiffness = 8e3,
           .bending_stiffness = 3e-6,
           .poisson_ratio = 0.2,
           .areal_density = 0.08,
           .damping = 0.002},
          "typical of a lining; values range from about 3 to 20 kN/m and 1e-6 to 8e-6 N m"),
    sheet("silk",
          {.membrane_stiffness = 4e3,
           .bending_stiffness = 2e-6,
           .poisson_ratio = 0.2,
           .areal_density = 0.07,
           .damping = 0.002},
          "typical of a light dress fabric; values range from about 2 to 15 kN/m and 5e-7 to 5e-6 N m"),
    sheet("wool",
          {.membrane_stiffness = 3e3,
           .bending_stiffness = 1e-5,
           .poisson_ratio = 0.2,
           .areal_density = 0.2,
           .damping = 0.002},
          "typical of a suiting; values range from about 1 to 10 kN/m and 5e-6 to 1.5e-5 N m"),
};

void require_value(bool holds, const char* material, const char* key, double value, const std::string& range) {
    if (!holds) {
        throw std::invalid_argument(std::string(material) + " material: " + key + " is " + toml_value(value) +
                                    ", must be " + range);
    }
}

void require_positive(const char* material, const char* key, double value, const char* unit) {
    require_value(std::isfinite(value) && value > 0.0, material, key, value, std::string("positive, ") + unit);
}

void require_not_negative(const char* material, const char* key, double value, const char* unit) {
    require_value(std::isfinite(value) && value >= 0.0, material, key, value, std::string("at least 0, ") + unit);
}

void require_poisson_ratio(const char* material, double value) {
    require_value(value >= 0.0 && value <= kMaxPoissonRatio, material, "poisson_ratio", value,
                  "0 to " + toml_value(kMaxPoissonRatio));
}

}  // namespace

std::span<const NamedMaterial> named_materials() noexcept {
    return kMaterials;
}

std::vector<std::string> material_names() {
    std::vector<std::string> names;
    names.reserve(kMaterials.size());
    for (const NamedMaterial& material : kMaterials) {
        names.emplace_back(material.name);
    }
    return names;
}

const NamedMaterial& find_material(std::string_view name) {
    const auto found = std::find_if(kMaterials.begin(), kMaterials.end(),
                                    [&](const NamedMaterial& material) { return material.name == name; });
    if (found == kMaterials.end()) {
        std::string names;
        for (const std::string& known : material_names()) {
            names += (names.empty() ? "" : ", ") + known;
        }
        throw std::invalid_argument("there is no material \"" + std::string(name) + "\"; there are " + names);
    }
    return *found;
}

void check(const SolidMaterial& material) {
    require_positive("solid", "young_modulus", material.young_modulus, "Pa");
    require_poisson_ratio("solid", material.poisson_ratio);
    require_positive("solid", "density", material.density, "kg/m^3");
    require_not_negative("solid", "damping", material.damping, "s");
}

void check(const SheetMaterial& material) {
    require_positive("sheet", "membrane_stiffness", material.membrane_stiffness, "N/m");
    require_not_negative("sheet", "bending_stiffness", material.bending_stiffness, "N m");
    require_poisson_ratio("sheet", material.poisson_ratio);
    require_positive("sheet", "areal_density", material.areal_density, "kg/m^2");
    require_not_negative("sheet", "damping", material.damping, "s");
}

}  // namespace haptic::sim
