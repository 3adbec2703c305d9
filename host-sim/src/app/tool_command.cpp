// host-sim tool: builds a tool and reports how well its spheres approximate its mesh.

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <iomanip>
#include <iostream>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "app/commands.hpp"
#include "haptic/config.hpp"
#include "haptic/setting.hpp"
#include "haptic/sim/mesh_file.hpp"
#include "haptic/sim/scene.hpp"
#include "haptic/sim/tool_model.hpp"
#include "haptic/types.hpp"
#include "program/option_checks.hpp"
#include "program/progress_bar.hpp"
#include "program/results.hpp"
#include "simd/aabb.hpp"
#include "tool/tool_proxies.hpp"

namespace haptic::sim {
namespace {

struct ToolOptions {
    std::string what;
    std::vector<std::string> assignments;
    std::string mesh;
    bool list = false;
};

constexpr std::array kToolGenerators{"sphere", "hand", "rod", "probe"};

bool is_tool_generator(const std::string& what) {
    return std::find(kToolGenerators.begin(), kToolGenerators.end(), what) != kToolGenerators.end();
}

bool is_mesh(const std::string& what) {
    try {
        (void)mesh_format(what);
        return true;
    } catch (const MeshError&) {
        return false;
    }
}

void print(std::ostream& out, const ToolModel& tool, bool list) {
    const DeformableBody& body = tool.body;
    const auto [low, high] = aabb_of(body.mesh.vertices);
    std::vector<double> radii = tool.radius;
    std::sort(radii.begin(), radii.end());
    out << std::setprecision(4) << body.name << ":\n"
        << "  mesh          " << body.mesh.vertices.size() << " vertices, " << body.mesh.triangles.size()
        << " triangles, " << (body.mesh.closed ? "closed" : "open") << '\n'
        << "  box           (" << low.x << ", " << low.y << ", " << low.z << ") to (" << high.x << ", " << high.y
        << ", " << high.z << ") m, grip frame\n"
        << "  spheres       " << radii.size();
    if (tool.added > 0) {
        out << ", " << tool.added << " of them added to close gaps";
    }
    out << "; radius " << radii.front() << " .. " << radii.back() << " m, median " << radii[radii.size() / 2] << '\n'
        << "  cover error   " << tool.cover_error << " m\n"
        << "  widest gap    " << tool.widest_gap << " m" << (tool.widest_gap > 0.0 ? "" : " (none)") << '\n'
        << "  groups        " << body.particles.groups.size() << '\n';
    if (!tool.joints.empty()) {
        out << "  joints        " << tool.joints.joints() - 1 << " (it can close)\n";
    }
    if (list) {
        out << "x_m,y_m,z_m,radius_m,mass_kg\n" << std::setprecision(17);
        for (std::size_t i = 0; i < tool.radius.size(); ++i) {
            const Vec3& p = body.particles.rest_position[i];
            out << p.x << ',' << p.y << ',' << p.z << ',' << tool.radius[i] << ',' << body.particles.mass[i] << '\n';
        }
    }
}

/// The scene of this name. Throws ConfigError that also lists the generated tools, for a misspelt one.
Config scene_of(const std::string& what) {
    try {
        return open_scene(what);
    } catch (const ConfigError& error) {
        std::string generators;
        for (const char* generator : kToolGenerators) {
            generators += (generators.empty() ? "" : ", ") + std::string(generator);
        }
        throw ConfigError(std::string(error.what()) + "; generated tools are: " + generators);
    }
}

ToolSettings settings_of(const ToolOptions& options) {
    const bool of_scene = !is_tool_generator(options.what) && !is_mesh(options.what);
    Config config = of_scene ? scene_of(options.what) : Config();
    if (is_tool_generator(options.what)) {
        config.set("tool.generator=" + options.what);
    } else if (!of_scene) {
        config.set("tool.file=" + toml_value(options.what));
    }
    for (const std::string& assignment : options.assignments) {
        config.set(assignment);
    }
    const ToolSettings settings = read_tool(config);
    if (!of_scene) {
        config.reject_unknown();
    }
    return settings;
}

/// Replaces the tool's rest shape by that at a curl.
void close(ToolModel& tool, double curl) {
    const ToolProxies::Settings still{.contact = {}, .reach = 0.0, .step = 0.01};
    const ToolProxies closed(tool, still, Pose{}, curl);
    tool.body.mesh.vertices = closed.vertices();
    const std::span<const ToolProxy> proxies = closed.particles();
    std::transform(proxies.begin(), proxies.end(), tool.body.particles.rest_position.begin(),
                   [](const ToolProxy& p) { return p.rest_offset; });
}

int run_tool(const ToolOptions& options) {
    const ToolSettings settings = settings_of(options);
    ToolModel tool = with_progress_bar("building " + options.what,
                                       [&](const Progress& progress) { return make_tool(settings, progress); });
    if (settings.curl > 0.0) {
        close(tool, settings.curl);
    }
    print(std::cout, tool, options.list);
    if (!options.mesh.empty()) {
        write_for("--mesh", [&] { write_mesh(options.mesh, tool.body.mesh); });
    }
    return 0;
}

}  // namespace

Command add_tool_command(CLI::App& app) {
    const auto options = std::make_shared<ToolOptions>();
    app.add_option("what", options->what, "sphere, hand, rod, probe, a mesh file, or a scene for its tool")->required();
    app.add_option("--set", options->assignments,
                   "Override a key of the [tool] table, e.g. tool.spheres=20; repeatable")
        ->type_name("KEY=VALUE")
        ->allow_extra_args(false);
    app.add_option("--mesh", options->mesh, "Write the mesh, in the grip frame: .obj or .ply")->check(result_file());
    app.add_flag("--list", options->list, "List the spheres, in the grip frame");
    return [options] { return run_tool(*options); };
}

}  // namespace haptic::sim
