#include "model/generator_table.hpp"

#include <algorithm>
#include <array>

#include "haptic/sim/model_builder.hpp"
#include "haptic/sim/skin.hpp"

namespace haptic::sim {
namespace {

using Settings = const ModelSettings&;

constexpr std::array<std::string_view, 2> kSquareKeys{"vertices_per_side", "side"};
constexpr std::array<std::string_view, 2> kFanKeys{"rim_vertices", "rim_radius"};
constexpr std::array<std::string_view, 2> kRefinedKeys{"length", "refinements"};
constexpr std::array<std::string_view, 2> kBoxKeys{"size", "cells"};
constexpr std::array<std::string_view, 2> kRodKeys{"length", "diameter"};

// A double-faced square grid has four triangles for each cell.
std::size_t double_faced_grid(std::size_t vertices_per_side) {
    return 4 * (vertices_per_side - 1) * (vertices_per_side - 1);
}

ParticleModel make_rigid(Settings s, const TriangleMesh& mesh) {
    return make_rigid_particles(mesh, s.mass);
}

constexpr std::array<GeneratorEntry, 8> kGenerators{{
    {
        .generator = Generator::Cloth,
        .name = "cloth",
        .keys = kSquareKeys,
        .defaults = {.mass = ClothShape{}.mass, .height = 10.0, .group_stiffness = 0.3, .link_stiffness = 1.0},
        .make_mesh = [](Settings s) { return make_cloth_mesh(s.cloth); },
        .make_particles =
            [](Settings s, const TriangleMesh& /*mesh*/) {
                return make_cloth_particles(s.cloth, s.group_stiffness, s.link_stiffness);
            },
        .length = [](Settings s) { return s.cloth.side; },
        .triangles = [](Settings s) { return double_faced_grid(s.cloth.vertices_per_side); },
    },
    {
        .generator = Generator::Curtain,
        .name = "curtain",
        .keys = kSquareKeys,
        .defaults = {.mass = CurtainShape{}.mass, .height = 0.0, .group_stiffness = 0.3, .link_stiffness = 1.0},
        .make_mesh = [](Settings s) { return make_curtain_mesh(s.curtain); },
        .make_particles =
            [](Settings s, const TriangleMesh& /*mesh*/) {
                return make_curtain_particles(s.curtain, s.group_stiffness, s.link_stiffness);
            },
        .length = [](Settings s) { return s.curtain.side; },
        .triangles = [](Settings s) { return double_faced_grid(s.curtain.vertices_per_side); },
    },
    {
        .generator = Generator::Fan,
        .name = "fan",
        .keys = kFanKeys,
        .defaults = {.mass = FanShape{}.mass, .height = 0.0, .group_stiffness = 0.3, .link_stiffness = 0.0},
        .make_mesh = [](Settings s) { return make_fan_mesh(s.fan); },
        .make_particles = [](Settings s,
                             const TriangleMesh& /*mesh*/) { return make_fan_particles(s.fan, s.group_stiffness); },
        .length = [](Settings s) { return 2.0 * s.fan.rim_radius; },
        .triangles = [](Settings s) { return std::size_t{s.fan.rim_vertices}; },
    },
    {
        .generator = Generator::Fish,
        .name = "fish",
        .keys = kRefinedKeys,
        // The mass of water in a fish of 0.3 m.
        .defaults = {.mass = 0.36, .height = 0.0, .group_stiffness = 0.6, .link_stiffness = 0.0},
        .make_mesh = [](Settings s) { return make_fish_mesh(s.fish); },
        .make_particles = nullptr,
        .length = [](Settings s) { return s.fish.length; },
        .triangles = [](Settings s) { return std::size_t{kFishTriangles} << (2U * s.fish.refinements); },
    },
    {
        .generator = Generator::Plate,
        .name = "plate",
        .keys = kBoxKeys,
        .defaults = {.mass = 1.0, .height = 0.0, .group_stiffness = 0.0, .link_stiffness = 0.0},
        .make_mesh = [](Settings s) { return make_plate_mesh(s.plate); },
        .make_particles = make_rigid,
        .length = [](Settings s) { return std::max({s.plate.size.x, s.plate.size.y, s.plate.size.z}); },
        .triangles = [](Settings s) { return plate_triangles(s.plate); },
    },
    {
        .generator = Generator::Rod,
        .name = "rod",
        .keys = kRodKeys,
        .defaults = {.mass = 1.0, .height = 0.0, .group_stiffness = 0.0, .link_stiffness = 0.0},
        .make_mesh = [](Settings s) { return make_rod_mesh(s.rod); },
        .make_particles = make_rigid,
        .length = [](Settings s) { return std::max(s.rod.length, s.rod.diameter); },
        .triangles = [](Settings /*s*/) { return rod_triangles(); },
    },
    {
        .generator = Generator::Block,
        .name = "block",
        .keys = kBoxKeys,
        // The mass of water in a block of the default size.
        .defaults = {.mass = 0.384, .height = 0.0, .group_stiffness = 0.6, .link_stiffness = 0.0},
        .make_mesh = [](Settings s) { return make_block_mesh(s.block); },
        .make_particles = nullptr,
        .length = [](Settings s) { return std::max({s.block.size.x, s.block.size.y, s.block.size.z}); },
        .triangles = [](Settings s) { return block_triangles(s.block); },
    },
    {
        .generator = Generator::Organ,
        .name = "organ",
        .keys = kRefinedKeys,
        // The mass of liver, 1060 kg/m^3, in an organ of 0.2 m.
        .defaults = {.mass = 0.7, .height = 0.0, .group_stiffness = 0.6, .link_stiffness = 0.0},
        .make_mesh = [](Settings s) { return make_organ_mesh(s.organ); },
        .make_particles = nullptr,
        .length = [](Settings s) { return s.organ.length; },
        .triangles = [](Settings s) { return organ_triangles(s.organ); },
    },
}};

constexpr bool is_in_order() {
    for (std::size_t i = 0; i < kGenerators.size(); ++i) {
        if (static_cast<std::size_t>(kGenerators[i].generator) != i) {
            return false;
        }
    }
    return true;
}
static_assert(is_in_order(), "generator_entry() indexes the table by the enumerator");

}  // namespace

std::span<const GeneratorEntry> generator_table() noexcept {
    return kGenerators;
}

const GeneratorEntry& generator_entry(Generator generator) noexcept {
    return kGenerators[static_cast<std::size_t>(generator)];
}

std::string generator_names() {
    std::string names;
    for (const GeneratorEntry& entry : kGenerators) {
        names += (names.empty() ? "" : ", ") + std::string(entry.name);
    }
    return names;
}

DeformableBody generate_body(const ModelSettings& settings, const Progress& progress) {
    const GeneratorEntry& entry = generator_entry(settings.generator);
    DeformableBody body;
    if (entry.make_particles == nullptr) {
        body = build_body(entry.make_mesh(settings), settings.builder, progress);
    } else {
        body.mesh = entry.make_mesh(settings);
        body.particles = entry.make_particles(settings, body.mesh);
        body.skin = skin_of_particles(body.mesh.vertices.size());
    }
    body.name = entry.name;
    return body;
}

}  // namespace haptic::sim
