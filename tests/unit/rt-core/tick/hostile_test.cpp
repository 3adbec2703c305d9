// Hostile frames and a noisy device: the motors stay within the limits in every tick. Measured at the emulated device,
// from the DAC codes sent to its motors and its true pose.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <string>

#include "random.hpp"
#include "tick/slot_source.hpp"
#include "tick_rig.hpp"
#include "units.hpp"

namespace haptic::rt {
namespace {

using test::kDacCodeN;
using test::Random;

/// Random and contradictory frames, bypassing the ring so that sessions and sequence numbers are wrong too.
class HostileFrames final : public FrameSource {
  public:
    explicit HostileFrames(std::uint64_t seed) : random_(seed) {}
    void tell_time(std::int64_t now_ns) { now_ns_ = now_ns; }
    /// Frames with a compliance that were sent without a defect.
    [[nodiscard]] int elastic() const { return elastic_; }

    bool read_newest(ContactFrame& frame) HAPTIC_RT override {
        HAPTIC_RT_EXCEPTION_BEGIN("a test's random numbers, in no real loop")
        return next(frame);
        HAPTIC_RT_EXCEPTION_END
    }

  private:
    bool next(ContactFrame& frame) {
        if (random_.uniform(0.0, 1.0) < quiet_) {
            return false;
        }
        if (random_.uniform(0.0, 1.0) < 0.02) {
            quiet_ = random_.uniform(0.0, 1.0) < 0.3 ? 1.0 - 1e-3 * random_.uniform(0.0, 30.0) : 0.5;
        }
        make(frame);
        elastic_ += frame.compliance_rows > 0 && find_defect(frame) == FrameDefect::None ? 1 : 0;
        return true;
    }

    double wild() {
        const double kind = random_.uniform(0.0, 1.0);
        if (kind < 0.02) {
            return std::numeric_limits<double>::quiet_NaN();
        }
        if (kind < 0.04) {
            return std::numeric_limits<double>::infinity();
        }
        return std::pow(10.0, random_.uniform(-2.0, 5.0));
    }

    void make(ContactFrame& frame) {
        frame = ContactFrame{};
        frame.session = static_cast<std::uint64_t>(random_.uniform(0.0, 3.0));
        frame.sequence = static_cast<std::uint64_t>(random_.uniform(0.0, 1e6));
        frame.step_ns = nanoseconds(random_.uniform(0.0005, 0.05));
        frame.plane_time_ns = now_ns_ + nanoseconds(random_.uniform(-0.2, 0.2));
        frame.publish_time_ns = now_ns_ + nanoseconds(random_.uniform(-0.3, 0.3));
        frame.stiffness = wild();
        frame.torque_stiffness = wild();
        frame.flags = random_.uniform(0.0, 1.0) < 0.1 ? std::uint32_t{HAPTIC_FRAME_CLUTCHED} : 0u;
        frame.proxy_count = static_cast<std::uint32_t>(random_.uniform(0.0, 66.0));
        for (std::uint32_t i = 0; i < std::min<std::uint32_t>(frame.proxy_count, kMaxProxies); ++i) {
            ProxyContact& proxy = frame.proxies[i];
            store(0.03 * random_.normal(), proxy.rest_offset);
            proxy.radius = random_.uniform(0.0, 1.0) < 0.3 ? std::pow(10.0, random_.uniform(-4.0, 1.0)) : 0.0;
            proxy.plane_count = static_cast<std::uint32_t>(random_.uniform(0.0, 4.02));
            for (std::uint32_t k = 0; k < std::min<std::uint32_t>(proxy.plane_count, kMaxPlanes); ++k) {
                store(random_.direction(), proxy.planes[k].normal);
                proxy.planes[k].offset = random_.uniform(-0.1, 0.1);  // in front of the hand, or far behind it
                proxy.planes[k].velocity = random_.uniform(-3.0, 3.0);
            }
        }
        if (random_.uniform(0.0, 1.0) < 0.02) {
            frame.proxies[0].radius = random_.uniform(-1.0, 1.0) * wild();
        }
        if (random_.uniform(0.0, 1.0) < 0.5) {
            make_elastic(frame);
        }
    }

    /// Friction, rest offsets that move, and where there is room for its rows a compliance that find_defect() accepts,
    /// though no tool has it.
    void make_elastic(ContactFrame& frame) {
        frame.static_friction = random_.uniform(0.0, 2.0);
        frame.dynamic_friction = random_.uniform(0.0, 2.0);
        frame.body_work = random_.uniform(-1.0, 1.0) * std::pow(10.0, random_.uniform(-6.0, 300.0));
        std::size_t rows = 0;
        for (std::uint32_t i = 0; i < std::min<std::uint32_t>(frame.proxy_count, kMaxProxies); ++i) {
            ProxyContact& proxy = frame.proxies[i];
            store(0.5 * random_.normal(), proxy.rest_velocity);
            store(0.5 * random_.normal(), proxy.surface_velocity);
            const bool tangents = proxy.plane_count > 0 && random_.uniform(0.0, 1.0) < 0.3;
            proxy.in_contact = tangents ? std::uint32_t{HAPTIC_PROXY_TANGENTS} : 0u;
            rows += contact_rows(proxy);
        }
        if (rows > kMaxComplianceRows) {
            return;
        }
        frame.compliance_rows = static_cast<std::uint32_t>(rows);
        for (std::size_t r = 0; r < rows; ++r) {
            for (std::size_t s = 0; s < r; ++s) {
                frame.compliance[compliance_index(r, s)] = static_cast<float>(random_.uniform(-1.0, 1.0));
            }
            frame.compliance[compliance_index(r, r)] = static_cast<float>(random_.uniform(1.0, 3.0));
        }
    }

    Random random_;
    double quiet_ = 0.5;
    int elastic_ = 0;
    std::int64_t now_ns_ = 0;
};

/// A hand that holds still while the loop arms, then wanders by up to 2 cm and 0.3 rad at up to 0.5 m/s.
PoseTrack wandering(Random& random) {
    std::vector<double> times{0.0, 0.9};
    std::vector<Pose> poses{Pose{}, Pose{}};
    for (int i = 1; i < 40; ++i) {
        times.push_back(0.9 + 0.08 * i);
        const Vec3 axis = random.direction();
        const double angle = random.uniform(-0.15, 0.15);
        poses.push_back(
            {0.012 * random.uniform(0.0, 1.0) * random.direction(),
             Quat(std::cos(angle), std::sin(angle) * axis.x, std::sin(angle) * axis.y, std::sin(angle) * axis.z)});
    }
    return {std::move(times), std::move(poses)};
}

struct Largest {
    double force = 0.0;
    double torque = 0.0;
    double force_step = 0.0;
    double torque_step = 0.0;
    double tension_step = 0.0;
    std::uint32_t faults = 0;
    int running_ticks = 0;
    int elastic_frames = 0;
};

/// Settings in which nothing before the limits reduces the wrench, so that the limits alone are tested.
TickSettings without_passivity() {
    TickSettings settings;
    settings.passivity.control = PassivityControl::Observe;
    return settings;
}

void run(std::uint64_t seed, Largest& largest) {
    Random random(seed);
    const TickSettings settings = seed % 2 == 0 ? TickSettings{} : without_passivity();
    device::EmulatedBoard board({.geometry = settings.geometry, .hand = wandering(random)});
    test::FaultyBoard faulty(board);
    HostileFrames frames(seed);
    RingWriter<DeviceState> states(test::unique_session());
    Tick tick(settings, faulty, frames, states, test::still_clock);
    std::int64_t now_ns = 1'000'000'000;
    int failing = 0;
    Wrench last = board.device().wrench();
    std::array<double, kStrings> last_tensions = board.device().tensions();
    for (int i = 0; i < 3000; ++i) {
        if (i == 1) {
            tick.arm();
        }
        const bool running = tick.safety_state() == SafetyState::Running;
        for (std::size_t k = 0; k < kStrings && running; ++k) {
            faulty.added[k] = static_cast<std::uint32_t>(static_cast<int>(random.uniform(-2.99, 2.99)));
        }
        failing = failing > 0 ? failing - 1 : (running && random.uniform(0.0, 1.0) < 0.01 ? 3 : 0);
        faulty.failing = failing > 0;
        frames.tell_time(now_ns);
        tick.run({now_ns, now_ns, 0});
        now_ns += settings.period_ns;

        const std::array<double, kStrings> tensions = board.device().tensions();
        const Wrench made = board.device().wrench();
        largest.force = std::max(largest.force, glm::length(made.force));
        largest.torque = std::max(largest.torque, glm::length(made.torque));
        largest.force_step = std::max(largest.force_step, glm::length(made.force - last.force));
        largest.torque_step = std::max(largest.torque_step, glm::length(made.torque - last.torque));
        for (std::size_t k = 0; k < kStrings; ++k) {
            largest.tension_step = std::max(largest.tension_step, std::fabs(tensions[k] - last_tensions[k]));
            ASSERT_LE(tensions[k], settings.geometry.maximum_tension);
            if (tick.safety_state() == SafetyState::Running) {
                ASSERT_GE(tensions[k], settings.geometry.minimum_tension - kDacCodeN);
            }
        }
        largest.running_ticks += running ? 1 : 0;
        last = made;
        last_tensions = tensions;
    }
    largest.faults |= tick.faults();
    largest.elastic_frames += frames.elastic();
}

TEST(TickUnderHostileFramesAndNoise, KeepsWrenchTensionAndTheirRatesWithinLimitsAtTheDevice) {
    const TickSettings settings;
    Largest largest;
    for (std::uint64_t seed = 1; seed <= 30; ++seed) {
        ASSERT_NO_FATAL_FAILURE(run(seed, largest)) << "seed " << seed;
    }
    RecordProperty("largest_force_n", std::to_string(largest.force));
    RecordProperty("largest_force_step_n", std::to_string(largest.force_step));
    RecordProperty("elastic_frames", largest.elastic_frames);
    // DAC codes are truncated: each of eight strings is short by up to one code. The hand moves between two ticks.
    const double dac_codes = static_cast<double>(kStrings) * kDacCodeN;
    const double knot = 0.0225;  // m, moment arm of a string at the grip
    EXPECT_LE(largest.force, settings.limits.force + dac_codes + 0.1);
    EXPECT_LE(largest.torque, settings.limits.torque + dac_codes * knot + 0.005);
    EXPECT_LE(largest.force_step, settings.limits.force_rate * 1e-3 + 2.0 * dac_codes + 0.2);
    EXPECT_LE(largest.torque_step, settings.limits.torque_rate * 1e-3 + 2.0 * dac_codes * knot + 0.005);
    EXPECT_LE(largest.tension_step, settings.tension_rate * 1e-3 + kDacCodeN);
    EXPECT_GT(largest.force, 0.9 * settings.limits.force) << "the limits were never approached";
    EXPECT_GT(largest.running_ticks, 10'000);
    EXPECT_GT(largest.elastic_frames, 1000);
}

TEST(TickUnderHostileFramesAndNoise, RespectsItsRatesForAnyConfiguredFadeTime) {
    TickSettings settings = without_passivity();
    settings.safety.fault_fade_ns = 1'000'000;
    settings.safety.tension_ramp_ns = 1'000'000;
    test::TickRig rig(PoseTrack(), settings);
    Wrench last;
    std::array<double, kStrings> last_tensions{};
    rig.tick.arm();
    for (int i = 0; i < 600; ++i) {
        if (i > 300 && i < 450) {
            rig.publish(test::floor_frame(0.02, 1000.0, rig.now_ns));  // 8 N, the limit
        }
        if (i == 450) {
            ASSERT_NEAR(glm::length(last.force), 8.0, 0.1);
            rig.tick.stop();
        }
        rig.step();
        const Wrench made = rig.board.device().wrench();
        const std::array<double, kStrings> tensions = rig.board.device().tensions();
        ASSERT_LE(glm::length(made.force - last.force), 1.0 + 16.0 * kDacCodeN) << i;
        for (std::size_t k = 0; k < kStrings; ++k) {
            ASSERT_LE(std::fabs(tensions[k] - last_tensions[k]), 3.0 + kDacCodeN) << i;
        }
        last = made;
        last_tensions = tensions;
    }
    EXPECT_EQ(rig.tick.safety_state(), SafetyState::Disarmed);
    EXPECT_EQ(glm::length(last.force), 0.0);
}

TEST(TickUnderHostileFramesAndNoise, HoldsTheWrenchWhileTheBoardDoesNotAnswer) {
    test::TickRig rig(PoseTrack(), without_passivity());
    rig.run_up();
    for (int i = 0; i < 100; ++i) {
        rig.publish(test::floor_frame(0.002, 1000.0, rig.now_ns));
        rig.step();
    }
    const double before = rig.board.device().wrench().force.y;
    ASSERT_NEAR(before, 2.0, 0.1);
    rig.faulty.failing = true;
    for (int i = 0; i < 15; ++i) {
        // 8 N is far from what the motors hold; a surface this fast may ask for it at once.
        ContactFrame leap = test::floor_frame(0.05, 1000.0, rig.now_ns);
        leap.proxies[0].planes[0].velocity = 10.0;
        rig.publish(leap);
        rig.step();
    }
    rig.faulty.failing = false;
    double last = before;
    for (int i = 0; i < 20; ++i) {
        rig.step();
        const double now = rig.board.device().wrench().force.y;
        EXPECT_LE(now - last, 1.0 + 16.0 * kDacCodeN) << i;
        last = now;
    }
    EXPECT_NEAR(last, 8.0, 0.1);
}

TEST(TickUnderHostileFramesAndNoise, FaultsAsNonFiniteWhenAFramesForceOverflows) {
    test::TickRig rig(PoseTrack(), without_passivity());
    rig.run_up();
    for (int i = 0; i < 100; ++i) {
        rig.publish(test::floor_frame(0.002, 1000.0, rig.now_ns));
        rig.step();
    }
    ContactFrame frame = test::floor_frame(0.002, 1000.0, rig.now_ns);
    frame.proxies[0].planes[0].offset = 1e307;  // finite, as is the stiffness, but not the product
    rig.publish(frame);
    rig.step();
    EXPECT_EQ(rig.tick.safety_state(), SafetyState::Faulted);
    EXPECT_EQ(rig.tick.faults(), static_cast<std::uint32_t>(HAPTIC_FAULT_NONFINITE));
    double last = rig.board.device().wrench().force.y;
    EXPECT_NEAR(last, 2.0, 0.1);
    for (int i = 0; i < 700; ++i) {
        rig.step();
        const double now = rig.board.device().wrench().force.y;
        ASSERT_LE(std::fabs(now - last), 1.5 * 2.0 / 100.0 + 8 * kDacCodeN) << i;
        last = now;
    }
    EXPECT_EQ(rig.tick.safety_state(), SafetyState::Disarmed);
}

}  // namespace
}  // namespace haptic::rt
