// The whole chain in lockstep is recorded; rt-core's part is repeated from the recording alone.
#include "measure/replay.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <vector>

#include "haptic/denormals.hpp"
#include "lockstep.hpp"
#include "measure/recording.hpp"
#include "temporary_file.hpp"

namespace haptic::test {
namespace {

constexpr double kQuantum = 1e-3;  // m, resolution of the tracking

/// Hand at 1 kHz from a coarse tracker: jumps by a millimetre at a time.
PoseTrack quantised_hand(double duration_s) {
    std::vector<double> times;
    std::vector<Pose> poses;
    const auto cut = [](double x) { return kQuantum * std::round(x / kQuantum); };
    for (int i = 0; i <= static_cast<int>(duration_s * 1000.0); ++i) {
        const double t = i * 1e-3;
        const double angle = 0.2 * std::sin(1.7 * t);
        times.push_back(t);
        poses.push_back({Vec3(cut(0.012 * std::sin(4.0 * t)), cut(0.008 * std::sin(7.0 * t)), cut(0.01 * std::sin(t))),
                         Quat(std::cos(angle / 2.0), 0.0, std::sin(angle / 2.0), 0.0)});
    }
    return {std::move(times), std::move(poses)};
}

class LockstepReplay : public testing::Test {
  protected:
    /// Runs the scene with the recorder on; returns the greatest force, N.
    double record(int steps) {
        const FlushDenormals flush;
        rt::Recorder recorder(16384, 1024);
        rt::RecordFile writer(file, recorder);
        Lockstep chain({.scene = sim::read_scene(sim::open_scene("cloth-drop"), "cloth-drop"),
                        .hand = quantised_hand(3.0),
                        .tick = settings,
                        .recorder = &recorder});
        double peak = 0.0;
        for (int step = 0; step < steps; ++step) {
            const sim::StepResult result = chain.step([&](const rt::TickRecord& tick, const device::EmulatedBoard&) {
                peak = std::max(peak, glm::length(tick.rendered.force));
            });
            EXPECT_FALSE(result.crossed) << "step " << step;
            writer.drain();
        }
        writer.close();
        EXPECT_EQ(recorder.dropped() + recorder.frames_dropped(), 0u);
        return peak;
    }
    rt::ReplayResult replay() {
        const RingSession session;
        RingWriter<DeviceState> states(session.name());
        rt::Replay again(file, settings, states, no_clock);
        while (again.step()) {
        }
        return again.result();
    }

    rt::TickSettings settings;
    TemporaryDirectory folder;
    std::filesystem::path file = folder.file("chain.csv");
};

TEST_F(LockstepReplay, OfACoarselyTrackedHandGivesTheSamePosesAndWrenches) {
    EXPECT_GT(record(230), 0.1) << "N: too small a force to prove anything";
    const rt::ReplayResult result = replay();
    EXPECT_GT(result.ticks, 2300u);
    EXPECT_GE(result.frames, 229u);
    EXPECT_TRUE(result.identical()) << result.first().first << " in line " << result.first().second.line;
}

TEST_F(LockstepReplay, WithALowerForceLimitHasTheSameMotionAndLessForce) {
    record(230);
    settings.limits.force = 0.05;
    const rt::ReplayResult result = replay();
    EXPECT_FALSE(result.identical());
    for (const char* same : {"x_m", "qw", "frame_sequence", "in_contact", "residual_m"}) {
        EXPECT_EQ(result.columns.count(same), 0u) << same;
    }
    EXPECT_EQ(result.columns.count("fy_n"), 1u);
}

}  // namespace
}  // namespace haptic::test
