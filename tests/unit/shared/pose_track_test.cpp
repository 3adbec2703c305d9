#include "haptic/pose_track.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <glm/gtc/constants.hpp>

#include "haptic/csv.hpp"
#include "temporary_file.hpp"

namespace haptic {
namespace {

using test::message_of;
using test::TemporaryDirectory;
using testing::EndsWith;
using testing::HasSubstr;

Quat about_y(double angle) {
    return {std::cos(angle / 2.0), 0.0, std::sin(angle / 2.0), 0.0};
}

/// Largest difference of the rotation matrices, which does not depend on the quaternions' signs.
double distance(const Quat& a, const Quat& b) {
    const Mat3 difference = glm::mat3_cast(a) - glm::mat3_cast(b);
    double largest = 0.0;
    for (int i = 0; i < 9; ++i) {
        largest = std::max(largest, std::abs(difference[i / 3][i % 3]));
    }
    return largest;
}

TEST(PoseTrack, HoldsStillWithoutAFile) {
    const PoseTrack track(Pose{{1.0, 2.0, 3.0}, about_y(0.4)});
    for (const std::int64_t time_ns : {-5LL, 0LL, 1'000'000'000'000LL}) {
        EXPECT_EQ(track.at(time_ns).position, Vec3(1.0, 2.0, 3.0));
        EXPECT_EQ(track.at(time_ns).orientation, about_y(0.4));
    }
    EXPECT_EQ(track.duration_s(), 0.0);
}

TEST(PoseTrack, MovesOnTheStraightLineAtEvenSpeed) {
    const PoseTrack track({0.0, 2.0, 3.0}, {Pose{{0.0, 0.0, 0.0}}, Pose{{2.0, -4.0, 0.0}}, Pose{{2.0, -4.0, 8.0}}});
    EXPECT_NEAR(glm::distance(track.at(500'000'000).position, Vec3(0.5, -1.0, 0.0)), 0.0, 1e-15);
    EXPECT_NEAR(glm::distance(track.at(2'250'000'000).position, Vec3(2.0, -4.0, 2.0)), 0.0, 1e-15);
    EXPECT_EQ(track.at(2'000'000'000).position, Vec3(2.0, -4.0, 0.0));
    EXPECT_EQ(track.duration_s(), 3.0);
}

TEST(PoseTrack, HoldsTheFirstAndTheLastPoseOutside) {
    const PoseTrack track({1.0, 2.0}, {Pose{{1.0, 0.0, 0.0}}, Pose{{2.0, 0.0, 0.0}}});
    EXPECT_EQ(track.at(0).position.x, 1.0);
    EXPECT_EQ(track.at(-1).position.x, 1.0);
    EXPECT_EQ(track.at(9'000'000'000).position.x, 2.0);
}

TEST(PoseTrack, TurnsAtEvenSpeedAlongTheShortestArc) {
    for (const double sign : {1.0, -1.0}) {  // q and -q are the same orientation
        const PoseTrack track({0.0, 1.0}, {Pose{{}, about_y(0.2)}, Pose{{}, sign * about_y(2.2)}});
        for (const double fraction : {0.0, 0.1, 0.25, 0.5, 0.9, 1.0}) {
            const Quat turned = track.at(nanoseconds(fraction)).orientation;
            EXPECT_LT(distance(turned, about_y(0.2 + 2.0 * fraction)), 1e-12) << sign << ' ' << fraction;
            EXPECT_NEAR(glm::length(turned), 1.0, 1e-15);
        }
    }
}

TEST(PoseTrack, StaysUnitBetweenAlmostEqualOrientations) {
    const PoseTrack track({0.0, 1.0}, {Pose{{}, about_y(0.2)}, Pose{{}, about_y(0.2 + 1e-9)}});
    EXPECT_NEAR(glm::length(track.at(500'000'000).orientation), 1.0, 1e-15);
}

TEST(PoseTrack, RefusesTimesThatDoNotIncrease) {
    EXPECT_THROW(PoseTrack({0.0, 0.0}, {Pose{}, Pose{}}), std::invalid_argument);
    EXPECT_THROW(PoseTrack({0.0, std::nan("")}, {Pose{}, Pose{}}), std::invalid_argument);
    EXPECT_THROW(PoseTrack({}, {}), std::invalid_argument);
    EXPECT_THROW(PoseTrack({0.0, 1.0}, {Pose{}}), std::invalid_argument);
}

TEST(PoseTrackFile, ReadsARecordingAndIgnoresItsOtherColumns) {
    const TemporaryDirectory directory;
    const PoseTrack track = PoseTrack::load(
        directory.write("f.csv", "time_s,x_m,y_m,z_m,qw,qx,qy,qz,fx_n\n0,1,2,3,1,0,0,0,7\n1,3,2,3,0,0,1,0,7\n"));
    EXPECT_EQ(track.at(500'000'000).position, Vec3(2.0, 2.0, 3.0));
    EXPECT_LT(distance(track.at(500'000'000).orientation, about_y(glm::half_pi<double>())), 1e-12);
}

TEST(PoseTrackFile, HoldsTheOrientationWhereItGivesNone) {
    const TemporaryDirectory directory;
    const PoseTrack track = PoseTrack::load(directory.write("f.csv", "y_m,time_s,x_m,z_m\n2,0,1,3\n"));
    EXPECT_EQ(track.at(0).position, Vec3(1.0, 2.0, 3.0));
    EXPECT_EQ(track.at(0).orientation, Quat(1.0, 0.0, 0.0, 0.0));
}

TEST(PoseTrackFile, NamesTheLineOfWhatIsWrong) {
    const TemporaryDirectory directory;
    const auto error = [&](const char* content) {
        return message_of<CsvError>([&] { static_cast<void>(PoseTrack::load(directory.write("f.csv", content))); });
    };
    EXPECT_THAT(error("time_s,x_m,y_m,z_m\n0,0,0,0\n1,0,0,0\n1,0,0,0\n"), HasSubstr("f.csv:4: time_s is not later"));
    EXPECT_THAT(error("time_s,x_m,y_m,z_m,qw,qx,qy,qz\n0,0,0,0,1,0,0,0\n1,0,0,0,1,0,0,0.1\n"),
                HasSubstr("f.csv:3: qw,qx,qy,qz is not of unit length"));
    EXPECT_THAT(error("time_s,x_m,y_m,z_m,qw,qx,qy\n0,0,0,0,1,0,0\n"), HasSubstr("there is no column qz"));
    EXPECT_THAT(error("time_s,x_m,y_m\n0,0,0\n"), HasSubstr("there is no column z_m"));
    EXPECT_THAT(error("time_s,x_m,y_m,z_m\n"), EndsWith("there is no pose"));
}

}  // namespace
}  // namespace haptic
