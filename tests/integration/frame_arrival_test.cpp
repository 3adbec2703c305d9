// Force of a slow simulation: with 30, 60 and 100 steps/s under a loop of 1 kHz, the force may change from one
// millisecond to the next by at most 1.5 times what the surface's own motion causes:
//     |dF| <= 1.5 k v T + 1 mN,    v: speed of the surface relative to the hand, as the simulation's frame says
// even if frames contradict one another or arrive late.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <glm/geometric.hpp>
#include <numbers>
#include <string>
#include <vector>

#include "lockstep.hpp"
#include "rendering/loaded_tool.hpp"
#include "rendering/renderer.hpp"

namespace haptic::test {
namespace {

constexpr double kTick = 1e-3;        // s
constexpr double kReleaseTicks = 50;  // for a force to end after its surface is gone

/// Steps of the force relative to the bound.
struct Steps {
    double largest = 0.0;    // N
    double over = 0.0;       // maximum of |dF| / bound
    double raw = 0.0;        // the same for a loop that renders each frame unfiltered
    double raw_steps = 0.0;  // N, largest step of that loop
    double peak = 0.0;       // N
    int contact_ticks = 0;
};

/// m, longest displacement of the hand relative to any of the planes in a tick.
double relative_displacement(const ContactFrame& frame, const Vec3& displacement) {
    const ProxyContact& proxy = frame.proxies[0];
    double longest = proxy.plane_count == 0 ? glm::length(displacement) : 0.0;
    for (std::uint32_t k = 0; k < proxy.plane_count; ++k) {
        const ContactPlane& plane = proxy.planes[k];
        longest = std::max(longest, glm::length(displacement - plane.velocity * kTick * to_vec3(plane.normal)));
    }
    return longest;
}

/// Checks each tick against the frame that it rendered, copied when the tick read it.
class Judge {
  public:
    void see(const rt::TickRecord& tick, const ContactFrame& newest) {
        if (tick.frame_sequence != sequence_) {
            sequence_ = tick.frame_sequence;
            frame_ = newest;
            tool_.load(frame_);
        }
        const Vec3 force = tick.rendered.force;
        const Vec3 raw =
            tool_.render(frame_.stiffness, {.pose = tick.pose, .previous = tick.pose}, tick.now_ns).wrench.force;
        if (seen_) {
            const double displacement = relative_displacement(frame_, tick.pose.position - position_);
            double bound = 1.5 * frame_.stiffness * displacement + 1e-3;
            raw_worst(glm::length(raw - raw_), bound);
            if (tick.in_contact == 0) {
                lost_ = in_contact_ ? glm::length(force_) : lost_;
                bound = std::max(bound, lost_ / kReleaseTicks);
            }
            const double change = glm::length(force - force_);
            steps.largest = std::max(steps.largest, change);
            steps.over = std::max(steps.over, change / bound);
        }
        steps.peak = std::max(steps.peak, glm::length(force));
        steps.contact_ticks += tick.in_contact > 0 ? 1 : 0;
        seen_ = true;
        in_contact_ = tick.in_contact > 0;
        force_ = force;
        raw_ = raw;
        position_ = tick.pose.position;
    }
    Steps steps;

  private:
    void raw_worst(double change, double bound) {
        steps.raw = std::max(steps.raw, change / bound);
        steps.raw_steps = std::max(steps.raw_steps, change);
    }

    ContactFrame frame_{};
    haptic::test::LoadedTool tool_;
    std::uint64_t sequence_ = 0;
    bool seen_ = false;
    bool in_contact_ = false;
    double lost_ = 0.0;
    Vec3 force_{0.0};
    Vec3 raw_{0.0};
    Vec3 position_{0.0};
};

struct ArrivalCase {
    int steps_per_s;
    double late;  // delay of each frame after the beginning of its step, in steps
    bool moving;  // the hand oscillates
};

/// Oscillation of a few mm at up to 0.05 m/s.
PoseTrack swinging_hand() {
    std::vector<double> times;
    std::vector<Pose> poses;
    for (int i = 0; i <= 3000; ++i) {
        const double t = i * 1e-3;
        const double ease = std::min(1.0, t);
        times.push_back(t);
        poses.push_back({ease * Vec3(0.006 * std::sin(7.0 * t), 0.004 * std::sin(11.0 * t), 0.003 * std::sin(5.0 * t)),
                         Quat(1, 0, 0, 0)});
    }
    return {std::move(times), std::move(poses)};
}

Steps fall(const ArrivalCase& which) {
    sim::Scene scene = sim::read_scene(sim::open_scene("cloth-drop"), "cloth-drop");
    scene.solver.step = 1.0 / which.steps_per_s;
    Lockstep chain({.scene = scene,
                    .hand = which.moving ? swinging_hand() : PoseTrack(),
                    .tick = {},
                    .late_ns = nanoseconds(which.late * scene.solver.step)});
    Judge judge;
    for (int step = 0; step < 5 * which.steps_per_s / 2; ++step) {
        chain.step([&](const rt::TickRecord& tick, const device::EmulatedBoard&) {
            judge.see(tick, chain.simulation().frame());
        });
    }
    return judge.steps;
}

class FrameArrival : public testing::TestWithParam<ArrivalCase> {};

TEST_P(FrameArrival, ForceChangesNoFasterThanTheSurfaceMoves) {
    const ArrivalCase& which = GetParam();
    const Steps steps = fall(which);
    std::printf(
        "%3d steps/s, %.1f steps late, hand %s: %4d ticks in contact, peak %.2f N, |dF| <= %.1f mN, %.3f of the "
        "bound; frames as they come: %.0f mN, %.0f times the bound\n",
        which.steps_per_s, which.late, which.moving ? "moves" : "still", steps.contact_ticks, steps.peak,
        1e3 * steps.largest, steps.over, 1e3 * steps.raw_steps, steps.raw);
    EXPECT_LE(steps.over, 1.0 + 1e-6);
    EXPECT_GT(steps.contact_ticks, 80)
        << "too little contact to prove anything; a moving hand loses the cloth after 97";
    EXPECT_GT(steps.peak, 0.5) << "N";
    EXPECT_GT(steps.raw, 3.0) << "without the follower the bound must be violated, or this proves nothing";
}

INSTANTIATE_TEST_SUITE_P(Rates, FrameArrival,
                         testing::Values(ArrivalCase{30, 0.0, false}, ArrivalCase{60, 0.0, false},
                                         ArrivalCase{100, 0.0, false}, ArrivalCase{30, 0.6, true},
                                         ArrivalCase{60, 0.6, true}, ArrivalCase{100, 0.6, true}),
                         [](const auto& drop) {
                             return std::to_string(drop.param.steps_per_s) + "StepsPerSecond" +
                                    (drop.param.moving ? "LateUnderAMovingHand" : "");
                         });

}  // namespace
}  // namespace haptic::test
