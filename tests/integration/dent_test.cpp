// The force of a sphere that a hand holds deep in a soft block. Prints the table of host-sim/docs/forces.md.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <glm/geometric.hpp>
#include <ostream>
#include <string>

#include "haptic/config.hpp"
#include "haptic/denormals.hpp"
#include "lockstep.hpp"

namespace haptic::test {
namespace {

struct Dent {
    std::string step;      // s
    std::string friction;  // static and dynamic
    double tremor;         // largest, of the force
};

void PrintTo(const Dent& dent, std::ostream* out) {
    *out << "steps of " << dent.step << " s, friction " << dent.friction;
}

class DentInALiver : public testing::TestWithParam<Dent> {
  protected:
    sim::Scene scene() const {
        Config config = sim::open_scene("gel-block");
        for (const std::string& setting :
             {"solver.step=" + GetParam().step, "proxy.static_friction=" + GetParam().friction,
              "proxy.dynamic_friction=" + GetParam().friction, std::string(R"(model.material.name="liver")")}) {
            config.set(setting);
        }
        return sim::read_scene(config, "gel-block");
    }
};

TEST_P(DentInALiver, HoldsASphereStill) {
    const FlushDenormals flush;
    const sim::Workspace workspace(scene().workspace);
    const auto at_height = [&](double y) { return workspace.to_device(Pose{Vec3(0.0, y, 0.0), {}}); };
    // Down to 10 mm below the face until 1.5 s.
    const PoseTrack hand({0.0, 0.5, 1.0, 1.5}, {Pose{}, at_height(0.04), at_height(0.022), at_height(0.01)});
    Lockstep chain({.scene = scene(), .hand = hand, .tick = {}});
    double least = 1e9;  // N, rendered
    double most = 0.0;
    while (chain.simulation().time() < 4.0) {
        const bool measures = chain.simulation().time() > 3.0;
        (void)chain.step([&](const rt::TickRecord& tick, const device::EmulatedBoard&) {
            if (measures) {
                least = std::min(least, glm::length(tick.rendered.force));
                most = std::max(most, glm::length(tick.rendered.force));
            }
        });
    }
    std::printf("step %s s, friction %s: %.3f to %.3f N\n", GetParam().step.c_str(), GetParam().friction.c_str(), least,
                most);
    EXPECT_NEAR(0.5 * (least + most), 0.64, 0.02);
    EXPECT_LT(most - least, GetParam().tremor * most);
}

INSTANTIATE_TEST_SUITE_P(Steps, DentInALiver,
                         testing::Values(Dent{"0.002", "0.0", 0.01}, Dent{"0.005", "0.0", 0.01},
                                         Dent{"0.01", "0.0", 0.01}, Dent{"0.02", "0.0", 0.01},
                                         Dent{"0.002", "0.4", 0.01}, Dent{"0.005", "0.4", 0.01},
                                         Dent{"0.01", "0.4", 0.01}, Dent{"0.02", "0.4", 0.1}));

}  // namespace
}  // namespace haptic::test
