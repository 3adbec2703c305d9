// A cloth is felt at 1 kHz as the simulation pushes it.
#include "reproduce/haptic_render.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <glm/geometric.hpp>
#include <vector>

#include "reproduce/scene_run.hpp"

namespace haptic::sim::reproduce {
namespace {

constexpr double kMaxError = 0.09;  // rms, of the rms force

// The catch of cloth-drop has damping and, once the cloth drapes over the sphere, planes at angles. A frame renders the
// damped force half a step late (contact_coupling.hpp): during a step it goes from the mean over the last step to that
// over this one.
TEST(HapticLoop, RendersTheForceThatPushesACloth) {
    SceneRun run("cloth-drop", {}, nullptr);
    HapticLoop loop;
    std::vector<HapticSample> samples;
    Vec3 last(0.0);       // N, mean over the last step
    double errors = 0.0;  // N^2, sums over the steps
    double squares = 0.0;
    while (!run.finished()) {
        const StepResult& result = run.step();
        const ContactFrame& frame = run.simulation().frame();
        samples.clear();
        loop.render(run.simulation(), frame, frame.plane_time_ns, frame.plane_time_ns + frame.step_ns, samples);
        Vec3 rendered(0.0);
        for (const HapticSample& s : samples) {
            rendered += s.force / static_cast<double>(samples.size());
        }
        const Vec3 pushed = 0.5 * (last + result.force);
        errors += glm::dot(rendered - pushed, rendered - pushed);
        squares += glm::dot(pushed, pushed);
        last = result.force;
    }
    std::printf("rms error %.1f %% of the rms force\n", 100.0 * std::sqrt(errors / squares));
    ASSERT_GT(squares, 100.0) << "N^2: the cloth was not caught";
    EXPECT_LT(std::sqrt(errors / squares), kMaxError);
}

}  // namespace
}  // namespace haptic::sim::reproduce
