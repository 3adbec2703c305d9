#include "haptic/frames.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <limits>
#include <memory>
#include <string_view>
#include <vector>

namespace haptic {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// A valid frame that uses every field.
std::unique_ptr<ContactFrame> full_frame() {
    auto frame = std::make_unique<ContactFrame>();
    frame->step_ns = 1'000'000;
    frame->stiffness = 500.0;
    frame->torque_stiffness = 300.0;
    frame->static_friction = 0.8;
    frame->dynamic_friction = 0.5;
    frame->proxy_count = kMaxProxies;
    for (ProxyContact& proxy : frame->proxies) {
        proxy.radius = 0.01;
        proxy.plane_count = kMaxPlanes;
        for (ContactPlane& plane : proxy.planes) {
            store(Vec3(0.6, 0.0, 0.8), plane.normal);
        }
    }
    return frame;
}

FrameDefect defect_after(const std::function<void(ContactFrame&)>& damage) {
    const auto frame = full_frame();
    damage(*frame);
    return find_defect(*frame);
}

TEST(FindDefect, AcceptsAFullFrameAndAnEmptyOne) {
    EXPECT_EQ(find_defect(*full_frame()), FrameDefect::None);
    EXPECT_EQ(defect_after([](ContactFrame& frame) { frame.proxy_count = 0; }), FrameDefect::None);
}

TEST(FindDefect, RefusesMoreProxiesOrPlanesThanThereIsRoomFor) {
    EXPECT_EQ(defect_after([](ContactFrame& frame) { frame.proxy_count = kMaxProxies + 1; }), FrameDefect::ProxyCount);
    EXPECT_EQ(defect_after([](ContactFrame& frame) { frame.proxy_count = 0xFFFFFFFF; }), FrameDefect::ProxyCount);
    EXPECT_EQ(defect_after([](ContactFrame& frame) { frame.proxies[63].plane_count = kMaxPlanes + 1; }),
              FrameDefect::PlaneCount);
}

TEST(FindDefect, RefusesEachNumberThatIsNotFinite) {
    const std::function<double*(ContactFrame&)> numbers[] = {
        [](ContactFrame& frame) { return &frame.stiffness; },
        [](ContactFrame& frame) { return &frame.torque_stiffness; },
        [](ContactFrame& frame) { return &frame.static_friction; },
        [](ContactFrame& frame) { return &frame.dynamic_friction; },
        [](ContactFrame& frame) { return &frame.body_work; },
        [](ContactFrame& frame) { return &frame.proxies[63].surface_velocity[1]; },
        [](ContactFrame& frame) { return &frame.proxies[63].rest_offset[2]; },
        [](ContactFrame& frame) { return &frame.proxies[63].rest_velocity[0]; },
        [](ContactFrame& frame) { return &frame.proxies[63].radius; },
        [](ContactFrame& frame) { return &frame.proxies[63].position[0]; },
        [](ContactFrame& frame) { return &frame.proxies[63].planes[2].normal[1]; },
        [](ContactFrame& frame) { return &frame.proxies[63].planes[2].offset; },
        [](ContactFrame& frame) { return &frame.proxies[63].planes[2].velocity; },
    };
    for (const auto& number : numbers) {
        for (const double bad : {kNan, kInfinity, -kInfinity}) {
            EXPECT_EQ(defect_after([&](ContactFrame& frame) { *number(frame) = bad; }), FrameDefect::NonFinite);
        }
    }
}

TEST(FindDefect, RefusesNormalsThatAreNotOfUnitLength) {
    const auto with_length = [](double length) {
        return defect_after(
            [&](ContactFrame& frame) { store(length * Vec3(0.6, 0.0, 0.8), frame.proxies[10].planes[1].normal); });
    };
    EXPECT_EQ(with_length(0.0), FrameDefect::Normal);
    EXPECT_EQ(with_length(1.0 + 2e-6), FrameDefect::Normal);
    EXPECT_EQ(with_length(1.0 - 2e-6), FrameDefect::Normal);
    EXPECT_EQ(with_length(1.0 + 0.5e-6), FrameDefect::None);
}

TEST(FindDefect, RefusesRadiiThatNoSphereHas) {
    const auto with_radius = [](double radius) {
        return defect_after([=](ContactFrame& frame) { frame.proxies[63].radius = radius; });
    };
    EXPECT_EQ(with_radius(-1e-9), FrameDefect::Radius);
    EXPECT_EQ(with_radius(10.001), FrameDefect::Radius);
    EXPECT_EQ(with_radius(std::numeric_limits<double>::max()), FrameDefect::Radius);
    EXPECT_EQ(with_radius(10.0), FrameDefect::None);
    EXPECT_EQ(with_radius(0.0), FrameDefect::None);
}

TEST(FindDefect, RefusesNegativeCoupling) {
    EXPECT_EQ(defect_after([](ContactFrame& frame) { frame.stiffness = -1e-9; }), FrameDefect::Coupling);
    EXPECT_EQ(defect_after([](ContactFrame& frame) { frame.torque_stiffness = -1.0; }), FrameDefect::Coupling);
    EXPECT_EQ(defect_after([](ContactFrame& frame) { frame.static_friction = -0.1; }), FrameDefect::Coupling);
    EXPECT_EQ(defect_after([](ContactFrame& frame) { frame.dynamic_friction = -0.1; }), FrameDefect::Coupling);
}

TEST(FindDefect, RefusesStepsThatAreNoDuration) {
    EXPECT_EQ(defect_after([](ContactFrame& frame) { frame.step_ns = 0; }), FrameDefect::Step);
    EXPECT_EQ(defect_after([](ContactFrame& frame) { frame.step_ns = -1; }), FrameDefect::Step);
    EXPECT_EQ(defect_after([](ContactFrame& frame) { frame.step_ns = 1'000'000'001; }), FrameDefect::Step);
    EXPECT_EQ(defect_after([](ContactFrame& frame) { frame.step_ns = 1'000'000'000; }), FrameDefect::None);
}

/// A valid frame with three proxies of two planes each; the second has tangents: 8 rows, k W = 1 on the diagonal plus
/// 0.5.
std::unique_ptr<ContactFrame> compliant_frame() {
    auto frame = full_frame();
    frame->proxy_count = 3;
    for (ProxyContact& proxy : frame->proxies) {
        proxy.plane_count = 2;
    }
    frame->proxies[1].in_contact = HAPTIC_PROXY_TANGENTS;
    frame->compliance_rows = 8;
    for (std::size_t r = 0; r < 8; ++r) {
        for (std::size_t s = 0; s <= r; ++s) {
            frame->compliance[compliance_index(r, s)] = r == s ? 1.5F : 0.5F;
        }
    }
    return frame;
}

FrameDefect defect_of_compliant(const std::function<void(ContactFrame&)>& damage) {
    const auto frame = compliant_frame();
    damage(*frame);
    return find_defect(*frame);
}

TEST(FindDefect, AcceptsTheComplianceOfTheRowsThatPlanesAndTangentsImply) {
    EXPECT_EQ(find_defect(*compliant_frame()), FrameDefect::None);
    EXPECT_EQ(defect_of_compliant([](ContactFrame& frame) { frame.compliance_rows = 0; }), FrameDefect::None);
    EXPECT_EQ(defect_of_compliant([](ContactFrame& frame) { frame.compliance_rows = 7; }), FrameDefect::Rows);
    EXPECT_EQ(defect_of_compliant([](ContactFrame& frame) { frame.compliance_rows = 9; }), FrameDefect::Rows);
    EXPECT_EQ(defect_of_compliant([](ContactFrame& frame) { frame.compliance_rows = 0xFFFFFFFF; }), FrameDefect::Rows);
    EXPECT_EQ(defect_of_compliant([](ContactFrame& frame) { frame.proxies[0].in_contact = HAPTIC_PROXY_TANGENTS; }),
              FrameDefect::Rows);
    EXPECT_EQ(defect_of_compliant([](ContactFrame& frame) {
                  frame.proxies[1].plane_count = 0;
                  frame.compliance_rows = 6;
              }),
              FrameDefect::Rows)
        << "tangents without a plane";
}

TEST(FindDefect, RefusesAMatrixThatIsNoCompliance) {
    const auto with = [](std::size_t r, std::size_t s, float value) {
        return defect_of_compliant([=](ContactFrame& frame) { frame.compliance[compliance_index(r, s)] = value; });
    };
    EXPECT_EQ(with(7, 7, std::numeric_limits<float>::infinity()), FrameDefect::NonFinite);
    EXPECT_EQ(with(7, 7, std::numeric_limits<float>::quiet_NaN()), FrameDefect::NonFinite);
    EXPECT_EQ(with(7, 6, std::numeric_limits<float>::quiet_NaN()), FrameDefect::Compliance);
    EXPECT_EQ(with(7, 7, -1.0F), FrameDefect::Compliance);
    EXPECT_EQ(with(0, 0, 0.0F), FrameDefect::Compliance) << "a normal row must yield";
    EXPECT_EQ(with(7, 0, 1.5F), FrameDefect::None) << "both rows always move together";
    EXPECT_EQ(with(7, 0, 1.6F), FrameDefect::Compliance);
    EXPECT_EQ(with(7, 0, -1.6F), FrameDefect::Compliance);
}

TEST(FindDefect, AllowsRigidTangents) {
    EXPECT_EQ(defect_of_compliant([](ContactFrame& frame) {
                  for (std::size_t k = 0; k < 8; ++k) {
                      frame.compliance[k <= 5 ? compliance_index(5, k) : compliance_index(k, 5)] = 0.0F;
                  }
              }),
              FrameDefect::None);
}

TEST(FindDefect, RefusesReservedFieldsThatAreNotZero) {
    EXPECT_EQ(defect_after([](ContactFrame& frame) { frame.reserved = 1; }), FrameDefect::Reserved);
}

TEST(FindDefect, IgnoresWhatTheFrameDoesNotUse) {
    EXPECT_EQ(defect_after([](ContactFrame& frame) {
                  frame.proxy_count = 63;
                  frame.proxies[63].position[0] = kNan;
                  frame.proxies[63].radius = -1.0;
                  frame.proxies[62].plane_count = 2;
                  frame.proxies[62].planes[2].offset = kNan;
              }),
              FrameDefect::None);
}

TEST(FrameDefects, EachHasASentenceOfItsOwn) {
    std::vector<std::string_view> seen;
    for (int i = 0; i <= static_cast<int>(kLastFrameDefect); ++i) {
        const std::string_view sentence = describe(static_cast<FrameDefect>(i));
        EXPECT_NE(sentence, "unknown defect");
        EXPECT_EQ(std::count(seen.begin(), seen.end(), sentence), 0) << sentence;
        seen.push_back(sentence);
    }
}

TEST(FrameNames, NameEveryFaultBit) {
    EXPECT_THAT(fault_names(0x1fff),
                ElementsAre("exchange", "encoder_jump", "slack", "residual", "overrun", "nonfinite", "stop", "thermal",
                            "watchdog", "wiring", "pose", "budget", "guard"));
    EXPECT_THAT(fault_names(HAPTIC_FAULT_SLACK), ElementsAre("slack"));
    EXPECT_THAT(fault_names(~0x1fffu), IsEmpty());
}

TEST(FrameNames, NameEveryTickFlagAndTheStringsUnderSuspicion) {
    EXPECT_THAT(
        tick_flag_names(0x1ffff),
        ElementsAre("overrun", "frame_stale", "frame_rejected", "force_limited", "slew_limited", "wrench_unreachable",
                    "exchange_failed", "derated", "stiffness_limited", "passivity_limited", "probe_off", "unproven",
                    "commissioning", "workspace_edge", "arm_awaited", "budget_low", "overlay"));
    EXPECT_THAT(tick_flag_names(HAPTIC_TICK_OVERRUN | 0b10000010u << HAPTIC_TICK_SUSPECTS_SHIFT),
                ElementsAre("overrun", "suspect_string_1", "suspect_string_7"));
    EXPECT_THAT(tick_flag_names(0x00fe0000u), IsEmpty());
}

TEST(FrameNames, NameEverySafetyState) {
    EXPECT_EQ(safety_state_name(HAPTIC_DISARMED), "disarmed");
    EXPECT_EQ(safety_state_name(HAPTIC_TENSIONING), "tensioning");
    EXPECT_EQ(safety_state_name(HAPTIC_CALIBRATING), "calibrating");
    EXPECT_EQ(safety_state_name(HAPTIC_RUNNING), "running");
    EXPECT_EQ(safety_state_name(HAPTIC_FAULTED), "faulted");
    EXPECT_EQ(safety_state_name(HAPTIC_PROVING), "proving");
    EXPECT_EQ(safety_state_name(HAPTIC_PROVING + 1), "unknown");
    EXPECT_EQ(safety_state_name(~0u), "unknown");
}

TEST(Frames, KeepVectorsAndQuaternionsInTheirOrder) {
    DeviceState state{};
    store(Vec3(1.0, 2.0, 3.0), state.position);
    store(Quat(0.5, -0.5, 0.5, 0.5), state.orientation);
    EXPECT_EQ(state.orientation[0], 0.5);
    EXPECT_EQ(state.orientation[1], -0.5);
    EXPECT_EQ(pose_of(state).position, Vec3(1.0, 2.0, 3.0));
    EXPECT_EQ(pose_of(state).orientation, Quat(0.5, -0.5, 0.5, 0.5));
}

}  // namespace
}  // namespace haptic
