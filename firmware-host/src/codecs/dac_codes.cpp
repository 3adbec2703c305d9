#include "haptic/device/dac_codes.hpp"

#include <algorithm>
#include <cmath>

namespace haptic::device {
namespace {

// In codes. Without it, rounding errors would truncate the exact tension of a code to the code below.
constexpr double kRounding = 1e-6;

}  // namespace

std::int16_t dac_code_of_tension(double tension_n, double newtons_per_code) HAPTIC_RT {
    // Rounded down, except within kRounding of the next code.
    const double size = tension_n / std::fabs(newtons_per_code) + kRounding;
    if (!std::isfinite(size) || size < 0.0) {
        return 0;
    }
    const int dac_code = size >= kMaxDacCode ? kMaxDacCode : static_cast<int>(size);
    return static_cast<std::int16_t>(newtons_per_code < 0.0 ? -dac_code : dac_code);
}

double tension_of_dac_code(std::int16_t dac_code, double newtons_per_code) HAPTIC_RT {
    return std::max(0.0, static_cast<double>(dac_code) * newtons_per_code);
}

}  // namespace haptic::device
