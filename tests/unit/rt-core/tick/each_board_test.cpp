// The tick with each kind of board: the same hand gives the same pose, and the motors end at zero, for every packet
// format and counter width.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <ostream>
#include <string>

#include "haptic/device/device_geometry_file.hpp"
#include "tick_rig.hpp"

namespace haptic::rt {
namespace {

struct Frame {
    const char* name;
    const char* geometry;
    device::BoardKind board;
};

void PrintTo(const Frame& frame, std::ostream* out) {
    *out << frame.name;
}

class TickWithEachBoard : public testing::TestWithParam<Frame> {
  protected:
    static TickSettings settings() {
        TickSettings settings;
        settings.geometry = device::built_in_geometry(GetParam().geometry);
        settings.geometry.board = GetParam().board;
        return settings;
    }
};

INSTANTIATE_TEST_SUITE_P(Boards, TickWithEachBoard,
                         testing::Values(Frame{"Sh4", "SpidarG6X3R", device::BoardKind::Sh4},
                                         Frame{"Simple", "SpidarG6X3R", device::BoardKind::Simple},
                                         Frame{"UartTwoOfFour", "SpidarG6X4", device::BoardKind::Uart},
                                         Frame{"UartOneOfEight", "SpidarG6X5R", device::BoardKind::Uart}),
                         [](const auto& param) { return std::string(param.param.name); });

TEST_P(TickWithEachBoard, FindsTheHandAndLeavesTheMotorsAtZero) {
    // At rest at the centre for three seconds, then 14 mm away and rotated by 0.3 rad within half a second.
    const Quat level(1.0, 0.0, 0.0, 0.0);
    const Pose there{{0.010, 0.008, -0.006}, Quat(std::cos(0.15), 0.0, std::sin(0.15), 0.0)};
    test::TickRig rig(PoseTrack({0.0, 3.0, 3.5}, {{{}, level}, {{}, level}, there}), settings());
    rig.run_up();
    ASSERT_EQ(rig.tick.safety_state(), SafetyState::Running);
    rig.steps(4000 - static_cast<int>((rig.now_ns - 1'000'000'000) / rig.settings.period_ns));
    ASSERT_EQ(rig.tick.faults(), 0U);

    // A count is 17 to 35 um; eight lengths determine a position to about a count, and a rotation to a count at the
    // grip's radius.
    const double count = std::fabs(rig.settings.geometry.strings[0].metres_per_count);
    const Pose& found = rig.tick.last().pose;
    EXPECT_LT(glm::length(found.position - there.position), 1.5 * count);
    EXPECT_GT(std::fabs(glm::dot(found.orientation, there.orientation)), 1.0 - 1e-5);
    for (std::size_t i = 0; i < kStrings; ++i) {
        EXPECT_GE(rig.board.device().tensions()[i],
                  rig.settings.geometry.minimum_tension - std::fabs(rig.settings.geometry.strings[i].newtons_per_code))
            << i;
    }

    rig.tick.stop();
    rig.steps(1000);
    EXPECT_EQ(rig.tick.safety_state(), SafetyState::Disarmed);
    EXPECT_EQ(rig.board.device().dac_codes(), (std::array<std::int16_t, kStrings>{}));
}

}  // namespace
}  // namespace haptic::rt
