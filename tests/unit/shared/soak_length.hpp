// How long a soak test lasts.
#pragma once

#include <cstdlib>
#include <string>

namespace haptic::test {

/// `turns`, or HAPTIC_SOAK times as many where the environment has that number: HAPTIC_SOAK=10 toolchain/check soak.
inline int soak_length(int turns) {
    const char* const factor = std::getenv("HAPTIC_SOAK");
    return factor == nullptr ? turns : turns * std::stoi(factor);
}

}  // namespace haptic::test
