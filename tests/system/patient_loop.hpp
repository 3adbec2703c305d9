// Settings of a loop that a busy machine can sustain, with boards that another process serves: 50 Hz, two ticks per
// exchange, and a device that is lost only when nothing has come from it for longer than a process may stand still.
#pragma once

#include <array>

namespace haptic::test {

inline constexpr std::array kPatientLoop = {
    "loop.period_s=0.02",      "loop.warm_up_ticks=1",     "device.uart_timeout_s=0.04", "safety.late_share=1",
    "safety.exchange_share=1", "safety.encoder_age_s=0.5", "safety.watchdog_s=1"};

}  // namespace haptic::test
