// Where executables take their time from. Libraries never call this: they are handed the time, so that tests can step
// everything under one virtual clock.
#pragma once

#include <cstdint>

#include "haptic/realtime.hpp"

namespace haptic {

/// CLOCK_MONOTONIC in nanoseconds. One vDSO call, no system call on Linux with a usable clock source.
[[nodiscard]] std::int64_t monotonic_now_ns() HAPTIC_RT;

}  // namespace haptic
