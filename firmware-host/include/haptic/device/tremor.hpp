// Tremor: how the hand that holds an emulated grip trembles and drifts about the pose of its track.
#pragma once

#include <array>
#include <cstdint>

#include "haptic/realtime.hpp"
#include "haptic/types.hpp"

namespace haptic::device {

/// Amplitudes along, or about, each axis of the device. Zeros: a hand as steady as its track.
struct TremorSettings {
    double position = 0.0;        // m, physiological tremor of 8 to 12 Hz; 1e-4 is usual
    double rotation = 0.0;        // rad, of the same
    double drift = 0.0;           // m, slow drift of 0.1 to 0.5 Hz
    double drift_rotation = 0.0;  // rad, of the same
    std::uint32_t seed = 1;       // frequencies and phases

    [[nodiscard]] bool still() const HAPTIC_RT {
        return position == 0.0 && rotation == 0.0 && drift == 0.0 && drift_rotation == 0.0;
    }
};

/// Sums of sinusoids, so that the pose is a smooth function of time: three of 8 to 12 Hz and two of 0.1 to 0.5 Hz for
/// each of the six coordinates. A coordinate never exceeds its amplitudes, and its root mean square is 0.41 of that of
/// the tremor and 0.5 of that of the drift.
/// @source Elble, Koller, Tremor, 1990: physiological tremor of the hand has 8 to 12 Hz.
class Tremor {
  public:
    explicit Tremor(const TremorSettings& settings = {});

    /// `pose` displaced by the tremor at a time.
    [[nodiscard]] Pose applied_to(const Pose& pose, std::int64_t time_ns) const HAPTIC_RT;

  private:
    struct Wave {
        double amplitude = 0.0;  // m or rad
        double rate = 0.0;       // rad/s
        double phase = 0.0;      // rad
    };
    static constexpr std::size_t kFast = 3;
    static constexpr std::size_t kSlow = 2;
    static constexpr std::size_t kCoordinates = 6;  // position, then rotation

    std::array<std::array<Wave, kFast + kSlow>, kCoordinates> waves_{};
    bool still_ = true;
};

}  // namespace haptic::device
