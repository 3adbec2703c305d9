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
            {{.key = "neighbours", .meaning = "Neighbours that form a shape-matching group with each particle."},
             V::integer(&S::neighbours, {1.0, static_cast<double>(BuilderSettings::kMaxNeighbours)})},
            {{.key = "mass",
              .unit = "kg",
              .meaning = "Mass of the tool. Only the ratios of its particles' masses matter."},
             V::number(&S::mass, {1e-6, 1e3})},
            {{.key = "group_stiffness", .meaning = "Stiffness of shape matching, from 0, limp, to 1, rigid."},
             V::number(&S::group_stiffness, kUnitInterval)},
            {{.key = "link_stiffness",
              .meaning = "Stiffness of the distance constraints between neighbouring particles. 0: none."},
             V::number(&S::link_stiffness, kUnitInterval)},
            {{.key = "iterations",
              .label = "Tool iterations",
              .meaning = "Iterations over the tool's own constraints per step."},
             V::integer(&S::iterations, {0, 1000})},
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

}  // namespace

ToolSettings read_tool(const Config& config) {
    ToolSettings tool;
    tool_table().read_key(config, "tool", "generator", tool);
    if (tool.shape == ToolShape::Sphere) {
        // A sphere without a size of its own has that of the scene's proxy.
        tool.ball_radius = config.number("proxy.radius", 0.03, kLengths);
    }
    tool_table().read(config, tool);
    return tool;
}

SettingSection tool_section() {
    return tool_table().describe();
}

}  // namespace haptic::sim
