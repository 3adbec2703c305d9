#include "haptic/device/emulated_device.hpp"

#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include "haptic/device/digits.hpp"

namespace haptic::device {
namespace {

constexpr std::uint8_t kButtonMask = 0x07;
constexpr std::uint8_t kRotaryMaximum = 15;

/// From the grip's knot to the motor, m, device frame.
Vec3 string_vector(const StringFacts& string, const Pose& grip) HAPTIC_RT {
    return string.motor - (grip.position + grip.orientation * string.grip);
}

/// The counter of a string that is `paid_out` metres longer than at the centre, modulo 2^bits. Counts are rounded to
/// nearest, so that the emulated device has no bias; which edge a real one counts first depends on its power-up.
std::uint32_t counter_of(double paid_out, double metres_per_count, std::uint32_t power_up, int bits) HAPTIC_RT {
    const std::uint32_t mask = (1U << static_cast<unsigned>(bits)) - 1U;
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
    : settings_(std::move(settings)), hand_(settings_.hand, settings_.hand_waits), grip_(hand_.pose()) {
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
    hand_.advance(started_ ? now_ns - last_ns_ : 0);
    started_ = true;
    last_ns_ = now_ns;
    if (!mechanical_) {
        grip_ = hand_.pose();
        return;
    }
    MechanicalGrip::Drive drive;
    drive.pull = tensions();
    drive.held = hand_.waits() && mechanical_->mechanics().hand == Hand::Free;
    mechanical_->advance(now_ns, drive, hand_);
    grip_ = mechanical_->state().pose;
}

std::uint8_t EmulatedDevice::buttons() const HAPTIC_RT {
    return buttons_ & kButtonMask;
}

std::array<std::uint32_t, kStrings> EmulatedDevice::counters() const HAPTIC_RT {
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
        tensions[i] = tension_of_digit(digits_[i], settings_.variant.strings[i].newtons_per_digit);
    }
    return tensions;
}

double EmulatedDevice::paid_out_length(std::size_t string) const HAPTIC_RT {
    if (mechanical_) {
        return mechanical_->state().length[string];
    }
    const Vec3 span = string_vector(settings_.variant.strings[string], grip_);
    return std::sqrt(glm::dot(span, span));
}

std::array<double, kStrings> EmulatedDevice::string_tensions() const HAPTIC_RT {
    return mechanical_ ? mechanical_->tensions({}) : tensions();
}

Twist EmulatedDevice::grip_velocity() const HAPTIC_RT {
    return mechanical_ ? twist_of(mechanical_->mechanics(), mechanical_->state()) : Twist{};
}

Wrench EmulatedDevice::wrench() const HAPTIC_RT {
    return wrench_of_strings(settings_.variant, grip_, string_tensions());
}

}  // namespace haptic::device
