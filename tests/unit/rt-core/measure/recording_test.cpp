#include "measure/recording.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <glm/geometric.hpp>
#include <set>
#include <string>

#include "haptic/device/hand_file.hpp"
#include "process/held_hand.hpp"
#include "tick_rig.hpp"

namespace haptic::rt {
namespace {

class RecordingTest : public testing::Test {
  protected:
    void SetUp() override { std::filesystem::create_directory(folder); }
    void TearDown() override { std::filesystem::remove_all(folder); }

    std::filesystem::path folder =
        std::filesystem::temp_directory_path() / ("haptic-recording-" + std::to_string(getpid()));
    std::filesystem::path file = folder / "run.csv";
};

TEST_F(RecordingTest, HasOneColumnForEachNumberOfARow) {
    std::vector<CsvCell> row;
    record_row(TickRecord{}, 0, row);
    EXPECT_EQ(record_columns().size(), row.size());
    EXPECT_EQ(nondeterministic_columns().size(), row.size());
    const std::set<std::string> names(record_columns().begin(), record_columns().end());
    EXPECT_EQ(names.size(), row.size()) << "two columns have one name";
}

TEST_F(RecordingTest, BeginsWithTheDocumentedColumns) {
    const std::vector<std::string> known = {
        "time_s", "x_m",   "y_m",   "z_m",   "qw",        "qx",           "qy",        "qz",         "fx_n", "fy_n",
        "fz_n",   "tx_nm", "ty_nm", "tz_nm", "proxy_x_m", "proxy_y_m",    "proxy_z_m", "t0_n",       "t1_n", "t2_n",
        "t3_n",   "t4_n",  "t5_n",  "t6_n",  "t7_n",      "frame_age_ms", "period_us", "compute_us", "flags"};
    ASSERT_GT(record_columns().size(), known.size());
    EXPECT_TRUE(std::equal(known.begin(), known.end(), record_columns().begin()));
}

TEST_F(RecordingTest, PutsEachQuantityUnderItsName) {
    TickRecord tick;
    tick.now_ns = 3'500'000'000;
    tick.period_ns = 1'001'000;
    tick.compute_ns = 2'500;
    tick.pose = {Vec3(1, 2, 3), glm::normalize(Quat(0.5, 0.1, 0.2, 0.3))};
    tick.rendered = {Vec3(4, 5, 6), Vec3(7, 8, 9)};
    tick.proxy = {10, 11, 12};
    for (std::size_t i = 0; i < kStrings; ++i) {
        tick.tensions[i] = 20.0 + static_cast<double>(i);
    }
    tick.frame_age_ns = 7'250'000;
    tick.flags = HAPTIC_TICK_SLEW_LIMITED;
    tick.exchange_in = static_cast<std::int8_t>(device::ExchangeStatus::Stalled);
    tick.counters[7] = 65535;
    tick.analog[2] = 4095;
    tick.command.dac_codes[3] = -77;
    tick.velocity.angular.y = 0.25;
    BlackBox box(4);
    TickRecord earlier;
    earlier.now_ns = 3'000'000'000;
    box.push(earlier);
    box.push(tick);
    write_black_box(file, box);

    const CsvTable table = CsvTable::load(file);
    ASSERT_EQ(table.rows(), 2u);
    const auto value = [&table](const char* column) { return table.column(column)[1]; };
    EXPECT_EQ(table.columns().front(), "time_s");
    EXPECT_EQ(value("time_s"), 0.5);
    EXPECT_EQ(value("y_m"), 2.0);
    EXPECT_EQ(value("qw"), tick.pose.orientation.w);
    EXPECT_EQ(value("qx"), tick.pose.orientation.x);
    EXPECT_EQ(value("qz"), tick.pose.orientation.z);
    EXPECT_EQ(value("fx_n"), 4.0);
    EXPECT_EQ(value("fz_n"), 6.0);
    EXPECT_EQ(value("ty_nm"), 8.0);
    EXPECT_EQ(value("proxy_x_m"), 10.0);
    EXPECT_EQ(value("t0_n"), 20.0);
    EXPECT_EQ(value("t7_n"), 27.0);
    EXPECT_EQ(value("frame_age_ms"), 7.25);
    EXPECT_EQ(value("period_us"), 1001.0);
    EXPECT_EQ(value("compute_us"), 2.5);
    EXPECT_EQ(value("flags"), HAPTIC_TICK_SLEW_LIMITED);
    EXPECT_EQ(table.column("frame_age_ms")[0], -1.0);
    EXPECT_EQ(value("exchange_in"), 5.0);
    EXPECT_EQ(value("exchange_out"), -1.0) << "there was none";
    EXPECT_EQ(value("counter7"), 65535.0);
    EXPECT_EQ(value("counter6"), 0.0);
    EXPECT_EQ(value("analog2"), 4095.0);
    EXPECT_EQ(value("digit3"), -77.0);
    EXPECT_EQ(value("wy_rad_s"), 0.25);
}

TEST_F(RecordingTest, KeepsNanosecondsAfterMonthsOfUptime) {
    TickRecord tick;
    tick.now_ns = 9'007'199'254'740'993;  // 104 days; not representable as a double
    tick.deadline_ns = tick.now_ns - 2;
    BlackBox box(1);
    box.push(tick);
    write_black_box(file, box);
    CsvReader reader(file);
    ASSERT_TRUE(reader.next());
    EXPECT_EQ(reader.integer(reader.index("now_ns")), tick.now_ns);
    EXPECT_EQ(reader.integer(reader.index("deadline_ns")), tick.deadline_ns);
}

TEST_F(RecordingTest, CountsTimeFromArmingAndKeepsTheTicksBefore) {
    test::TickRig rig;
    Recorder recorder(4096);
    RecordFile record(file, recorder);
    rig.tick.record_to(&recorder);
    rig.steps(30);
    record.drain();
    rig.run_up();
    record.close();
    const CsvTable table = CsvTable::load(file);
    EXPECT_DOUBLE_EQ(table.column("time_s").front(), -0.03);
    EXPECT_EQ(table.column("time_s")[30], 0.0);
    EXPECT_EQ(table.column("requests")[0], kRequestNew);
    EXPECT_EQ(table.column("requests")[30], kRequestArm);
    EXPECT_EQ(table.column("tick").front(), 1.0);
    EXPECT_EQ(table.column("tick").back(), static_cast<double>(table.rows()));
}

TEST_F(RecordingTest, OfABlackBoxCountsTimeFromArmingThoughThatTickIsGone) {
    BlackBox box(2);
    for (std::int64_t i = 0; i < 6; ++i) {
        TickRecord tick;
        tick.now_ns = 7'000'000'000 + i * 500'000'000;
        tick.requests = i == 2 ? kRequestArm : 0;
        box.push(tick);
    }
    write_black_box(file, box);
    EXPECT_THAT(CsvTable::load(file).column("time_s"), testing::ElementsAre(1.0, 1.5));
}

TEST_F(RecordingTest, OfABlackBoxKeepsTheFirstNineOfThatNameAndTheLast) {
    constexpr int boxes = 12;
    for (int i = 1; i <= boxes; ++i) {
        TickRecord tick;
        tick.number = static_cast<std::uint64_t>(i);
        BlackBox box(1);
        box.push(tick);
        write_black_box(file, box);
    }
    const auto tick_of = [](const std::filesystem::path& box) { return CsvTable::load(box).column("tick")[0]; };
    for (int i = 1; i <= 9; ++i) {
        EXPECT_EQ(tick_of(file.string() + ".bak-" + std::to_string(i)), i);
    }
    EXPECT_EQ(tick_of(file), boxes);
    EXPECT_FALSE(std::filesystem::exists(file.string() + ".bak-10"));
}

TEST_F(RecordingTest, CanBeTheHandOfAnotherRun) {
    const PoseTrack hand({0.0, 1.0, 1.4, 9.0},
                         {Pose{}, Pose{}, Pose{{0.01, -0.01, 0.0}, glm::angleAxis(0.2, Vec3(0, 0, 1))},
                          Pose{{0.01, -0.01, 0.0}, glm::angleAxis(0.2, Vec3(0, 0, 1))}});
    test::TickRig rig(hand);
    Recorder recorder(4096);
    RecordFile record(file, recorder);
    rig.tick.record_to(&recorder);
    rig.run_up();
    rig.steps(1000);
    record.close();
    EXPECT_EQ(recorder.dropped(), 0u);

    const PoseTrack again = device::hand_from_centre(file);
    for (const double time_s : {0.5, 1.1, 1.3, 1.6}) {
        const Pose recorded = again.at(nanoseconds(time_s));
        const Pose real = hand.at(nanoseconds(time_s));
        // An encoder count is 17 um of string.
        EXPECT_LT(glm::length(recorded.position - real.position), 3e-5) << time_s;
        EXPECT_LT(glm::length(rotation_between(recorded.orientation, real.orientation)), 1e-3) << time_s;
    }
}

TEST_F(RecordingTest, LeavesTheTicksOfARunThatNeverClosesIt) {
    test::TickRig rig;
    Recorder recorder(4096);
    RecordFile record(file, recorder);
    rig.tick.record_to(&recorder);
    rig.run_up();
    record.drain();
    EXPECT_EQ(CsvTable::load(file).column("tick").back(), static_cast<double>(rig.tick.last().number));
}

TEST_F(RecordingTest, ThatDoesNotFitEndsAndReportsItAtTheEnd) {
    test::TickRig rig;
    Recorder recorder(4096);
    RecordFile record("/dev/full", recorder);
    rig.tick.record_to(&recorder);
    rig.run_up();
    record.drain();
    record.drain();
    EXPECT_EQ(recorder.dropped(), 0u);
    EXPECT_THROW(record.close(), std::runtime_error);
}

TEST_F(RecordingTest, ThatBeginsElsewhereIsReachedFromTheCentreInHalfASecond) {
    std::ofstream(file) << "time_s,x_m,y_m,z_m\n2.0,0.02,0,0\n3.0,0.02,0.01,0\n";
    const PoseTrack hand = device::hand_from_centre(file);
    EXPECT_EQ(hand.at(0).position, Vec3(0.0));
    EXPECT_NEAR(hand.at(nanoseconds(0.25)).position.x, 0.01, 1e-12);
    EXPECT_NEAR(hand.at(nanoseconds(0.5)).position.x, 0.02, 1e-12);
    EXPECT_NEAR(hand.at(nanoseconds(1.5)).position.y, 0.01, 1e-12);
}

TEST_F(RecordingTest, HasTheButtonsThatTheHandHolds) {
    std::ofstream(file) << "time_s,x_m,y_m,z_m,buttons\n2.0,0.02,0,0,0\n3.0,0.02,0.01,0,2\n3.5,0.02,0.01,0,1\n";
    const device::ButtonTrack buttons = device::buttons_of_hand(file);
    EXPECT_EQ(buttons.at(0), 0);
    // Half a second for the way to the first pose.
    EXPECT_EQ(buttons.at(nanoseconds(1.49)), 0);
    EXPECT_EQ(buttons.at(nanoseconds(1.51)), 2);
    EXPECT_EQ(buttons.at(nanoseconds(2.01)), 1);
    EXPECT_EQ(buttons.at(nanoseconds(9.0)), 1);

    device::EmulatedDevice device({.geometry = device::spidar_g6_x3r(), .hand_buttons = buttons});
    device.advance(0);
    EXPECT_EQ(device.buttons(), 0);
    device.advance(nanoseconds(1.6));
    EXPECT_EQ(device.buttons(), 2);
}

TEST_F(RecordingTest, WithoutButtonsLeavesThemToTheSwitches) {
    std::ofstream(file) << "time_s,x_m,y_m,z_m\n2.0,0.02,0,0\n";
    EXPECT_FALSE(device::buttons_of_hand(file).known());
}

TEST_F(RecordingTest, WithButtonsThatAreNoSwitchesIsRefused) {
    std::ofstream(file) << "time_s,x_m,y_m,z_m,buttons\n2.0,0.02,0,0,0.5\n";
    EXPECT_THROW((void)device::buttons_of_hand(file), CsvError);
}

TEST(HeldHandBoard, LetsTheHandMoveOnlyOnceTheLoopRuns) {
    // The recorded hand moves from the start; held back, it is nevertheless calibrated at the centre.
    const PoseTrack hand({0.0, 0.5, 9.0},
                         {Pose{}, Pose{{0.01, 0, 0}, Quat(1, 0, 0, 0)}, Pose{{0.01, 0, 0}, Quat(1, 0, 0, 0)}});
    const TickSettings settings;
    const std::string session = test::unique_session();
    device::EmulatedBoard board({.geometry = settings.geometry, .hand = hand, .hand_waits = true});
    HeldHandBoard held(board);
    RingReader<ContactFrame> frames(session);
    RingWriter<DeviceState> states(session);
    Tick tick(settings, held, frames, states, test::still_clock);
    held.attach(tick);
    tick.arm();
    std::int64_t now_ns = 7'000'000'000;
    while (tick.safety_state() != SafetyState::Running) {
        tick.run({now_ns, now_ns});
        EXPECT_EQ(board.device().grip_pose().position, Vec3(0.0));
        now_ns += settings.period_ns;
    }
    for (int i = 0; i < 250; ++i, now_ns += settings.period_ns) {
        tick.run({now_ns, now_ns});
    }
    EXPECT_NEAR(board.device().grip_pose().position.x, 0.005, 1e-4);
    EXPECT_NEAR(tick.last().pose.position.x, board.device().grip_pose().position.x, 3e-5);
}

}  // namespace
}  // namespace haptic::rt
