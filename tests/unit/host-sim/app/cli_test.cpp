// Statistics, records, workspace files and device input of host-sim's commands.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>
#include <string>

#include "app/hand.hpp"
#include "app/run_statistics.hpp"
#include "app/snapshots.hpp"
#include "app/step_record.hpp"
#include "app/workspace_file.hpp"
#include "haptic/csv.hpp"
#include "haptic/pose_track.hpp"
#include "haptic/sim/curl_track.hpp"
#include "haptic/text_file.hpp"
#include "late_drop.hpp"
#include "tool/tool_proxies.hpp"
#include "unique_session.hpp"

namespace haptic::sim {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

class RunStatisticsTest : public ::testing::Test {
  protected:
    void run(int steps) {
        for (int i = 0; i < steps; ++i) {
            const StepInput input = simulation_.scripted_input(10'000'000 * std::int64_t{i});
            snapshots_.before_step();
            const StepResult result = simulation_.step(input);
            snapshots_.after_step(result);
            statistics_.add(result);
            record_.add(input, result);
        }
    }

    Simulation simulation_{test::late_drop()};
    RunStatistics statistics_;
    StepRecord record_{{.scene = "late-drop", .assignments = {}, .first_step = 0, .changes = {}}};
    Snapshots snapshots_{simulation_};
    std::filesystem::path folder_ =
        std::filesystem::path(::testing::TempDir()) / ("haptic-cli-test-" + std::to_string(getpid()));
};

TEST_F(RunStatisticsTest, ReportHasItsDocumentedKeys) {
    run(30);
    const nlohmann::json report = statistics_.report(simulation_, 0.5, true);
    EXPECT_EQ(report["scene"], "late-drop");
    EXPECT_EQ(report["steps"], 30);
    EXPECT_NEAR(report["sim_s"].get<double>(), 0.3, 1e-12);
    EXPECT_EQ(report["steps_per_s"], 60.0);
    EXPECT_EQ(report["counts"]["triangles"], 4096);
    EXPECT_EQ(report["counts"]["particles"], 1089);
    EXPECT_EQ(report["counts"]["proxies"], 1);
    EXPECT_EQ(report["contact"]["escapes"], 0);
    EXPECT_GT(report["contact"]["steps_in_contact"], 20);
    EXPECT_GT(report["contact"]["max_depth_m"], 0.1);
    EXPECT_GT(report["force_N"]["max"], 1.0);
    EXPECT_GT(report["force_N"]["max"], report["force_N"]["mean_in_contact"]);
    for (const char* stage : {"total", "ccd", "popout", "proxy", "deform", "collide", "skin"}) {
        EXPECT_EQ(report["timing_us"][stage]["count"], 30) << stage;
    }
    EXPECT_EQ(report["caught"], true);
    EXPECT_EQ(report["state_hash"].get<std::string>().size(), 16u);
}

TEST_F(RunStatisticsTest, NothingIsCaughtBeforeItArrives) {
    run(2);
    EXPECT_FALSE(statistics_.caught());
    // The cloth has fallen from 0.5 m for two steps of 10 ms at 13.66 m/s and more, the hand rests at 0.
    EXPECT_THAT(statistics_.summary(simulation_, 0.1, false),
                AllOf(HasSubstr("never"), HasSubstr("tool was in    (0.000 0.000 0.000)"),
                      HasSubstr("move the hand at least 0.2"), HasSubstr("m along y")));
    EXPECT_THAT(statistics_.summary(simulation_, 0.1, false), HasSubstr("--verify"));
}

TEST_F(RunStatisticsTest, AnEscapeIsNotACatch) {
    StepResult escaped;
    escaped.in_contact = true;
    escaped.crossed = true;
    for (int i = 0; i < 50; ++i) {
        statistics_.add(escaped);
    }
    EXPECT_FALSE(statistics_.caught());
    EXPECT_THAT(statistics_.violations(), ElementsAre("the proxy's centre passed through a surface in 50 steps"));
}

TEST_F(RunStatisticsTest, SurfacesThatCrossAreReportedAndThoseThatAreKeptApartMayNot) {
    StepResult crossed;
    for (const std::size_t edges : {0u, 7u, 3u}) {
        crossed.surfaces.sheets = edges;
        crossed.surfaces.solids = edges == 3u ? 4 : 0;
        crossed.surfaces.others = 2 * edges;
        crossed.surfaces.below_ground = edges == 7u ? 5 : 0;
        crossed.surfaces.ground_depth = edges == 7u ? 0.0012 : 0.0;
        statistics_.add(crossed);
    }
    const nlohmann::json report = statistics_.report(simulation_, 0.1, true)["surface_crossings"];
    EXPECT_EQ(report["verified"], true);
    EXPECT_EQ(report["sheets"], (nlohmann::json{{"steps", 2}, {"most", 7}}));
    EXPECT_EQ(report["solids"], (nlohmann::json{{"steps", 1}, {"most", 4}}));
    EXPECT_EQ(report["others"], (nlohmann::json{{"steps", 2}, {"most", 14}}));
    EXPECT_EQ(report["ground"], (nlohmann::json{{"steps", 1}, {"most", 5}, {"max_depth_m", 0.0012}}));
    EXPECT_THAT(statistics_.summary(simulation_, 0.1, true),
                AllOf(HasSubstr("sheets         2 steps, at most 7 edges through them\n"),
                      HasSubstr("solids         1 steps, at most 4 edges through them\n"),
                      HasSubstr("others         2 steps, at most 14 edges through them\n"),
                      HasSubstr("the ground     1 steps, at most 5 vertices below it, 1.2 mm deep\n")));
    EXPECT_THAT(statistics_.summary(simulation_, 0.1, false), Not(HasSubstr("surfaces cross")));
    EXPECT_THAT(statistics_.violations(), ElementsAre("a sheet passed through a sheet, seen in 2 steps",
                                                      "a solid passed through a solid, seen in 1 steps",
                                                      "a surface was below the ground, seen in 1 steps"));
}

TEST_F(RunStatisticsTest, RecordIsAValidHand) {
    run(12);
    std::filesystem::create_directories(folder_);
    const std::filesystem::path file = folder_ / "record.csv";
    write_text(file, record_.text());
    const CsvTable table = CsvTable::load(file);
    EXPECT_EQ(table.rows(), 12u);
    EXPECT_EQ(table.columns().size(), 29u);
    EXPECT_EQ(table.column("time_s")[3], 0.03);
    EXPECT_EQ(table.column("in_contact")[11], 1.0);
    EXPECT_LT(table.column("fy_n")[11], -0.1);  // the cloth pulls the hand down
    EXPECT_EQ(table.column("tx_nm")[11], 0.0);  // one sphere at the grip's origin has no moment arm
    EXPECT_NO_THROW((void)PoseTrack::load(file));
    EXPECT_TRUE(CurlTrack::load(file).known());
    std::filesystem::remove_all(folder_);
}

TEST_F(RunStatisticsTest, SnapshotsShowTheMomentsAroundTheContactAndTheLargestForce) {
    run(150);
    const std::vector<std::filesystem::path> files = snapshots_.write(folder_);
    ASSERT_EQ(files.size(), 4u);
    EXPECT_THAT(files[0].string(), HasSubstr("late-drop-1-contact.pov"));
    EXPECT_THAT(files[3].string(), HasSubstr("late-drop-4-peak-force.pov"));
    for (const std::filesystem::path& file : files) {
        EXPECT_GT(std::filesystem::file_size(file), 50'000u);
    }
    std::filesystem::remove_all(folder_);
}

TEST(SnapshotsTest, DrawTheMeshOfTheToolAndItsContacts) {
    // The hand of plane-slide reaches the plate after 0.6 s.
    Simulation simulation(read_scene(open_scene("plane-slide"), "plane-slide"));
    Snapshots snapshots(simulation);
    while (simulation.time() < 0.9) {
        snapshots.before_step();
        const auto time_ns = static_cast<std::int64_t>(simulation.steps()) * 20'000'000;
        snapshots.after_step(simulation.step(simulation.scripted_input(time_ns)));
    }
    const std::filesystem::path folder =
        std::filesystem::path(::testing::TempDir()) / ("haptic-snapshots-test-" + std::to_string(getpid()));
    const std::vector<std::filesystem::path> files = snapshots.write(folder);
    ASSERT_EQ(files.size(), 3u);  // no second has passed since the contact
    std::ostringstream peak;
    peak << std::ifstream(files.back()).rdbuf();
    // The plate's vertices and those of the hand, and no ball in place of the hand.
    const std::size_t vertices = simulation.tool().mesh().vertices.size();
    EXPECT_THAT(peak.str(), HasSubstr("vertex_vectors {\n        " + std::to_string(vertices) + ","));
    EXPECT_THAT(peak.str(), Not(HasSubstr("texture { ProxyBall } }")));
    EXPECT_THAT(peak.str(), HasSubstr("texture { TouchingBall } no_shadow }"));
    std::filesystem::remove_all(folder);
}

class WorkspaceFileTest : public ::testing::Test {
  protected:
    void SetUp() override { std::filesystem::create_directories(folder_); }
    void TearDown() override { std::filesystem::remove_all(folder_); }
    /// Replaces the file, as editors do: even with the same size and time its inode differs.
    void write(const std::string& text) {
        const std::filesystem::path fresh = folder_ / "fresh.toml";
        std::ofstream(fresh) << text;
        std::filesystem::rename(fresh, file_);
    }
    /// Two polls: the first sees a change, the second accepts it if the file is stable.
    std::optional<WorkspaceSettings> poll_twice() {
        EXPECT_FALSE(workspace_->poll(now_ns_ += WorkspaceFile::kPollNs));
        return workspace_->poll(now_ns_ += WorkspaceFile::kPollNs);
    }

    std::filesystem::path folder_ =
        std::filesystem::path(::testing::TempDir()) / ("haptic-workspace-test-" + std::to_string(getpid()));
    std::filesystem::path file_ = folder_ / "workspace.toml";
    WorkspaceSettings scene_{.scale = 0.05, .force_scale = 0.4, .clutch_button = 3};
    std::unique_ptr<WorkspaceFile> workspace_;
    std::int64_t now_ns_ = 5'000'000'000;
};

TEST_F(WorkspaceFileTest, OverridesTheKeysThatItNames) {
    write("[workspace]\nscale = 0.02\n");
    workspace_ = std::make_unique<WorkspaceFile>(file_, scene_);
    WorkspaceSettings expected = scene_;
    expected.scale = 0.02;
    EXPECT_EQ(workspace_->settings(), expected);
    EXPECT_FALSE(poll_twice());  // it was read already

    write("[workspace]\nforce_scale = 0.1\n");
    expected = scene_;
    expected.force_scale = 0.1;
    const std::optional<WorkspaceSettings> next = poll_twice();
    ASSERT_TRUE(next.has_value());
    EXPECT_EQ(*next, expected);
    EXPECT_FALSE(poll_twice());
}

TEST_F(WorkspaceFileTest, IsPolledAtMostFiveTimesPerSecond) {
    write("[workspace]\n");
    workspace_ = std::make_unique<WorkspaceFile>(file_, scene_);
    EXPECT_FALSE(poll_twice());
    write("[workspace]\nscale = 0.02\n");
    EXPECT_FALSE(workspace_->poll(now_ns_ + WorkspaceFile::kPollNs));
    EXPECT_FALSE(workspace_->poll(now_ns_ + 2 * WorkspaceFile::kPollNs - 1));
    EXPECT_TRUE(workspace_->poll(now_ns_ + 2 * WorkspaceFile::kPollNs));
}

TEST_F(WorkspaceFileTest, IsNotAcceptedWhileItIsBeingWritten) {
    write("[workspace]\n");
    workspace_ = std::make_unique<WorkspaceFile>(file_, scene_);
    for (const char* so_far : {"[workspace]\nsca", "[workspace]\nscale = 0.0", "[workspace]\nscale = 0.02"}) {
        write(so_far);
        EXPECT_FALSE(workspace_->poll(now_ns_ += WorkspaceFile::kPollNs));
        EXPECT_EQ(workspace_->error(), "");
    }
    const std::optional<WorkspaceSettings> next = workspace_->poll(now_ns_ += WorkspaceFile::kPollNs);
    ASSERT_TRUE(next.has_value());
    EXPECT_EQ(next->scale, 0.02);
}

TEST_F(WorkspaceFileTest, KeepsTheOldSettingsAndReportsAnErrorOnce) {
    write("[workspace]\nscale = 0.02\n");
    workspace_ = std::make_unique<WorkspaceFile>(file_, scene_);
    const WorkspaceSettings before = workspace_->settings();
    for (const char* wrong :
         {"[workspace]\nscale = -1.0\n", "[workspace]\nscael = 0.03\n", "[workspace\n",
          "[workspace]\nscale = 0.03\nrotation = [1.0, 1.0, 0.0, 0.0]\n", "[solver]\nstep = 0.1\n"}) {
        write(wrong);
        EXPECT_FALSE(poll_twice()) << wrong;
        EXPECT_THAT(workspace_->error(), HasSubstr("workspace.toml")) << wrong;
        EXPECT_EQ(workspace_->settings(), before) << wrong;
        EXPECT_FALSE(poll_twice());
        EXPECT_EQ(workspace_->error(), "");
    }
    std::filesystem::remove(file_);
    EXPECT_FALSE(poll_twice());
    EXPECT_EQ(workspace_->error(), "");
    write("[workspace]\nscale = 0.03\n");
    ASSERT_TRUE(poll_twice());
    EXPECT_EQ(workspace_->settings().scale, 0.03);
}

TEST_F(WorkspaceFileTest, IsRejectedAtTheStartIfInvalidOrMissing) {
    EXPECT_THROW(WorkspaceFile(file_, scene_), ConfigError);
    write("[workspace]\nscale = 0.0\n");
    EXPECT_THROW(WorkspaceFile(file_, scene_), ConfigError);
}

class DeviceHandTest : public ::testing::Test {
  protected:
    static constexpr std::int64_t kNow = 1'000'000'000'000;

    DeviceState state(double x) {
        DeviceState s{};
        s.position[0] = x;
        s.orientation[0] = 1.0;
        s.latch_time_ns = kNow;
        s.buttons = 1;
        return s;
    }

    static StepInput first_input() {
        StepInput input;
        input.device = {{0.5, 0.0, 0.0}, {}};
        return input;
    }

    std::string session_ = haptic::test::unique_session();
    RingWriter<DeviceState> writer_{session_};
    RingReader<DeviceState> reader_{session_};
    StepInput initial_ = first_input();
    DeviceHand hand_{reader_, initial_};
};

TEST_F(DeviceHandTest, StaysInPlaceUntilTheFirstState) {
    EXPECT_EQ(hand_.at(5, kNow).device.position.x, 0.5);
    EXPECT_EQ(hand_.at(6, kNow).time_ns, 6);
    EXPECT_FALSE(hand_.fresh());
}

TEST_F(DeviceHandTest, FollowsTheNewestState) {
    DeviceState first = state(0.01);
    DeviceState second = state(0.02);
    (void)writer_.publish(first, kNow);
    (void)writer_.publish(second, kNow);
    const StepInput input = hand_.at(7, kNow + 1'000'000);
    EXPECT_EQ(input.device.position.x, 0.02);
    EXPECT_EQ(input.buttons, 1u);
    EXPECT_EQ(input.state_sequence, 2u);
    EXPECT_EQ(input.state_time_ns, kNow);
    EXPECT_EQ(input.time_ns, 7);
    EXPECT_TRUE(hand_.fresh());
}

TEST_F(DeviceHandTest, KeepsThePoseAndReleasesTheButtonsWhenStatesAreStale) {
    DeviceState only = state(0.01);
    (void)writer_.publish(only, kNow);
    (void)hand_.at(0, kNow);
    const StepInput input = hand_.at(0, kNow + DeviceHand::kFreshNs + 1);
    EXPECT_FALSE(hand_.fresh());
    EXPECT_EQ(input.device.position.x, 0.01);
    EXPECT_EQ(input.buttons, 0u);
}

TEST_F(DeviceHandTest, IgnoresInvalidPoses) {
    DeviceState good = state(0.01);
    DeviceState infinite = state(std::nan(""));
    DeviceState crooked = state(0.02);
    crooked.orientation[0] = 0.7;
    (void)writer_.publish(good, kNow);
    (void)hand_.at(0, kNow);
    for (DeviceState* bad : {&infinite, &crooked}) {
        (void)writer_.publish(*bad, kNow);
        EXPECT_EQ(hand_.at(0, kNow).device.position.x, 0.01);
    }
    EXPECT_EQ(hand_.rejected(), 2u);
    EXPECT_NE(find_defect(crooked), nullptr);
    EXPECT_EQ(find_defect(good), nullptr);
}

}  // namespace
}  // namespace haptic::sim
