// Whole scenes of several sizes are measured, and a cost that grows faster than n log n is named.
#include "reproduce/scene_growth.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include "haptic/clock.hpp"
#include "haptic/csv.hpp"
#include "reproduce/growth_figure.hpp"
#include "temporary_file.hpp"

namespace haptic::sim::reproduce {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

/// Costs of sizes 1,000, 10,000 and 20,000, whose deformation takes n log n and whose collisions take `collide(n)`, us.
template <class Collide>
std::vector<SceneCost> costs_with(const Collide& collide) {
    std::vector<SceneCost> costs;
    for (const std::size_t n : {1000u, 10'000u, 20'000u}) {
        const auto x = static_cast<double>(n);
        SceneCost cost;
        cost.particles = n;
        cost.free_us = {x * std::log(x) + collide(x), collide(x), x * std::log(x), 1e-9 * x * x};
        costs.push_back(cost);
    }
    return costs;
}

std::vector<std::string> faster_in(const std::vector<SceneCost>& costs) {
    std::vector<std::string> names;
    for (const Growth& growth : growths_of(costs)) {
        if (growth.is_faster()) {
            names.push_back(growth.what);
        }
    }
    return names;
}

TEST(SceneGrowth, NamesTheStageThatGrowsFasterThanNLogN) {
    EXPECT_THAT(faster_in(costs_with([](double n) { return 5.0 * n; })), IsEmpty());
    EXPECT_THAT(faster_in(costs_with([](double n) { return 1e-4 * n * n; })), ElementsAre("collide, free"));
    EXPECT_THAT(faster_in(costs_with([](double n) { return n * n; })), ElementsAre("total, free", "collide, free"));
}

TEST(SceneGrowth, JudgesNothingFromOneSize) {
    std::vector<SceneCost> costs = costs_with([](double n) { return n * n; });
    costs.resize(1);
    EXPECT_THAT(growths_of(costs), IsEmpty());
}

TEST(SceneGrowth, HeapsAndClothsHaveTheSizesAskedFor) {
    EXPECT_EQ(fish_heaps(1).scene.model.copies.size(), 4u);
    EXPECT_EQ(fish_heaps(10).scene.model.copies.size(), 40u);
    GrowthCase cloth = falling_cloth(5);
    cloth.steps = 3;
    std::vector<double> shares;
    GrowthCase finer = falling_cloth(9);
    finer.steps = 5;
    const std::vector<SceneCost> costs =
        measure_growth(std::array{cloth, finer}, monotonic_now_ns, [&](double share) { shares.push_back(share); });
    ASSERT_EQ(costs.size(), 2u);
    EXPECT_EQ(costs[0].particles, 25u);
    EXPECT_EQ(costs[0].triangles, 64u);
    EXPECT_EQ(costs[0].free_steps, 2u) << "the first is not measured";
    EXPECT_GT(costs[0].free_us[0], 0.0);
    EXPECT_EQ(costs[1].particles, 81u);
    EXPECT_EQ(costs[1].free_steps, 4u);
    EXPECT_GT(costs[1].peak_mb, 0.0);
    EXPECT_GE(shares.size(), 5u) << "one a step";
    EXPECT_TRUE(std::is_sorted(shares.begin(), shares.end()));
    EXPECT_LT(shares.back(), 1.0);
}

// The scene's cloth falls 10 m before it arrives; here it begins so low and so fast that it arrives alike.
TEST(SceneGrowth, TheClothIsCaughtAtTheVelocityOfItsFall) {
    const GrowthCase cloth = falling_cloth(9);
    EXPECT_LT(cloth.scene.model.cloth.centre.y, 2.0);
    const double y = cloth.scene.model.cloth.centre.y;
    const double v = cloth.scene.model.velocity.y;
    EXPECT_NEAR(v * v, 2.0 * 9.81 * (10.0 - y), 1e-9) << "m^2/s^2";
    const SceneCost cost = measure_growth(std::array{cloth}, monotonic_now_ns, [](double) {}).front();
    EXPECT_GE(cost.free_steps, 8u);
    EXPECT_GE(cost.contact_steps, 5u);
}

TEST(SceneGrowth, TheFigureHasTimesGrowthAndAVerdictOfEachScene) {
    const test::TemporaryDirectory folder;
    const Study study(folder.path(), monotonic_now_ns);
    Figure figure;
    add_scene_growth(study, figure, {.heaps = {1, 2}, .cloths = {5, 9}});
    EXPECT_THAT(figure.data, ElementsAre("scaling-heaps.csv", "scaling-heaps-growth.csv", "scaling-cloth.csv",
                                         "scaling-cloth-growth.csv"));
    CsvReader times(folder.path() / "scaling-heaps.csv");
    ASSERT_TRUE(times.next());
    EXPECT_EQ(times.number(times.index("particles")), 548.0);
    EXPECT_GT(times.number(times.index("total_contact_us")), times.number(times.index("collide_contact_us")));
    ASSERT_TRUE(times.next());
    EXPECT_EQ(times.number(times.index("bodies")), 8.0);
    EXPECT_FALSE(times.next());
    CsvReader growth(folder.path() / "scaling-cloth-growth.csv");
    ASSERT_TRUE(growth.next());
    EXPECT_EQ(growth.number(growth.index("particles")), 81.0);
    std::vector<std::string> claims;
    for (const Comparison& comparison : figure.comparisons) {
        claims.push_back(comparison.what);
        EXPECT_THAT(comparison.ours, Not(HasSubstr("nan")));
    }
    EXPECT_THAT(claims, AllOf(Contains("heaps of four fish: grows faster than n log n"),
                              Contains("a falling cloth: grows faster than n log n")));
}

}  // namespace
}  // namespace haptic::sim::reproduce
