#include "device/encoder.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdlib>

namespace haptic::rt {
namespace {

// Counts, tolerance for the quantisation of a difference: up to one count at each of the two latches.
constexpr double kQuantisationCounts = 2.0;

/// Sign extension: the value nearest to zero that is equal to the counter modulo 2^(32 - unused_bits).
std::int32_t sign_extended(std::uint32_t counter, unsigned unused_bits) HAPTIC_RT {
    return static_cast<std::int32_t>(counter << unused_bits) >> unused_bits;
}

}  // namespace

StringEncoders::StringEncoders(const device::DeviceGeometry& geometry, double maximum_speed)
    : maximum_speed_(maximum_speed), unused_bits_(32U - static_cast<unsigned>(device::counter_bits(geometry.board))) {
    for (std::size_t i = 0; i < kStrings; ++i) {
        metres_per_count_[i] = geometry.strings[i].metres_per_count;
        rest_lengths_[i] = geometry.rest_length(i);
    }
    lengths_ = rest_lengths_;
}

bool StringEncoders::update(const RawCounters& raw, std::int64_t elapsed_ns) HAPTIC_RT {
    // The first latch defines the counts; the grip is assumed to be at its rest position.
    if (!started_) {
        for (std::size_t i = 0; i < kStrings; ++i) {
            counts_[i] = sign_extended(raw[i], unused_bits_);
        }
        raw_ = raw;
        started_ = true;
        calibrate();
        mark();
        return true;
    }
    if (lost_) {
        return false;
    }
    // Reject the latch as a whole if any string moved farther than possible.
    const double max_movement = maximum_speed_ * seconds(elapsed_ns);  // m
    std::array<std::int32_t, kStrings> steps{};
    for (std::size_t i = 0; i < kStrings; ++i) {
        steps[i] = sign_extended(raw[i] - raw_[i], unused_bits_);
        if ((std::abs(steps[i]) - kQuantisationCounts) * std::fabs(metres_per_count_[i]) > max_movement) {
            lost_ = true;
            jumped_ = static_cast<std::uint8_t>(jumped_ | 1U << i);
        }
    }
    if (lost_) {
        return false;
    }
    // l_i = rest length + metres per count * (counts since the calibration).
    for (std::size_t i = 0; i < kStrings; ++i) {
        counts_[i] += steps[i];
        lengths_[i] = rest_lengths_[i] + metres_per_count_[i] * static_cast<double>(counts_[i] - offsets_[i]);
    }
    raw_ = raw;
    return true;
}

void StringEncoders::restart() HAPTIC_RT {
    started_ = false;
    lost_ = false;
    jumped_ = 0;
}

void StringEncoders::calibrate() HAPTIC_RT {
    offsets_ = counts_;
    lengths_ = rest_lengths_;
}

double StringEncoders::largest_movement() const HAPTIC_RT {
    double max_movement = 0.0;
    for (std::size_t i = 0; i < kStrings; ++i) {
        max_movement =
            std::max(max_movement, std::fabs(static_cast<double>(counts_[i] - marked_[i]) * metres_per_count_[i]));
    }
    return max_movement;
}

}  // namespace haptic::rt
