// Button track: the buttons that a hand holds, as a list over time.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "haptic/realtime.hpp"
#include "haptic/types.hpp"

namespace haptic::device {

class ButtonTrack {
  public:
    /// No buttons known.
    ButtonTrack() = default;
    /// Times, s, increasing, and as many numbers; bit k: button k is held from that time on.
    ButtonTrack(std::vector<double> times_s, std::vector<std::uint8_t> buttons)
        : times_s_(std::move(times_s)), buttons_(std::move(buttons)) {}

    [[nodiscard]] bool known() const HAPTIC_RT { return !buttons_.empty(); }
    /// Buttons at a time; none before the first. O(log rows).
    [[nodiscard]] std::uint8_t at(std::int64_t time_ns) const HAPTIC_RT {
        const auto after = std::upper_bound(times_s_.begin(), times_s_.end(), seconds(time_ns));
        return after == times_s_.begin() ? std::uint8_t{0}
                                         : buttons_[static_cast<std::size_t>(after - times_s_.begin()) - 1];
    }

  private:
    std::vector<double> times_s_;
    std::vector<std::uint8_t> buttons_;
};

}  // namespace haptic::device
