// Velocity of the grip from its poses: the slope over a window that is as long as the hand's motion is straight.
//
// A difference of two poses a millisecond apart is mostly the encoders' quantisation, and a low pass that is long
// enough to quieten it takes the phase that damping needs. The adaptive window does better at both ends: for each
// coordinate by itself, the longest window back from now within which a straight line through its two ends misses no
// pose by more than the noise; the velocity is the slope of the best line through that window. At rest it is long and
// quiet, in a sudden motion it is one tick and lags by half of one.
// @source Janabi-Sharifi, Hayward and Chen 2000, "Discrete-time adaptive windowing for velocity estimation", IEEE
// Trans. Control Systems Technology 8(6): the window of its end-fit-FOAW, the slope of its best-fit-FOAW.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include <haptic/device/variant.hpp>
#include <haptic/realtime.hpp>
#include <haptic/types.hpp>

namespace haptic::rt {

/// Rotation from one unit quaternion to another as a vector (axis times angle, rad), by the shorter way.
[[nodiscard]] Vec3 rotation_between(const Quat& from, const Quat& to) HAPTIC_RT;

/// How far a pose may be off because each length is known to half a count only, at the most and at the centre.
struct PoseNoise {
    Vec3 position{0.0, 0.0, 0.0};  // m, along x, y and z
    Vec3 rotation{0.0, 0.0, 0.0};  // rad
};

/// Sum of the sizes of each row of the lengths' pseudo-inverse, times half a count. Zero where the strings do not
/// determine the pose at the centre. For X3R 11 to 12 um and 0.6 to 0.7 mrad.
[[nodiscard]] PoseNoise quantisation_noise(const device::Variant& variant);

struct VelocitySettings {
    int window_ticks = 8;  // 1..AdaptiveVelocity::kMostTicks; ball-park 8, whose lag is 4 ms at the most. 1: the plain
                           // difference of poses
    PoseNoise noise;       // half width of the band that a straight motion stays in
};

class AdaptiveVelocity {
  public:
    static constexpr int kMostTicks = 64;

    /// Throws std::invalid_argument for a window out of range, or noise that is negative or not finite.
    explicit AdaptiveVelocity(const VelocitySettings& settings);

    /// Takes the pose measured elapsed_ns after the last one: at most 6 * window_ticks steps of a few operations. With
    /// elapsed_ns <= 0 the pose takes the place of the last one, and the velocity stays.
    const Twist& update(const Pose& pose, std::int64_t elapsed_ns) HAPTIC_RT;
    /// At rest at a pose.
    void reset(const Pose& pose) HAPTIC_RT;
    [[nodiscard]] const Twist& twist() const HAPTIC_RT { return twist_; }

  private:
    static constexpr std::size_t kSize = kMostTicks + 1;

    using Coordinates = std::array<double, 6>;  // m and rad; rotation is summed up from tick to tick

    [[nodiscard]] std::size_t back(int ticks) const HAPTIC_RT;
    [[nodiscard]] double slope(std::size_t coordinate) const HAPTIC_RT;

    int window_ticks_;
    Coordinates noise_{};
    std::array<Coordinates, kSize> history_{};  // a ring
    std::array<double, kSize> times_s_{};       // since reset()
    std::size_t newest_ = 0;
    int filled_ = 0;  // poses before the newest one, at most window_ticks_
    Pose last_;
    Twist twist_;
};

}  // namespace haptic::rt
