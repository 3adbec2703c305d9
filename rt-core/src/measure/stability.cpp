#include "measure/stability.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "haptic/ring.hpp"
#include "measure/trial_rig.hpp"
#include "tick/slot_source.hpp"

namespace haptic::rt {
namespace {

constexpr double kWall = -0.002;        // m, height of the wall's surface
constexpr double kHandTarget = -0.012;  // m, height to which the hand moves
constexpr double kApproachS = 0.1;      // s, duration of that motion
constexpr double kWindowS = 0.4;        // s, over which an amplitude is measured
constexpr double kSettleS = 0.1;        // s, between the end of the motion and the first window
constexpr double kVisible = 2e-4;       // m, smaller vibrations come from encoder and DAC quantisation
constexpr double kMinEnergy = -1e-4;    // J, below: energy was generated
constexpr double kMinDurationS = 1.0;   // s

PoseTrack pressing_hand() {
    const Quat level(1.0, 0.0, 0.0, 0.0);
    return {{0.0, kApproachS, kApproachS + 1.0},
            {Pose{}, Pose{{0.0, kHandTarget, 0.0}, level}, Pose{{0.0, kHandTarget, 0.0}, level}}};
}

/// One trial: the tick, the emulated board, and the simulation's side of the rings.
class RunningTrial {
  public:
    explicit RunningTrial(const StabilityTrial& trial)
        : trial_(trial),
          session_(unique_session()),
          frame_reader_(session_),
          frames_in_(frame_reader_),
          rig_({.session = session_, .tick = trial.tick, .hand = pressing_hand(), .mechanics = trial.mechanics},
               frames_in_),
          frames_out_(session_),
          states_in_(session_) {
        // The delay line holds whole ticks.
        if (trial.delay_ns < 0 || trial.delay_ns % trial.tick.period_ns != 0) {
            throw std::invalid_argument("stability: the delay must be a multiple of the period");
        }
        if (!(trial.duration_s >= kMinDurationS)) {
            throw std::invalid_argument("stability: a trial must last at least 1 s");
        }
        // Without a delay one entry, which is not read.
        heights_.assign(static_cast<std::size_t>(std::max<std::int64_t>(trial.delay_ns / trial.tick.period_ns, 1)),
                        0.0);
    }

    StabilityOutcome run() {
        rig_.arm();
        StabilityOutcome outcome;
        const auto ticks_in = [this](double time_s) {
            return static_cast<std::size_t>(nanoseconds(time_s) / trial_.tick.period_ns);
        };
        // Tick numbers of the measured windows.
        const std::size_t begin = ticks_in(kApproachS + kSettleS);
        const std::size_t all = ticks_in(kApproachS + trial_.duration_s);
        const std::size_t window = ticks_in(kWindowS);
        // Release the hand, which then presses the grip into the wall; a fault ends the trial early.
        std::vector<double> heights;
        heights.reserve(all);
        rig_.release_hand();
        auto fresh = std::make_unique<Instruments>(trial_.tick.period_ns);
        rig_.tick().swap_instruments(fresh);
        while (heights.size() < all && rig_.tick().faults() == 0) {
            press();
            heights.push_back(rig_.grip_pose().position.y);
        }
        // Amplitudes of the first window after the approach and of the last window.
        const Instruments& measured = rig_.tick().instruments();
        const std::span<const double> track(heights);
        outcome.first_amplitude =
            amplitude_of(track.subspan(std::min(begin, track.size()))
                             .first(std::min(window, track.size() - std::min(begin, track.size()))));
        outcome.last_amplitude = amplitude_of(track.last(std::min(window, track.size())));
        // Energy balance, peak force, and share of ticks in which the controller acted.
        outcome.min_energy = measured.min_energy;
        outcome.peak_force = measured.peak_force;
        outcome.controlled = static_cast<double>(measured.passivity_ticks) / static_cast<double>(all);
        outcome.faults = rig_.tick().faults();
        // Verdict, as defined in the header.
        const bool sustained =
            outcome.min_energy < kMinEnergy && outcome.last_amplitude > 0.5 * outcome.first_amplitude;
        outcome.grows = outcome.faults != 0 || (outcome.last_amplitude > kVisible &&
                                                (outcome.last_amplitude > outcome.first_amplitude || sustained));
        return outcome;
    }

  private:
    /// Publishes the reply to the delayed pose, and runs one tick.
    void press() {
        // The tick's exchange would move the board anyway. Moving it here first has the same result, and lets an
        // undelayed frame use the pose that the tick is going to measure.
        rig_.advance_grip();
        ContactFrame frame = reply();
        frames_out_.publish(frame, rig_.now_ns());
        rig_.run_tick();
        // Keep the measured height in the delay line.
        if (states_in_.read_newest(state_)) {
            heights_[next_] = state_.position[1];
            next_ = next_ + 1 == heights_.size() ? 0 : next_ + 1;
        }
    }

    /// The contact frame of this tick, according to the delayed part.
    [[nodiscard]] ContactFrame reply() const {
        const double now = rig_.grip_pose().position.y;
        // The newest published state is already one period old, so a frame without delay uses the grip itself.
        const double then = trial_.delay_ns == 0 ? now : heights_[next_];
        ContactFrame frame{};
        // The simulation steps once per tick and answers a state as old as the delay.
        frame.state_time_ns = rig_.now_ns() - trial_.delay_ns;
        frame.plane_time_ns = rig_.now_ns();
        frame.publish_time_ns = rig_.now_ns();
        frame.step_ns = trial_.tick.period_ns;
        frame.stiffness = trial_.stiffness;
        frame.proxy_count = 1;
        ProxyContact& proxy = frame.proxies[0];
        // One proxy on the wall, with the wall's plane.
        proxy.position[1] = std::max(kWall, then);
        proxy.in_contact = then < kWall ? 1 : 0;
        proxy.plane_count = 1;
        proxy.planes[0].normal[1] = 1.0;
        proxy.planes[0].offset = kWall;
        // With delayed planes the tick itself decides on contact. A delayed contact decides whether there is a plane.
        if (trial_.late == DelayedPart::Contact) {
            proxy.plane_count = proxy.in_contact;
        } else if (trial_.late == DelayedPart::Force && trial_.delay_ns > 0) {
            proxy.plane_count = proxy.in_contact;
            proxy.planes[0].offset = now + (kWall - then);  // the delayed depth, measured from the present grip
        }
        return frame;
    }

    StabilityTrial trial_;
    std::string session_;
    RingReader<ContactFrame> frame_reader_;
    RingFrames frames_in_;
    TrialRig rig_;
    RingWriter<ContactFrame> frames_out_;
    RingReader<DeviceState> states_in_;
    DeviceState state_{};
    std::vector<double> heights_;  // m, delay line: ring of the measured heights of the last `delay`
    std::size_t next_ = 0;         // index of the oldest
};

}  // namespace

std::string_view name_of(DelayedPart late) noexcept {
    switch (late) {
        case DelayedPart::Planes:
            return "planes";
        case DelayedPart::Contact:
            return "contact";
        case DelayedPart::Force:
            return "force";
    }
    return "unknown";
}

device::GripMechanics undamped_mechanics() {
    device::GripMechanics mechanics;
    mechanics.mass = 0.1;
    mechanics.damping = 0.3;
    mechanics.motor_drag = 0.0;
    mechanics.motor_friction = 0.0;
    mechanics.hand_stiffness = 100.0;
    mechanics.hand_damping = 0.0;
    return mechanics;
}

StabilityOutcome run_stability_trial(const StabilityTrial& trial) {
    // On the heap: a tick with its black box exceeds some stacks.
    return std::make_unique<RunningTrial>(trial)->run();
}

}  // namespace haptic::rt
