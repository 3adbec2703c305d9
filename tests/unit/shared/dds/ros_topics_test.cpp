// The wrench overlay on its way from a writer of ROS 2's topic to the ring of a session.
#include "dds/ros_topics.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <limits>
#include <string>

#include "dds/entities.hpp"
#include "dds/loopback.hpp"
#include "haptic/clock.hpp"
#include "haptic/ring.hpp"
#include "ros_messages.h"

namespace haptic {
namespace {

using Wrench = geometry_msgs_msg_dds__WrenchStamped_;

class RosOverlay : public ::testing::Test {
  protected:
    RosOverlay()
        : link_(test::loopback("ros-test")),
          domain_(link_),
          ring_(link_.session),
          participant_(dds::participant_in(link_.domain)),
          // As rclcpp publishes by default.
          sender_(participant_, geometry_msgs_msg_dds__WrenchStamped__desc, "rt/lab/hand/wrench_overlay",
                  dds::Quality{10}.reliable()) {}

    RosTopics topics(bool overlay) { return {{.names = "lab/hand", .rate_hz = 100.0, .overlay = overlay}, link_}; }

    void send(std::string frame, double fx, double tz = 0.0) {
        Wrench message{};
        message.header.frame_id = frame.data();
        message.wrench = {{fx, 0.25, -0.5}, {0.0, 0.0, tz}};
        sender_.send(message);
    }
    /// Sends again and again until this holds. False: it never did.
    template <class Condition>
    bool send_until(RosTopics& ros, const std::string& frame, double fx, double tz, const Condition& condition) {
        for (const std::int64_t end_ns = monotonic_now_ns() + test::kPatienceNs; monotonic_now_ns() < end_ns;) {
            send(frame, fx, tz);
            ros.run_once(monotonic_now_ns(), {});
            if (condition()) {
                return true;
            }
            ::usleep(500);
        }
        return false;
    }

    LinkSettings link_;
    LinkDomain domain_;
    RingReader<WrenchOverlay> ring_;  // rt-core
    dds::Entity participant_;
    dds::Sender<Wrench> sender_;
};

TEST_F(RosOverlay, ArrivesWithTheTimeOfItsArrival) {
    RosTopics ros = topics(true);
    for (const char* const frame : {"", "lab_hand_device"}) {
        const double fx = frame[0] == '\0' ? 1.5 : 2.5;
        WrenchOverlay overlay{};
        ASSERT_TRUE(
            send_until(ros, frame, fx, 0.03, [&] { return ring_.read_newest(overlay) && overlay.force[0] == fx; }));
        EXPECT_EQ(overlay.force[1], 0.25);
        EXPECT_EQ(overlay.force[2], -0.5);
        EXPECT_EQ(overlay.torque[2], 0.03);
        EXPECT_NEAR(seconds(monotonic_now_ns() - overlay.arrival_time_ns), 0.0, 0.5);
    }
    EXPECT_GE(ros.counts().overlays, 2u);
    EXPECT_EQ(ros.counts().refused, 0u);
}

TEST_F(RosOverlay, IsDroppedIfItWaitedWhileTheRelayStoodStill) {
    RosTopics ros = topics(true);
    WrenchOverlay overlay{};
    ASSERT_TRUE(send_until(ros, "", 1.0, 0.0, [&] { return ring_.read_newest(overlay); }));
    for (int i = 0; i < 100; ++i) {
        ros.run_once(monotonic_now_ns(), {});
        ::usleep(500);
    }
    (void)ring_.read_newest(overlay);
    // It arrives, and nobody takes it for 100 ms.
    const std::uint64_t passed_on = ros.counts().overlays;
    send("", 2.0);
    ::usleep(100'000);
    const std::int64_t end_ns = monotonic_now_ns() + 30'000'000;
    while (monotonic_now_ns() < end_ns) {
        ros.run_once(monotonic_now_ns(), {});
        ::usleep(500);
    }
    EXPECT_FALSE(ring_.read_newest(overlay)) << overlay.force[0];
    EXPECT_EQ(ros.counts().overlays, passed_on);
    // Those that are sent from then on count again.
    EXPECT_TRUE(send_until(ros, "", 3.0, 0.0, [&] { return ring_.read_newest(overlay) && overlay.force[0] == 3.0; }));
}

TEST_F(RosOverlay, IsRefusedInAnotherFrameOrIfItIsNotFinite) {
    RosTopics ros = topics(true);
    EXPECT_TRUE(send_until(ros, "base_link", 1.0, 0.0, [&] { return ros.counts().refused > 0; }));
    const std::uint64_t refused = ros.counts().refused;
    const double nan = std::numeric_limits<double>::quiet_NaN();
    EXPECT_TRUE(send_until(ros, "", nan, 0.0, [&] { return ros.counts().refused > refused + 3; }));
    EXPECT_TRUE(send_until(ros, "", 0.0, -std::numeric_limits<double>::infinity(),
                           [&] { return ros.counts().refused > refused + 9; }));
    WrenchOverlay overlay{};
    EXPECT_FALSE(ring_.read_newest(overlay));
    EXPECT_EQ(ros.counts().overlays, 0u);
}

TEST_F(RosOverlay, IsNotTakenUnlessAskedFor) {
    RosTopics ros = topics(false);
    // A second relay that takes it shows when the messages have arrived; the ring's place was free for it.
    RosTopics other = topics(true);
    EXPECT_TRUE(send_until(other, "", 1.0, 0.0, [&] {
        ros.run_once(monotonic_now_ns(), {});
        return other.counts().overlays > 0;
    }));
    EXPECT_EQ(ros.counts().overlays + ros.counts().refused, 0u);
}

TEST_F(RosOverlay, HasOneSourceInASession) {
    const RosTopics ros = topics(true);
    EXPECT_THROW((void)topics(true), RingError);
}

TEST(RosNames, AreThoseThatRosAllows) {
    for (const char* const good : {"haptic", "lab/left_2", "_a"}) {
        EXPECT_NO_THROW(check(RosSettings{.names = good})) << good;
    }
    for (const char* const bad : {"", "/a", "a/", "a//b", "2left", "a/2", "left hand", "a-b"}) {
        EXPECT_THROW(check(RosSettings{.names = bad}), std::invalid_argument) << bad;
    }
}

}  // namespace
}  // namespace haptic
