// Claims about the strain of a cloth that is caught at 14 m/s and then hangs: that of its material, at any step.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <glm/geometric.hpp>
#include <numeric>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "haptic/sim/simulation.hpp"
#include "late_drop.hpp"

namespace haptic::sim {
namespace {

constexpr double kCatch = 0.3;    // s, from the first contact
constexpr double kHanging = 2.0;  // s, from then on

struct StrainedLink {
    std::uint32_t a = 0;
    std::uint32_t b = 0;
    double length = 0.0;  // m, unstrained
};

double length_of(const Simulation& simulation, std::uint32_t a, std::uint32_t b) {
    return glm::distance(simulation.vertices()[a], simulation.vertices()[b]);
}

/// The edges of a cloth before its first step, without those between its two faces, which have no length.
std::vector<StrainedLink> links_of(const Simulation& simulation) {
    std::set<std::pair<std::uint32_t, std::uint32_t>> edges;
    for (const Triangle& triangle : simulation.mesh().triangles) {
        for (std::size_t i = 0; i < 3; ++i) {
            edges.insert(std::minmax(triangle[i], triangle[(i + 1) % 3]));
        }
    }
    std::vector<StrainedLink> links;
    for (const auto& [a, b] : edges) {
        if (const double length = length_of(simulation, a, b); length > 1e-3) {
            links.push_back({a, b, length});
        }
    }
    return links;
}

/// The strain, stretched or compressed, that one link in a hundred exceeds.
double strain_of(const Simulation& simulation, const std::vector<StrainedLink>& links) {
    std::vector<double> strains;
    for (const StrainedLink& link : links) {
        strains.push_back(std::abs(length_of(simulation, link.a, link.b) / link.length - 1.0));
    }
    const auto p99 = strains.begin() + static_cast<std::ptrdiff_t>(strains.size() * 99 / 100);
    std::nth_element(strains.begin(), p99, strains.end());
    return *p99;
}

class ClothStrain : public testing::TestWithParam<int> {};

TEST_P(ClothStrain, IsThatOfTheMaterialInACatchAndAfterwards) {
    Simulation simulation(test::late_drop(0.0, {"solver.step=" + std::to_string(1e-3 * GetParam())}));
    const std::vector<StrainedLink> links = links_of(simulation);
    // Fall until the first contact.
    std::int64_t time_ns = 0;
    const auto step = [&] {
        const StepResult result = simulation.step(simulation.scripted_input(time_ns));
        time_ns += std::int64_t{1'000'000} * GetParam();
        return result.in_contact;
    };
    while (!step()) {
        ASSERT_LT(time_ns, 1'000'000'000);
    }
    const auto strains_during = [&](double duration) {
        std::vector<double> strains;
        for (int i = 0; i < static_cast<int>(1e3 * duration) / GetParam(); ++i) {
            strains.push_back(strain_of(simulation, links));
            step();
        }
        return strains;
    };
    // The catch decelerates it by hundreds of g.
    const std::vector<double> caught = strains_during(kCatch);
    EXPECT_LE(std::accumulate(caught.begin(), caught.end(), 0.0) / static_cast<double>(caught.size()), 0.02);
    EXPECT_LE(*std::ranges::max_element(caught), 0.06);
    EXPECT_GE(*std::ranges::max_element(caught), 0.01) << "stiffer than cotton";
    // It hangs from the sphere.
    const std::vector<double> hanging = strains_during(kHanging);
    EXPECT_LE(hanging.back(), 0.01);
}

INSTANTIATE_TEST_SUITE_P(Steps, ClothStrain, testing::Values(2, 5, 10, 20),
                         [](const auto& tested) { return "Of" + std::to_string(tested.param) + "ms"; });

}  // namespace
}  // namespace haptic::sim
