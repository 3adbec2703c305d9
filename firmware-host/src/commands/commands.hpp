// What the executable firmware-host does, once its command line has been understood.
#pragma once

#include <array>
#include <string>
#include <vector>

#include <haptic/device/variant.hpp>
#include <haptic/frames.hpp>
#include <haptic/types.hpp>

namespace haptic::device {

struct ExchangeRequest {
    Pose grip;                                // where the hand holds the grip
    std::array<double, kStrings> tensions{};  // N
    bool hex = false;                         // the packets' bytes too
};

/// Sends one OUT packet to an emulated board and prints what went both ways, and what the strings then do. False, with
/// the reason on stderr, if the board did not answer.
bool run_exchange(const Variant& variant, const ExchangeRequest& request);

/// Prints geometry, constants, reach and warnings of each variant in these files; of the built-in ones without any.
/// Throws ConfigError for a file that is none.
void run_variants(const std::vector<std::string>& files);

}  // namespace haptic::device
