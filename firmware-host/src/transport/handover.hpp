// Handover: a guard keeps the device of a process that was killed for as long as it sends zeros, some 50 ms.
#pragma once

#include <chrono>
#include <thread>

namespace haptic::device {

/// Tries until it succeeds, for 0.3 s; false if it never did.
template <class Take>
bool take_over(Take&& take) {
    constexpr int tries = 30;
    for (int k = 0; k < tries; ++k) {
        if (take()) {
            return true;
        }
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    return take();
}

}  // namespace haptic::device
