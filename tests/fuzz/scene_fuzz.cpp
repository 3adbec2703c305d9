// Fuzz target: scene files. The result is a ConfigError that names the file, or a scene of bounded size. A small scene
// is created and stepped: it is refused with a message or stays finite.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string_view>

#include "haptic/config.hpp"
#include "haptic/numeric.hpp"
#include "haptic/sim/scene.hpp"
#include "haptic/sim/simulation.hpp"
#include "require.hpp"

namespace {

using haptic::is_finite;
using haptic::sim::ModelSettings;
using haptic::sim::Scene;

constexpr std::size_t kSmall = 300;  // triangles
constexpr double kFewPasses = 1000;  // solver passes per step
constexpr int kSteps = 3;

std::size_t triangles_of(const Scene& scene) {
    std::size_t triangles = haptic::sim::expected_triangles(scene.model);
    for (const ModelSettings& object : scene.objects) {
        triangles += haptic::sim::expected_triangles(object);
    }
    return triangles;
}

/// Throws std::invalid_argument for an invalid scene, std::runtime_error for a state that is not finite.
void run(const Scene& scene) {
    const auto reads_files = [](const ModelSettings& model) { return !model.file.empty() || !model.particles.empty(); };
    if (reads_files(scene.model) || std::any_of(scene.objects.begin(), scene.objects.end(), reads_files)) {
        return;  // files of this machine are not inputs of this test
    }
    if (scene.tool && (scene.tool->shape != haptic::sim::ToolShape::Sphere || !scene.tool->file.empty())) {
        return;  // searching for a sphere cover takes a second
    }
    haptic::sim::Simulation simulation(scene);
    require(simulation.mesh().triangles.size() == triangles_of(scene), "there are as many triangles as expected");
    for (int k = 0; k < kSteps; ++k) {
        const auto result = simulation.step(simulation.scripted_input(haptic::nanoseconds(k * scene.solver.step)));
        require(is_finite(result.proxy) && is_finite(result.force) && is_finite(result.hand_force),
                "what is felt is a number");
        for (const haptic::Vec3& vertex : simulation.vertices()) {
            require(is_finite(vertex), "what is seen is a number");
        }
    }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    try {
        const haptic::Config config = haptic::Config::parse({reinterpret_cast<const char*>(data), size}, "fuzz.toml");
        const Scene scene = haptic::sim::read_scene(config, "fuzz");
        require(triangles_of(scene) <= 2'000'000, "scenes are bounded");
        const double passes = static_cast<double>(scene.solver.substeps) * (1 + scene.solver.iterations) *
                              scene.solver.rotation_iterations;
        if (triangles_of(scene) <= kSmall && passes <= kFewPasses) {
            run(scene);
        }
    } catch (const haptic::ConfigError& error) {
        require(std::string_view(error.what()).starts_with("fuzz.toml"), "an error names the file");
    } catch (const std::invalid_argument&) {  // NOLINT(bugprone-empty-catch): refused with a message
    } catch (const std::runtime_error&) {     // NOLINT(bugprone-empty-catch): not finite, and reported
    }
    return 0;
}
