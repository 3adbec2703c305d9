#include <haptic/sim/model_settings.hpp>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <glm/common.hpp>
#include <glm/gtc/quaternion.hpp>
#include <stdexcept>

#include <haptic/sim/mesh_file.hpp>
#include "model/model_file.hpp"
#include "dynamics/rotation.hpp"
#include <haptic/sim/skin.hpp>

namespace haptic::sim {
namespace {

// Beyond any scene that the solver is meant for; keeps a slip of the keyboard from becoming an hour of waiting.
constexpr Range kPositions{-1e4, 1e4};
constexpr Range kVelocities{-1e3, 1e3};
constexpr Range kUnitInterval{0.0, 1.0};
constexpr Range kSizes{0.0, 1e4};
constexpr Range kCompliances{0.0, 1e6};

Placement read_placement(const Config& config, const std::string& table) {
    Placement placement;
    placement.position = config.vec3(table + ".position", placement.position, kPositions);
    placement.orientation = config.quat(table + ".orientation", placement.orientation);
    placement.velocity = config.vec3(table + ".velocity", placement.velocity, kVelocities);
    return placement;
}

bool stays(const Placement& placement) {
    return placement.position == Vec3(0.0) && placement.orientation == Quat(1.0, 0.0, 0.0, 0.0) &&
           placement.velocity == Vec3(0.0);
}

Generator read_generator(const Config& config, const std::string& key) {
    static const std::vector<std::string> names{"cloth", "curtain", "fan", "fish", "plate", "rod"};  // as in Generator
    const std::string name = config.choice(key, names.front(), names);
    return static_cast<Generator>(std::find(names.begin(), names.end(), name) - names.begin());
}

/// What the mass, stiffnesses and height are if the scene says nothing.
struct Usual {
    double mass;
    double height;
    double group_stiffness;
    double link_stiffness;
};

Usual usual_of(Generator generator) {
    switch (generator) {
        case Generator::Cloth:
            return {ClothShape{}.mass, 10.0, 0.3, 1.0};
        case Generator::Curtain:
            return {CurtainShape{}.mass, 0.0, 0.3, 1.0};
        case Generator::Fan:
            return {FanShape{}.mass, 0.0, 0.3, 0.0};
        case Generator::Fish:
            break;
        case Generator::Plate:
        case Generator::Rod:
            return {1.0, 0.0, 0.0, 0.0};
    }
    return {0.36, 0.0, 0.6, 0.0};  // that of water, for a fish of 0.3 m
}

BuilderSettings read_builder(const Config& config, const std::string& table) {
    BuilderSettings builder;
    builder.particles = static_cast<std::size_t>(
        config.integer(table + ".particles_count", static_cast<std::int64_t>(builder.particles),
                       {0.0, static_cast<double>(BuilderSettings::kMostParticles)}));
    builder.neighbours =
        static_cast<std::size_t>(config.integer(table + ".neighbours", static_cast<std::int64_t>(builder.neighbours),
                                                {1.0, static_cast<double>(BuilderSettings::kMostNeighbours)}));
    builder.bridge = config.number(table + ".bridge", builder.bridge, kSizes);
    return builder;
}

Region read_region(const Config& config, const std::string& table) {
    Region region;
    for (const char* corner : {".low", ".high"}) {
        if (!config.has(table + corner)) {
            config.fail(table + corner, "is missing: a region is a box between low and high, [x, y, z] each");
        }
    }
    region.low = config.vec3(table + ".low", region.low, kPositions);
    region.high = config.vec3(table + ".high", region.high, kPositions);
    if (config.has(table + ".stiffness")) {
        region.stiffness = config.number(table + ".stiffness", 1.0, kUnitInterval);
    }
    region.fixed = config.flag(table + ".fixed", region.fixed);
    region.motion_times = config.numbers(table + ".motion_times", {}, {0.0, 1e6});
    const std::vector<double> offsets = config.numbers(table + ".motion_offsets", {}, kPositions);
    const std::size_t count = region.motion_times.size();
    if (offsets.size() != 3 * count) {
        config.fail(table + ".motion_offsets", "needs three numbers (x, y, z) for each of the " +
                                                   std::to_string(count) + " elements of motion_times, has " +
                                                   std::to_string(offsets.size()));
    }
    for (std::size_t i = 0; i < count; ++i) {
        if (i == 0 ? region.motion_times[0] != 0.0 : !(region.motion_times[i] > region.motion_times[i - 1])) {
            config.fail(table + ".motion_times", "must begin with 0 and increase from each element to the next");
        }
        region.motion_offsets.emplace_back(offsets[3 * i], offsets[3 * i + 1], offsets[3 * i + 2]);
    }
    region.motion_repeat = config.flag(table + ".motion_repeat", region.motion_repeat);
    return region;
}

bool is_in(const Vec3& p, const Region& region) {
    return p.x >= region.low.x && p.y >= region.low.y && p.z >= region.low.z &&  //
           p.x <= region.high.x && p.y <= region.high.y && p.z <= region.high.z;
}

/// The body stands where `placement` says.
void apply(const Region& region, std::size_t index, const Placement& placement, bool may_be_empty,
           DeformableBody& body) {
    ParticleModel& model = body.particles;
    const Mat3 scene_from_body = to_matrix(placement.orientation);
    const Mat3 body_from_scene = glm::transpose(scene_from_body);
    std::vector<std::uint8_t> inside(model.size(), 0);
    Motion motion{{}, region.motion_times, region.motion_offsets, region.motion_repeat};
    for (std::uint32_t i = 0; i < model.size(); ++i) {
        if (is_in(body_from_scene * (model.rest_position[i] - placement.position), region)) {
            inside[i] = 1;
            motion.particles.push_back(i);
        }
    }
    if (motion.particles.empty() && may_be_empty) {
        return;
    }
    if (motion.particles.empty()) {
        throw std::invalid_argument("region " + std::to_string(index) + " of the model \"" + body.name +
                                    "\" has no particle in it; low and high are in the body's own frame, in m");
    }
    if (region.stiffness) {
        for (Group& group : model.groups) {
            if (inside[group.centre] != 0) {
                group.stiffness = *region.stiffness;
            }
        }
    }
    const bool moves = !motion.times.empty();
    if (!region.fixed && !moves) {
        return;
    }
    for (const std::uint32_t i : motion.particles) {
        model.pinned[i] = 1;
    }
    // Nobody leads a particle twice.
    for (Motion& earlier : body.motions) {
        std::erase_if(earlier.particles, [&](std::uint32_t i) { return inside[i] != 0; });
    }
    std::erase_if(body.motions, [](const Motion& earlier) { return earlier.particles.empty(); });
    if (moves) {
        for (Vec3& offset : motion.offsets) {
            offset = scene_from_body * offset;
        }
        body.motions.push_back(std::move(motion));
    }
}

void apply_regions(const ModelSettings& settings, const Placement& stands, DeformableBody& body) {
    for (std::size_t k = 0; k < settings.regions.size(); ++k) {
        apply(settings.regions[k], k, stands, !settings.file.empty(), body);
    }
}

TriangleMesh generate_mesh(const ModelSettings& settings) {
    switch (settings.generator) {
        case Generator::Cloth:
            return make_cloth_mesh(settings.cloth);
        case Generator::Curtain:
            return make_curtain_mesh(settings.curtain);
        case Generator::Fan:
            return make_fan_mesh(settings.fan);
        case Generator::Fish:
            break;
        case Generator::Plate:
            return make_plate_mesh(settings.plate);
        case Generator::Rod:
            return make_rod_mesh(settings.rod);
    }
    return make_fish_mesh(settings.fish);
}

/// Where what is generated is made: the cloth in its place, the others about the origin.
DeformableBody generate(const ModelSettings& settings) {
    DeformableBody body;
    switch (settings.generator) {
        case Generator::Cloth:
            body.name = "cloth";
            body.mesh = make_cloth_mesh(settings.cloth);
            body.particles = make_cloth_particles(settings.cloth, settings.group_stiffness, settings.link_stiffness);
            break;
        case Generator::Curtain:
            body.name = "curtain";
            body.mesh = make_curtain_mesh(settings.curtain);
            body.particles =
                make_curtain_particles(settings.curtain, settings.group_stiffness, settings.link_stiffness);
            break;
        case Generator::Fan:
            body.name = "fan";
            body.mesh = make_fan_mesh(settings.fan);
            body.particles = make_fan_particles(settings.fan, settings.group_stiffness);
            break;
        case Generator::Fish:
            body = build_body(make_fish_mesh(settings.fish), settings.builder);
            body.name = "fish";
            return body;
        case Generator::Plate:
        case Generator::Rod:
            body.name = settings.generator == Generator::Plate ? "plate" : "rod";
            body.mesh = generate_mesh(settings);
            body.particles = make_rigid_particles(body.mesh, settings.mass);
            break;
    }
    body.skin = skin_of_particles(body.mesh.vertices.size());
    return body;
}

double generated_length(const ModelSettings& settings) {
    switch (settings.generator) {
        case Generator::Cloth:
            return settings.cloth.side;
        case Generator::Curtain:
            return settings.curtain.side;
        case Generator::Fan:
            return 2.0 * settings.fan.rim_radius;
        case Generator::Fish:
            break;
        case Generator::Plate:
            return std::max({settings.plate.size.x, settings.plate.size.y, settings.plate.size.z});
        case Generator::Rod:
            return std::max(settings.rod.length, settings.rod.diameter);
    }
    return settings.fish.length;
}

TriangleMesh mesh_of_file(const ModelSettings& settings) {
    MeshFileSettings reading;
    if (settings.file_scale > 0.0) {
        reading.scale = settings.file_scale;
        return load_mesh(settings.file, reading);
    }
    TriangleMesh mesh = load_mesh(settings.file, reading);
    Vec3 low = mesh.vertices.front();
    Vec3 high = low;
    for (const Vec3& p : mesh.vertices) {
        low = glm::min(low, p);
        high = glm::max(high, p);
    }
    const Vec3 size = high - low;
    const double scale = generated_length(settings) / std::max({size.x, size.y, size.z});
    for (Vec3& p : mesh.vertices) {
        p = scale * (p - 0.5 * (low + high));
    }
    return mesh;
}

void set_compliances(const ModelSettings& settings, ParticleModel& model) {
    for (Group& group : model.groups) {
        group.compliance = settings.group_compliance;
    }
    for (Link& link : model.links) {
        link.compliance = settings.link_compliance;
    }
}

/// The cloth as the thesis' scene has it, to the last bit: it is made where it falls from, not moved there.
bool is_made_in_place(const ModelSettings& settings) {
    return settings.generator == Generator::Cloth && settings.file.empty() && settings.particles.empty();
}

}  // namespace

DeformableBody make_body(const ModelSettings& settings) {
    ModelSettings about_origin = settings;
    about_origin.cloth.centre = Vec3(0.0);
    about_origin.cloth.orientation = Quat(1.0, 0.0, 0.0, 0.0);
    DeformableBody body;
    if (!settings.particles.empty()) {
        const TriangleMesh mesh = settings.file.empty() ? generate_mesh(about_origin) : mesh_of_file(settings);
        body = read_model_file(Config::load(settings.particles), mesh, settings.builder.bridge);
    } else if (!settings.file.empty()) {
        body = build_body(mesh_of_file(settings), settings.builder);
        body.name = std::filesystem::path(settings.file).stem().string();
    } else {
        body = generate(about_origin);
    }
    if (settings.particles.empty()) {
        set_compliances(settings, body.particles);
    }
    apply_regions(settings, Placement{}, body);
    return body;
}

ModelSettings read_model(const Config& config, const std::string& table) {
    const auto key = [&table](const char* name) { return table + "." + name; };
    ModelSettings model;
    model.generator = read_generator(config, key("generator"));
    model.file = config.text(key("file"), "");
    // Who puts a mesh in the place of a generated one wants it to fit; who names no generator means the file's own
    // size.
    model.file_scale = config.number(key("scale"), config.has(key("generator")) ? 0.0 : 1.0, {0.0, 1e6});
    model.particles = config.text(key("particles"), "");
    const Usual usual = usual_of(model.generator);
    ClothShape& cloth = model.cloth;
    cloth.vertices_per_side =
        static_cast<std::uint32_t>(config.integer(key("vertices_per_side"), cloth.vertices_per_side, {2.0, 257.0}));
    const double side = model.generator == Generator::Curtain ? model.curtain.side : cloth.side;
    cloth.side = config.number(key("side"), side, {1e-3, 100.0});
    cloth.mass = config.number(key("mass"), usual.mass, {1e-6, 1e3});
    const double height = config.number(key("height"), usual.height, kPositions);
    const double shift = config.number(key("shift"), 0.0, kPositions);
    const Vec3 aside = config.vec3(key("offset"), Vec3(0.0), kPositions);
    cloth.centre = aside + Vec3(0.0, height + shift, 0.0);
    cloth.orientation = config.quat(key("orientation"), cloth.orientation);
    model.placement = {cloth.centre, cloth.orientation, Vec3(0.0)};
    model.velocity = config.vec3(key("velocity"), model.velocity, kVelocities);
    // A compliance says how soft a constraint is; a stiffness below 1 would soften it once more.
    model.group_compliance = config.number(key("group_compliance"), model.group_compliance, kCompliances);
    model.link_compliance = config.number(key("link_compliance"), model.link_compliance, kCompliances);
    model.group_stiffness = config.number(key("group_stiffness"),
                                          model.group_compliance > 0.0 ? 1.0 : usual.group_stiffness, kUnitInterval);
    model.link_stiffness =
        config.number(key("link_stiffness"), model.link_compliance > 0.0 ? 1.0 : usual.link_stiffness, kUnitInterval);

    model.curtain.vertices_per_side = cloth.vertices_per_side;
    model.curtain.side = cloth.side;
    model.curtain.mass = model.fan.mass = cloth.mass;
    model.fan.rim_vertices =
        static_cast<std::uint32_t>(config.integer(key("rim_vertices"), model.fan.rim_vertices, {3.0, 4096.0}));
    model.fan.rim_radius = config.number(key("rim_radius"), model.fan.rim_radius, {1e-3, 100.0});
    model.fish.length = config.number(
        key("length"), model.generator == Generator::Rod ? model.rod.length : model.fish.length, {1e-3, 100.0});
    model.fish.refinements =
        static_cast<std::uint32_t>(config.integer(key("refinements"), model.fish.refinements, {0.0, 5.0}));
    model.plate.size = config.vec3(key("size"), model.plate.size, {1e-4, 100.0});
    model.plate.cells = static_cast<std::uint32_t>(config.integer(key("cells"), model.plate.cells, {1.0, 256.0}));
    model.rod.length = model.fish.length;
    model.rod.diameter = config.number(key("diameter"), model.rod.diameter, {1e-4, 100.0});
    model.mass = cloth.mass;
    model.builder = read_builder(config, table);
    model.builder.mass = cloth.mass;
    model.builder.group_stiffness = model.group_stiffness;
    model.builder.link_stiffness = model.link_stiffness;
    for (std::size_t k = 0; k < config.tables(key("regions")); ++k) {
        model.regions.push_back(read_region(config, key("regions.") + std::to_string(k)));
    }
    const std::size_t copies = config.tables(key("copies"));
    if (copies > 0) {
        model.copies.clear();
        for (std::size_t k = 0; k < copies; ++k) {
            model.copies.push_back(read_placement(config, key("copies.") + std::to_string(k)));
        }
    }
    return model;
}

std::size_t expected_triangles(const ModelSettings& settings) {
    if (!settings.file.empty()) {
        return 0;
    }
    const auto grid = [](std::size_t side) { return 4 * (side - 1) * (side - 1); };
    std::size_t triangles = 0;
    switch (settings.generator) {
        case Generator::Cloth:
            triangles = grid(settings.cloth.vertices_per_side);
            break;
        case Generator::Curtain:
            triangles = grid(settings.curtain.vertices_per_side);
            break;
        case Generator::Fan:
            triangles = settings.fan.rim_vertices;
            break;
        case Generator::Fish:
            triangles = std::size_t{kFishTriangles} << (2U * settings.fish.refinements);
            break;
        case Generator::Plate:
            triangles = plate_triangles(settings.plate);
            break;
        case Generator::Rod:
            triangles = rod_triangles();
            break;
    }
    return triangles * settings.copies.size();
}

std::vector<DeformableBody> make_bodies(const ModelSettings& settings) {
    DeformableBody body;
    if (is_made_in_place(settings)) {
        body = generate(settings);
        set_compliances(settings, body.particles);
        apply_regions(settings, {settings.cloth.centre, settings.cloth.orientation, Vec3(0.0)}, body);
    } else {
        body = make_body(settings);
        place(body, settings.placement);
    }
    for (std::size_t i = 0; i < body.particles.size(); ++i) {
        body.particles.velocity[i] = body.particles.pinned[i] != 0 ? Vec3(0.0) : settings.velocity;
    }
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
