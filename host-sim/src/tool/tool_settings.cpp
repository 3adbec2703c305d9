#include "tool/tool_settings.hpp"

#include "haptic/sim/model_builder.hpp"
#include "haptic/sim/tool_model.hpp"

namespace haptic::sim {
namespace {

constexpr Range kLengths{1e-5, 100.0};      // m
constexpr Range kPositions{-100.0, 100.0};  // m
constexpr Range kUnitInterval{0.0, 1.0};

const SettingTable<ToolSettings>& tool_table() {
    using S = ToolSettings;
    using V = SettingValues<S>;
    static const SettingTable<S> table{
        "tool",
        "The tool in the hand. Without this table the tool is one sphere of proxy.radius.",
        {
            {{.key = "generator", .meaning = "Shape of the tool."},
             V::choice(&S::shape, {{"sphere", ToolShape::Sphere},
                                   {"hand", ToolShape::Hand},
                                   {"rod", ToolShape::Rod},
                                   {"probe", ToolShape::Probe}})},
            {{.key = "length",
              .unit = "m",
              .meaning = "Length of a hand, rod or probe, and of a mesh file without scale."},
             V::number(&S::length, kLengths)},
            {{.key = "thickness", .unit = "m", .meaning = "Diameter of a rod, or of a probe's shaft."},
             V::number(&S::thickness, kLengths)},
            {{.key = "ball_radius",
              .unit = "m",
              .default_note = "0.02, or proxy.radius for a sphere",
              .meaning = "Radius of a sphere, or of the ball at the end of a probe."},
             V::number(&S::ball_radius, kLengths)},
            {{.key = "file",
              .meaning = "Mesh file (OBJ, PLY, STL or glTF) that takes the place of the generated mesh. Empty: none."},
             V::text(&S::file)},
            {{.key = "scale",
              .unit = "m",
              .meaning = "Metres per unit of the mesh file. 0: centred, and as long as length."},
             V::number(&S::file_scale, {0.0, 1e6})},
            {{.key = "spheres", .meaning = "Number of spheres that cover the tool. 0: as many as cover_error needs."},
             V::integer(&S::spheres, {0.0, static_cast<double>(ToolSettings::kMaxSpheres)})},
            {{.key = "radius", .unit = "m", .meaning = "Radius of each sphere. 0: each has its own."},
             V::number(&S::radius, {0.0, kLengths.max})},
            {{.key = "cover_error",
              .unit = "m",
              .meaning = "Distance by which the mesh may stand out of the spheres, or the spheres out of the mesh, if "
                         "spheres is 0. 0: 37 spheres for a hand, else 0.02 of the longest side."},
             V::number(&S::cover_error, {0.0, kLengths.max})},
            {{.key = "close_gaps", .meaning = "Whether to add spheres where neighbouring spheres leave a gap."},
             V::flag(&S::close_gaps)},
            {{.key = "neighbours", .meaning = "Neighbours that form an elastic element with each particle."},
             V::integer(&S::neighbours, {1.0, static_cast<double>(BuilderSettings::kMaxNeighbours)})},
            {{.key = "curl",
              .meaning = "Closure of the generated hand, from 0, flat, to 1, a fist, while nothing else sets it."},
             V::number(&S::curl, kUnitInterval)},
            {{.key = "close_button", .meaning = "Button of the grip that closes the hand while it is held. -1: none."},
             V::integer(&S::close_button, {-1, 31})},
            {{.key = "close_to", .meaning = "Closure that the button moves the hand to."},
             V::number(&S::close_to, kUnitInterval)},
            {{.key = "close_speed", .unit = "1/s", .meaning = "Speed at which the hand closes and opens."},
             V::number(&S::close_speed, {1e-3, 100.0})},
            {{.key = "position", .unit = "m", .meaning = "Position of the tool's origin in the frame of the grip."},
             V::vector([](S& s) -> auto& { return s.grip.position; }, kPositions)},
            {{.key = "orientation",
              .meaning = "Rotation of the tool in the frame of the grip (w, x, y, z). A tool points along -z."},
             V::rotation([](S& s) -> auto& { return s.grip.orientation; })},
        },
        SectionKind::Optional};
    return table;
}

const SettingTable<ToolMaterial>& material_table() {
    using S = ToolMaterial;
    using V = SettingValues<S>;
    static const SettingTable<S> table{
        "tool.material",
        "What the tool is made of. It resists changes of its shape with this elasticity.",
        {
            {{.key = "young_modulus",
              .unit = "Pa",
              .meaning =
                  "Young's modulus: silicone 1e5 to 1e6, rubber 1e6 to 1e7, wood 1e10. 0: limp, each sphere on a "
                  "spring of its own."},
             V::number(&S::young_modulus, {0.0, ToolMaterial::kMaxYoungModulus})},
            {{.key = "poisson_ratio",
              .meaning = "Contraction across per stretch along: rubber 0.49, steel 0.3, cork 0."},
             V::number(&S::poisson_ratio, {0.0, ToolMaterial::kMaxPoissonRatio})},
            {{.key = "rigid", .meaning = "Whether the tool keeps its shape exactly, whatever its modulus."},
             V::flag(&S::rigid)},
        },
        SectionKind::Optional};
    return table;
}

/// Names the new keys for those that were removed.
void refuse_removed_keys(const Config& config) {
    if (config.has("tool.mass")) {
        config.fail("tool.mass", "was removed: a tool has no mass at the hand");
    }
    for (const char* const key : {"tool.group_stiffness", "tool.link_stiffness", "tool.iterations"}) {
        if (config.has(key)) {
            config.fail(key,
                        "was removed: a tool's stiffness is that of its material, tool.material.young_modulus "
                        "(Pa), or tool.material.rigid");
        }
    }
}

}  // namespace

ToolSettings read_tool(const Config& config) {
    ToolSettings tool;
    tool_table().read_key(config, "tool", "generator", tool);
    if (tool.shape == ToolShape::Sphere) {
        // A sphere without a size of its own has that of the scene's proxy.
        tool.ball_radius = config.number("proxy.radius", 0.03, kLengths);
    }
    refuse_removed_keys(config);
    tool_table().read(config, tool);
    tool.file = config.input_file("tool.file", tool.file);
    material_table().read(config, tool.material);
    return tool;
}

SettingSection tool_section() {
    return tool_table().describe();
}

SettingSection tool_material_section() {
    return material_table().describe();
}

}  // namespace haptic::sim
