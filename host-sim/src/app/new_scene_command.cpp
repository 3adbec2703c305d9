// host-sim new-scene: writes a scene for a mesh file, so that it can be touched at once.
#include <CLI/CLI.hpp>
#include <filesystem>
#include <iostream>
#include <memory>
#include <stdexcept>
#include <string>

#include "app/commands.hpp"
#include "haptic/clock.hpp"
#include "haptic/sim/mesh_file.hpp"
#include "haptic/text_file.hpp"
#include "program/exit_status.hpp"
#include "program/option_checks.hpp"
#include "program/progress_bar.hpp"
#include "program/results.hpp"
#include "scene/mesh_scene.hpp"

namespace haptic::sim {
namespace {

struct NewSceneOptions {
    std::string mesh;
    std::string out;  // empty: the mesh's name with .toml, in the current folder
    bool force = false;
};

/// The mesh as the scene file names it: from the folder of the scene file, as the file system resolves it.
std::string named_from(const std::filesystem::path& scene, const std::filesystem::path& mesh) {
    const std::filesystem::path folder =
        std::filesystem::weakly_canonical(std::filesystem::absolute(scene)).parent_path();
    return std::filesystem::canonical(mesh).lexically_relative(folder).generic_string();
}

int run_new_scene(const NewSceneOptions& options) {
    const std::filesystem::path mesh(options.mesh);
    const std::string scene = options.out.empty() ? mesh.stem().string() + ".toml" : options.out;
    if (!options.force && std::filesystem::is_regular_file(scene)) {
        throw std::runtime_error(scene + ": exists; --force overwrites it, --out names another file");
    }
    const CheckedMesh checked = with_progress_bar(
        "reading " + options.mesh, [&](const Progress& progress) { return read_mesh(mesh, {}, progress); });
    const MeshScene made = with_progress_bar("trying " + options.mesh, [&](const Progress& progress) {
        return make_mesh_scene(checked, named_from(scene, mesh), monotonic_now_ns, progress);
    });
    const auto write = [&] { write_text(scene, made.text); };
    options.out.empty() ? write() : write_for("--out", write);
    std::cout << scene << ": a hand presses " << options.mesh << '\n'
              << made.explanation << "run it:    host-sim run " << scene << " --verify\n"
              << "touch it:  host-sim run " << scene
              << " --view --view-control      # then open http://127.0.0.1:7060/\n";
    return kExitDone;
}

}  // namespace

Command add_new_scene_command(CLI::App& app) {
    const auto options = std::make_shared<NewSceneOptions>();
    app.footer(
        "The scene is tried out before it is written. Exit status 0 if it is written, 1 with the problem if not.");
    app.add_option("mesh", options->mesh, "Mesh file: .obj, .ply, .stl, .gltf or .glb")->required();
    app.add_option("--out", options->out, "Scene file to write [the mesh's name with .toml, in the current folder]")
        ->check(result_file());
    app.add_flag("--force", options->force, "Overwrite the scene file if it exists");
    return [options] { return run_new_scene(*options); };
}

}  // namespace haptic::sim
