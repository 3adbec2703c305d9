#include "model/model_keys.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "haptic/setting.hpp"
#include "haptic/sim/model_settings.hpp"
#include "model/generator_table.hpp"
#include "model/material_settings.hpp"
#include "model/model_ranges.hpp"

namespace haptic::sim {
namespace {

constexpr Range kLengths{1e-3, 100.0};  // m
constexpr Range kForces{-1e6, 1e6};     // N
constexpr Range kPressures{-1e9, 1e9};  // Pa
constexpr std::size_t kNeighboursOfElements = 16;
// With fewer an element does not know how its body deforms: with 3 it has half the modulus, with 2 a fiftieth.
constexpr std::size_t kFewestNeighboursOfElements = 6;

/// The keys of [model] where several shapes share one, or one member is computed from several.
struct ModelKeys {
    ModelSettings model;
    std::uint32_t vertices_per_side = ClothShape{}.vertices_per_side;
    double side = 0.0;    // m
    double length = 0.0;  // m
    std::uint32_t refinements = 0;
    Vec3 size{0.0};  // m
    std::uint32_t cells = 0;
    double height = 0.0;  // m
    double shift = 0.0;   // m
    Vec3 offset{0.0};     // m
    Quat orientation{1.0, 0.0, 0.0, 0.0};
};

struct RegionKeys {
    Region region;
    std::vector<double> motion_offsets;  // m, x, y, z for each time
};

std::vector<std::pair<std::string, Generator>> generator_choices() {
    std::vector<std::pair<std::string, Generator>> choices;
    for (const GeneratorEntry& entry : generator_table()) {
        choices.emplace_back(entry.name, entry.generator);
    }
    return choices;
}

const SettingTable<ModelKeys>& model_table() {
    using S = ModelKeys;
    using V = SettingValues<S>;
    static const SettingTable<S> table{
        "model",
        "The body. It is made by a generator, or from a mesh file.",
        {
            {{.key = "generator", .meaning = "Shape of the body. Plate and rod are rigid."},
             V::choice([](S& s) -> auto& { return s.model.generator; }, generator_choices())},
            {{.key = "file",
              .meaning = "Mesh file (OBJ, PLY, STL or glTF) that takes the place of the generated mesh. Empty: none."},
             V::text([](S& s) -> auto& { return s.model.file; })},
            {{.key = "scale",
              .unit = "m",
              .default_note = "1, or 0 if generator is given",
              .meaning = "Metres per unit of the mesh file. 0: centred, and as long as the generated body."},
             V::number([](S& s) -> auto& { return s.model.file_scale; }, {0.0, 1e6})},
            {{.key = "max_edge",
              .unit = "m",
              .meaning = "Longest edge of a mesh file's triangles; longer ones are divided, so that a coarse mesh can "
                         "bend. 0: as in the file."},
             V::number([](S& s) -> auto& { return s.model.max_edge; }, kSizes)},
            {{.key = "particles",
              .meaning = "Particle file, as written by host-sim model, whose particles are used. Empty: none."},
             V::text([](S& s) -> auto& { return s.model.particles; })},
            {{.key = "vertices_per_side", .meaning = "Vertices along each side of a cloth or curtain."},
             V::integer(&S::vertices_per_side, {2, 512})},
            {{.key = "side",
              .unit = "m",
              .default_note = "that of the generator",
              .meaning = "Side of a cloth or curtain."},
             V::number(&S::side, kLengths)},
            {{.key = "mass",
              .unit = "kg",
              .default_note = "that of the generator",
              .meaning = "Mass of the whole body, without a material."},
             V::number([](S& s) -> auto& { return s.model.mass; }, {1e-6, 1e3})},
            {{.key = "height",
              .unit = "m",
              .default_note = "10 for a cloth, else 0",
              .meaning = "Height of the body's origin at the start."},
             V::number(&S::height, kPositions)},
            {{.key = "shift",
              .unit = "m",
              .meaning = "Added to the height. Shifts the moment of contact within a step."},
             V::number(&S::shift, kPositions)},
            {{.key = "offset", .unit = "m", .meaning = "Added to the position of the body's origin."},
             V::vector(&S::offset, kPositions)},
            {{.key = "orientation",
              .meaning = "Rotation of the body (w, x, y, z). A cloth without rotation lies in the x-z plane."},
             V::rotation(&S::orientation)},
            {{.key = "velocity", .unit = "m/s", .meaning = "Velocity at the start."},
             V::vector([](S& s) -> auto& { return s.model.velocity; }, kVelocities)},
            {{.key = "group_stiffness",
              .default_note = "that of the generator, or 1 with a group_compliance",
              .meaning = "Stiffness of shape matching without a material, from 0, limp, to 1, rigid."},
             V::number([](S& s) -> auto& { return s.model.group_stiffness; }, kUnitInterval)},
            {{.key = "link_stiffness",
              .default_note = "that of the generator, or 1 with a link_compliance",
              .meaning = "Stiffness of the distance constraints between neighbouring particles without a material. 0: "
                         "none."},
             V::number([](S& s) -> auto& { return s.model.link_stiffness; }, kUnitInterval)},
            {{.key = "group_compliance",
              .unit = "s^2",
              .meaning = "Compliance of the shape-matching groups without a material (XPBD): displacement per "
                         "acceleration. 0: off."},
             V::number([](S& s) -> auto& { return s.model.group_compliance; }, kCompliances)},
            {{.key = "link_compliance",
              .unit = "m/N",
              .meaning = "Compliance of the distance constraints without a material (XPBD), which become springs. 0: "
                         "off."},
             V::number([](S& s) -> auto& { return s.model.link_compliance; }, kCompliances)},
            {{.key = "particles_count",
              .meaning = "Number of particles of a block, fish, organ or mesh file. 0: one per vertex, for open "
                         "meshes and bodies without a material."},
             V::integer([](S& s) -> auto& { return s.model.builder.particles; },
                        {0.0, static_cast<double>(BuilderSettings::kMaxParticles)})},
            {{.key = "neighbours",
              .default_note = "8, or 16 with a material",
              .meaning = "Neighbours that form a group with each particle of a block, fish, organ or mesh file."},
             V::integer([](S& s) -> auto& { return s.model.builder.neighbours; },
                        {1.0, static_cast<double>(BuilderSettings::kMaxNeighbours)})},
            {{.key = "bridge",
              .unit = "m",
              .meaning = "Distance over which disconnected parts of a mesh are joined. 0: the spacing of the "
                         "particles."},
             V::number([](S& s) -> auto& { return s.model.builder.bridge; }, kSizes)},
            {{.key = "length",
              .unit = "m",
              .default_note = "0.3 for a fish, 0.2 for an organ, 1 for a rod",
              .meaning = "Length of a fish, an organ or a rod along x."},
             V::number(&S::length, kLengths)},
            {{.key = "refinements",
              .meaning = "Number of times that each triangle of a fish or an organ is divided into four."},
             V::integer(&S::refinements, {0, 5})},
            {{.key = "rim_vertices", .meaning = "Vertices on the rim of a fan."},
             V::integer([](S& s) -> auto& { return s.model.fan.rim_vertices; }, {3, 4096})},
            {{.key = "rim_radius", .unit = "m", .meaning = "Radius of a fan."},
             V::number([](S& s) -> auto& { return s.model.fan.rim_radius; }, kLengths)},
            {{.key = "size",
              .unit = "m",
              .default_note = "[0.12, 0.04, 0.08] for a block, [1, 0.05, 1] for a plate",
              .meaning = "Size of a block or a plate along x, y and z."},
             V::vector(&S::size, {1e-4, 100.0})},
            {{.key = "cells",
              .default_note = "12 for a block, 8 for a plate",
              .meaning = "Cells of a block along its longest side, or of a plate along x, and as many along z."},
             V::integer(&S::cells, {1, 256})},
            {{.key = "diameter", .unit = "m", .meaning = "Diameter of a rod."},
             V::number([](S& s) -> auto& { return s.model.rod.diameter; }, {1e-4, 100.0})},
        }};
    return table;
}

const SettingTable<RegionKeys>& region_table() {
    using S = RegionKeys;
    using V = SettingValues<S>;
    static const SettingTable<S> table{
        "model.regions",
        "Particles whose rest position is in a box, in the body's own frame. If regions overlap, the last one counts; "
        "loads add up.",
        {
            {{.key = "low", .unit = "m", .required = true, .meaning = "Lower corner of the box."},
             V::vector([](S& s) -> auto& { return s.region.low; }, kPositions)},
            {{.key = "high", .unit = "m", .required = true, .meaning = "Upper corner of the box."},
             V::vector([](S& s) -> auto& { return s.region.high; }, kPositions)},
            {{.key = "stiffness",
              .default_note = "that of the body",
              .meaning = "Stiffness of the shape-matching groups of these particles, of a body without a material."},
             V::optional_number([](S& s) -> auto& { return s.region.stiffness; }, kUnitInterval)},
            {{.key = "fixed", .meaning = "Whether these particles stay where they are."},
             V::flag([](S& s) -> auto& { return s.region.fixed; })},
            {{.key = "motion_times",
              .unit = "s",
              .meaning = "Times of a prescribed motion, increasing from 0. Empty: no prescribed motion."},
             V::numbers([](S& s) -> auto& { return s.region.motion_times; }, {0.0, 1e6})},
            {{.key = "motion_offsets", .unit = "m", .meaning = "Displacement x, y, z for each of motion_times."},
             V::numbers(&S::motion_offsets, kPositions)},
            {{.key = "motion_repeat", .meaning = "Whether the motion starts again after its last time."},
             V::flag([](S& s) -> auto& { return s.region.motion_repeat; })},
            {{.key = "force",
              .unit = "N",
              .meaning = "Force on the free particles together, in the scene's axes, divided among them by mass."},
             V::vector([](S& s) -> auto& { return s.region.force; }, kForces)},
            {{.key = "pressure",
              .unit = "Pa",
              .meaning = "Pressure on the triangles of the surface that have all corners in the box at rest. It acts "
                         "inwards, against the normal of the present surface, which it follows; if it is negative, it "
                         "pulls."},
             V::number([](S& s) -> auto& { return s.region.pressure; }, kPressures)},
            {{.key = "load_times",
              .unit = "s",
              .meaning = "Times of load_factors, increasing from 0. Empty: force and pressure are constant."},
             V::numbers([](S& s) -> auto& { return s.region.load_times; }, {0.0, 1e6})},
            {{.key = "load_factors",
              .meaning = "Factor of force and pressure at each of load_times, linear between them."},
             V::numbers([](S& s) -> auto& { return s.region.load_factors; }, {-1e6, 1e6})},
            {{.key = "load_repeat", .meaning = "Whether the load starts again after the last of load_times."},
             V::flag([](S& s) -> auto& { return s.region.load_repeat; })},
        },
        SectionKind::Repeated};
    return table;
}

const SettingTable<Placement>& copy_table() {
    using S = Placement;
    using V = SettingValues<S>;
    static const SettingTable<S> table{
        "model.copies",
        "Copies of the body. Without any, the body exists once.",
        {
            {{.key = "position", .unit = "m", .meaning = "Added to the position of the body."},
             V::vector(&S::position, kPositions)},
            {{.key = "orientation", .meaning = "Rotation (w, x, y, z), applied to the body with its rotation."},
             V::rotation(&S::orientation)},
            {{.key = "velocity", .unit = "m/s", .meaning = "Added to the velocity of the body."},
             V::vector(&S::velocity, kVelocities)},
        },
        SectionKind::Repeated};
    return table;
}

double default_length(const ModelSettings& model) {
    switch (model.generator) {
        case Generator::Organ:
            return model.organ.length;
        case Generator::Rod:
            return model.rod.length;
        default:
            return model.fish.length;
    }
}

/// Sets the defaults of the keys. They depend on the generator and on whether constraints are compliant.
void set_defaults(ModelKeys& keys) {
    ModelSettings& model = keys.model;
    const GeneratorDefaults& defaults = generator_entry(model.generator).defaults;
    model.mass = defaults.mass;
    keys.height = defaults.height;
    keys.side = model.generator == Generator::Curtain ? model.curtain.side : model.cloth.side;
    keys.length = default_length(model);
    keys.size = model.generator == Generator::Block ? model.block.size : model.plate.size;
    keys.cells = model.generator == Generator::Block ? model.block.cells : model.plate.cells;
    // A compliance already makes a constraint soft; a stiffness below 1 would soften it twice.
    model.group_stiffness = model.group_compliance > 0.0 ? 1.0 : defaults.group_stiffness;
    model.link_stiffness = model.link_compliance > 0.0 ? 1.0 : defaults.link_stiffness;
}

/// Throws ConfigError if the elements of a material had too little to be made of.
void check_elements(const Config& config, const std::string& table, const BuilderSettings& builder) {
    if (builder.neighbours < kFewestNeighboursOfElements) {
        config.fail(table + ".neighbours", "is " + std::to_string(builder.neighbours) +
                                               "; with a material it must be " +
                                               std::to_string(kFewestNeighboursOfElements) + " or more");
    }
    if (builder.particles > 0 && builder.particles <= kFewestNeighboursOfElements) {
        config.fail(table + ".particles_count", "is " + std::to_string(builder.particles) +
                                                    "; a body with a material needs more than " +
                                                    std::to_string(kFewestNeighboursOfElements) +
                                                    ", or, of an open mesh, 0 for one at each vertex");
    }
}

ModelKeys read_model_keys(const Config& config, const std::string& table) {
    ModelKeys keys;
    for (const char* key : {"generator", "group_compliance", "link_compliance"}) {
        model_table().read_key(config, table, key, keys);
    }
    set_defaults(keys);
    // A mesh that takes the place of a generated one is made to fit; a mesh alone has the size of its file.
    // The elements of a material need more neighbours than shape matching.
    const bool has_material = read_material(config, table + ".material").has_value();
    if (has_material) {
        keys.model.builder.neighbours = kNeighboursOfElements;
    }
    keys.model.file_scale = config.has(table + ".generator") ? 0.0 : 1.0;
    model_table().read(config, table, keys);
    if (has_material) {
        check_elements(config, table, keys.model.builder);
    }
    return keys;
}

/// Gives each shape the keys that it shares with others.
ModelSettings with_shapes(const ModelKeys& keys) {
    ModelSettings model = keys.model;
    model.cloth.vertices_per_side = model.curtain.vertices_per_side = keys.vertices_per_side;
    model.cloth.side = model.curtain.side = keys.side;
    model.cloth.mass = model.curtain.mass = model.fan.mass = model.builder.mass = model.mass;
    model.cloth.centre = keys.offset + Vec3(0.0, keys.height + keys.shift, 0.0);
    model.cloth.orientation = keys.orientation;
    model.placement = {model.cloth.centre, keys.orientation, Vec3(0.0)};
    model.fish.length = model.organ.length = model.rod.length = keys.length;
    model.fish.refinements = model.organ.refinements = keys.refinements;
    model.block.size = model.plate.size = keys.size;
    model.block.cells = model.plate.cells = keys.cells;
    model.builder.group_stiffness = model.group_stiffness;
    model.builder.link_stiffness = model.link_stiffness;
    return model;
}

/// Refuses times that do not increase from 0.
void check_times(const Config& config, const std::string& key, const std::vector<double>& times) {
    for (std::size_t i = 0; i < times.size(); ++i) {
        if (i == 0 ? times[0] != 0.0 : !(times[i] > times[i - 1])) {
            config.fail(key, "must start at 0 and increase from each element to the next");
        }
    }
}

void check_load(const Config& config, const std::string& table, const Region& region) {
    check_times(config, table + ".load_times", region.load_times);
    if (region.load_factors.size() != region.load_times.size()) {
        config.fail(table + ".load_factors",
                    "needs one number for each of the " + std::to_string(region.load_times.size()) +
                        " elements of load_times, has " + std::to_string(region.load_factors.size()));
    }
    if (!region.load_times.empty() && !config.has(table + ".force") && !config.has(table + ".pressure")) {
        config.fail(table + ".load_times", "has no load to vary; give the region a force or a pressure");
    }
    if (region.load_repeat && region.load_times.empty()) {
        config.fail(table + ".load_repeat", "has no course to repeat; give load_times and load_factors, or remove it");
    }
}

/// Refuses a region that says nothing of what is in its box.
void check_purpose(const Config& config, const std::string& table) {
    constexpr std::array purposes{"stiffness", "material", "fixed", "motion_times", "force", "pressure"};
    const auto is_given = [&](const char* key) { return config.has(table + "." + key); };
    if (std::ranges::none_of(purposes, is_given)) {
        config.fail(table,
                    "has no effect; give it fixed, motion_times, force, pressure, a material or a stiffness, or remove "
                    "it");
    }
}

void check_box(const Config& config, const std::string& table, const Region& region) {
    for (int c = 0; c < 3; ++c) {
        if (region.low[c] > region.high[c]) {
            config.fail(table + ".low", std::string("is above high along ") + "xyz"[c] + ": " +
                                            toml_value(region.low[c]) + " > " + toml_value(region.high[c]));
        }
    }
}

Region read_region(const Config& config, const std::string& table) {
    for (const char* corner : {".low", ".high"}) {
        if (!config.has(table + corner)) {
            config.fail(table + corner, "is missing: a region is a box between low and high, [x, y, z] each");
        }
    }
    RegionKeys keys;
    region_table().read(config, table, keys);
    Region region = std::move(keys.region);
    region.place = config.place(table);
    check_box(config, table, region);
    region.material = read_material(config, table + ".material");
    const std::vector<double>& offsets = keys.motion_offsets;
    const std::size_t count = region.motion_times.size();
    if (offsets.size() != 3 * count) {
        config.fail(table + ".motion_offsets", "needs three numbers (x, y, z) for each of the " +
                                                   std::to_string(count) + " elements of motion_times, has " +
                                                   std::to_string(offsets.size()));
    }
    check_times(config, table + ".motion_times", region.motion_times);
    for (std::size_t i = 0; i < count; ++i) {
        region.motion_offsets.emplace_back(offsets[3 * i], offsets[3 * i + 1], offsets[3 * i + 2]);
    }
    if (region.motion_repeat && count == 0) {
        config.fail(table + ".motion_repeat",
                    "has no motion to repeat; give motion_times and motion_offsets, or remove it");
    }
    check_load(config, table, region);
    check_purpose(config, table);
    return region;
}

}  // namespace

ModelSettings read_model(const Config& config, const std::string& table) {
    ModelSettings model = with_shapes(read_model_keys(config, table));
    model.place = config.place(table);
    model.file = config.input_file(table + ".file", model.file);
    model.particles = config.input_file(table + ".particles", model.particles);
    model.material = read_material(config, table + ".material");
    if (model.material && is_rigid(model)) {
        config.fail(table + ".material", "does not apply to plates and rods, which are rigid");
    }
    if (model.material) {
        for (const char* key : {"mass", "group_stiffness", "link_stiffness", "group_compliance", "link_compliance"}) {
            if (config.has(table + "." + key)) {
                config.fail(table + "." + key,
                            "does not apply to a body with a material, which says how heavy and "
                            "how stiff it is; remove one of them");
            }
        }
    }
    const std::string regions = table + ".regions";
    for (std::size_t k = 0; k < config.tables(regions); ++k) {
        const std::string region = regions + "." + std::to_string(k);
        model.regions.push_back(read_region(config, region));
        if (model.regions.back().stiffness && model.material) {
            config.fail(region + ".stiffness",
                        "does not apply to a body with a material; give the region a material instead");
        }
        if (model.material && !model.regions.back().material && config.has(region + ".material")) {
            config.fail(region + ".material", "cannot be \"none\" in a body with a material; name another one");
        }
        // With the material "none" the body is one without, whatever its regions have.
        if (model.regions.back().material && !config.has(table + ".material")) {
            config.fail(region + ".material",
                        "needs a body with a material, from which the region differs; give it one "
                        "with " +
                            table + ".material");
        }
    }
    const std::string copies = table + ".copies";
    if (const std::size_t count = config.tables(copies); count > 0) {
        model.copies.assign(count, Placement{});
        for (std::size_t k = 0; k < count; ++k) {
            copy_table().read(config, copies + "." + std::to_string(k), model.copies[k]);
        }
    }
    return model;
}

void add_model_reference(SettingReference& reference) {
    ModelKeys keys;
    set_defaults(keys);
    add_section(reference, model_table().describe(keys));
    add_section(reference, material_section());
    add_section(reference, region_table().describe());
    add_section(reference,
                {.path = "model.regions.material",
                 .kind = SectionKind::Optional,
                 .meaning = "Material of the body about these particles: the name of a material, or the keys "
                            "of [model.material]. What is not given is that of the body.",
                 .settings = {},
                 .same_keys_as = "model.material",
                 .or_text = true});
    add_section(reference, copy_table().describe());
    add_section(reference, {"objects",
                            SectionKind::Repeated,
                            "Further bodies, each with the keys of [model], [[objects.regions]] and "
                            "[[objects.copies]].",
                            {},
                            "model"});
}

}  // namespace haptic::sim
