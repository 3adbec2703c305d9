// Wiring of an emulated device: how the channels of its board are connected to motors, encoders and strings. A device
// that was assembled wrongly differs from its geometry here.
//
//     KIND:VALUE[+KIND:VALUE ...]          sign:3          strings:2,5          gain:6=2+dead:7
#pragma once

#include <array>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>

#include "haptic/frames.hpp"
#include "haptic/realtime.hpp"

namespace haptic::device {

/// Channel i of the board drives motor motor_of[i] and counts encoder encoder_of[i]. Motors, encoders and strings have
/// the numbers of the device geometry. The default is the wiring that the geometry describes.
struct Wiring {
    std::array<std::uint8_t, kStrings> motor_of{0, 1, 2, 3, 4, 5, 6, 7};    // permutation
    std::array<std::uint8_t, kStrings> encoder_of{0, 1, 2, 3, 4, 5, 6, 7};  // permutation
    // Newtons per DAC code of a channel over those of the geometry. A negative one pushes: it unwinds the string.
    std::array<double, kStrings> gain{1, 1, 1, 1, 1, 1, 1, 1};
    // Counts of a channel over those of the geometry; negative: it counts backwards; 0: it does not count.
    std::array<double, kStrings> encoder_factor{1, 1, 1, 1, 1, 1, 1, 1};
    std::array<bool, kStrings> dead{};   // the channel's motor has no current
    std::array<bool, kStrings> slack{};  // the string never becomes taut: its motor winds, its knot carries nothing

    friend bool operator==(const Wiring&, const Wiring&) = default;

    [[nodiscard]] bool correct() const { return *this == Wiring{}; }
    /// The channel that drives a motor.
    [[nodiscard]] std::size_t channel_of_motor(std::size_t motor) const HAPTIC_RT;
};

/// what() quotes the text and says what is wrong and what is allowed.
class WiringError : public std::invalid_argument {
  public:
    using std::invalid_argument::invalid_argument;
};

/// Adds the errors of a text to a wiring, in their order. Throws WiringError and leaves the wiring unchanged.
void add_wiring(Wiring& wiring, std::string_view text);

/// Throws WiringError for values that cannot be emulated.
void validate(const Wiring& wiring);

/// Grammar with all kinds, for --help.
[[nodiscard]] std::string wiring_help();

}  // namespace haptic::device
