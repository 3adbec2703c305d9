// Human-like hand, tracked at 1 kHz to a millimetre, in every scene: nothing tunnels, the force has no spikes, and the
// run is repeated from its recordings to the bit.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <glm/geometric.hpp>
#include <string>
#include <vector>

#include "haptic/denormals.hpp"
#include "human_hand.hpp"
#include "lockstep.hpp"
#include "measure/recording.hpp"
#include "measure/replay.hpp"
#include "temporary_file.hpp"

namespace haptic::test {
namespace {

// Ticks, centred on each. Cloth that does not stretch is caught within 0.08 s: that is the width of an impact, and the
// median of more would be of what surrounds it.
constexpr std::ptrdiff_t kWindow = 51;
constexpr double kMaxMedians = 2.0;  // bound of a spike, in medians of the whole run

/// N, greatest excess of the force over the median of the 0.05 s around it, where all of these are in contact.
double worst_spike(const std::vector<double>& force) {
    double worst = 0.0;
    std::vector<double> window;
    for (auto first = force.begin(); force.end() - first >= kWindow; ++first) {
        window.assign(first, first + kWindow);
        if (*std::min_element(window.begin(), window.end()) <= 0.0) {
            continue;
        }
        const auto middle = window.begin() + kWindow / 2;
        std::nth_element(window.begin(), middle, window.end());
        worst = std::max(worst, first[kWindow / 2] - *middle);
    }
    return worst;
}

class HumanTrace : public testing::TestWithParam<HandTrace> {};

/// Runs the trace through the whole chain without tunnelling, then repeats it from both recordings, to the bit.
/// `force`: N, per tick.
void run_twice(const HandTrace& trace, std::vector<double>& force) {
    const FlushDenormals flush;
    const sim::Scene scene = scene_of(trace);
    const TemporaryDirectory folder;
    const std::filesystem::path file = folder.file("trace.csv");
    const rt::TickSettings settings;
    std::vector<sim::StepInput> inputs;
    std::uint64_t hash = 0;
    {
        rt::Recorder recorder(16384, 1024);
        rt::RecordFile writer(file, recorder);
        Lockstep chain({.scene = scene, .hand = human_hand(scene, trace), .tick = settings, .recorder = &recorder});
        const int steps = static_cast<int>((trace.duration_s + 1e-3 * kHandRampMs) / scene.solver.step);
        const int closes = static_cast<int>((trace.closes_s + 1e-3 * kHandRampMs) / scene.solver.step);
        for (int step = 0; step < steps; ++step) {
            if (trace.closes_s >= 0.0 && step == closes) {
                chain.board().device().set_buttons(static_cast<std::uint8_t>(1u << scene.tool->close_button));
            }
            const sim::StepResult result = chain.step([&](const rt::TickRecord& tick, const device::EmulatedBoard&) {
                force.push_back(glm::length(tick.rendered.force));
            });
            inputs.push_back(chain.input());
            ASSERT_FALSE(result.crossed) << "the proxy's centre passed through a surface in step " << step;
            writer.drain();
        }
        writer.close();
        EXPECT_EQ(recorder.dropped() + recorder.frames_dropped(), 0u);
        EXPECT_EQ(chain.tick().faults(), 0u);
        hash = chain.simulation().state_hash();
    }

    sim::Simulation again(scene);
    for (const sim::StepInput& input : inputs) {
        again.step(input);
    }
    EXPECT_EQ(again.state_hash(), hash) << "host-sim repeated from its input poses";
    const RingSession session;
    RingWriter<DeviceState> states(session.name());
    rt::Replay replay(file, settings, states, no_clock);
    while (replay.step()) {
    }
    EXPECT_TRUE(replay.result().identical())
        << replay.result().first().first << " in line " << replay.result().first().second.line;
}

/// Without tunnelling, without spikes, and repeatable.
void expect_smooth(const HandTrace& trace) {
    std::vector<double> force;
    run_twice(trace, force);
    ASSERT_FALSE(testing::Test::HasFatalFailure());
    std::vector<double> felt = force;
    std::erase_if(felt, [](double f) { return f <= 0.0; });
    ASSERT_GT(felt.size(), 150u) << "too few ms in contact to prove anything";
    std::sort(felt.begin(), felt.end());
    // An impact may be strong; a spike stands out of its own 0.05 s. The effect of a hand that jumps by millimetres is
    // in both.
    const double median = felt[felt.size() / 2];
    const double spike = worst_spike(force);
    std::printf("%-10s %5zu ms in contact, median %.2f N, largest %.2f N, out of its own 0.05 s by %.2f N\n",
                trace.scene.c_str(), felt.size(), median, felt.back(), spike);
    EXPECT_LE(spike, kMaxMedians * median);
}

TEST_P(HumanTrace, DoesNotTunnelHasNoSpikesAndIsRepeatable) {
    expect_smooth(GetParam());
}

// Fingers that close put energy into the object.
TEST(HumanGrip, DoesNotTunnelHasNoSpikesAndIsRepeatable) {
    expect_smooth({"fish-grab", 0.2, 1.7, 0.3});
}

// A quantum of 1 mm is a step of the springs by 0.45 N, and more with damping, which hides what the grip does by
// itself. Real encoders resolve some 0.02 mm.
TEST(HumanGrip, HasNoSpikesWhenDampedAndTrackedFinely) {
    expect_smooth({.scene = "fish-grab",
                   .from_s = 0.2,
                   .duration_s = 1.7,
                   .closes_s = 0.3,
                   .settings = {"coupling.damping_time=0.01"},
                   .quantum = 1e-4});
}

/// Without friction cloth slips off a hand that moves within 0.15 s.
const std::vector<std::string> kRough{"proxy.static_friction=0.5", "proxy.dynamic_friction=0.4"};

INSTANTIATE_TEST_SUITE_P(Scenes, HumanTrace,
                         testing::Values(HandTrace{"cloth-drop", 0.0, 1.5, -1.0, kRough},
                                         HandTrace{"popout-fan", 0.0, 2.5}, HandTrace{"fish-hold", 0.5, 1.5},
                                         HandTrace{"fish-slide", 0.0, 1.5}, HandTrace{"four-fish", 0.5, 2.2},
                                         HandTrace{"curtain-hand", 0.4, 1.6}, HandTrace{"plane-slide", 0.3, 2.4},
                                         HandTrace{"rod-gap", 0.3, 2.4}),
                         [](const auto& trace) {
                             std::string name = trace.param.scene;
                             std::erase(name, '-');
                             return name;
                         });

}  // namespace
}  // namespace haptic::test
