// Waiting for what another thread does.
#pragma once

#include <chrono>
#include <thread>

namespace haptic::test {

/// Waits until the condition holds, at most 30 s; false if it never did.
template <class Condition>
bool wait_for(Condition&& condition) {
    const auto limit = std::chrono::steady_clock::now() + std::chrono::seconds(30);
    while (!condition() && std::chrono::steady_clock::now() < limit) {
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return condition();
}

}  // namespace haptic::test
