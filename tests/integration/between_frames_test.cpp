// The force between the frames of a slow simulation, against one whose frames come with each tick. Prints the table of
// rt-core/docs/forces.md.
//
// A run with steps of 1 ms gives the reference. A second run of the same hand with steps of 20 ms would compare bodies
// as well: falling cloth and piles of fish go other ways after the first difference. So both renderings share one run:
// at each 20th step the simulation is copied (fork), the copy makes one step of 20 ms from the same state, and its
// frame is rendered until the next one along the same hand. Sub-steps are equal, 1 ms, so the bodies are as stiff in
// both. What remains is what a frame of a simulation at 50 steps/s does not know of its 20 ms.
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <glm/geometric.hpp>
#include <memory>
#include <ostream>
#include <stdexcept>
#include <string>
#include <vector>

#include "haptic/denormals.hpp"
#include "human_hand.hpp"
#include "lockstep.hpp"
#include "rendering/loaded_tool.hpp"
#include "rendering/renderer.hpp"
#include "tool/tool_proxies.hpp"

namespace haptic::test {
namespace {

constexpr int kSlowdown = 20;   // steps of the reference in one of the slow simulation
constexpr double kTick = 1e-3;  // s, and step of the reference
constexpr std::int64_t kTickNs = 1'000'000;

/// A frame that a child process writes.
class SharedFrame {
  public:
    SharedFrame()
        : frame_(static_cast<ContactFrame*>(
              mmap(nullptr, sizeof(ContactFrame), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0))) {
        if (frame_ == MAP_FAILED) {
            throw std::runtime_error("no shared memory for a frame");
        }
    }
    SharedFrame(const SharedFrame&) = delete;
    SharedFrame& operator=(const SharedFrame&) = delete;
    ~SharedFrame() { (void)munmap(frame_, sizeof(ContactFrame)); }
    ContactFrame& operator*() const { return *frame_; }

  private:
    ContactFrame* frame_;
};

/// Input of the next step. The curl of a hand that closes by its button advances by a tick, not by the slow step.
sim::StepInput input_of(Lockstep& chain) {
    sim::StepInput input = chain.next_input();
    const sim::Scene& scene = chain.simulation().scene();
    if (scene.tool && scene.tool->close_button >= 0) {
        const bool closes = ((input.buttons >> static_cast<unsigned>(scene.tool->close_button)) & 1U) != 0;
        const double aim = closes ? scene.tool->close_to : scene.tool->curl;
        const double most = kTick * scene.tool->close_speed;
        const double curl = chain.simulation().tool().curl();
        input.curl = curl + std::clamp(aim - curl, -most, most);
    }
    return input;
}

/// The frame that a simulation of kSlowdown ticks a step makes of the present state.
void make_slow_frame(Lockstep& chain, ContactFrame& frame) {
    const pid_t child = fork();
    if (child == 0) {
        chain.simulation().change_rate(kSlowdown * kTick, kSlowdown);
        (void)chain.simulation().step(input_of(chain));
        frame = chain.simulation().frame();
        _exit(0);
    }
    int status = -1;
    if (child < 0 || waitpid(child, &status, 0) != child || status != 0) {
        throw std::runtime_error("the copy of the simulation failed");
    }
}

/// Rms error of force and torque, relative to the rms of the reference, over the ticks with a force.
struct Deviation {
    double force = 0.0;
    double torque = 0.0;
    double reference = 0.0;         // N, rms
    double reference_torque = 0.0;  // N*m, rms
    int ticks = 0;
};

class Comparison {
  public:
    void add(const Wrench& reference, const Wrench& slow) {
        if (reference.force == Vec3(0.0) && slow.force == Vec3(0.0)) {
            return;
        }
        const auto square = [](const Vec3& v) { return glm::dot(v, v); };
        force_ += square(reference.force);
        torque_ += square(reference.torque);
        force_error_ += square(slow.force - reference.force);
        torque_error_ += square(slow.torque - reference.torque);
        ++ticks_;
    }
    [[nodiscard]] Deviation result() const {
        return {.force = std::sqrt(force_error_ / force_),
                .torque = torque_ > 0.0 ? std::sqrt(torque_error_ / torque_) : 0.0,
                .reference = std::sqrt(force_ / ticks_),
                .reference_torque = std::sqrt(torque_ / ticks_),
                .ticks = ticks_};
    }

  private:
    double force_ = 0.0;
    double torque_ = 0.0;
    double force_error_ = 0.0;
    double torque_error_ = 0.0;
    int ticks_ = 0;
};

struct Measured {
    Deviation planes;    // of the frame's contact problem alone
    Deviation rendered;  // with the follower that joins frames
};

/// Renders frames by their contact problem alone.
class PlaneRenderer {
  public:
    void accept(const ContactFrame& frame) {
        frame_ = frame;
        tool_.load(frame_);
    }
    Wrench render(const Pose& grip, std::int64_t now_ns) {
        const GripMotion motion{.pose = grip, .previous = last_, .elapsed_s = kTick};
        last_ = grip;
        return tool_.render(frame_.stiffness, motion, now_ns).wrench;
    }

  private:
    ContactFrame frame_{};
    haptic::test::LoadedTool tool_;
    Pose last_;
};

Measured measure(HandTrace trace) {
    trace.settings.insert(trace.settings.end(),
                          {"solver.step=" + std::to_string(kTick), "solver.substeps=1", "solver.iterations=1"});
    const sim::Scene scene = scene_of(trace);
    Lockstep chain({.scene = scene, .hand = human_hand(scene, trace), .tick = {}});
    const SharedFrame sent;
    // The same renderers for both: no other limits than the follower.
    const auto reference = std::make_unique<FrameRenderer>(FrameSettings{});
    const auto slow = std::make_unique<FrameRenderer>(FrameSettings{});
    const auto reference_planes = std::make_unique<PlaneRenderer>();
    const auto slow_planes = std::make_unique<PlaneRenderer>();
    Comparison rendered;
    Comparison planes;
    const int ramp = kHandRampMs;
    const int steps = static_cast<int>(trace.duration_s / kTick) + ramp;
    const int closes = trace.closes_s < 0.0 ? steps : static_cast<int>(trace.closes_s / kTick) + ramp;
    for (int step = 0; step < steps; ++step) {
        if (step == closes) {
            chain.board().device().set_buttons(static_cast<std::uint8_t>(1U << scene.tool->close_button));
        }
        const bool is_slow_step = step % kSlowdown == 0;
        if (is_slow_step) {
            make_slow_frame(chain, *sent);
        }
        (void)chain.step([&](const rt::TickRecord& tick, const device::EmulatedBoard&) {
            const auto accept = [&](FrameRenderer& renderer, PlaneRenderer& alone, const ContactFrame& frame) {
                ContactFrame published = frame;
                published.publish_time_ns = tick.now_ns;
                EXPECT_EQ(renderer.accept(published, tick.now_ns), FrameDefect::None);
                alone.accept(frame);
            };
            accept(*reference, *reference_planes, chain.simulation().frame());
            if (is_slow_step) {
                accept(*slow, *slow_planes, *sent);
            }
            const auto render = [&](FrameRenderer& renderer) {
                return renderer.render(tick.pose, tick.now_ns, kTickNs).contact.wrench;
            };
            const Wrench exact = render(*reference);
            const Wrench between = render(*slow);
            const Wrench exact_planes = reference_planes->render(tick.pose, tick.now_ns);
            const Wrench between_planes = slow_planes->render(tick.pose, tick.now_ns);
            if (step >= ramp) {
                rendered.add(exact, between);
                planes.add(exact_planes, between_planes);
            }
        });
    }
    return {.planes = planes.result(), .rendered = rendered.result()};
}

struct Case {
    HandTrace trace;
    double largest;  // error of the rendered force
};

std::ostream& operator<<(std::ostream& out, const Case& c) {
    return out << c.trace.scene;
}

class BetweenFrames : public testing::TestWithParam<Case> {};

TEST_P(BetweenFrames, AFrameAt50HertzLastsUntilTheNextOne) {
    const FlushDenormals flush;
    const Measured measured = measure(GetParam().trace);
    const Deviation& rendered = measured.rendered;
    std::printf(
        "%-12s %4d ms in contact, rms %.3f N, %5.2f mN m; error of the force: planes %5.1f %%, rendered %5.1f %%; "
        "of the torque %5.1f %%, %5.1f %%\n",
        GetParam().trace.scene.c_str(), rendered.ticks, rendered.reference, 1e3 * rendered.reference_torque,
        100.0 * measured.planes.force, 100.0 * rendered.force, 100.0 * measured.planes.torque, 100.0 * rendered.torque);
    ASSERT_GT(rendered.ticks, 150) << "too little contact to measure";
    EXPECT_LE(rendered.force, GetParam().largest);
}

/// The error of no force at all: where impacts decide, a frame is only better than none.
constexpr double kNoForce = 1.0;

INSTANTIATE_TEST_SUITE_P(Scenes, BetweenFrames,
                         testing::Values(Case{{"fish-slide", 0.3, 2.0}, 0.12}, Case{{"plane-slide", 0.3, 1.4}, 0.05},
                                         Case{{"fish-hold", 0.8, 1.5}, 0.12},
                                         Case{{"curtain-hand", 0.4, 1.6}, kNoForce},
                                         Case{{"cloth-drop", 0.0, 1.1}, kNoForce},
                                         Case{{"fish-grab", 0.2, 1.7, 0.3}, kNoForce}),
                         [](const auto& c) {
                             std::string name = c.param.trace.scene;
                             std::erase(name, '-');
                             return name;
                         });

}  // namespace
}  // namespace haptic::test
