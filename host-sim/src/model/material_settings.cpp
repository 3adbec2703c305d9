#include "model/material_settings.hpp"

#include <string>
#include <string_view>

namespace haptic::sim {
namespace {

constexpr std::string_view kNoMaterial = "none";  // takes a scene's material away, as on the command line

constexpr Range kModuli{1.0, 1e12};               // Pa
constexpr Range kMembraneStiffnesses{1e-3, 1e8};  // N/m
constexpr Range kBendingStiffnesses{0.0, 1e3};    // N m
constexpr Range kDensities{1e-3, 1e5};            // kg/m^3, kg/m^2
constexpr Range kRetardations{0.0, 10.0};         // s
// The named rubbers, gels and tissues have 0.45.
constexpr Range kPoissonRatios{
    0.0, kMaxPoissonRatio,
    "at 0.5 a material is incompressible, its bulk modulus infinite, and near it bodies lock; give rubber, gel and "
    "tissue 0.45, as the named materials have"};

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
             V::optional_number([](S& s) -> auto& { return s.poisson_ratio; }, kPoissonRatios)},
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

std::string_view word_of(MaterialKind kind) {
    return kind == MaterialKind::Solid ? "solid" : "sheet";
}

/// The named material. Throws ConfigError if it is not of the kind of the body.
const NamedMaterial& named_of_kind(const MaterialSettings& settings, MaterialKind body) {
    const NamedMaterial& named = find_material(settings.name);
    if (named.kind != body) {
        settings.place.of("name").fail("\"" + settings.name + "\" is a " + std::string(word_of(named.kind)) +
                                       ", but the body is a " + std::string(word_of(body)) +
                                       "; `host-sim materials` lists those of either kind");
    }
    return named;
}

/// Throws ConfigError for a value that bodies of this kind do not have. `instead`: their key for it.
void refuse_value(const MaterialSettings& settings, const std::optional<double>& value, std::string_view key,
                  MaterialKind body, std::string_view instead) {
    if (value) {
        const MaterialKind other = body == MaterialKind::Solid ? MaterialKind::Sheet : MaterialKind::Solid;
        settings.place.of(key).fail("is a value of a " + std::string(word_of(other)) + ", but the body is a " +
                                    std::string(word_of(body)) + "; give it " + std::string(instead) + " instead");
    }
}

}  // namespace

std::optional<MaterialSettings> read_material(const Config& config, const std::string& key) {
    if (!config.has(key)) {
        return std::nullopt;
    }
    MaterialSettings settings;
    settings.place = config.place(key);
    if (!config.has_table(key)) {
        settings.name = config.text(key, "");
        if (settings.name == kNoMaterial) {
            return std::nullopt;
        }
    } else {
        material_table().read(config, key, settings);
    }
    if (!settings.name.empty()) {
        static_cast<void>(config.choice(config.has_table(key) ? key + ".name" : key, "", material_names()));
    }
    return settings;
}

SettingSection material_section() {
    SettingSection section = material_table().describe();
    section.or_text = true;
    return section;
}

SolidMaterial solid_of(const MaterialSettings& settings, const SolidMaterial& otherwise) {
    constexpr MaterialKind body = MaterialKind::Solid;
    refuse_value(settings, settings.membrane_stiffness, "membrane_stiffness", body, "young_modulus");
    refuse_value(settings, settings.bending_stiffness, "bending_stiffness", body, "young_modulus");
    refuse_value(settings, settings.areal_density, "areal_density", body, "density");
    SolidMaterial material = otherwise;
    if (!settings.name.empty()) {
        material = named_of_kind(settings, body).solid;
    }
    material.young_modulus = settings.young_modulus.value_or(material.young_modulus);
    material.poisson_ratio = settings.poisson_ratio.value_or(material.poisson_ratio);
    material.density = settings.density.value_or(material.density);
    material.damping = settings.damping.value_or(material.damping);
    check(material);
    return material;
}

SheetMaterial sheet_of(const MaterialSettings& settings, const SheetMaterial& otherwise) {
    constexpr MaterialKind body = MaterialKind::Sheet;
    refuse_value(settings, settings.young_modulus, "young_modulus", body, "membrane_stiffness");
    refuse_value(settings, settings.density, "density", body, "areal_density");
    SheetMaterial material = otherwise;
    if (!settings.name.empty()) {
        material = named_of_kind(settings, body).sheet;
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
