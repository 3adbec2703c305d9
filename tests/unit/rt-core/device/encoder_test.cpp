#include "device/encoder.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <initializer_list>

#include "units.hpp"

namespace haptic::rt {
namespace {

using test::kTickNs;

constexpr double kMaximumSpeed = 2.0;  // m/s
constexpr double kPulse = 1.66555e-5;  // m per count, X3R

// The board's counters for lengths l by definition: start + (l - rest) / metres_per_count mod 65536.
RawCounters counters_of(const device::DeviceGeometry& geometry, const StringArray& lengths, std::uint16_t start) {
    RawCounters raw{};
    for (std::size_t i = 0; i < kStrings; ++i) {
        const double counts = (lengths[i] - geometry.rest_length(i)) / geometry.strings[i].metres_per_count;
        const std::int64_t value = start + std::llround(counts);
        raw[i] = static_cast<std::uint32_t>(((value % 65536) + 65536) % 65536);
    }
    return raw;
}

StringArray rest_lengths(const device::DeviceGeometry& geometry) {
    StringArray lengths{};
    for (std::size_t i = 0; i < kStrings; ++i) {
        lengths[i] = geometry.rest_length(i);
    }
    return lengths;
}

class StringEncodersTest : public testing::Test {
  protected:
    device::DeviceGeometry geometry = device::spidar_g6_x3r();
    StringEncoders encoders{geometry, kMaximumSpeed};
    StringArray lengths = rest_lengths(geometry);
};

TEST_F(StringEncodersTest, HaveTheRestLengthsAtTheFirstLatchForAnyCounters) {
    ASSERT_TRUE(encoders.update({1, 65535, 32768, 32767, 0, 7, 400, 50000}, 0));
    EXPECT_EQ(encoders.lengths(), lengths);
}

TEST_F(StringEncodersTest, FollowLengthsAcrossTheWrapInBothDirections) {
    for (const std::uint16_t start : std::initializer_list<std::uint16_t>{0, 1, 32767, 32768, 65535}) {
        StringEncoders wrapping(geometry, kMaximumSpeed);
        ASSERT_TRUE(wrapping.update(counters_of(geometry, lengths, start), 0));
        for (int tick = 1; tick <= 400; ++tick) {
            StringArray moved = lengths;
            for (std::size_t i = 0; i < kStrings; ++i) {
                // Half of the strings pay out and half wind in, at 0.1 m/s.
                moved[i] += (i % 2 == 0 ? 1.0 : -1.0) * 1e-4 * tick;
            }
            ASSERT_TRUE(wrapping.update(counters_of(geometry, moved, start), kTickNs));
            for (std::size_t i = 0; i < kStrings; ++i) {
                ASSERT_NEAR(wrapping.lengths()[i], moved[i], 0.51 * kPulse) << "string " << i;
            }
        }
    }
}

TEST_F(StringEncodersTest, RejectAStringFasterThanAHandAndKeepTheLengths) {
    ASSERT_TRUE(encoders.update(counters_of(geometry, lengths, 500), 0));
    StringArray moved = lengths;
    moved[3] += kMaximumSpeed * 1e-3 + 4 * kPulse;
    EXPECT_FALSE(encoders.update(counters_of(geometry, moved, 500), kTickNs));
    EXPECT_EQ(encoders.lengths(), lengths);
    // A jump stays rejected, however long ago it was.
    EXPECT_FALSE(encoders.update(counters_of(geometry, moved, 500), 1000 * kTickNs));
    EXPECT_EQ(encoders.lengths(), lengths);
    encoders.restart();
    EXPECT_TRUE(encoders.update(counters_of(geometry, moved, 500), 1000 * kTickNs));
    EXPECT_EQ(encoders.lengths(), lengths);
}

TEST_F(StringEncodersTest, AcceptTheSameMovementOverALongerTime) {
    ASSERT_TRUE(encoders.update(counters_of(geometry, lengths, 500), 0));
    StringArray moved = lengths;
    moved[3] += kMaximumSpeed * 1.5e-3;
    EXPECT_TRUE(encoders.update(counters_of(geometry, moved, 500), 2 * kTickNs));
}

TEST_F(StringEncodersTest, AreRelativeToTheirLastCalibration) {
    ASSERT_TRUE(encoders.update(counters_of(geometry, lengths, 500), 0));
    StringArray moved = lengths;
    moved[0] += 1e-3;
    ASSERT_TRUE(encoders.update(counters_of(geometry, moved, 500), kTickNs));
    encoders.calibrate();
    EXPECT_EQ(encoders.lengths(), lengths);
    moved[0] += 1e-3;
    ASSERT_TRUE(encoders.update(counters_of(geometry, moved, 500), kTickNs));
    EXPECT_NEAR(encoders.lengths()[0], lengths[0] + 1e-3, kPulse);
}

TEST_F(StringEncodersTest, ReportTheLargestMovementSinceTheMark) {
    ASSERT_TRUE(encoders.update(counters_of(geometry, lengths, 500), 0));
    StringArray moved = lengths;
    moved[2] -= 1.5e-3;
    moved[5] += 0.5e-3;
    ASSERT_TRUE(encoders.update(counters_of(geometry, moved, 500), kTickNs));
    EXPECT_NEAR(encoders.largest_movement(), 1.5e-3, kPulse);
    encoders.mark();
    EXPECT_EQ(encoders.largest_movement(), 0.0);
}

}  // namespace
}  // namespace haptic::rt
