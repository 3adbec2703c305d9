// Numbers that no input may have.
#pragma once

#include <limits>

namespace haptic::rt::test {

inline constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
inline constexpr double kInfinity = std::numeric_limits<double>::infinity();

}  // namespace haptic::rt::test
