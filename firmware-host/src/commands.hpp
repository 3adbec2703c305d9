// What the executable firmware-host does, once its command line has been understood.
#pragma once

#include <array>

#include "haptic/device/variant.hpp"
#include "haptic/frames.hpp"
#include "haptic/types.hpp"

namespace haptic::device {

struct ExchangeRequest {
    Pose grip;                                // where the hand holds the grip
    std::array<double, kStrings> tensions{};  // N
    bool hex = false;                         // the packets' bytes too
};

/// Sends one OUT packet to an emulated board and prints what went both ways, and what the strings then do. False, with
/// the reason on stderr, if the board did not answer.
bool run_exchange(const Variant& variant, const ExchangeRequest& request);

/// Prints geometry and constants of each variant that there is.
void run_variants();

}  // namespace haptic::device
