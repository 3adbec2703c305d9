#include "measure/scene_trial.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <deque>
#include <memory>
#include <span>
#include <stdexcept>
#include <thread>
#include <vector>

#include "haptic/clock.hpp"
#include "haptic/ring.hpp"
#include "measure/trial_rig.hpp"
#include "tick/slot_source.hpp"

namespace haptic::rt {
namespace {

constexpr std::chrono::microseconds kPoll{20};
constexpr std::int64_t kMaxSilenceNs = 60 * kNanosecondsPerSecond;

/// Frames on their way to the tick.
class DelayedFrames final : public FrameSource {
  public:
    void send(const ContactFrame& frame, std::int64_t arrival_ns) { waiting_.push_back({frame, arrival_ns}); }

    /// Lets frames arrive that are due; the newest of them replaces the others.
    void arrive(std::int64_t now_ns) {
        while (!waiting_.empty() && waiting_.front().arrival_ns <= now_ns) {
            arrived_ = waiting_.front().frame;
            arrived_.publish_time_ns = now_ns;
            is_new_ = true;
            waiting_.pop_front();
        }
    }

    [[nodiscard]] bool read_newest(ContactFrame& frame) HAPTIC_RT override {
        if (!is_new_) {
            return false;
        }
        frame = arrived_;
        is_new_ = false;
        return true;
    }

  private:
    struct Sent {
        ContactFrame frame;
        std::int64_t arrival_ns = 0;
    };
    std::deque<Sent> waiting_;
    ContactFrame arrived_{};
    bool is_new_ = false;
};

class RunningSceneTrial {
  public:
    explicit RunningSceneTrial(const SceneTrial& trial)
        : trial_(trial),
          rig_({.session = trial.session, .tick = trial.tick, .hand = trial.hand, .mechanics = trial.mechanics},
               delayed_),
          frames_(trial.session) {
        if (trial.delay_ns < 0 || !(trial.still_s >= kSceneSettleS + 2.0 * kSceneWindowS)) {
            throw std::invalid_argument(
                "stability: the delay must not be negative, and the hand must be still for 2.8 s or longer");
        }
    }

    SceneOutcome run() {
        rig_.arm();
        rig_.release_hand();
        auto fresh = std::make_unique<Instruments>(trial_.tick.period_ns);
        rig_.tick().swap_instruments(fresh);
        // host-sim starts with the state of the tick that has just run.
        step_ns_ = latch_ns();
        take_answer();
        SceneOutcome outcome{.stiffness = answer_.stiffness};
        // The grip's way until the end, or until a fault.
        const std::size_t ticks = ticks_in(trial_.moving_s + trial_.still_s);
        for (std::vector<double>& way : way_) {
            way.reserve(ticks);
        }
        std::uint64_t touched_before = 0;
        while (way_[0].size() < ticks && rig_.tick().faults() == 0) {
            delayed_.arrive(rig_.now_ns());
            rig_.run_tick();
            if (latch_ns() >= step_ns_) {
                take_answer();
            }
            if (way_[0].size() < ticks_in(trial_.moving_s)) {
                touched_before = rig_.tick().instruments().contact_ticks;
            }
            const Vec3 grip = rig_.grip_pose().position;
            for (std::size_t axis = 0; axis < way_.size(); ++axis) {
                way_[axis].push_back(grip[static_cast<glm::length_t>(axis)]);
            }
        }
        const std::size_t window = ticks_in(kSceneWindowS);
        outcome.first_amplitude = amplitude(ticks_in(trial_.moving_s + kSceneSettleS), window);
        outcome.last_amplitude = amplitude(way_[0].size() - std::min(window, way_[0].size()), window);
        const Instruments& measured = rig_.tick().instruments();
        outcome.min_energy = measured.min_energy;
        outcome.peak_force = measured.peak_force;
        outcome.touching = static_cast<double>(measured.contact_ticks - touched_before) /
                           static_cast<double>(ticks_in(trial_.still_s));
        outcome.controlled = static_cast<double>(measured.passivity_ticks) / static_cast<double>(ticks);
        outcome.faults = rig_.tick().faults();
        return outcome;
    }

  private:
    [[nodiscard]] std::size_t ticks_in(double time_s) const {
        return static_cast<std::size_t>(nanoseconds(time_s) / trial_.tick.period_ns);
    }
    [[nodiscard]] std::int64_t latch_ns() const { return rig_.now_ns() - trial_.tick.period_ns; }

    /// Waits for the frame of the step that begins now, and sends it on its way.
    void take_answer() {
        const std::int64_t begin_ns = monotonic_now_ns();
        while (!frames_.read_newest(answer_)) {
            if (!trial_.peer_runs()) {
                throw std::runtime_error("stability: host-sim has ended");
            }
            if (monotonic_now_ns() - begin_ns > kMaxSilenceNs) {
                throw std::runtime_error("stability: no frame of host-sim for a minute");
            }
            std::this_thread::sleep_for(kPoll);
        }
        delayed_.send(answer_, latch_ns() + trial_.delay_ns);
        step_ns_ += answer_.step_ns;
    }

    /// Peak to peak in a window, along the axis where it is largest.
    [[nodiscard]] double amplitude(std::size_t begin, std::size_t window) const {
        double largest = 0.0;
        for (const std::vector<double>& way : way_) {
            const std::span<const double> after = std::span(way).subspan(std::min(begin, way.size()));
            largest = std::max(largest, amplitude_of(after.first(std::min(window, after.size()))));
        }
        return largest;
    }

    const SceneTrial& trial_;
    DelayedFrames delayed_;
    TrialRig rig_;
    RingReader<ContactFrame> frames_;
    ContactFrame answer_{};
    std::int64_t step_ns_ = 0;                // beginning of host-sim's next step
    std::array<std::vector<double>, 3> way_;  // m, of the grip in each tick, by axis
};

}  // namespace

SceneOutcome run_scene_trial(const SceneTrial& trial) {
    // On the heap: a tick with its black box exceeds some stacks.
    return std::make_unique<RunningSceneTrial>(trial)->run();
}

}  // namespace haptic::rt
