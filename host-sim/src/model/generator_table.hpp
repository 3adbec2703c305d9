// Table of the body generators: name, defaults and functions of each, in the order of `Generator`.
//
// A new generator needs its enumerator, its shape in ModelSettings, its keys in model_keys.cpp and one row here.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>

#include "haptic/sim/model_settings.hpp"

namespace haptic::sim {

/// Values that apply where the scene gives none.
struct GeneratorDefaults {
    double mass;    // kg, of the whole body
    double height;  // m, of the body's origin
    double group_stiffness;
    double link_stiffness;
};

struct GeneratorEntry {
    Generator generator;
    const char* name;                        // as in the key model.generator
    std::span<const std::string_view> keys;  // of [model], that give the shape
    GeneratorDefaults defaults;
    TriangleMesh (*make_mesh)(const ModelSettings& settings);
    /// One particle for each vertex of that mesh, in the same order. Null: build_body() distributes the particles.
    ParticleModel (*make_particles)(const ModelSettings& settings, const TriangleMesh& mesh);
    double (*length)(const ModelSettings& settings);          // m, longest side of the body
    std::size_t (*triangles)(const ModelSettings& settings);  // of the mesh, without making it
};

[[nodiscard]] std::span<const GeneratorEntry> generator_table() noexcept;
[[nodiscard]] const GeneratorEntry& generator_entry(Generator generator) noexcept;

/// "cloth, curtain, ..." in the order of the table.
[[nodiscard]] std::string generator_names();

/// Makes mesh, particles and skin from the shape that `settings.generator` selects. Throws std::invalid_argument.
[[nodiscard]] DeformableBody generate_body(const ModelSettings& settings, const Progress& progress = {});

}  // namespace haptic::sim
