#include "model/material_settings.hpp"

#include <limits>
#include <stdexcept>
#include <string_view>

namespace haptic::sim {
namespace {

constexpr std::string_view kNoMaterial = "none";  // takes a scene's material away, as on the command line

constexpr Range kModuli{1.0, 1e12};               // Pa
constexpr Range kMembraneStiffnesses{1e-3, 1e8};  // N/m
constexpr Range kBendingStiffnesses{0.0, 1e3};    // N m
constexpr Range kDensities{1e-3, 1e5};            // kg/m^3, kg/m^2
constexpr Range kRetardations{0.0, 10.0};         // s

const SettingTable<MaterialSettings>& material_table() {
    using S = MaterialSettings;
    using V = SettingValues<S>;
    static const SettingTable<S> table{
        "model.material",
        "Material of the body, in the units of a data sheet. model.material = \"NAME\" takes a named material as it "
        "is, and \"none\" is as if there were no material, without the notice on keys of stiffness and mass "
        "that a material replaces. Cloth, curtain and other open meshes with a particle at "
        "each vertex are sheets, closed meshes solids.",
        {
            {{.key = "name", .meaning = "A named material, whose values the other keys replace. Empty: none."},
             V::text([](S& s) -> auto& { return s.name; })},
            {{.key = "young_modulus",
              .unit = "Pa",
              .default_note = "that of the named material, or 3e4",
              .meaning = "Young's modulus of a solid."},
             V::optional_number([](S& s) -> auto& { return s.young_modulus; }, kModuli)},
            {{.key = "poisson_ratio",
              .default_note = "that of the named material, 0.4 for other solids, 0.3 for other sheets",
              .meaning = "Poisson's ratio, of a sheet in its plane."},
             V::optional_number([](S& s) -> auto& { return s.poisson_ratio; }, {0.0, kMaxPoissonRatio})},
            {{.key = "density",
              .unit = "kg/m^3",
              .default_note = "that of the named material, or 1000",
              .meaning = "Density of a solid. The mass of the body follows from it."},
             V::optional_number([](S& s) -> auto& { return s.density; }, kDensities)},
            {{.key = "membrane_stiffness",
              .unit = "N/m",
              .default_note = "that of the named material, or 1000",
              .meaning = "Young's modulus of a sheet times its thickness."},
             V::optional_number([](S& s) -> auto& { return s.membrane_stiffness; }, kMembraneStiffnesses)},
            {{.key = "bending_stiffness",
              .unit = "N*m",
              .default_note = "that of the named material, or 1e-5",
              .meaning = "Bending moment of a sheet per length and curvature."},
             V::optional_number([](S& s) -> auto& { return s.bending_stiffness; }, kBendingStiffnesses)},
            {{.key = "areal_density",
              .unit = "kg/m^2",
              .default_note = "that of the named material, or 0.1",
              .meaning = "Mass of a sheet per area. The mass of the body follows from it."},
             V::optional_number([](S& s) -> auto& { return s.areal_density; }, kDensities)},
            {{.key = "damping",
              .unit = "s",
              .default_note = "that of the named material, or 0",
              .meaning = "Retardation time: stress is the elastic one at strain + damping * strain rate."},
             V::optional_number([](S& s) -> auto& { return s.damping; }, kRetardations)},
        },
        SectionKind::Optional};
    return table;
}

void refuse_kind(const std::string& name, const char* is, const char* must_be) {
    throw std::invalid_argument("model.material: \"" + name + "\" is a " + is + ", but the body is a " + must_be +
                                "; `host-sim materials` lists those of either kind");
}

void refuse_value(bool given, const char* key, const char* of, const char* must_be) {
    if (given) {
        throw std::invalid_argument(std::string("model.material.") + key + " is a value of a " + of +
                                    ", but the body is a " + must_be);
    }
}

}  // namespace

std::optional<MaterialSettings> read_material(const Config& config, const std::string& key) {
    if (!config.has(key)) {
        return std::nullopt;
    }
    MaterialSettings settings;
    if (!config.has_table(key)) {
        settings.name = config.text(key, "");
        if (settings.name == kNoMaterial) {
            return std::nullopt;
        }
    } else {
        material_table().read(config, key, settings);
    }
    if (!settings.name.empty()) {
        try {
            static_cast<void>(find_material(settings.name));
        } catch (const std::invalid_argument& error) {
            config.fail(config.has_table(key) ? key + ".name" : key, error.what());
        }
    }
    return settings;
}

SettingSection material_section() {
    SettingSection section = material_table().describe();
    section.or_text = true;
    return section;
}

SolidMaterial solid_of(const MaterialSettings& settings, const SolidMaterial& otherwise) {
    refuse_value(settings.membrane_stiffness.has_value(), "membrane_stiffness", "sheet", "solid");
    refuse_value(settings.bending_stiffness.has_value(), "bending_stiffness", "sheet", "solid");
    refuse_value(settings.areal_density.has_value(), "areal_density", "sheet", "solid");
    SolidMaterial material = otherwise;
    if (!settings.name.empty()) {
        const NamedMaterial& named = find_material(settings.name);
        if (named.kind != MaterialKind::Solid) {
            refuse_kind(settings.name, "sheet", "solid");
        }
        material = named.solid;
    }
    material.young_modulus = settings.young_modulus.value_or(material.young_modulus);
    material.poisson_ratio = settings.poisson_ratio.value_or(material.poisson_ratio);
    material.density = settings.density.value_or(material.density);
    material.damping = settings.damping.value_or(material.damping);
    check(material);
    return material;
}

SheetMaterial sheet_of(const MaterialSettings& settings, const SheetMaterial& otherwise) {
    refuse_value(settings.young_modulus.has_value(), "young_modulus", "solid", "sheet");
    refuse_value(settings.density.has_value(), "density", "solid", "sheet");
    SheetMaterial material = otherwise;
    if (!settings.name.empty()) {
        const NamedMaterial& named = find_material(settings.name);
        if (named.kind != MaterialKind::Sheet) {
            refuse_kind(settings.name, "solid", "sheet");
        }
        material = named.sheet;
    }
    material.membrane_stiffness = settings.membrane_stiffness.value_or(material.membrane_stiffness);
    material.bending_stiffness = settings.bending_stiffness.value_or(material.bending_stiffness);
    material.poisson_ratio = settings.poisson_ratio.value_or(material.poisson_ratio);
    material.areal_density = settings.areal_density.value_or(material.areal_density);
    material.damping = settings.damping.value_or(material.damping);
    check(material);
    return material;
}

}  // namespace haptic::sim
