#include "measure/stability.hpp"

#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <memory>
#include <numeric>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "haptic/device/emulated_board.hpp"
#include "haptic/ring.hpp"

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

std::int64_t frozen_clock() HAPTIC_RT {
    return 0;
}

std::string unique_session() {
    static std::atomic<unsigned> count{0};
    return "stability-" + std::to_string(getpid()) + "-" + std::to_string(count.fetch_add(1));
}

PoseTrack pressing_hand() {
    const Quat level(1.0, 0.0, 0.0, 0.0);
    return {{0.0, kApproachS, kApproachS + 1.0},
            {Pose{}, Pose{{0.0, kHandTarget, 0.0}, level}, Pose{{0.0, kHandTarget, 0.0}, level}}};
}

TickSettings with_short_arming(TickSettings settings) {
    settings.safety.tension_ramp_ns = 100'000'000;
    settings.safety.calibration_hold_ns = 50'000'000;
    settings.frames.ramp_ns = settings.period_ns;  // full stiffness from the first tick
    return settings;
}

/// Peak-to-peak amplitude of equidistant samples after removing their least-squares line, because a slow drift is no
/// vibration. 0 for fewer than three samples.
double amplitude(std::span<const double> values) {
    if (values.size() < 3) {
        return 0.0;
    }
    // Slope of the least-squares line over the sample index, centred: cov(x, value) / var(x).
    const double middle = 0.5 * static_cast<double>(values.size() - 1);
    const double mean = std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
    double covariance = 0.0;
    double variance = 0.0;
    for (std::size_t i = 0; i < values.size(); ++i) {
        const double x = static_cast<double>(i) - middle;
        covariance += x * (values[i] - mean);
        variance += x * x;
    }
    // Range of the residuals.
    double low = 0.0;
    double high = 0.0;
    for (std::size_t i = 0; i < values.size(); ++i) {
        const double off = values[i] - mean - covariance / variance * (static_cast<double>(i) - middle);
        low = std::min(low, off);
        high = std::max(high, off);
    }
    return high - low;
}

/// One trial: the tick, the emulated board, and the simulation's side of the rings.
class Trial {
  public:
    explicit Trial(const StabilityTrial& trial)
        : trial_(trial),
          session_(unique_session()),
          board_({.geometry = trial.tick.geometry,
                  .hand = pressing_hand(),
                  .power_up = {60000, 1, 32768, 12345, 65535, 0, 40000, 777},
                  .hand_waits = true,
                  .mechanics = trial.mechanics}),
          frames_in_(session_),
          states_out_(session_),
          frames_out_(session_),
          states_in_(session_),
          tick_(with_short_arming(trial.tick), board_, frames_in_, states_out_, frozen_clock) {
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
        arm();
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
        board_.device().release_hand();
        tick_.set_instruments(Instruments{});
        while (heights.size() < all && tick_.faults() == 0) {
            press();
            heights.push_back(board_.device().grip_pose().position.y);
        }
        // Amplitudes of the first window after the approach and of the last window.
        const Instruments& measured = tick_.instruments();
        const std::span<const double> track(heights);
        outcome.first_amplitude = amplitude(track.subspan(std::min(begin, track.size()))
                                                .first(std::min(window, track.size() - std::min(begin, track.size()))));
        outcome.last_amplitude = amplitude(track.last(std::min(window, track.size())));
        // Energy balance, peak force, and share of ticks in which the controller acted.
        outcome.min_energy = measured.min_energy;
        outcome.peak_force = measured.peak_force;
        outcome.controlled = static_cast<double>(measured.passivity_ticks) / static_cast<double>(all);
        outcome.faults = tick_.faults();
        // Verdict, as defined in the header.
        const bool sustained =
            outcome.min_energy < kMinEnergy && outcome.last_amplitude > 0.5 * outcome.first_amplitude;
        outcome.grows = outcome.faults != 0 || (outcome.last_amplitude > kVisible &&
                                                (outcome.last_amplitude > outcome.first_amplitude || sustained));
        return outcome;
    }

  private:
    /// Runs ticks until the safety machine is Running; allows three times the nominal arming time.
    void arm() {
        // Ramp the tension and calibrate, while the hand waits at the centre.
        tick_.arm();
        const SafetySettings& safety = with_short_arming(trial_.tick).safety;
        const std::int64_t until_ns = 3 * arming_time_ns(safety);
        for (std::int64_t t = 0; t < until_ns && tick_.safety_state() != SafetyState::Running;
             t += trial_.tick.period_ns) {
            step();
        }
        if (tick_.safety_state() != SafetyState::Running) {
            throw std::runtime_error("stability: the tick did not reach the running state");
        }
    }

    void step() {
        tick_.run({.deadline_ns = now_ns_, .now_ns = now_ns_});
        now_ns_ += trial_.tick.period_ns;
    }

    /// Publishes the reply to the delayed pose, and runs one tick.
    void press() {
        // The tick's exchange would move the board anyway. Moving it here first has the same result, and lets an
        // undelayed frame use the pose that the tick is going to measure.
        board_.device().advance(now_ns_);
        ContactFrame frame = reply();
        frames_out_.publish(frame, now_ns_);
        step();
        // Keep the measured height in the delay line.
        if (states_in_.read_newest(state_)) {
            heights_[next_] = state_.position[1];
            next_ = next_ + 1 == heights_.size() ? 0 : next_ + 1;
        }
    }

    /// The contact frame of this tick, according to the delayed part.
    [[nodiscard]] ContactFrame reply() const {
        const double now = board_.device().grip_pose().position.y;
        // The newest published state is already one period old, so a frame without delay uses the grip itself.
        const double then = trial_.delay_ns == 0 ? now : heights_[next_];
        ContactFrame frame{};
        // The simulation steps once per tick and answers a state as old as the delay.
        frame.state_time_ns = now_ns_ - trial_.delay_ns;
        frame.plane_time_ns = now_ns_;
        frame.publish_time_ns = now_ns_;
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
    device::EmulatedBoard board_;
    RingReader<ContactFrame> frames_in_;
    RingWriter<DeviceState> states_out_;
    RingWriter<ContactFrame> frames_out_;
    RingReader<DeviceState> states_in_;
    Tick tick_;
    DeviceState state_{};
    std::vector<double> heights_;  // m, delay line: ring of the measured heights of the last `delay`
    std::size_t next_ = 0;         // index of the oldest
    std::int64_t now_ns_ = 0;
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
    return std::make_unique<Trial>(trial)->run();
}

}  // namespace haptic::rt
