// Both relays in one process, through DDS on the loopback interface.
#include "dds/relay.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdint>
#include <cstring>
#include <limits>
#include <optional>
#include <string>

#include "dds/loopback.hpp"
#include "haptic/clock.hpp"

namespace haptic {
namespace {

constexpr std::int64_t kPollNs = 500'000;

class Relays : public ::testing::Test {
  protected:
    Relays()
        : settings_(test::loopback("relay-test")),
          domain_(settings_),
          device_(settings_),
          loop_states_(settings_.session),
          loop_frames_(settings_.session),
          simulation_(std::in_place, settings_, 42),
          states_(SimulationRelay::ring_session(settings_)),
          frames_(std::in_place, SimulationRelay::ring_session(settings_)) {}

    /// Runs both relays until this holds. False: it never did.
    template <class Condition>
    bool run_until(const Condition& condition) {
        for (const std::int64_t end_ns = monotonic_now_ns() + test::kPatienceNs; monotonic_now_ns() < end_ns;) {
            if (condition()) {
                return true;
            }
            device_.run_once(kPollNs);
            if (simulation_) {
                simulation_->run_once(kPollNs);
            }
        }
        return false;
    }

    std::uint64_t publish_state(std::int64_t latch_ns) {
        DeviceState state{};
        state.latch_time_ns = latch_ns;
        state.frame_sequence = rendered_;
        state.orientation[0] = 1.0;
        for (int k = 0; k < 3; ++k) {
            state.position[k] = 0.01 * (k + 1);
            state.angular_impulse[k] = 5.0 + k;
        }
        state.tension[7] = 2.5;
        state.tick_flags = 0x1234;
        state.buttons = 3;
        return loop_states_.publish(state, monotonic_now_ns());
    }

    static ContactFrame valid_frame(double offset) {
        ContactFrame frame{};
        frame.step_ns = 10'000'000;
        frame.plane_time_ns = monotonic_now_ns();
        frame.stiffness = 200.0;
        frame.static_friction = 0.5;
        frame.dynamic_friction = 0.25;
        frame.proxy_count = 2;
        for (std::uint32_t i = 0; i < 2; ++i) {
            ProxyContact& proxy = frame.proxies[i];
            proxy.rest_offset[0] = 0.1 * i;
            proxy.rest_velocity[1] = 0.2;
            proxy.radius = 0.01 * (1 + i);
            proxy.position[2] = 0.3;
            proxy.surface_velocity[0] = 0.4;
            proxy.plane_count = 1 + i;
            proxy.planes[0] = {{0.0, 1.0, 0.0}, offset, 0.01};
            if (i == 1) {
                proxy.planes[1] = {{1.0, 0.0, 0.0}, 0.02, 0.0};
            }
        }
        // A row for each plane.
        frame.compliance_rows = 3;
        for (std::size_t r = 0; r < 3; ++r) {
            for (std::size_t s = 0; s <= r; ++s) {
                frame.compliance[compliance_index(r, s)] = r == s ? 1.0f : 0.25f;
            }
        }
        return frame;
    }

    bool connect() {
        return run_until([&] {
            (void)publish_state(monotonic_now_ns());
            DeviceState state{};
            return states_.read_newest(state);
        });
    }

    LinkSettings settings_;
    LinkDomain domain_;
    DeviceRelay device_;
    RingWriter<DeviceState> loop_states_;   // rt-core
    RingReader<ContactFrame> loop_frames_;  // rt-core
    std::optional<SimulationRelay> simulation_;
    RingReader<DeviceState> states_;                  // the simulator
    std::optional<RingWriter<ContactFrame>> frames_;  // the simulator
    std::uint64_t rendered_ = 0;
};

TEST_F(Relays, PassStatesWithTheirTimesConverted) {
    ASSERT_TRUE(connect());
    const std::int64_t latch_ns = monotonic_now_ns();
    (void)publish_state(latch_ns);
    DeviceState state{};
    ASSERT_TRUE(
        run_until([&] { return states_.read_newest(state) && std::abs(state.latch_time_ns - latch_ns) < 1'000'000; }));
    EXPECT_DOUBLE_EQ(state.position[2], 0.03);
    EXPECT_DOUBLE_EQ(state.angular_impulse[1], 6.0);
    EXPECT_DOUBLE_EQ(state.tension[7], 2.5);
    EXPECT_EQ(state.tick_flags, 0x1234u);
    EXPECT_EQ(state.buttons, 3u);
    // Both ends have one clock here.
    const ClockOffset offset = simulation_->clock().at(monotonic_now_ns()).value();
    EXPECT_LE(std::abs(offset.offset_ns), offset.uncertainty_ns);
    EXPECT_LT(offset.uncertainty_ns, 10'000'000);
}

TEST_F(Relays, PassFramesWholeAndWithSequencesOfBothRings) {
    ASSERT_TRUE(connect());
    // A state whose number in the simulator's ring differs from that in the loop's.
    DeviceState state{};
    const std::uint64_t loop_number = publish_state(77);
    ASSERT_TRUE(run_until([&] { return states_.read_newest(state); }));
    ContactFrame sent = valid_frame(-0.004);
    sent.state_sequence = state.sequence;
    sent.state_time_ns = state.latch_time_ns;
    const std::uint64_t number = frames_->publish(sent, monotonic_now_ns());
    ContactFrame frame{};
    ASSERT_TRUE(run_until([&] { return loop_frames_.read_newest(frame); }));
    EXPECT_EQ(find_defect(frame), FrameDefect::None);
    EXPECT_EQ(frame.state_sequence, loop_number);
    const std::int64_t error_ns = simulation_->clock().at(monotonic_now_ns())->uncertainty_ns;
    EXPECT_LE(std::abs(frame.plane_time_ns - sent.plane_time_ns), error_ns);
    EXPECT_LE(std::abs(frame.state_time_ns - 77), 2 * error_ns);
    EXPECT_EQ(frame.proxy_count, 2u);
    EXPECT_EQ(std::memcmp(frame.proxies, sent.proxies, 2 * sizeof(ProxyContact)), 0);
    EXPECT_EQ(std::memcmp(frame.compliance, sent.compliance, 6 * sizeof(float)), 0);
    EXPECT_DOUBLE_EQ(frame.dynamic_friction, 0.25);
    // The loop says which frame it renders; the simulator hears its own number.
    rendered_ = frame.sequence;
    ASSERT_TRUE(run_until([&] {
        (void)publish_state(monotonic_now_ns());
        return states_.read_newest(state) && state.frame_sequence == number;
    }));
}

TEST_F(Relays, RefuseInvalidAndOutdatedFrames) {
    ASSERT_TRUE(connect());
    ContactFrame bad = valid_frame(0.0);
    bad.proxies[0].planes[0].normal[1] = 2.0;
    (void)frames_->publish(bad, monotonic_now_ns());
    ASSERT_TRUE(run_until([&] { return device_.counts().refused == 1; }));
    ContactFrame old = valid_frame(0.0);
    old.plane_time_ns -= 2 * DeviceRelay::kMaxAgeNs;
    (void)frames_->publish(old, monotonic_now_ns());
    ASSERT_TRUE(run_until([&] { return device_.counts().late == 1; }));
    old.plane_time_ns = std::numeric_limits<std::int64_t>::min();
    (void)frames_->publish(old, monotonic_now_ns());
    ASSERT_TRUE(run_until([&] { return device_.counts().late == 2; }));
    ContactFrame frame{};
    EXPECT_FALSE(loop_frames_.read_newest(frame));
}

TEST_F(Relays, DetachWhenTheSimulationIsGoneAndTakeItBack) {
    ASSERT_TRUE(connect());
    const auto pass_one = [&](double offset) {
        ContactFrame frame{};
        return run_until([&] {
            ContactFrame sent = valid_frame(offset);
            (void)frames_->publish(sent, monotonic_now_ns());
            return loop_frames_.read_newest(frame) && frame.proxies[0].planes[0].offset == offset;
        });
    };
    ASSERT_TRUE(pass_one(0.001));
    EXPECT_FALSE(loop_frames_.peer().closed);
    simulation_.reset();
    ASSERT_TRUE(run_until([&] { return loop_frames_.peer().closed; }));
    simulation_.emplace(settings_, 43);
    ASSERT_TRUE(pass_one(0.002));
    EXPECT_EQ(device_.counts().connections, 2u);
}

TEST_F(Relays, RefuseASimulationWhosePlaceIsTakenAndJoinOnceItIsFree) {
    // A simulator on the loop's own machine.
    std::optional<RingWriter<ContactFrame>> local(std::in_place, settings_.session);
    ASSERT_TRUE(connect());
    const auto remote_is = [&](const auto& condition) {
        return run_until([&] {
            ContactFrame sent = valid_frame(0.003);
            (void)frames_->publish(sent, monotonic_now_ns());
            return condition();
        });
    };
    ASSERT_TRUE(remote_is([&] { return device_.counts().displaced > 3; }));
    EXPECT_NE(device_.problem().find("already has its writer"), std::string::npos) << device_.problem();
    EXPECT_EQ(device_.counts().connections, 0u);
    // The local one keeps its place, and the remote one its hand.
    ContactFrame frame = valid_frame(0.001);
    (void)local->publish(frame, monotonic_now_ns());
    ASSERT_TRUE(loop_frames_.read_newest(frame));
    EXPECT_EQ(frame.proxies[0].planes[0].offset, 0.001);
    EXPECT_TRUE(connect()) << "states still arrive";
    // The place is free: the remote one has it, without being started again.
    local.reset();
    ASSERT_TRUE(
        remote_is([&] { return loop_frames_.read_newest(frame) && frame.proxies[0].planes[0].offset == 0.003; }));
    EXPECT_EQ(device_.problem(), "");
    EXPECT_EQ(device_.counts().connections, 1u);
}

TEST_F(Relays, ForgetARefusedSimulationThatIsGone) {
    const RingWriter<ContactFrame> local(settings_.session);
    ASSERT_TRUE(connect());
    ASSERT_TRUE(run_until([&] {
        ContactFrame sent = valid_frame(0.003);
        (void)frames_->publish(sent, monotonic_now_ns());
        return !device_.problem().empty();
    }));
    simulation_.reset();
    EXPECT_TRUE(run_until([&] { return device_.problem().empty(); }));
}

TEST(Link, NamesWhatItCannotUse) {
    EXPECT_THROW(check({.session = "a/b"}), std::invalid_argument);
    EXPECT_THROW(check({.interface = "lo\"/>"}), std::invalid_argument);
    EXPECT_THROW(check({.peers = {"10.0.0.1 "}}), std::invalid_argument);
    EXPECT_THROW(check({.domain = 233}), std::invalid_argument);
    EXPECT_THROW(LinkDomain({.interface = "nonesuch0", .domain = 99}), std::runtime_error);
}

}  // namespace
}  // namespace haptic
