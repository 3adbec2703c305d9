#include "device/encoder.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdlib>

namespace haptic::rt {
namespace {

// A latch may fall on the far side of a count's edge at both ends.
constexpr double kQuantisationCounts = 2.0;

/// The value nearest to zero of a counter modulo 2^(32 - unused_bits).
std::int32_t extended(std::uint32_t counter, unsigned unused_bits) HAPTIC_RT {
    return static_cast<std::int32_t>(counter << unused_bits) >> unused_bits;
}

}  // namespace

StringEncoders::StringEncoders(const device::Variant& variant, double maximum_speed)
    : maximum_speed_(maximum_speed), unused_bits_(32U - static_cast<unsigned>(device::counter_bits(variant.board))) {
    for (std::size_t i = 0; i < kStrings; ++i) {
        metres_per_count_[i] = variant.strings[i].metres_per_count;
        rest_lengths_[i] = variant.rest_length(i);
    }
    lengths_ = rest_lengths_;
}

bool StringEncoders::update(const RawCounters& raw, std::int64_t elapsed_ns) HAPTIC_RT {
    if (!started_) {
        for (std::size_t i = 0; i < kStrings; ++i) {
            counts_[i] = extended(raw[i], unused_bits_);
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
    const double most = maximum_speed_ * seconds(elapsed_ns);  // m
    std::array<std::int32_t, kStrings> steps{};
    for (std::size_t i = 0; i < kStrings; ++i) {
        steps[i] = extended(raw[i] - raw_[i], unused_bits_);
        if ((std::abs(steps[i]) - kQuantisationCounts) * std::fabs(metres_per_count_[i]) > most) {
            lost_ = true;
            return false;
        }
    }
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
}

void StringEncoders::calibrate() HAPTIC_RT {
    offsets_ = counts_;
    lengths_ = rest_lengths_;
}

double StringEncoders::largest_movement() const HAPTIC_RT {
    double largest = 0.0;
    for (std::size_t i = 0; i < kStrings; ++i) {
        largest = std::max(largest, std::fabs(static_cast<double>(counts_[i] - marked_[i]) * metres_per_count_[i]));
    }
    return largest;
}

}  // namespace haptic::rt
