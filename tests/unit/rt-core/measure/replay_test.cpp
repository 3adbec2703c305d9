#include "measure/replay.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <span>
#include <sstream>

#include "haptic/denormals.hpp"
#include "measure/recording.hpp"
#include "tick_rig.hpp"

namespace haptic::rt {
namespace {

using testing::AllOf;
using testing::HasSubstr;

/// Hand that moves down into the floor and up again, with a slight rotation.
PoseTrack into_the_floor() {
    const Quat turned = glm::angleAxis(0.2, glm::normalize(Vec3(1.0, 2.0, 0.5)));
    return {{0.0, 0.8, 1.1, 1.4, 9.0},
            {Pose{}, Pose{}, Pose{{0.002, -0.02, 0.004}, turned}, Pose{{0.01, -0.005, 0.0}, turned}, Pose{}}};
}

class ReplayTest : public testing::Test {
  protected:
    void SetUp() override { std::filesystem::create_directory(folder); }
    void TearDown() override { std::filesystem::remove_all(folder); }

    /// Records a run with a frame every 10 ms; `disturb` is called before each tick.
    void record(int ticks, const std::function<void(test::TickRig&, int)>& disturb = {}) {
        const FlushDenormals flush;
        test::TickRig rig(into_the_floor(), settings);
        Recorder recorder(8192, 1024);
        RecordFile writer(file, recorder);
        rig.tick.record_to(&recorder);
        rig.steps(20);
        rig.tick.arm();
        for (int i = 0; i < ticks; ++i) {
            if (i % 10 == 0) {
                ContactFrame frame = test::floor_frame(-0.008, 400.0, rig.now_ns);
                frame.proxy_count = 3;
                frame.proxies[1] = frame.proxies[0];
                frame.proxies[1].rest_offset[0] = 0.01;
                frame.proxies[2] = frame.proxies[0];
                frame.proxies[2].rest_offset[2] = -0.01;
                rig.publish(frame);
            }
            if (disturb) {
                disturb(rig, i);
            }
            rig.step(1000 * (i % 7));
        }
        EXPECT_GT(rig.tick.instruments().contact_ticks, 50u) << "without a contact this proves little";
        writer.close();
    }

    ReplayResult replay(Recorder* recorder = nullptr) {
        RingWriter<DeviceState> states(test::unique_session());
        Replay again(file, settings, states, test::still_clock);
        while (again.step(recorder)) {
        }
        faults = again.tick().faults();
        return again.result();
    }
    std::string error() {
        try {
            replay();
        } catch (const CsvError& problem) {
            return problem.what();
        }
        return "";
    }

    static std::vector<std::string> lines_of(const std::filesystem::path& path) {
        std::ifstream stream(path);
        std::vector<std::string> lines;
        for (std::string line; std::getline(stream, line);) {
            lines.push_back(line);
        }
        return lines;
    }
    static void write_lines(const std::filesystem::path& path, const std::vector<std::string>& lines) {
        std::ofstream stream(path);
        for (const std::string& line : lines) {
            stream << line << '\n';
        }
    }
    /// Replaces one cell; lines are counted from 1, including the header.
    void edit(std::size_t line, const std::string& column, const std::string& value) const {
        std::vector<std::string> lines = lines_of(file);
        const auto& names = record_columns();
        const auto index = std::find(names.begin(), names.end(), column) - names.begin();
        std::istringstream cells(lines[line - 1]);
        std::string edited;
        std::string cell;
        for (std::ptrdiff_t i = 0; std::getline(cells, cell, ','); ++i) {
            edited += (edited.empty() ? "" : ",") + (i == index ? value : cell);
        }
        lines[line - 1] = edited;
        write_lines(file, lines);
    }

    TickSettings settings;
    std::filesystem::path folder =
        std::filesystem::temp_directory_path() / ("haptic-replay-" + std::to_string(getpid()));
    std::filesystem::path file = folder / "run.csv";
    std::uint32_t faults = 0;
};

TEST_F(ReplayTest, ReproducesEveryTickToTheLastBit) {
    record(2500);
    const ReplayResult result = replay();
    EXPECT_EQ(result.ticks, 2520u);
    EXPECT_EQ(result.frames, 250u);
    EXPECT_GE(result.compared_columns, record_columns().size() - 2) << "time_s and compute_us alone may differ";
    EXPECT_TRUE(result.identical()) << result.first().first << " in line " << result.first().second.line;
}

TEST_F(ReplayTest, ReproducesARunWithAnOverlay) {
    settings.overlay.max_force = 1.0;
    settings.overlay.max_torque = 0.02;
    const std::string overlays = test::unique_session();
    RingWriter<WrenchOverlay> sender(overlays);
    RingReader<WrenchOverlay> ring(overlays);
    RingOverlays source(ring);
    record(2500, [&](test::TickRig& rig, int i) {
        rig.tick.overlay_from(&source);
        // One of three ticks, silent for a while, and some that are refused.
        if (i % 3 == 0 && (i < 1500 || i > 1800)) {
            WrenchOverlay overlay{};
            overlay.arrival_time_ns = rig.now_ns - 300'000;
            overlay.force[0] = std::sin(0.01 * i);
            overlay.force[2] = i % 300 == 0 ? std::numeric_limits<double>::quiet_NaN() : 1.0 / 3.0;
            overlay.torque[1] = 0.01;
            overlay.arrival_time_ns += i % 300 == 150 ? 2'000'000'000 : 0;
            sender.publish(overlay, rig.now_ns);
        }
    });
    const CsvTable recorded = CsvTable::load(file);
    const std::span<const double> flags = recorded.column("flags");
    const auto pushes = std::count_if(flags.begin(), flags.end(), [](double flag) {
        return (static_cast<std::uint32_t>(flag) & HAPTIC_TICK_OVERLAY) != 0;
    });
    EXPECT_GT(pushes, 1000);
    EXPECT_LT(pushes, 1800) << "arming, and the silence";
    const std::span<const double> read = recorded.column("overlay_read");
    EXPECT_GT(std::count(read.begin(), read.end(), kOverlayRefused), 8);
    const ReplayResult result = replay();
    EXPECT_EQ(result.compared_columns, record_columns().size() - 2);
    EXPECT_TRUE(result.identical()) << result.first().first << " in line " << result.first().second.line;
    // Without the recorded overlays it is another run.
    settings.overlay = {};
    EXPECT_EQ(replay().columns.count("fz_n"), 1u);
}

TEST_F(ReplayTest, ReproducesARecordingFromBeforeThereWereOverlaysAndCollectedAnswers) {
    record(1500);
    std::vector<std::string> lines = lines_of(file);
    for (std::string& line : lines) {
        // The last nine columns.
        for (int k = 0; k < 9; ++k) {
            line.erase(line.rfind(','));
        }
    }
    ASSERT_TRUE(lines[0].ends_with(",cut")) << lines[0];
    write_lines(file, lines);
    settings.overlay.max_force = 1.0;
    EXPECT_TRUE(replay().identical());
}

TEST_F(ReplayTest, ReproducesARunThatLostAnswersToItsMotors) {
    record(2500, [](test::TickRig& rig, int i) { rig.faulty.losing_answers = i % 50 < 3; });
    const ReplayResult result = replay();
    EXPECT_TRUE(result.identical()) << result.first().first << " in line " << result.first().second.line;
    // One more lost answer is seen: the row's flags say that there was none.
    edit(1500, "exchange_collected", "1");
    EXPECT_FALSE(replay().identical());
}

TEST_F(ReplayTest, ReproducesARunWithOneExchangePerTick) {
    settings.exchanges = 1;
    record(1500);
    EXPECT_TRUE(replay().identical());
}

TEST_F(ReplayTest, ReproducesTheRecordingOfAReplay) {
    record(1500);
    const auto first = lines_of(file);
    Recorder recorder(8192, 1024);
    const std::filesystem::path original = file;
    const std::filesystem::path second = folder / "second.csv";
    RecordFile writer(second, recorder);
    EXPECT_TRUE(replay(&recorder).identical());
    writer.close();
    EXPECT_EQ(lines_of(folder / "run.frames.csv"), lines_of(folder / "second.frames.csv"));
    file = second;
    EXPECT_TRUE(replay().identical());
    EXPECT_EQ(lines_of(second).size(), first.size());
}

TEST_F(ReplayTest, FaultsWhereTheRunDid) {
    record(2500, [](test::TickRig& rig, int i) {
        rig.faulty.failing = (i % 40) < 4 || i > 2000;
        if (i == 1500) {
            ContactFrame broken = test::floor_frame(0.0, -1.0, rig.now_ns);
            rig.publish(broken);  // rejected by the tick
        }
    });
    const ReplayResult result = replay();
    EXPECT_TRUE(result.identical()) << result.first().first << " in line " << result.first().second.line;
    EXPECT_NE(faults & HAPTIC_FAULT_EXCHANGE, 0u);
}

TEST_F(ReplayTest, StopsAndArmsAgainWhereTheRunDid) {
    record(4000, [](test::TickRig& rig, int i) {
        if (i == 1400) {
            rig.tick.stop();
        }
        if (i == 2600) {
            rig.tick.arm();
        }
    });
    const ReplayResult result = replay();
    EXPECT_TRUE(result.identical()) << result.first().first << " in line " << result.first().second.line;
    EXPECT_EQ(CsvTable::load(file).column("safety_state").back(), HAPTIC_RUNNING);
}

TEST_F(ReplayTest, NamesTheFirstTickAndColumnThatDiffer) {
    record(1500);
    edit(1000, "fy_n", "0.125");
    const std::string dac_code = std::to_string(static_cast<int>(CsvTable::load(file).column("digit3")[1198]));
    edit(1200, "digit3", "7");
    const ReplayResult result = replay();
    EXPECT_EQ(result.differing_ticks, 2u);
    EXPECT_EQ(result.first().first, "fy_n");
    EXPECT_EQ(result.first().second.line, 1000u);
    EXPECT_EQ(result.first().second.first_tick, 999u);
    EXPECT_EQ(result.first().second.recorded, "0.125");
    EXPECT_EQ(result.columns.at("digit3").replayed, dac_code);
    EXPECT_EQ(result.columns.at("digit3").largest, std::stod(dac_code) - 7.0);
}

TEST_F(ReplayTest, DetectsACounterThatIsOneCountOff) {
    record(1500);
    edit(1300, "counter5", std::to_string(static_cast<int>(CsvTable::load(file).column("counter5")[1298]) ^ 1));
    const ReplayResult result = replay();
    EXPECT_FALSE(result.identical());
    EXPECT_EQ(result.columns.count("counter5"), 0u) << "the counter itself is what the board said";
    EXPECT_EQ(result.columns.at("x_m").line, 1300u);
}

TEST_F(ReplayTest, ReportsTheEffectOfOtherSettings) {
    record(2000);
    settings.limits.force = 1.0;
    const ReplayResult result = replay();
    EXPECT_EQ(result.columns.count("x_m"), 0u);
    EXPECT_GT(result.columns.at("fy_n").largest, 1.0);
    EXPECT_EQ(result.ticks, 2020u);
}

TEST_F(ReplayTest, RefusesARecordingWithoutTheBoardsData) {
    std::ofstream(file) << "time_s,x_m,y_m,z_m\n0,0,0,0\n";
    EXPECT_THAT(error(), AllOf(HasSubstr("run.csv:1: there is no column counter0"), HasSubstr("--hand")));
    std::filesystem::remove(file);
    EXPECT_THAT(error(), HasSubstr("run.csv: cannot be read"));
}

TEST_F(ReplayTest, RefusesARecordingWithMissingTicks) {
    record(1500);
    const std::vector<std::string> whole = lines_of(file);
    std::vector<std::string> lines = whole;
    lines.erase(lines.begin() + 500, lines.begin() + 503);
    write_lines(file, lines);
    EXPECT_THAT(error(), AllOf(HasSubstr("run.csv:501: tick 500 is missing"), HasSubstr("recording.queue_ticks")));
    lines = whole;
    lines.erase(lines.begin() + 1, lines.begin() + 700);
    write_lines(file, lines);
    EXPECT_THAT(error(), HasSubstr("run.csv:2: begins at tick 700 of a run"));
    write_lines(file, whole);
    std::vector<std::string> frames = lines_of(folder / "run.frames.csv");
    frames.erase(frames.begin() + 31, frames.begin() + 34);
    write_lines(folder / "run.frames.csv", frames);
    EXPECT_THAT(error(), AllOf(HasSubstr("contact frame of this tick is not in"), HasSubstr("recording.queue_frames")));
    std::filesystem::remove(folder / "run.frames.csv");
    EXPECT_THAT(error(), HasSubstr("run.frames.csv: cannot be read"));
}

TEST_F(ReplayTest, RefusesValuesOutOfRange) {
    record(1500);
    edit(900, "counter2", "4294967296");
    EXPECT_THAT(error(), HasSubstr("run.csv:900: column counter2: 4294967296 is not between 0 and 4294967295"));
    edit(900, "counter2", "1.5");
    EXPECT_THAT(error(), HasSubstr("run.csv:900: column counter2: \"1.5\" is not an integer"));
    edit(800, "exchange_in", "99");
    EXPECT_THAT(error(), HasSubstr("run.csv:800: column exchange_in: 99"));
}

}  // namespace
}  // namespace haptic::rt
