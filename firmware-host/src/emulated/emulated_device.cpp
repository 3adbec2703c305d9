#include "haptic/device/emulated_device.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include "emulated/device_faults.hpp"
#include "emulated/hand_motion.hpp"
#include "emulated/mechanical_grip.hpp"
#include "haptic/device/dac_codes.hpp"

namespace haptic::device {
namespace {

constexpr std::uint8_t kButtonMask = 0x07;
constexpr std::uint8_t kMaxRotary = 15;
// m/s at which a motor reels in a slack string, used without mechanics.
constexpr double kReelSpeed = 0.5;
// m of slack that no motor reels in.
constexpr double kNeverTaut = 1e4;

/// From the grip's knot to the motor, m, device frame.
Vec3 string_vector(const StringFacts& string, const Pose& grip) HAPTIC_RT {
    return string.motor - (grip.position + grip.orientation * string.grip);
}

constexpr std::uint32_t mask_of(int bits) HAPTIC_RT {
    return (1U << static_cast<unsigned>(bits)) - 1U;
}

/// Counter, modulo 2^bits, of a string that is `paid_out` metres longer than at the centre. Counts are rounded to
/// nearest, so that the emulated device has no bias; the first edge of a real encoder depends on its power-up.
std::uint32_t counter_of(double paid_out, double metres_per_count, std::uint32_t power_up, int bits) HAPTIC_RT {
    const std::uint32_t mask = mask_of(bits);
    const double wrap = static_cast<double>(mask) + 1.0;
    const double counts = std::floor(paid_out / std::fabs(metres_per_count) + 0.5);
    // Reduce modulo 2^bits before the conversion to an integer: exact in double precision, defined for any length.
    const double wrapped = std::isfinite(counts) ? counts - wrap * std::floor(counts / wrap) : 0.0;
    const auto steps = static_cast<std::uint32_t>(wrapped);
    const std::uint32_t counter = metres_per_count < 0.0 ? power_up - steps : power_up + steps;
    return counter & mask;
}

bool usable(double scale) {
    return std::isfinite(scale) && scale != 0.0;
}

}  // namespace

struct EmulatedDevice::State {
    explicit State(Settings a_settings)
        : settings(std::move(a_settings)),
          hand(settings.hand, settings.hand_waits, settings.tremor),
          faults(settings.faults),
          grip(hand.pose()) {}

    /// Counters without faults.
    [[nodiscard]] std::array<std::uint32_t, kStrings> true_counters() const HAPTIC_RT;
    /// Moves the grip with the hand, and the motors of slack strings; without mechanics.
    void move_ideally(std::int64_t passed_ns) HAPTIC_RT;
    [[nodiscard]] double paid_out_length(std::size_t string) const HAPTIC_RT;
    /// Of the motors, N; negative where a code has the wrong sign for its motor, which then unwinds its string.
    [[nodiscard]] std::array<double, kStrings> pulls() const HAPTIC_RT;
    [[nodiscard]] std::array<double, kStrings> tensions() const HAPTIC_RT;
    [[nodiscard]] std::array<double, kStrings> string_tensions() const HAPTIC_RT;
    /// Extra length of the strings, m, by faults and wiring.
    [[nodiscard]] std::array<double, kStrings> slack() const HAPTIC_RT;

    Settings settings;
    HandMotion hand;
    std::optional<MechanicalGrip> mechanical;
    DeviceFaults faults;
    Pose grip;
    std::array<std::int16_t, kStrings> dac_codes{};  // of the channels
    std::array<std::int16_t, kStrings> written{};    // by the firmware
    std::array<double, kStrings> reeled{};           // m of slack that the motor has reeled in; without mechanics
    std::array<std::uint8_t, kStrings> driven_by{};  // motor that a channel drives if nothing is wired wrongly
    bool motors_powered = true;
    bool pulled_out = false;  // a string was; without mechanics
    std::int64_t last_ns = 0;
    std::int64_t fault_ns = 0;  // fault clock at last_ns
    std::uint8_t buttons = 0;
    bool started = false;
    bool released = false;
};

EmulatedDevice::EmulatedDevice(Settings settings) : state_(std::make_unique<State>(std::move(settings))) {
    const DeviceGeometry& geometry = state_->settings.geometry;
    for (std::size_t i = 0; i < kStrings; ++i) {
        if (!usable(geometry.strings[i].metres_per_count) || !usable(geometry.strings[i].newtons_per_code)) {
            throw std::invalid_argument("emulated device: device geometry '" + geometry.name + "', string " +
                                        std::to_string(i) +
                                        ": metres_per_count and newtons_per_code must be finite and not zero");
        }
    }
    validate(state_->settings.wiring);
    for (std::size_t i = 0; i < kStrings; ++i) {
        state_->driven_by[geometry.motor_channels[i]] = static_cast<std::uint8_t>(i);
    }
    if (state_->settings.mechanics) {
        state_->mechanical.emplace(geometry, *state_->settings.mechanics, state_->grip);
    }
    if (state_->settings.rotary > kMaxRotary) {
        throw std::invalid_argument("emulated device: the rotary switch has positions 0 to 15, not " +
                                    std::to_string(state_->settings.rotary));
    }
}

EmulatedDevice::~EmulatedDevice() = default;

void EmulatedDevice::advance(std::int64_t now_ns) HAPTIC_RT {
    State& s = *state_;
    const std::int64_t passed_ns = s.started ? now_ns - s.last_ns : 0;
    // Advance the clocks of faults and hand before the grip, which depends on both.
    s.fault_ns = std::max<std::int64_t>(fault_time_ns(now_ns), 0);
    s.hand.advance(passed_ns);
    if (s.settings.hand_buttons.known()) {
        s.buttons = s.settings.hand_buttons.at(s.hand.time_ns());
    }
    s.started = true;
    s.last_ns = now_ns;
    s.faults.advance(fault_time_ns(now_ns), passed_ns);
    if (s.mechanical) {
        MechanicalGrip::Drive drive;
        drive.pull = s.pulls();
        drive.slack = s.slack();
        // A free grip falls only after the hand was released.
        drive.held = s.hand.waits() && s.mechanical->mechanics().hand == Hand::Free;
        s.mechanical->advance(now_ns, drive, s.hand);
        s.grip = s.mechanical->state().pose;
    } else {
        s.move_ideally(passed_ns);
    }
    s.faults.latch_stuck_encoders(s.true_counters());
}

void EmulatedDevice::set_dac_codes(const std::array<std::int16_t, kStrings>& dac_codes) HAPTIC_RT {
    state_->written = dac_codes;
    if (!state_->faults.motors_frozen()) {
        state_->dac_codes = dac_codes;
    }
}

const std::array<std::int16_t, kStrings>& EmulatedDevice::dac_codes() const HAPTIC_RT {
    return state_->dac_codes;
}

const std::array<std::int16_t, kStrings>& EmulatedDevice::echo() const HAPTIC_RT {
    const bool echoes_written = state_->faults.motors_frozen() && !state_->faults.echo_frozen();
    return echoes_written ? state_->written : state_->dac_codes;
}

void EmulatedDevice::release_hand() HAPTIC_RT {
    state_->hand.release();
    state_->released = true;
}

void EmulatedDevice::hold_hand() HAPTIC_RT {
    state_->hand.hold();
}

void EmulatedDevice::pull_out(std::size_t string, double metres) HAPTIC_RT {
    if (state_->mechanical) {
        state_->mechanical->pay_out(string, metres);
    } else {
        state_->reeled[string] -= metres;
        state_->pulled_out = true;
    }
}

void EmulatedDevice::set_motor_power(bool on) HAPTIC_RT {
    state_->motors_powered = on;
}

void EmulatedDevice::set_buttons(std::uint8_t buttons) HAPTIC_RT {
    state_->buttons = buttons;
}

std::uint8_t EmulatedDevice::buttons() const HAPTIC_RT {
    return state_->buttons & kButtonMask;
}

std::uint8_t EmulatedDevice::rotary() const HAPTIC_RT {
    return state_->settings.rotary;
}

const DeviceGeometry& EmulatedDevice::geometry() const HAPTIC_RT {
    return state_->settings.geometry;
}

Pose EmulatedDevice::grip_pose() const HAPTIC_RT {
    return state_->grip;
}

const std::vector<Fault>& EmulatedDevice::faults() const noexcept {
    return state_->settings.faults;
}

std::int64_t EmulatedDevice::fault_time_ns(std::int64_t now_ns) const HAPTIC_RT {
    if (!state_->started || (state_->settings.faults_wait && !state_->released)) {
        return -1;
    }
    return state_->fault_ns + std::max<std::int64_t>(now_ns - state_->last_ns, 0);
}

void EmulatedDevice::State::move_ideally(std::int64_t passed_ns) HAPTIC_RT {
    if (settings.faults.empty() && settings.wiring.correct() && !pulled_out) {
        grip = hand.pose();
        return;
    }
    std::array<double, kStrings> before{};
    for (std::size_t i = 0; i < kStrings; ++i) {
        before[i] = paid_out_length(i);
    }
    grip = hand.pose();
    // A motor reels in at most the slack of its string.
    const double reelable = kReelSpeed * seconds(std::max<std::int64_t>(passed_ns, 0));
    const std::array<double, kStrings> pull = tensions();
    const std::array<double, kStrings> reelable_slack = slack();
    for (std::size_t i = 0; i < kStrings; ++i) {
        if (faults.dead()[i]) {  // a dead motor turns only when a taut string turns it
            reeled[i] += paid_out_length(i) - before[i];
        } else if (pull[i] > 0.0) {
            reeled[i] += reelable;
        }
        reeled[i] = std::min(reeled[i], reelable_slack[i]);
    }
}

std::array<std::uint32_t, kStrings> EmulatedDevice::counters() const HAPTIC_RT {
    const std::uint32_t mask = mask_of(counter_bits(state_->settings.geometry.board));
    std::array<std::uint32_t, kStrings> counters = state_->faults.counters(state_->true_counters());
    for (std::uint32_t& counter : counters) {
        counter &= mask;
    }
    return counters;
}

std::array<std::uint32_t, kStrings> EmulatedDevice::State::true_counters() const HAPTIC_RT {
    std::array<std::uint32_t, kStrings> counters{};
    for (std::size_t i = 0; i < kStrings; ++i) {
        const std::size_t string = settings.wiring.encoder_of[i];
        const double paid_out = paid_out_length(string) - settings.geometry.rest_length(string);
        counters[i] =
            counter_of(settings.wiring.encoder_factor[i] * paid_out, settings.geometry.strings[string].metres_per_count,
                       settings.power_up[i], counter_bits(settings.geometry.board));
    }
    return counters;
}

std::array<double, kStrings> EmulatedDevice::tensions() const HAPTIC_RT {
    return state_->tensions();
}

std::array<double, kStrings> EmulatedDevice::State::pulls() const HAPTIC_RT {
    std::array<double, kStrings> pulls{};
    for (std::size_t channel = 0; channel < kStrings; ++channel) {
        const std::size_t motor = driven_by[settings.wiring.motor_of[channel]];
        if (!motors_powered || faults.dead()[motor] || settings.wiring.dead[channel]) {
            continue;
        }
        const double newtons_per_code =
            settings.wiring.gain[channel] * settings.geometry.strings[motor].newtons_per_code;
        pulls[motor] = dac_codes[channel] * newtons_per_code;
    }
    return pulls;
}

std::array<double, kStrings> EmulatedDevice::State::tensions() const HAPTIC_RT {
    std::array<double, kStrings> tensions = pulls();
    for (double& tension : tensions) {
        tension = std::max(tension, 0.0);
    }
    return tensions;
}

std::array<double, kStrings> EmulatedDevice::State::slack() const HAPTIC_RT {
    std::array<double, kStrings> slack = faults.slack();
    for (std::size_t i = 0; i < kStrings; ++i) {
        slack[i] += settings.wiring.slack[i] ? kNeverTaut : 0.0;
    }
    return slack;
}

double EmulatedDevice::State::paid_out_length(std::size_t string) const HAPTIC_RT {
    if (mechanical) {
        return mechanical->state().length[string];
    }
    const Vec3 span = string_vector(settings.geometry.strings[string], grip);
    return std::sqrt(glm::dot(span, span)) - reeled[string];
}

std::array<double, kStrings> EmulatedDevice::string_tensions() const HAPTIC_RT {
    return state_->string_tensions();
}

std::array<double, kStrings> EmulatedDevice::State::string_tensions() const HAPTIC_RT {
    if (mechanical) {
        return mechanical->tensions(slack());
    }
    std::array<double, kStrings> carried = tensions();
    const std::array<double, kStrings> slack_left = slack();
    for (std::size_t i = 0; i < kStrings; ++i) {
        carried[i] = reeled[i] < slack_left[i] ? 0.0 : carried[i];
    }
    return carried;
}

Twist EmulatedDevice::grip_velocity() const HAPTIC_RT {
    const std::optional<MechanicalGrip>& mechanical = state_->mechanical;
    return mechanical ? twist_of(mechanical->mechanics(), mechanical->state()) : Twist{};
}

Wrench EmulatedDevice::wrench() const HAPTIC_RT {
    return wrench_of_strings(state_->settings.geometry, state_->grip, state_->string_tensions());
}

}  // namespace haptic::device
