#include <haptic/device/digits.hpp>

#include <algorithm>
#include <cmath>

namespace haptic::device {
namespace {

// Digits. Without this millionth, a tension that stands for a digit would come back as the digit below, by rounding.
constexpr double kRounding = 1e-6;

}  // namespace

std::int16_t digit_of_tension(double tension_n, double newtons_per_digit) HAPTIC_RT {
    const double size = tension_n / std::fabs(newtons_per_digit) + kRounding;
    if (!std::isfinite(size) || size < 0.0) {
        return 0;
    }
    const int digit = size >= kMaximumDigit ? kMaximumDigit : static_cast<int>(size);
    return static_cast<std::int16_t>(newtons_per_digit < 0.0 ? -digit : digit);
}

double tension_of_digit(std::int16_t digit, double newtons_per_digit) HAPTIC_RT {
    return std::max(0.0, static_cast<double>(digit) * newtons_per_digit);
}

}  // namespace haptic::device
