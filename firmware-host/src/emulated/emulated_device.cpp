#include <haptic/device/emulated_device.hpp>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include <haptic/device/digits.hpp>

namespace haptic::device {
namespace {

constexpr std::uint8_t kButtonMask = 0x07;
constexpr std::uint8_t kRotaryMaximum = 15;
// m/s, at which a motor reels in slack where no mechanics say otherwise.
constexpr double kReelSpeed = 0.5;

/// From the grip's knot to the motor, m, device frame.
Vec3 string_vector(const StringFacts& string, const Pose& grip) HAPTIC_RT {
    return string.motor - (grip.position + grip.orientation * string.grip);
}

constexpr std::uint32_t mask_of(int bits) HAPTIC_RT {
    return (1U << static_cast<unsigned>(bits)) - 1U;
}

/// The counter of a string that is `paid_out` metres longer than at the centre, modulo 2^bits. Counts are rounded to
/// nearest, so that the emulated device has no bias; which edge a real one counts first depends on its power-up.
std::uint32_t counter_of(double paid_out, double metres_per_count, std::uint32_t power_up, int bits) HAPTIC_RT {
    const std::uint32_t mask = mask_of(bits);
    const double wrap = static_cast<double>(mask) + 1.0;
    const double counts = std::floor(paid_out / std::fabs(metres_per_count) + 0.5);
    const double wrapped = std::isfinite(counts) ? counts - wrap * std::floor(counts / wrap) : 0.0;  // exact
    const auto steps = static_cast<std::uint32_t>(wrapped);
    const std::uint32_t counter = metres_per_count < 0.0 ? power_up - steps : power_up + steps;
    return counter & mask;
}

bool usable(double scale) {
    return std::isfinite(scale) && scale != 0.0;
}

}  // namespace

EmulatedDevice::EmulatedDevice(Settings settings)
    : settings_(std::move(settings)),
      hand_(settings_.hand, settings_.hand_waits),
      faults_(settings_.faults),
      grip_(hand_.pose()) {
    const Variant& variant = settings_.variant;
    for (std::size_t i = 0; i < kStrings; ++i) {
        if (!usable(variant.strings[i].metres_per_count) || !usable(variant.strings[i].newtons_per_digit)) {
            throw std::invalid_argument("emulated device: variant '" + variant.name + "', string " + std::to_string(i) +
                                        ": metres_per_count and newtons_per_digit must be finite and not zero");
        }
    }
    if (settings_.mechanics) {
        mechanical_.emplace(variant, *settings_.mechanics, grip_);
    }
    if (settings_.rotary > kRotaryMaximum) {
        throw std::invalid_argument("emulated device: the rotary switch has positions 0 to 15, not " +
                                    std::to_string(settings_.rotary));
    }
}

void EmulatedDevice::advance(std::int64_t now_ns) HAPTIC_RT {
    const std::int64_t passed_ns = started_ ? now_ns - last_ns_ : 0;
    fault_ns_ = std::max<std::int64_t>(fault_time_ns(now_ns), 0);
    hand_.advance(passed_ns);
    started_ = true;
    last_ns_ = now_ns;
    faults_.advance(fault_time_ns(now_ns), passed_ns);
    if (mechanical_) {
        MechanicalGrip::Drive drive;
        drive.pull = tensions();
        drive.slack = faults_.slack();
        drive.held = hand_.waits() && mechanical_->mechanics().hand == Hand::Free;
        mechanical_->advance(now_ns, drive, hand_);
        grip_ = mechanical_->state().pose;
    } else {
        move_ideally(passed_ns);
    }
    faults_.hold(true_counters());
}

void EmulatedDevice::set_digits(const std::array<std::int16_t, kStrings>& digits) HAPTIC_RT {
    written_ = digits;
    if (!faults_.motors_frozen()) {
        digits_ = digits;
    }
}

const std::array<std::int16_t, kStrings>& EmulatedDevice::echo() const HAPTIC_RT {
    return faults_.motors_frozen() && !faults_.echo_frozen() ? written_ : digits_;
}

void EmulatedDevice::release_hand() HAPTIC_RT {
    hand_.release();
    released_ = true;
}

std::int64_t EmulatedDevice::fault_time_ns(std::int64_t now_ns) const HAPTIC_RT {
    if (!started_ || (settings_.faults_wait && !released_)) {
        return -1;
    }
    return fault_ns_ + std::max<std::int64_t>(now_ns - last_ns_, 0);
}

void EmulatedDevice::move_ideally(std::int64_t passed_ns) HAPTIC_RT {
    if (settings_.faults.empty()) {
        grip_ = hand_.pose();
        return;
    }
    std::array<double, kStrings> before{};
    for (std::size_t i = 0; i < kStrings; ++i) {
        before[i] = paid_out_length(i);
    }
    grip_ = hand_.pose();
    const double reeled = kReelSpeed * seconds(std::max<std::int64_t>(passed_ns, 0));
    for (std::size_t i = 0; i < kStrings; ++i) {
        if (faults_.dead()[i]) {  // it turns only where a taut string turns it
            reeled_[i] += paid_out_length(i) - before[i];
        } else if (digits_[i] != 0) {
            reeled_[i] += reeled;
        }
        reeled_[i] = std::min(reeled_[i], faults_.slack()[i]);
    }
}

std::uint8_t EmulatedDevice::buttons() const HAPTIC_RT {
    return buttons_ & kButtonMask;
}

std::array<std::uint32_t, kStrings> EmulatedDevice::counters() const HAPTIC_RT {
    const std::uint32_t mask = mask_of(counter_bits(settings_.variant.board));
    std::array<std::uint32_t, kStrings> counters = faults_.counters(true_counters());
    for (std::uint32_t& counter : counters) {
        counter &= mask;
    }
    return counters;
}

std::array<std::uint32_t, kStrings> EmulatedDevice::true_counters() const HAPTIC_RT {
    std::array<std::uint32_t, kStrings> counters{};
    for (std::size_t i = 0; i < kStrings; ++i) {
        const StringFacts& string = settings_.variant.strings[i];
        const double paid_out = paid_out_length(i) - settings_.variant.rest_length(i);
        counters[i] =
            counter_of(paid_out, string.metres_per_count, settings_.power_up[i], counter_bits(settings_.variant.board));
    }
    return counters;
}

std::array<double, kStrings> EmulatedDevice::tensions() const HAPTIC_RT {
    std::array<double, kStrings> tensions{};
    for (std::size_t i = 0; i < kStrings; ++i) {
        if (!faults_.dead()[i]) {
            tensions[i] = tension_of_digit(digits_[i], settings_.variant.strings[i].newtons_per_digit);
        }
    }
    return tensions;
}

double EmulatedDevice::paid_out_length(std::size_t string) const HAPTIC_RT {
    if (mechanical_) {
        return mechanical_->state().length[string];
    }
    const Vec3 span = string_vector(settings_.variant.strings[string], grip_);
    return std::sqrt(glm::dot(span, span)) - reeled_[string];
}

std::array<double, kStrings> EmulatedDevice::string_tensions() const HAPTIC_RT {
    if (mechanical_) {
        return mechanical_->tensions(faults_.slack());
    }
    std::array<double, kStrings> carried = tensions();
    for (std::size_t i = 0; i < kStrings; ++i) {
        carried[i] = reeled_[i] < faults_.slack()[i] ? 0.0 : carried[i];
    }
    return carried;
}

Twist EmulatedDevice::grip_velocity() const HAPTIC_RT {
    return mechanical_ ? twist_of(mechanical_->mechanics(), mechanical_->state()) : Twist{};
}

Wrench EmulatedDevice::wrench() const HAPTIC_RT {
    return wrench_of_strings(settings_.variant, grip_, string_tensions());
}

}  // namespace haptic::device
