// Units of the tests: the period of the loop, and the tension of one DAC code of an X3R.
#pragma once

#include <cstdint>

namespace haptic::rt::test {

inline constexpr std::int64_t kTickNs = 1'000'000;
inline constexpr double kTick = 1e-3;                                // s
inline constexpr double kDacCodeN = 1.0 / (0.365296803653 * 415.0);  // N per DAC code

}  // namespace haptic::rt::test
