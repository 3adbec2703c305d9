#include "haptic/device/emulated_board.hpp"

#include <cmath>
#include <stdexcept>
#include <utility>

namespace haptic::device {
namespace {

constexpr std::uint16_t kButtonMask = 0x0007;
constexpr unsigned kRotaryShift = 4;
constexpr std::uint8_t kRotaryMaximum = 15;
constexpr double kWrap = 65536.0;

/// From the grip's knot to the motor, m, device frame.
Vec3 string_vector(const StringFacts& string, const Pose& grip) HAPTIC_RT {
    return string.motor - (grip.position + grip.orientation * string.grip);
}

/// The 16-bit counter of a string that is `paid_out` metres longer than at the centre. The encoder's counts are rounded
/// to nearest, so that the emulated device has no bias; which edge a real one counts first depends on its power-up.
std::uint16_t counter_of(double paid_out, int sign, double metres_per_count, std::uint16_t power_up) HAPTIC_RT {
    const double counts = std::floor(paid_out / metres_per_count + 0.5);
    if (!std::isfinite(counts)) {
        return power_up;
    }
    const double wrapped = counts - kWrap * std::floor(counts / kWrap);  // 0..65535, exact
    const auto steps = static_cast<std::uint32_t>(wrapped);
    const std::uint32_t raw = sign > 0 ? power_up - steps : power_up + steps;
    return static_cast<std::uint16_t>(raw & 0xFFFFU);
}

}  // namespace

EmulatedBoard::EmulatedBoard(Settings settings) : settings_(std::move(settings)), grip_(settings_.hand.at(0)) {
    const Variant& variant = settings_.variant;
    const bool usable = variant.metres_per_count > 0.0 && variant.volts_per_newton > 0.0 &&
                        variant.digits_per_volt > 0.0 && std::isfinite(variant.metres_per_count) &&
                        std::isfinite(variant.volts_per_newton) && std::isfinite(variant.digits_per_volt);
    if (!usable) {
        throw std::invalid_argument("emulated board: variant '" + variant.name +
                                    "' needs positive metres_per_count, volts_per_newton and digits_per_volt");
    }
    if (settings_.rotary > kRotaryMaximum) {
        throw std::invalid_argument("emulated board: the rotary switch has positions 0 to 15, not " +
                                    std::to_string(settings_.rotary));
    }
}

ExchangeStatus EmulatedBoard::exchange(const Sh4Packet& out, Sh4Packet& in, std::int64_t now_ns) HAPTIC_RT {
    switch (decode(std::span<const std::byte>(out), command_)) {
        case PacketDefect::None:
            break;
        case PacketDefect::Digit:
            // What a deployed board does with more than 12 bits is unknown; a driver must never find out.
            return ExchangeStatus::Refused;
        case PacketDefect::Length:
        case PacketDefect::Opcode:
            return ExchangeStatus::Timeout;  // the firmware answers nothing else
    }
    if (!started_) {
        started_ = true;
        start_ns_ = now_ns;
    }
    grip_ = settings_.hand.at(now_ns - start_ns_);

    Sh4Reply reply;
    reply.digits = command_.digits;
    for (std::size_t i = 0; i < kStrings; ++i) {
        const StringFacts& string = settings_.variant.strings[i];
        const Vec3 span = string_vector(string, grip_);
        const double paid_out = std::sqrt(glm::dot(span, span)) - settings_.variant.rest_length(i);
        reply.counters[i] =
            counter_of(paid_out, string.count_sign, settings_.variant.metres_per_count, settings_.power_up[i]);
    }
    reply.pio = static_cast<std::uint16_t>((buttons_ & kButtonMask) | (settings_.rotary << kRotaryShift));
    encode(reply, in);
    return ExchangeStatus::Ok;
}

std::array<double, kStrings> EmulatedBoard::tensions() const HAPTIC_RT {
    std::array<double, kStrings> tensions{};
    for (std::size_t i = 0; i < kStrings; ++i) {
        tensions[i] =
            tension_of_digit(command_.digits[i], settings_.variant.volts_per_newton, settings_.variant.digits_per_volt);
    }
    return tensions;
}

Wrench EmulatedBoard::wrench() const HAPTIC_RT {
    const std::array<double, kStrings> tension = tensions();
    Wrench sum;
    for (std::size_t i = 0; i < kStrings; ++i) {
        const StringFacts& string = settings_.variant.strings[i];
        const Vec3 span = string_vector(string, grip_);
        const double length = std::sqrt(glm::dot(span, span));
        if (length > 0.0) {
            const Vec3 pull = span * (tension[i] / length);
            sum.force += pull;
            sum.torque += glm::cross(grip_.orientation * string.grip, pull);
        }
    }
    return sum;
}

}  // namespace haptic::device
