// Scene popout-fan, figure 4.14 of the thesis: the deeper the funnel, the more pop-out iterations.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "haptic/sim/scene.hpp"
#include "haptic/sim/simulation.hpp"

namespace haptic::sim {
namespace {

constexpr std::size_t kDepths = 3;  // number of depths of the hand: 1, 2, 3 m

struct Crossings {
    std::array<int, kDepths> iterations{};  // sums over the steps of each crossing
    std::array<int, kDepths> steps{};
    std::array<double, kDepths> lowest{};  // m, of the fan's centre
    std::uint64_t crossed = 0;

    [[nodiscard]] double mean(std::size_t k) const { return static_cast<double>(iterations.at(k)) / steps.at(k); }
};

Crossings cross_the_fan(const std::vector<std::string>& settings) {
    Config config = open_scene("popout-fan");
    for (const std::string& setting : settings) {
        config.set(setting);
    }
    const Scene scene = read_scene(config, "popout-fan");
    Simulation simulation(scene);
    simulation.set_verification(true);
    const std::int64_t step_ns = nanoseconds(scene.solver.step);
    Crossings crossings;
    for (std::int64_t t = 0; t < nanoseconds(scene.duration_s); t += step_ns) {
        const StepResult result = simulation.step(simulation.scripted_input(t));
        crossings.crossed += result.crossed ? 1 : 0;
        for (std::size_t k = 0; k < kDepths; ++k) {
            if (std::abs(result.hip.y + static_cast<double>(k + 1)) < 1e-9) {
                crossings.iterations.at(k) += result.pop_out_iterations;
                ++crossings.steps.at(k);
                crossings.lowest.at(k) = std::min(crossings.lowest.at(k), simulation.vertices()[0].y);
            }
        }
    }
    return crossings;
}

TEST(PopOutFan, NeedsMoreIterationsByTheThesisTheDeeperItIs) {
    const Crossings thesis = cross_the_fan({"contact.method=thesis", "contact.pop_out=thesis"});
    EXPECT_EQ(thesis.crossed, 0u);
    EXPECT_LT(thesis.mean(0), thesis.mean(1));
    EXPECT_LT(thesis.mean(1), thesis.mean(2));
    EXPECT_GT(thesis.mean(2), 1.0);
    for (std::size_t k = 0; k < kDepths; ++k) {
        EXPECT_NEAR(thesis.lowest.at(k), -static_cast<double>(k + 1), 0.1) << "m, centre as in the thesis";
    }
}

TEST(PopOutFan, NeedsNoPopOutByOurs) {
    const Crossings ours = cross_the_fan({});
    EXPECT_EQ(ours.crossed, 0u);
    for (std::size_t k = 0; k < kDepths; ++k) {
        EXPECT_GT(ours.steps.at(k), 100);
        EXPECT_LT(ours.mean(k), 0.1);
        EXPECT_NEAR(ours.lowest.at(k), -static_cast<double>(k + 1), 0.1) << "it was not pressed";
    }
}

}  // namespace
}  // namespace haptic::sim
