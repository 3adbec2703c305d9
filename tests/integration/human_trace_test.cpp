// Human-like hand, tracked at 1 kHz to a millimetre, in every scene: nothing tunnels, the force has no spikes, and the
// run is repeated from its recordings to the bit.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <numbers>
#include <ostream>
#include <string>
#include <vector>

#include "haptic/denormals.hpp"
#include "lockstep.hpp"
#include "measure/recording.hpp"
#include "measure/replay.hpp"
#include "temporary_file.hpp"

namespace haptic::test {
namespace {

constexpr std::ptrdiff_t kWindow = 101;  // ticks, centred on each
constexpr double kQuantum = 1e-3;        // m, resolution of the tracking
constexpr double kStroke = 0.3;          // s, from one point to the next
constexpr double kReach = 0.003;         // m at the device, deviation of a stroke's end from the script
constexpr double kTremor = 0.0003;       // m, at 9 to 11 Hz
constexpr double kMaxMedians = 2.0;      // bound of a spike, in medians of the 0.1 s around it
constexpr int kRampMs = 600;             // ms, from the device's centre to the start of the script
constexpr int kAppearingMs = 100;        // ms, in which the tool appears at the centre, in some scenes inside an object

std::int64_t no_clock() HAPTIC_RT {
    return 0;
}

/// Pseudo-random number in -1..1, the same on every machine (integer hash).
class Wander {
  public:
    double next() {
        state_ = state_ * 6364136223846793005u + 1442695040888963407u;
        return static_cast<double>(state_ >> 33) / 1073741824.0 - 1.0;
    }
    Vec3 random_point() {
        const double x = next();
        const double y = next();
        return kReach * Vec3(x, y, next());
    }

  private:
    std::uint64_t state_ = 4;
};

double minimum_jerk(double x) {  // Flash and Hogan 1985
    return x * x * x * (10.0 + x * (6.0 * x - 15.0));
}

struct Trace {
    std::string scene;
    double from_s;      // of the script
    double duration_s;  // after the ramp
    /// s after the ramp: from then on the closing button is held; negative: never.
    double closes_s = -1.0;
};

/// Minimum-jerk strokes between points near the script's path, with tremor, quantised to millimetres. The script starts
/// after the ramp.
PoseTrack human_hand(const sim::Scene& scene, const Trace& trace) {
    const sim::Workspace workspace(scene.workspace);
    Wander wander;
    std::vector<double> times;
    std::vector<Pose> poses;
    const auto script_at = [&](double script_s) { return workspace.to_device(scene.hand.at(nanoseconds(script_s))); };
    const Pose begin = script_at(trace.from_s);
    Vec3 from(0.0);
    Vec3 to = wander.random_point();
    int stroke = 0;
    for (int ms = 0; ms <= static_cast<int>(trace.duration_s * 1000.0) + kRampMs; ++ms) {
        const double t = 1e-3 * ms;
        if (t >= (stroke + 1) * kStroke) {
            ++stroke;
            from = to;
            to = wander.random_point();
        }
        const double ramp = minimum_jerk(std::min(1.0, static_cast<double>(ms) / kRampMs));
        const Pose script = ms < kRampMs ? interpolate(Pose{}, begin, ramp)
                                         : script_at(trace.from_s + 1e-3 * std::max(0, ms - kRampMs));
        const Vec3 aside = from + minimum_jerk((t - stroke * kStroke) / kStroke) * (to - from);
        const double w = 2.0 * std::numbers::pi * t;
        const Vec3 tremor = kTremor * Vec3(std::sin(9.0 * w), std::sin(10.0 * w + 1.0), std::sin(11.0 * w + 2.0));
        const Vec3 exact = script.position + aside + tremor;
        const auto cut = [](double x) { return kQuantum * std::round(x / kQuantum); };
        times.push_back(t);
        poses.push_back({{cut(exact.x), cut(exact.y), cut(exact.z)}, script.orientation});
    }
    return {std::move(times), std::move(poses)};
}

/// N, greatest excess of the force over the median of the 0.1 s around it, where all of these are in contact.
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

std::ostream& operator<<(std::ostream& out, const Trace& trace) {
    return out << trace.scene;
}

class HumanTrace : public testing::TestWithParam<Trace> {};

/// Runs the trace through the whole chain without tunnelling, then repeats it from both recordings, to the bit.
/// `force`: N, per tick, from kAppearingMs on.
void run_twice(const Trace& trace, std::vector<double>& force) {
    const FlushDenormals flush;
    const sim::Scene scene = sim::read_scene(sim::open_scene(trace.scene), trace.scene);
    const TemporaryDirectory folder;
    const std::filesystem::path file = folder.file("trace.csv");
    const rt::TickSettings settings;
    std::vector<sim::StepInput> inputs;
    std::uint64_t hash = 0;
    {
        rt::Recorder recorder(16384, 1024);
        rt::RecordFile writer(file, recorder);
        Lockstep chain({.scene = scene, .hand = human_hand(scene, trace), .tick = settings, .recorder = &recorder});
        const int steps = static_cast<int>((trace.duration_s + 1e-3 * kRampMs) / scene.solver.step);
        const int closes = static_cast<int>((trace.closes_s + 1e-3 * kRampMs) / scene.solver.step);
        for (int step = 0; step < steps; ++step) {
            if (trace.closes_s >= 0.0 && step == closes) {
                chain.board().device().set_buttons(static_cast<std::uint8_t>(1u << scene.tool->close_button));
            }
            const sim::StepResult result = chain.step([&](const rt::TickRecord& tick, const device::EmulatedBoard&) {
                // Without limits of its own rt-core limits only frames whose compliance lacks the springs.
                EXPECT_EQ(tick.flags & HAPTIC_TICK_STIFFNESS_LIMITED, 0u) << "step " << step;
                if (step * scene.solver.step >= 1e-3 * kAppearingMs) {
                    force.push_back(glm::length(tick.rendered.force));
                }
            });
            inputs.push_back(chain.input());
            ASSERT_FALSE(result.crossed) << "the proxy's centre passed through a surface in step " << step;
            ASSERT_FALSE(result.passed_through) << "step " << step;
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
void expect_smooth(const Trace& trace) {
    std::vector<double> force;
    run_twice(trace, force);
    ASSERT_FALSE(testing::Test::HasFatalFailure());
    std::vector<double> felt = force;
    std::erase_if(felt, [](double f) { return f <= 0.0; });
    ASSERT_GT(felt.size(), 150u) << "too few ms in contact to prove anything";
    std::sort(felt.begin(), felt.end());
    // An impact may be strong; a spike stands out of its own 0.1 s. The effect of a hand that jumps by millimetres is
    // in both.
    const double median = felt[felt.size() / 2];
    const double spike = worst_spike(force);
    std::printf("%-10s %5zu ms in contact, median %.2f N, largest %.2f N, out of its own 0.1 s by %.2f N\n",
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

INSTANTIATE_TEST_SUITE_P(Scenes, HumanTrace,
                         testing::Values(Trace{"cloth-drop", 0.0, 1.9}, Trace{"popout-fan", 0.0, 2.5},
                                         Trace{"fish-hold", 0.5, 1.5}, Trace{"fish-slide", 0.0, 1.5},
                                         Trace{"four-fish", 0.5, 2.2}, Trace{"curtain-hand", 0.4, 1.6},
                                         Trace{"plane-slide", 0.3, 2.4}, Trace{"rod-gap", 0.3, 2.4}),
                         [](const auto& trace) {
                             std::string name = trace.param.scene;
                             std::erase(name, '-');
                             return name;
                         });

}  // namespace
}  // namespace haptic::test
