// host-sim mesh: checks a mesh file and describes its contents.
#include <CLI/CLI.hpp>
#include <iomanip>
#include <iostream>
#include <memory>
#include <sstream>
#include <string>

#include "app/commands.hpp"
#include "haptic/sim/mesh_file.hpp"
#include "program/option_checks.hpp"
#include "program/progress_bar.hpp"
#include "program/results.hpp"

namespace haptic::sim {
namespace {

struct MeshOptions {
    std::string file;
    std::string out;
    MeshFileSettings settings;
};

std::string shown(const Vec3& v) {
    std::ostringstream text;
    text << std::setprecision(6) << '(' << v.x << ", " << v.y << ", " << v.z << ')';
    return text.str();
}

std::string describe_kind(const MeshReport& report) {
    if (report.closed) {
        return report.turned ? "closed (was inside out)" : "closed";
    }
    if (report.double_faced > 0 && 2 * report.double_faced == report.triangles) {
        return "open, double-faced";
    }
    return "open";
}

void print(std::ostream& out, const MeshOptions& options, const MeshReport& report) {
    out << options.file << ":\n"
        << "  vertices      " << report.vertices << " of " << report.vertices_given << " (" << report.welded
        << " merged, " << report.unused << " unused)\n"
        << "  triangles     " << report.triangles << " of " << report.triangles_given << " (" << report.collapsed
        << " degenerate, " << report.duplicates << " duplicate, " << report.flipped << " flipped)\n"
        << "  surface       " << describe_kind(report) << "; parts: " << report.components
        << "; open edges: " << report.boundary_edges << "; non-manifold edges: " << report.crowded_edges
        << "; edges that pierce it: " << report.crossings << (report.crossings_known ? "\n" : " or more\n")
        << std::setprecision(6) << "  box           " << shown(report.low) << " to " << shown(report.high) << " m\n"
        << "  area          " << report.area << " m^2\n";
    if (report.closed) {
        out << "  volume        " << report.volume << " m^3\n";
    }
    for (const std::string& warning : report.warnings) {
        out << "  warning: " << warning << '\n';
    }
}

int run_mesh(const MeshOptions& options) {
    const CheckedMesh checked = with_progress_bar("reading " + options.file, [&](const Progress& progress) {
        return read_mesh(options.file, options.settings, progress);
    });
    print(std::cout, options, checked.report);
    if (!options.out.empty()) {
        write_for("--out", [&] { write_mesh(options.out, checked.mesh); });
    }
    return 0;
}

}  // namespace

Command add_mesh_command(CLI::App& app) {
    const auto options = std::make_shared<MeshOptions>();
    app.footer("Exit status 0 if the mesh can be simulated, 1 if not.");
    app.add_option("file", options->file, "Mesh file: .obj, .ply, .stl, .gltf or .glb")->required();
    app.add_option("--out", options->out, "Write the mesh as simulated: .obj or .ply")->check(result_file());
    app.add_option("--scale", options->settings.scale, "Metres per unit of the file")
        ->check(number_in(MeshFileSettings::kMinScale, MeshFileSettings::kMaxScale))
        ->capture_default_str();
    app.add_option("--weld", options->settings.check.weld_tolerance,
                   "Merge vertices within this distance, as a fraction of the mesh's diagonal")
        ->check(number_in(0.0, MeshCheckSettings::kMaxWeldTolerance))
        ->capture_default_str();
    return [options] { return run_mesh(*options); };
}

}  // namespace haptic::sim
