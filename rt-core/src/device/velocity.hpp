// Adaptive-window velocity of the grip: the slope of the longest window of poses over which the motion is straight.
//
// The difference of two poses a millisecond apart is mostly quantisation, and a low-pass filter long enough to suppress
// it adds phase lag that damping cannot afford. The adaptive window avoids both. For each coordinate it takes the
// longest window, ending now, in which the line through its two end points misses no pose by more than the noise. The
// velocity is the slope of the least-squares line over that window. At rest the window is long and the result quiet; in
// a sudden motion it is one tick and the lag half a tick.
// @source Janabi-Sharifi, Hayward and Chen 2000, "Discrete-time adaptive windowing for velocity estimation", IEEE
// Trans. Control Systems Technology 8(6): the window of its end-fit-FOAW, the slope of its best-fit-FOAW.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "haptic/device/device_geometry.hpp"
#include "haptic/realtime.hpp"
#include "haptic/types.hpp"

namespace haptic::rt {

/// Rotation vector (axis times angle, rad) from one unit quaternion to another, angle at most pi.
[[nodiscard]] Vec3 rotation_between(const Quat& from, const Quat& to) HAPTIC_RT;

/// Largest pose error, at the centre, that lengths rounded to half a count can cause.
struct PoseNoise {
    Vec3 position{0.0, 0.0, 0.0};  // m, along x, y and z
    Vec3 rotation{0.0, 0.0, 0.0};  // rad
};

/// Sum of absolute values of each row of the pseudo-inverse of the lengths' Jacobian, times half a count. Zero if the
/// strings do not determine the pose at the centre. For the X3R 11 to 12 um and 0.6 to 0.7 mrad.
[[nodiscard]] PoseNoise quantisation_noise(const device::DeviceGeometry& geometry);

struct VelocitySettings {
    int window_ticks = 8;  // longest window, 1..AdaptiveVelocity::kMaxTicks; 8 lags by at most 4 ms. 1: plain
                           // difference of poses
    PoseNoise noise;       // half width of the band around a straight motion
};

class AdaptiveVelocity {
  public:
    static constexpr int kMaxTicks = 64;

    /// Throws std::invalid_argument for a window out of range, or noise that is negative or not finite.
    explicit AdaptiveVelocity(const VelocitySettings& settings);

    /// Takes the pose measured elapsed_ns after the last one. Costs at most 6 * window_ticks steps of a few operations.
    /// With elapsed_ns <= 0 the pose replaces the last one, and the velocity does not change.
    const Twist& update(const Pose& pose, std::int64_t elapsed_ns) HAPTIC_RT;
    /// Restarts at rest at a pose.
    void reset(const Pose& pose) HAPTIC_RT;
    [[nodiscard]] const Twist& twist() const HAPTIC_RT { return twist_; }

  private:
    static constexpr std::size_t kSize = kMaxTicks + 1;

    using Coordinates = std::array<double, 6>;  // m and rad; rotation vectors summed over the ticks

    [[nodiscard]] std::size_t index_before(int ticks) const HAPTIC_RT;
    [[nodiscard]] double slope(std::size_t coordinate) const HAPTIC_RT;

    int window_ticks_;
    Coordinates noise_{};
    std::array<Coordinates, kSize> history_{};  // ring buffer
    std::array<double, kSize> times_s_{};       // since reset()
    std::size_t newest_ = 0;
    int filled_ = 0;  // poses before the newest one, at most window_ticks_
    Pose last_;
    Twist twist_;
};

}  // namespace haptic::rt
