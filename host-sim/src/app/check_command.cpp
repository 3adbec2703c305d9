// host-sim check: reads a scene completely, its files included, builds it, and says what it is. Nothing is simulated.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <iomanip>
#include <iostream>
#include <memory>
#include <numeric>
#include <string>
#include <vector>

#include "app/commands.hpp"
#include "app/run_options.hpp"
#include "app/unresolved_motion.hpp"
#include "haptic/sim/simulation.hpp"
#include "program/exit_status.hpp"
#include "program/progress_bar.hpp"
#include "tool/tool_proxies.hpp"

namespace haptic::sim {
namespace {

constexpr double kShownDifference = 1e-3;  // of radii, relative; smaller ones are rounding

struct CheckOptions {
    std::string scene;
    std::vector<std::string> assignments;
};

/// Bodies of one kind: copies have the same name and sizes.
struct Kind {
    std::string name;
    std::size_t particles = 0;
    std::size_t triangles = 0;
    double mass = 0.0;  // kg, of one; fixed particles count as 0
    std::size_t count = 0;
};

std::vector<Kind> kinds_of(const Simulation& simulation) {
    const std::vector<SceneBody>& bodies = simulation.bodies();
    const std::vector<double>& mass = simulation.model().mass;
    std::vector<Kind> kinds;
    for (std::size_t i = 0; i < bodies.size(); ++i) {
        const std::size_t first = bodies[i].first_particle;
        const std::size_t next = i + 1 < bodies.size() ? bodies[i + 1].first_particle : mass.size();
        const auto at = [&mass](std::size_t k) { return mass.begin() + static_cast<std::ptrdiff_t>(k); };
        Kind kind{bodies[i].name, next - first, bodies[i].mesh.triangles.size(),
                  std::accumulate(at(first), at(next), 0.0), 1};
        const auto same = std::find_if(kinds.begin(), kinds.end(), [&kind](const Kind& k) {
            return k.name == kind.name && k.particles == kind.particles && k.triangles == kind.triangles &&
                   k.mass == kind.mass;
        });
        if (same == kinds.end()) {
            kinds.push_back(kind);
        } else {
            ++same->count;
        }
    }
    return kinds;
}

void print_tool(std::ostream& out, const Simulation& simulation) {
    const auto proxies = simulation.tool().particles();
    const auto [low, high] = std::minmax_element(proxies.begin(), proxies.end(),
                                                 [](const auto& a, const auto& b) { return a.radius < b.radius; });
    out << "  tool          ";
    if (proxies.size() == 1) {
        out << "one sphere of radius " << low->radius << " m\n";
        return;
    }
    out << proxies.size() << " spheres of radius " << low->radius;
    if (high->radius > (1.0 + kShownDifference) * low->radius) {
        out << " to " << high->radius;
    }
    out << " m\n";
}

void print(std::ostream& out, const CheckOptions& options, const Simulation& simulation) {
    const Scene& scene = simulation.scene();
    const TriangleMesh& mesh = simulation.mesh();
    out << std::setprecision(4) << options.scene << ':' << (scene.description.empty() ? "" : " " + scene.description)
        << '\n'
        << "  duration      " << scene.duration_s << " s" << (scene.duration_s > 0.0 ? "" : " (until it is stopped)")
        << '\n'
        << "  step          " << scene.solver.step << " s; substeps " << simulation.substeps()
        << (simulation.iterates() ? ", iterations " + std::to_string(scene.solver.iterations) : "") << '\n'
        << "  bodies        " << simulation.bodies().size() << ": " << mesh.vertices.size() << " vertices, "
        << mesh.triangles.size() << " triangles, " << simulation.model().size() << " particles\n";
    for (const Kind& kind : kinds_of(simulation)) {
        out << "    " << std::left << std::setw(12) << kind.name << std::right << kind.count << " x " << kind.particles
            << " particles, " << kind.triangles << " triangles, " << kind.mass << " kg\n";
    }
    print_tool(out, simulation);
    out << "  coupling      " << scene.coupling.stiffness << " N/m, at the hand "
        << scene.workspace.force_scale * scene.coupling.stiffness / scene.workspace.scale << " N/m\n"
        << "  at the device 1 m of the scene is " << scene.workspace.scale << " m, 1 N is "
        << scene.workspace.force_scale << " N\n";
}

int run_check(const CheckOptions& options) {
    const Scene scene = load_scene(options.scene, options.assignments);
    const Simulation simulation = with_progress_bar(
        "building " + scene.name, [&](const Progress& progress) { return Simulation(scene, nullptr, progress); });
    if (const std::string warning = unresolved_motion(simulation); !warning.empty()) {
        std::cerr << "warning: " << warning << '\n';
    }
    print(std::cout, options, simulation);
    return kExitDone;
}

}  // namespace

Command add_check_command(CLI::App& app) {
    const auto options = std::make_shared<CheckOptions>();
    app.footer("Exit status 0 if the scene can be run, 1 with the file, the line and the problem if not.");
    app.add_option("scene", options->scene, "Built-in scene (list: host-sim scenes) or scene file NAME.toml")
        ->required();
    app.add_option("--set", options->assignments, "Override a scene key, e.g. solver.iterations=5; repeatable")
        ->type_name("KEY=VALUE")
        ->allow_extra_args(false);
    return [options] { return run_check(*options); };
}

}  // namespace haptic::sim
