#include "model/idle_keys.hpp"

#include <algorithm>
#include <array>
#include <set>
#include <span>
#include <string>
#include <string_view>

#include "model/generator_table.hpp"

namespace haptic::sim {
namespace {

constexpr std::array<std::string_view, 2> kMeshFileKeys{"scale", "max_edge"};
constexpr std::array<std::string_view, 2> kBuilderKeys{"particles_count", "neighbours"};
constexpr std::string_view kBridge = "bridge";  // of the builder, and of the skin of a particle file

bool is_among(std::span<const std::string_view> keys, std::string_view key) {
    return std::ranges::find(keys, key) != keys.end();
}

/// Whether the key has an effect on the body. `key`: one of those that some bodies do not use.
bool is_used(std::string_view key, const ModelSettings& body) {
    const GeneratorEntry& generator = generator_entry(body.generator);
    const bool from_file = !body.file.empty();
    const bool has_particle_file = !body.particles.empty();
    const bool is_built = !has_particle_file && (from_file || generator.make_particles == nullptr);
    if (is_among(kMeshFileKeys, key)) {
        return from_file;
    }
    if (is_among(kBuilderKeys, key)) {
        return is_built;
    }
    if (key == kBridge) {
        return is_built || has_particle_file;
    }
    // A mesh without a scale is as long as the generated body.
    const bool has_shape = !from_file || body.file_scale == 0.0;
    return has_shape && is_among(generator.keys, key);
}

}  // namespace

std::string idle_key_notice(const Config& config, const std::string& table, const ModelSettings& body) {
    std::set<std::string_view> candidates(kMeshFileKeys.begin(), kMeshFileKeys.end());
    candidates.insert(kBuilderKeys.begin(), kBuilderKeys.end());
    candidates.insert(kBridge);
    for (const GeneratorEntry& entry : generator_table()) {
        candidates.insert(entry.keys.begin(), entry.keys.end());
    }
    std::string first;
    std::string others;
    for (const std::string_view key : candidates) {
        if (!config.has(table + "." + std::string(key)) || is_used(key, body)) {
            continue;
        }
        if (first.empty()) {
            first = key;
        } else {
            others += (others.empty() ? "" : ", ") + std::string(key);
        }
    }
    if (first.empty()) {
        return "";
    }
    const std::string generator = "generator = \"" + std::string(generator_entry(body.generator).name) + '"';
    const bool has_files = !body.particles.empty() || !body.file.empty();
    const std::string source = !has_files               ? generator
                               : body.file.empty()      ? generator + " and a particle file"
                               : body.particles.empty() ? "a mesh file"
                                                        : "a mesh file and a particle file";
    return config.where(table + "." + first) + "has no effect with " + source +
           (others.empty() ? "; remove it" : ", nor have these keys: " + others + "; remove them");
}

}  // namespace haptic::sim
