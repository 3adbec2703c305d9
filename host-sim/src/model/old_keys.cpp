#include "model/old_keys.hpp"

#include <array>
#include <string_view>

namespace haptic::sim {
namespace {

/// A key of [model], and what says the same in [model.material].
struct OldKey {
    std::string_view key;
    std::string_view problem;
    std::string_view of_solid;
    std::string_view of_sheet;
};

constexpr std::string_view kDependsOnSteps = "depends on step and iterations";
constexpr std::string_view kDependsOnParticles = "is that of each constraint, so the body's depends on its particles";
constexpr std::string_view kModulus = "young_modulus (Pa)";
constexpr std::string_view kMembrane = "membrane_stiffness (N/m)";
constexpr std::string_view kMembraneAndBending = "membrane_stiffness (N/m) with bending_stiffness (N*m)";

constexpr std::array<OldKey, 5> kOldKeys{
    {{"group_stiffness", kDependsOnSteps, kModulus, kMembraneAndBending},
     {"link_stiffness", kDependsOnSteps, kModulus, kMembrane},
     {"group_compliance", kDependsOnParticles, kModulus, kMembraneAndBending},
     {"link_compliance", kDependsOnParticles, kModulus, kMembrane},
     {"mass", "does not follow the body's size", "density (kg/m^3)", "areal_density (kg/m^2)"}}};

enum class Kind { Solid, Sheet, Unknown };

/// Kind of the body as far as the scene tells: a mesh file may be either.
Kind kind_of(const ModelSettings& body) {
    if (!body.file.empty()) {
        return Kind::Unknown;
    }
    switch (body.generator) {
        case Generator::Cloth:
        case Generator::Curtain:
        case Generator::Fan:
            return Kind::Sheet;
        default:
            return Kind::Solid;
    }
}

std::string successor_of(const OldKey& old, Kind kind) {
    switch (kind) {
        case Kind::Solid:
            return std::string(old.of_solid);
        case Kind::Sheet:
            return std::string(old.of_sheet);
        case Kind::Unknown:
            break;
    }
    return std::string(old.of_solid) + ", of an open mesh " + std::string(old.of_sheet) + ',';
}

}  // namespace

std::vector<std::string> old_key_notices(const Config& config, const std::string& table, const ModelSettings& body) {
    if (is_rigid(body) || config.has(table + ".material")) {
        return {};
    }
    // Tables of [[objects]] have no names of their own.
    const std::string heading = table.substr(0, table.find('.'));
    const std::string none = heading == table ? table + ".material = \"none\"" : "material = \"none\" in [[objects]]";
    const Kind kind = kind_of(body);
    std::vector<std::string> notices;
    const auto add = [&](const std::string& key, const OldKey& old, const std::string& tables) {
        notices.push_back(config.where(key) + std::string(old.problem) + "; " + successor_of(old, kind) + " of " +
                          tables + " replaces it (" + none + " keeps this method and ends this notice)");
    };
    const std::string material = "[" + heading + ".material]";
    for (const OldKey& old : kOldKeys) {
        const std::string key = table + '.' + std::string(old.key);
        if (config.has(key)) {
            add(key, old, material);
        }
    }
    // The stiffness of a region is that of its groups.
    for (std::size_t k = 0; k < body.regions.size(); ++k) {
        if (body.regions[k].stiffness) {
            std::string successors = material;
            successors.append(" and [").append(heading).append(".regions.material]");
            add(table + ".regions." + std::to_string(k) + ".stiffness", kOldKeys.front(), successors);
            break;
        }
    }
    return notices;
}

}  // namespace haptic::sim
