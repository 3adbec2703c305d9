// Monotonic clock of the executables. Libraries receive the time as a parameter instead, so that tests can run them on
// a virtual clock.
#pragma once

#include <cstdint>

#include "haptic/realtime.hpp"

namespace haptic {

/// CLOCK_MONOTONIC, ns. One vDSO call, without a system call if the clock source supports it.
[[nodiscard]] std::int64_t monotonic_now_ns() HAPTIC_RT;

/// CLOCK_REALTIME minus CLOCK_MONOTONIC now, ns; it changes when the wall clock is set.
[[nodiscard]] std::int64_t real_minus_monotonic_ns();

}  // namespace haptic
