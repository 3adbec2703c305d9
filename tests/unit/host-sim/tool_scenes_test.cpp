// What the built-in scenes of tools are there to show.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <glm/geometric.hpp>
#include <optional>
#include <string>
#include <vector>

#include "haptic/config.hpp"
#include "haptic/sim/scene.hpp"
#include "haptic/sim/simulation.hpp"
#include "haptic/sim/tool_proxies.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {
namespace {

/// m, height at which the line through the tool's spheres passes the plane z = 0 that the rod lies in; none if it does
/// not reach across it.
std::optional<double> height_at_rod(const ToolProxies& tool) {
    std::vector<ToolParticle> row(tool.particles().begin(), tool.particles().end());
    std::sort(row.begin(), row.end(),
              [](const ToolParticle& p, const ToolParticle& q) { return p.rest_offset.z < q.rest_offset.z; });
    for (std::size_t k = 1; k < row.size(); ++k) {
        const Vec3& a = row[k - 1].position;
        const Vec3& b = row[k].position;
        if ((a.z <= 0.0) != (b.z <= 0.0)) {
            return a.y + (b.y - a.y) * (0.0 - a.z) / (b.z - a.z);
        }
    }
    return std::nullopt;
}

Scene scene_with(const std::string& name, const std::vector<std::string>& assignments) {
    Config config = open_scene(name);
    for (const std::string& assignment : assignments) {
        config.set(assignment);
    }
    return read_scene(config, name);
}

/// m, mean height of the particles of all bodies after so many seconds of the script.
double height_after(Simulation& simulation, double seconds_of_script) {
    const std::int64_t step_ns = nanoseconds(simulation.scene().solver.step);
    for (std::int64_t time_ns = 0; time_ns < nanoseconds(seconds_of_script); time_ns += step_ns) {
        (void)simulation.step(simulation.scripted_input(time_ns));
    }
    double sum = 0.0;
    for (const Vec3& p : simulation.model().position) {
        sum += p.y;
    }
    return sum / static_cast<double>(simulation.model().size());
}

// Figure 5.9: a thin rod between two spheres of the tool.
TEST(RodGap, LetsNoThinRodThroughHoweverDeepTheToolIsPressed) {
    Simulation simulation(scene_with("rod-gap", {}));
    simulation.set_verification(true);
    int pressed = 0;
    for (int k = 0; k < 300; ++k) {
        const StepResult result = simulation.step(simulation.scripted_input(10'000'000 * std::int64_t{k}));
        EXPECT_FALSE(result.crossed) << k;
        const std::optional<double> height = height_at_rod(simulation.tool());
        ASSERT_TRUE(height.has_value()) << k;
        ASSERT_GT(*height, 0.0) << k;  // over the rod's axis
        if (result.hip.y < -0.02) {
            ++pressed;
            EXPECT_GT(result.force.y, 0.1) << k;  // N, up
        }
    }
    EXPECT_GT(pressed, 150);
}

TEST(RodGap, LetsItThroughAsTheThesisDoesIfItsGapsAreOpen) {
    Simulation simulation(scene_with("rod-gap", {"tool.close_gaps=false"}));
    for (int k = 0; k < 150; ++k) {
        (void)simulation.step(simulation.scripted_input(10'000'000 * std::int64_t{k}));
    }
    EXPECT_LT(height_at_rod(simulation.tool()).value_or(0.0), -0.02);
}

TEST(FishGrab, LiftsTheFishByFriction) {
    Simulation rough(scene_with("fish-grab", {}));
    EXPECT_GT(height_after(rough, 1.3), 0.05);  // m: lifted by 0.045 from where it lay, on a palm at 0
    Simulation smooth(scene_with("fish-grab", {"proxy.static_friction=0", "proxy.dynamic_friction=0"}));
    EXPECT_LT(height_after(smooth, 0.8), -0.02);  // it has slid off, and falls
}

}  // namespace
}  // namespace haptic::sim
