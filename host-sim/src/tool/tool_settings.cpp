#include <cstdint>

#include <haptic/sim/live_settings.hpp>
#include <haptic/sim/model_builder.hpp>
#include <haptic/sim/tool_model.hpp>

namespace haptic::sim {
namespace {

constexpr Range kLengths{1e-5, 100.0};
constexpr Range kPlaces{-100.0, 100.0};
constexpr Range kUnitInterval{0.0, 1.0};

}  // namespace

ToolSettings read_tool(const Config& config) {
    ToolSettings tool;
    const std::string shape = config.choice("tool.generator", "sphere", {"sphere", "hand", "rod", "probe"});
    tool.shape = shape == "hand"    ? ToolShape::Hand
                 : shape == "rod"   ? ToolShape::Rod
                 : shape == "probe" ? ToolShape::Probe
                                    : ToolShape::Sphere;
    tool.length = config.number("tool.length", tool.length, kLengths);
    tool.thickness = config.number("tool.thickness", tool.thickness, kLengths);
    // Who names no size for a sphere means that of the scene's proxy.
    tool.ball_radius = config.number(
        "tool.ball_radius",
        tool.shape == ToolShape::Sphere ? config.number("proxy.radius", 0.03, kLengths) : tool.ball_radius, kLengths);
    tool.file = config.text("tool.file", "");
    tool.file_scale = config.number("tool.scale", tool.file_scale, {0.0, 1e6});

    tool.spheres = static_cast<std::size_t>(
        config.integer("tool.spheres", 0, {0.0, static_cast<double>(ToolSettings::kMostSpheres)}));
    tool.radius = config.number("tool.radius", tool.radius, {0.0, kLengths.most});
    tool.cover_error = config.number("tool.cover_error", tool.cover_error, {0.0, kLengths.most});
    tool.close_gaps = config.flag("tool.close_gaps", tool.close_gaps);

    tool.neighbours =
        static_cast<std::size_t>(config.integer("tool.neighbours", static_cast<std::int64_t>(tool.neighbours),
                                                {1.0, static_cast<double>(BuilderSettings::kMostNeighbours)}));
    tool.mass = config.number("tool.mass", tool.mass, {1e-6, 1e3});
    tool.group_stiffness = config.number("tool.group_stiffness", tool.group_stiffness, kUnitInterval);
    tool.link_stiffness = config.number("tool.link_stiffness", tool.link_stiffness, kUnitInterval);
    tool.iterations = static_cast<int>(config.integer("tool.iterations", tool.iterations, ranges::kIterations));
    tool.curl = config.number("tool.curl", tool.curl, kUnitInterval);
    tool.close_button = static_cast<int>(config.integer("tool.close_button", tool.close_button, {-1.0, 31.0}));
    tool.close_to = config.number("tool.close_to", tool.close_to, kUnitInterval);
    tool.close_speed = config.number("tool.close_speed", tool.close_speed, {1e-3, 100.0});
    tool.grip.position = config.vec3("tool.position", tool.grip.position, kPlaces);
    tool.grip.orientation = config.quat("tool.orientation", tool.grip.orientation);
    return tool;
}

}  // namespace haptic::sim
