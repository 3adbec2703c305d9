#include "haptic/device/tremor.hpp"

#include <cmath>
#include <random>

#include "haptic/device/grip_mechanics.hpp"

namespace haptic::device {
namespace {

constexpr double kTwoPi = 6.283185307179586;

/// In [0, 1), the same on every platform, unlike the distributions of <random>.
double uniform(std::mt19937& random) {
    return static_cast<double>(random()) / 4294967296.0;
}

}  // namespace

Tremor::Tremor(const TremorSettings& settings) : still_(settings.still()) {
    std::mt19937 random(settings.seed);
    for (std::size_t k = 0; k < kCoordinates; ++k) {
        const bool turns = k >= kCoordinates / 2;
        for (std::size_t n = 0; n < kFast + kSlow; ++n) {
            const bool fast = n < kFast;
            Wave& wave = waves_[k][n];
            // Equal shares, so that the amplitudes add up to that of the settings.
            wave.amplitude = fast ? (turns ? settings.rotation : settings.position) / kFast
                                  : (turns ? settings.drift_rotation : settings.drift) / kSlow;
            const double hertz = fast ? 8.0 + 4.0 * uniform(random) : 0.1 + 0.4 * uniform(random);
            wave.rate = kTwoPi * hertz;
            wave.phase = kTwoPi * uniform(random);
        }
    }
}

Pose Tremor::applied_to(const Pose& pose, std::int64_t time_ns) const HAPTIC_RT {
    if (still_) {
        return pose;
    }
    std::array<double, kCoordinates> sum{};
    for (std::size_t k = 0; k < kCoordinates; ++k) {
        for (const Wave& wave : waves_[k]) {
            sum[k] += wave.amplitude * std::sin(wave.rate * seconds(time_ns) + wave.phase);
        }
    }
    return {pose.position + Vec3(sum[0], sum[1], sum[2]), rotated(pose.orientation, Vec3(sum[3], sum[4], sum[5]))};
}

}  // namespace haptic::device
