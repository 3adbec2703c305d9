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

#include <haptic/device/emulated_board.hpp>
#include <haptic/ring.hpp>

namespace haptic::rt {
namespace {

constexpr double kWall = -0.002;        // m, height of the wall's surface
constexpr double kPressedTo = -0.012;   // m, where the hand goes
constexpr double kWayS = 0.1;           // s, in which it does
constexpr double kWindowS = 0.4;        // s, over which an amplitude is measured
constexpr double kSettleS = 0.1;        // s, after the hand's way, before the first window
constexpr double kVisible = 2e-4;       // m, smaller vibrations are the encoders' and the digits'
constexpr double kLeastEnergy = -1e-4;  // J
constexpr double kShortestS = 1.0;      // s

std::int64_t standing_clock() HAPTIC_RT {
    return 0;
}

std::string session_of_its_own() {
    static std::atomic<unsigned> count{0};
    return "stability-" + std::to_string(getpid()) + "-" + std::to_string(count.fetch_add(1));
}

PoseTrack pressing_hand() {
    const Quat level(1.0, 0.0, 0.0, 0.0);
    return {{0.0, kWayS, kWayS + 1.0},
            {Pose{}, Pose{{0.0, kPressedTo, 0.0}, level}, Pose{{0.0, kPressedTo, 0.0}, level}}};
}

TickSettings quick_to_arm(TickSettings settings) {
    settings.safety.tension_ramp_ns = 100'000'000;
    settings.safety.calibration_hold_ns = 50'000'000;
    settings.frames.ramp_ns = settings.period_ns;  // the wall is there from the beginning
    return settings;
}

/// From the lowest to the highest of equidistant values, off the straight line that fits them best: a grip that creeps
/// does not vibrate.
double amplitude(std::span<const double> values) {
    if (values.size() < 3) {
        return 0.0;
    }
    const double middle = 0.5 * static_cast<double>(values.size() - 1);
    const double mean = std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
    double covariance = 0.0;
    double variance = 0.0;
    for (std::size_t i = 0; i < values.size(); ++i) {
        const double x = static_cast<double>(i) - middle;
        covariance += x * (values[i] - mean);
        variance += x * x;
    }
    double low = 0.0;
    double high = 0.0;
    for (std::size_t i = 0; i < values.size(); ++i) {
        const double off = values[i] - mean - covariance / variance * (static_cast<double>(i) - middle);
        low = std::min(low, off);
        high = std::max(high, off);
    }
    return high - low;
}

class Trial {
  public:
    explicit Trial(const StabilityTrial& trial)
        : trial_(trial),
          session_(session_of_its_own()),
          board_({.variant = trial.tick.variant,
                  .hand = pressing_hand(),
                  .power_up = {60000, 1, 32768, 12345, 65535, 0, 40000, 777},
                  .hand_waits = true,
                  .mechanics = trial.mechanics}),
          frames_in_(session_),
          states_out_(session_),
          frames_out_(session_),
          states_in_(session_),
          tick_(quick_to_arm(trial.tick), board_, frames_in_, states_out_, standing_clock) {
        if (trial.delay_ns < 0 || trial.delay_ns % trial.tick.period_ns != 0) {
            throw std::invalid_argument("stability: the delay must be a multiple of the period");
        }
        if (!(trial.duration_s >= kShortestS)) {
            throw std::invalid_argument("stability: a trial takes a second at least");
        }
        heights_.assign(static_cast<std::size_t>(std::max<std::int64_t>(trial.delay_ns / trial.tick.period_ns, 1)),
                        0.0);
    }

    StabilityOutcome run() {
        arm();
        StabilityOutcome outcome;
        const auto ticks_in = [this](double time_s) {
            return static_cast<std::size_t>(nanoseconds(time_s) / trial_.tick.period_ns);
        };
        const std::size_t begin = ticks_in(kWayS + kSettleS);
        const std::size_t all = ticks_in(kWayS + trial_.duration_s);
        const std::size_t window = ticks_in(kWindowS);
        std::vector<double> heights;
        heights.reserve(all);
        board_.device().release_hand();
        tick_.set_instruments(Instruments{});
        while (heights.size() < all && tick_.faults() == 0) {
            press();
            heights.push_back(board_.device().grip_pose().position.y);
        }
        const Instruments& measured = tick_.instruments();
        const std::span<const double> track(heights);
        outcome.first_amplitude = amplitude(track.subspan(std::min(begin, track.size()))
                                                .first(std::min(window, track.size() - std::min(begin, track.size()))));
        outcome.last_amplitude = amplitude(track.last(std::min(window, track.size())));
        outcome.least_energy = measured.least_energy;
        outcome.peak_force = measured.peak_force;
        outcome.controlled = static_cast<double>(measured.passivity_ticks) / static_cast<double>(all);
        outcome.faults = tick_.faults();
        const bool kept_up =
            outcome.least_energy < kLeastEnergy && outcome.last_amplitude > 0.5 * outcome.first_amplitude;
        outcome.grows = outcome.faults != 0 || (outcome.last_amplitude > kVisible &&
                                                (outcome.last_amplitude > outcome.first_amplitude || kept_up));
        return outcome;
    }

  private:
    void arm() {
        tick_.arm();
        const SafetySettings& safety = quick_to_arm(trial_.tick).safety;
        const std::int64_t until_ns = 3 * arming_time_ns(safety);
        for (std::int64_t t = 0; t < until_ns && tick_.safety_state() != SafetyState::Running;
             t += trial_.tick.period_ns) {
            step();
        }
        if (tick_.safety_state() != SafetyState::Running) {
            throw std::runtime_error("stability: the tick did not come to run with this grip");
        }
    }

    void step() {
        tick_.run({.deadline_ns = now_ns_, .now_ns = now_ns_});
        now_ns_ += trial_.tick.period_ns;
    }

    /// Answers the pose of then, and ticks.
    void press() {
        // The board moves in the tick's exchange; moved there before, it gives the same, and the frame can lie where
        // the grip will be.
        board_.device().advance(now_ns_);
        ContactFrame frame = answer();
        frames_out_.publish(frame, now_ns_);
        step();
        if (states_in_.read_newest(state_)) {
            heights_[next_] = state_.position[1];
            next_ = next_ + 1 == heights_.size() ? 0 : next_ + 1;
        }
    }

    [[nodiscard]] ContactFrame answer() const {
        const double now = board_.device().grip_pose().position.y;
        // The state of the last tick is one period old already; without a delay the frame answers the grip itself.
        const double then = trial_.delay_ns == 0 ? now : heights_[next_];
        ContactFrame frame{};
        frame.state_time_ns = now_ns_ - trial_.delay_ns;
        frame.plane_time_ns = now_ns_;
        frame.publish_time_ns = now_ns_;
        frame.step_ns = trial_.tick.period_ns;
        frame.stiffness = trial_.stiffness;
        frame.proxy_count = 1;
        ProxyContact& proxy = frame.proxies[0];
        proxy.position[1] = std::max(kWall, then);
        proxy.in_contact = then < kWall ? 1 : 0;
        proxy.plane_count = 1;
        proxy.planes[0].normal[1] = 1.0;
        proxy.planes[0].offset = kWall;
        if (trial_.late == LateAnswer::Contact) {
            proxy.plane_count = proxy.in_contact;
        } else if (trial_.late == LateAnswer::Force && trial_.delay_ns > 0) {
            proxy.plane_count = proxy.in_contact;
            proxy.planes[0].offset = now + (kWall - then);
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
    std::vector<double> heights_;  // m, of the last states, a circle
    std::size_t next_ = 0;         // the oldest of them
    std::int64_t now_ns_ = 0;
};

}  // namespace

std::string_view name_of(LateAnswer late) noexcept {
    switch (late) {
        case LateAnswer::Planes:
            return "planes";
        case LateAnswer::Contact:
            return "contact";
        case LateAnswer::Force:
            return "force";
    }
    return "unknown";
}

device::GripMechanics undamped_hand() {
    device::GripMechanics mechanics;
    mechanics.mass = 0.1;
    mechanics.damping = 0.3;
    mechanics.motor_drag = 0.0;
    mechanics.motor_friction = 0.0;
    mechanics.hand_stiffness = 100.0;
    mechanics.hand_damping = 0.0;
    return mechanics;
}

StabilityOutcome try_contact(const StabilityTrial& trial) {
    // A tick with its black box is too large for some stacks.
    return std::make_unique<Trial>(trial)->run();
}

}  // namespace haptic::rt
