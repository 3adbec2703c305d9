#include "haptic/sim/model_settings.hpp"

#include <algorithm>
#include <cstdint>

#include "haptic/sim/skin.hpp"

namespace haptic::sim {
namespace {

// Beyond any scene that the solver is meant for; keeps a slip of the keyboard from becoming an hour of waiting.
constexpr Range kPositions{-1e4, 1e4};
constexpr Range kVelocities{-1e3, 1e3};
constexpr Range kUnitInterval{0.0, 1.0};

Placement read_placement(const Config& config, const std::string& table) {
    Placement placement;
    placement.position = config.vec3(table + ".position", placement.position, kPositions);
    placement.orientation = config.quat(table + ".orientation", placement.orientation);
    placement.velocity = config.vec3(table + ".velocity", placement.velocity, kVelocities);
    return placement;
}

bool stays(const Placement& placement) {
    return placement.position == Vec3(0.0) && placement.orientation == Quat(1.0, 0.0, 0.0, 0.0);
}

}  // namespace

ModelSettings read_model(const Config& config, const std::string& table) {
    const auto key = [&table](const char* name) { return table + "." + name; };
    ModelSettings model;
    (void)config.choice(key("generator"), "cloth", {"cloth"});
    ClothShape& cloth = model.cloth;
    cloth.vertices_per_side =
        static_cast<std::uint32_t>(config.integer(key("vertices_per_side"), cloth.vertices_per_side, {2.0, 257.0}));
    cloth.side = config.number(key("side"), cloth.side, {1e-3, 100.0});
    cloth.mass = config.number(key("mass"), cloth.mass, {1e-6, 1e3});
    const double height = config.number(key("height"), 10.0, kPositions);
    const double shift = config.number(key("shift"), 0.0, kPositions);
    const Vec3 aside = config.vec3(key("offset"), Vec3(0.0), kPositions);
    cloth.centre = aside + Vec3(0.0, height + shift, 0.0);
    cloth.orientation = config.quat(key("orientation"), cloth.orientation);
    model.velocity = config.vec3(key("velocity"), model.velocity, kVelocities);
    model.group_stiffness = config.number(key("group_stiffness"), model.group_stiffness, kUnitInterval);
    model.link_stiffness = config.number(key("link_stiffness"), model.link_stiffness, kUnitInterval);
    const std::size_t copies = config.tables(key("copies"));
    if (copies > 0) {
        model.copies.clear();
        for (std::size_t k = 0; k < copies; ++k) {
            model.copies.push_back(read_placement(config, key("copies.") + std::to_string(k)));
        }
    }
    return model;
}

std::vector<DeformableBody> make_bodies(const ModelSettings& settings) {
    DeformableBody body;
    body.name = "cloth";
    body.mesh = make_cloth_mesh(settings.cloth);
    body.particles = make_cloth_particles(settings.cloth, settings.group_stiffness, settings.link_stiffness);
    body.skin = skin_of_particles(body.mesh.vertices.size());
    std::fill(body.particles.velocity.begin(), body.particles.velocity.end(), settings.velocity);
    std::vector<DeformableBody> bodies;
    for (const Placement& placement : settings.copies) {
        bodies.push_back(body);
        if (!stays(placement)) {
            place(bodies.back(), placement);
        }
    }
    return bodies;
}

}  // namespace haptic::sim
