#include "haptic/rt/encoder.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace haptic::rt {
namespace {

// A latch may fall on the far side of a count's edge at both ends.
constexpr double kQuantisationCounts = 2.0;

}  // namespace

StringEncoders::StringEncoders(const device::Variant& variant, double maximum_speed)
    : maximum_speed_(maximum_speed), metres_per_count_(variant.metres_per_count) {
    for (std::size_t i = 0; i < kStrings; ++i) {
        metres_of_count_[i] = variant.metres_per_count * variant.strings[i].count_sign;
        rest_lengths_[i] = variant.rest_length(i);
    }
    lengths_ = rest_lengths_;
}

bool StringEncoders::update(const RawCounters& raw, std::int64_t elapsed_ns) HAPTIC_RT {
    if (!started_) {
        for (std::size_t i = 0; i < kStrings; ++i) {
            counts_[i] = -static_cast<std::int64_t>(static_cast<std::int16_t>(raw[i]));
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
    const double most = maximum_speed_ * seconds(elapsed_ns) / metres_per_count_ + kQuantisationCounts;
    std::array<std::int16_t, kStrings> steps{};
    for (std::size_t i = 0; i < kStrings; ++i) {
        // The nearest difference modulo 65536.
        steps[i] = static_cast<std::int16_t>(static_cast<std::uint16_t>(raw[i] - raw_[i]));
        if (std::fabs(static_cast<double>(steps[i])) > most) {
            lost_ = true;
            return false;
        }
    }
    for (std::size_t i = 0; i < kStrings; ++i) {
        counts_[i] -= steps[i];
        lengths_[i] = rest_lengths_[i] + metres_of_count_[i] * static_cast<double>(counts_[i] - offsets_[i]);
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
        largest = std::max(largest, std::fabs(static_cast<double>(counts_[i] - marked_[i])));
    }
    return largest * metres_per_count_;
}

}  // namespace haptic::rt
