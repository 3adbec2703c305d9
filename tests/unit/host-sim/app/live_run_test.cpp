// Runs with viewers: sources of the hand, pause, changes, records and their playback.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <csignal>
#include <deque>
#include <filesystem>
#include <fstream>
#include <glm/geometric.hpp>
#include <string>
#include <thread>
#include <vector>

#include "app/contact_frame_publisher.hpp"
#include "app/hand_sources.hpp"
#include "app/live_control.hpp"
#include "app/moment_store.hpp"
#include "app/playback.hpp"
#include "app/recorded_run.hpp"
#include "app/recordings.hpp"
#include "app/replay.hpp"
#include "app/run.hpp"
#include "app/run_options.hpp"
#include "haptic/csv.hpp"
#include "haptic/pose_track.hpp"
#include "haptic/ring.hpp"
#include "haptic/text_file.hpp"
#include "unique_session.hpp"
#include "view/capture.hpp"
#include "view/live_view.hpp"

namespace haptic::sim {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

/// A live view that sends a test's commands and accepts every snapshot.
class FakeView : public view::LiveView {
  public:
    [[nodiscard]] std::string url() const override { return "http://nowhere/"; }
    void set_scene(const view::SceneDescription& scene) override {
        introduced.push_back(scene);
        moment.vertices.resize(scene.bodies.back().first_vertex + scene.bodies.back().vertices);
        moment.particles.resize(scene.semi_axes.size());
        moment.orientations.resize(scene.semi_axes.size());
        moment.tool_vertices.resize(scene.tool_vertices);
    }
    [[nodiscard]] view::SceneSnapshot* requested_snapshot() noexcept override { return looking ? &moment : nullptr; }
    void publish_snapshot() noexcept override { ++shown; }
    void add_sample(const view::StepSample& sample) noexcept override { samples.push_back(sample); }
    void frame_published(std::uint64_t sequence, std::int64_t /*time_ns*/) noexcept override { published = sequence; }
    [[nodiscard]] bool next_command(view::Command& command) override {
        if (commands.empty()) {
            return false;
        }
        command = commands.front();
        commands.pop_front();
        return true;
    }
    void offer_record(std::string csv) override { record = std::move(csv); }

    std::vector<view::SceneDescription> introduced;
    view::SceneSnapshot moment;
    std::deque<view::Command> commands;
    std::vector<view::StepSample> samples;
    std::string record;
    std::uint64_t published = 0;
    int shown = 0;
    bool looking = true;
};

Scene scene_named(const std::string& name) {
    return read_scene(open_scene(name), name);
}

/// A minimal run: makes steps as Run::make_step() does.
class LiveRun : public testing::Test {
  protected:
    LiveRun() {
        auto made = std::make_unique<FakeView>();
        view = made.get();
        live = std::make_unique<LiveControl>(std::move(made), recordings);
        recordings.begin({.scene = "cloth-drop", .assignments = {}, .first_step = 0, .changes = {}});
        hand.begin(simulation);
        live->introduce(simulation, simulation.settings(), hand);
    }
    /// True if a step was made.
    bool step() {
        live->serve();
        if (live->is_idle()) {
            live->show(now_ns);
            return false;
        }
        const StepInput input = hand.at(simulation, {.scene_ns = scene_ns, .step_ns = scene_ns, .now_ns = now_ns});
        const StepResult result = simulation.step(input);
        scene_ns += nanoseconds(result.step);
        now_ns += nanoseconds(result.step);
        recordings.add(input, result);
        live->after_step(result, 0, now_ns);
        last = result;
        return true;
    }
    void steps(int count) {
        for (int k = 0; k < count; ++k) {
            (void)step();
        }
    }
    void ask(view::Command command) { view->commands.push_back(std::move(command)); }
    std::size_t parameter(const std::string& key) {
        const auto& all = view->introduced.back().parameters;
        for (std::size_t k = 0; k < all.size(); ++k) {
            if (all[k].key == key) {
                return k;
            }
        }
        ADD_FAILURE() << key;
        return 0;
    }
    void wait_for_record() {
        for (int k = 0; k < 2000 && view->record.empty(); ++k) {
            std::this_thread::sleep_for(std::chrono::milliseconds(5));
            live->serve();
        }
        ASSERT_FALSE(view->record.empty());
    }

    Simulation simulation{scene_named("cloth-drop")};
    Recordings recordings{""};
    HandSources hand{{.input = "", .hostile_seed = std::nullopt, .scripted = true}, nullptr};
    FakeView* view = nullptr;
    std::unique_ptr<LiveControl> live;
    StepResult last;
    std::int64_t scene_ns = 0;
    std::int64_t now_ns = 1'000'000'000;
};

TEST_F(LiveRun, IsShownInItsCurrentState) {
    steps(20);
    EXPECT_EQ(view->shown, 20);
    EXPECT_EQ(view->samples.size(), 20u);
    EXPECT_EQ(view->moment.vertices, simulation.vertices());
    EXPECT_EQ(view->moment.run.hand, view::HandSource::Script);
    EXPECT_EQ(view->moment.run.parameters[parameter("coupling.stiffness")], 10.0);
    view->looking = false;
    steps(1);
    EXPECT_EQ(view->shown, 20);
}

TEST_F(LiveRun, PausesSingleStepsAndContinuesUnchanged) {
    steps(5);
    ask(view::SetPaused{true});
    steps(10);
    EXPECT_EQ(simulation.steps(), 5u);
    EXPECT_TRUE(view->moment.run.paused);
    ask(view::SingleStep{3});
    steps(10);
    EXPECT_EQ(simulation.steps(), 8u);
    ask(view::SetPaused{false});
    steps(192);
    Simulation alone(scene_named("cloth-drop"));
    for (int k = 0; k < 200; ++k) {
        (void)alone.step(alone.scripted_input(10'000'000 * std::int64_t{k}));
    }
    EXPECT_EQ(simulation.state_hash(), alone.state_hash());
}

TEST_F(LiveRun, SetsParametersWithinTheirRangesAndCountsThem) {
    const std::size_t stiffness = parameter("coupling.stiffness");
    ask(view::SetParameter{stiffness, 20.0});
    ask(view::SetParameter{stiffness, 20.0});  // no change
    ask(view::SetParameter{parameter("solver.step"), 1e9});
    ask(view::SetParameter{99, 1.0});
    steps(1);
    EXPECT_EQ(simulation.settings().stiffness, 20.0);
    EXPECT_EQ(simulation.settings().step, 1.0 / 2000.0);
    EXPECT_EQ(live->counts().changes, 2u);
    EXPECT_EQ(view->moment.run.parameters[stiffness], 20.0);
}

TEST_F(LiveRun, LeavesSceneRequestsToTheRun) {
    ask(view::Reset{});
    steps(1);
    ASSERT_TRUE(live->take_request().has_value());
    EXPECT_FALSE(live->take_request().has_value());
    ask(view::ChangeScene{"four-fish"});
    steps(1);
    EXPECT_EQ(live->take_request()->scene, "four-fish");
}

TEST_F(LiveRun, TheMouseTakesTheHandFromTheScriptSmoothlyAndReturnsIt) {
    steps(5);
    ask(view::MoveHand{Vec3(0.3, 0.1, 0.0), std::nullopt, std::nullopt});
    steps(1);
    EXPECT_EQ(view->moment.run.hand, view::HandSource::Mouse);
    EXPECT_LT(last.hip.x, 0.3);
    EXPECT_GT(last.hip.x, 0.0);
    steps(60);
    EXPECT_NEAR(glm::length(last.hip - Vec3(0.3, 0.1, 0.0)), 0.0, 1e-6);
    ask(view::ReleaseHand{});
    steps(10);
    EXPECT_EQ(view->moment.run.hand, view::HandSource::Still);
    EXPECT_NEAR(last.hip.x, 0.3, 1e-6);
    ask(view::FollowScript{});
    double before = last.hip.x;
    for (int k = 0; k < 60; ++k) {
        steps(1);
        EXPECT_LE(std::fabs(last.hip.x - before), 0.3 * 1.5 * 0.01 / 0.5 * 1.01);  // fastest speed of the easing
        before = last.hip.x;
    }
    EXPECT_EQ(last.hip, Vec3(0.0));
    EXPECT_EQ(view->moment.run.hand, view::HandSource::Script);
}

TEST_F(LiveRun, TheMouseCanDragTheProxyUnderTheCloth) {
    steps(100);
    ask(view::MoveHand{Vec3(0.0, 0.4, 0.0), std::nullopt, std::nullopt});
    steps(46);  // 10 - g t^2 / 2 = 0.4 at 1.4 s
    EXPECT_TRUE(last.in_contact);
    EXPECT_LT(last.proxy.y, 0.4);
    EXPECT_LT(last.hand_force.y, -0.1);
}

TEST_F(LiveRun, OffersARecordThatRepeatsTheRunBitForBit) {
    ask(view::SetRecording{true});
    steps(100);
    ask(view::SetParameter{parameter("proxy.radius"), 0.06});
    ask(view::SetParameter{parameter("solver.step"), 200.0});
    steps(120);
    ask(view::MoveHand{Vec3(0.05, 0.2, 0.0), std::nullopt, std::nullopt});
    ask(view::SetParameter{parameter("coupling.stiffness"), 15.0});
    steps(150);
    EXPECT_EQ(view->moment.run.recorded_steps, 370u);
    ask(view::SetRecording{false});
    live->serve();
    wait_for_record();

    const std::filesystem::path file =
        std::filesystem::path(testing::TempDir()) / ("haptic-live-" + std::to_string(getpid()) + ".csv");
    std::ofstream(file) << view->record;
    const RecordedRun record = RecordedRun::load(file);
    EXPECT_NO_THROW((void)PoseTrack::load(file));  // valid for --input
    ASSERT_TRUE(record.notes());
    EXPECT_EQ(record.notes()->changes.size(), 3u);
    EXPECT_EQ(record.rows(), 370u);
    Replay replay(scene_named(record.notes()->scene), record, true);
    int made = 0;
    for (StepResult result; replay.step(result); ++made) {
    }
    EXPECT_EQ(made, 370);
    EXPECT_EQ(replay.simulation().state_hash(), simulation.state_hash());
    EXPECT_FALSE(replay.diverged_at());

    Scene other = scene_named("cloth-drop");
    other.solver.drag = 1.0;
    Replay elsewhere(other, record, true);
    for (StepResult result; elsewhere.step(result);) {
    }
    EXPECT_TRUE(elsewhere.diverged_at());
    std::filesystem::remove(file);
}

TEST(ReplayTest, RepeatsWorkspaceChangesAndRecouplingAtTheSameSteps) {
    Simulation simulation(scene_named("fish-slide"));
    const std::filesystem::path file =
        std::filesystem::path(testing::TempDir()) / ("haptic-replay-" + std::to_string(getpid()) + ".csv");
    Recordings recordings(file);
    recordings.begin({.scene = "fish-slide", .assignments = {}, .first_step = 0, .changes = {}});
    for (int k = 0; k < 200; ++k) {
        if (k == 110) {
            WorkspaceSettings next = simulation.scene().workspace;
            next.scale *= 0.7;
            next.offset = Vec3(0.001, 0.002, 1.0 / 3.0 * 0.001);
            simulation.change_workspace(next);
            for (const std::string& assignment : assignments_of(next)) {
                recordings.note(simulation.steps(), assignment);
            }
        }
        if (k == 160) {
            simulation.recouple();
            recordings.note(simulation.steps(), std::string(kRecouple));
        }
        const StepInput input = simulation.scripted_input(10'000'000 * std::int64_t{k});
        recordings.add(input, simulation.step(input));
    }
    recordings.close();
    const RecordedRun record = RecordedRun::load(file);
    Replay replay(scene_named("fish-slide"), record, true);
    for (StepResult result; replay.step(result);) {
    }
    EXPECT_EQ(replay.simulation().state_hash(), simulation.state_hash());
    EXPECT_FALSE(replay.diverged_at());
    std::filesystem::remove(file);
}

TEST(RecordNotesTest, DescribeTheOriginOfARecordAndRejectUnknownNotes) {
    const RecordNotes notes{.scene = "my scenes/a b.toml",
                            .assignments = {"solver.iterations=5", "hand.times=[0.0,\n1.0]"},
                            .first_step = 7,
                            .changes = {{9, "coupling.stiffness=20"}, {9, std::string(kRecouple)}}};
    const std::vector<std::string> lines = lines_of(notes);
    const std::optional<RecordNotes> read = read_notes(lines);
    ASSERT_TRUE(read);
    EXPECT_EQ(read->scene, notes.scene);
    EXPECT_THAT(read->assignments, ElementsAre("solver.iterations=5", "hand.times=[0.0, 1.0]"));
    EXPECT_EQ(read->first_step, 7u);
    ASSERT_EQ(read->changes.size(), 2u);
    EXPECT_EQ(read->changes[1].what, kRecouple);
    EXPECT_EQ(read->changes[1].step, 9u);
    EXPECT_FALSE(read_notes({}));
    const std::vector<std::string> of_somebody_else{"made with love"};
    EXPECT_FALSE(read_notes(of_somebody_else));
    const std::vector<std::string> wrong{lines[0], "change soon coupling.stiffness=20"};
    EXPECT_THROW((void)read_notes(wrong), std::invalid_argument);
    const std::vector<std::string> newer{lines[0], "weather rain"};
    EXPECT_THROW((void)read_notes(newer), std::invalid_argument);
}

TEST(RecordNotesTest, TellWhenTheFirstStepOfARunByTheClockWas) {
    const std::filesystem::path file =
        std::filesystem::path(testing::TempDir()) / ("haptic-clocked-" + std::to_string(getpid()) + ".csv");
    for (const bool clocked : {true, false}) {
        Recordings recordings(file, clocked);
        recordings.begin({.scene = "cloth-drop", .assignments = {}, .first_step = 0, .changes = {}});
        StepInput input;
        for (const std::int64_t time_ns : {51'000'000'007, 51'010'000'007}) {
            input.time_ns = time_ns;
            recordings.add(input, {});
        }
        recordings.close();
        std::vector<std::string> expected{"host-sim record 2", "scene cloth-drop", "first-step 0"};
        if (clocked) {
            expected.emplace_back("time-zero-ns 51000000007");
        }
        const CsvTable table = CsvTable::load(file);
        EXPECT_EQ(table.notes(), expected);
        EXPECT_THAT(std::vector(table.column("time_s").begin(), table.column("time_s").end()), ElementsAre(0.0, 0.01));
        EXPECT_TRUE(read_notes(table.notes()));  // which play and --input do
    }
    std::filesystem::remove(file);
}

TEST(RecordNotesTest, KeepOnlyTheLastChangeOfAKeyBetweenTwoSteps) {
    Recordings recordings("");
    recordings.begin({.scene = "cloth-drop", .assignments = {}, .first_step = 0, .changes = {}});
    recordings.start_offer(0);
    recordings.note(3, "coupling.stiffness=11");
    recordings.note(3, "proxy.radius=0.04");
    recordings.note(3, "coupling.stiffness=12");
    recordings.note(4, "coupling.stiffness=13");
    recordings.add({}, {});
    recordings.finish_offer();
    std::optional<std::string> csv;
    while (!(csv = recordings.take_offer())) {
        std::this_thread::yield();
    }
    EXPECT_THAT(*csv, HasSubstr("# change 3 coupling.stiffness=12\n# change 3 proxy.radius=0.04\n"
                                "# change 4 coupling.stiffness=13\n0,"));
}

class MomentStoreTest : public testing::Test {
  protected:
    view::SceneSnapshot after_step() {
        const StepResult result = simulation.step(simulation.scripted_input(time_ns));
        time_ns += nanoseconds(result.step);
        view::SceneSnapshot moment;
        view::capture(simulation, result, moment);
        return moment;
    }

    Simulation simulation{scene_named("four-fish")};
    view::SceneDescription description = view::describe(simulation);
    std::int64_t time_ns = 0;
};

TEST_F(MomentStoreTest, ReturnsSnapshotsToAFractionOfEachBodysSize) {
    MomentStore store(description);
    view::SceneSnapshot kept;
    for (int k = 0; k < 220; ++k) {
        kept = after_step();
        if (store.wants(kept.time)) {
            store.add(kept);
        }
    }
    ASSERT_TRUE(store.wants(1e9));
    store.add(kept);
    view::SceneSnapshot found;
    view::make_room(simulation, found);
    ASSERT_TRUE(store.find(kept.time, found));
    EXPECT_EQ(found.time, kept.time);
    EXPECT_EQ(found.step, kept.step);
    EXPECT_EQ(found.force, kept.force);
    EXPECT_EQ(found.planes.size(), kept.planes.size());
    EXPECT_EQ(found.forces.size(), kept.forces.size());
    EXPECT_EQ(found.proxies[0].position, kept.proxies[0].position);
    // Half of 1/65535 of 0.3 m along each axis.
    const double tolerance = 0.5 * 0.4 / 65535.0;
    for (std::size_t i = 0; i < kept.vertices.size(); ++i) {
        for (int c = 0; c < 3; ++c) {
            ASSERT_NEAR(found.vertices[i][c], kept.vertices[i][c], tolerance);
        }
    }
    for (std::size_t i = 0; i < kept.particles.size(); ++i) {
        ASSERT_LT(glm::length(found.particles[i] - kept.particles[i]), 2.0 * tolerance);
        ASSERT_NEAR(std::fabs(glm::dot(found.orientations[i], kept.orientations[i])), 1.0, 1e-7);
    }
}

TEST_F(MomentStoreTest, BecomesCoarserWhenFullButNeverShorter) {
    MomentStore store(description, 1'000'000);
    double end = 0.0;
    for (int k = 0; k < 400; ++k) {
        const view::SceneSnapshot moment = after_step();
        if (store.wants(moment.time)) {
            store.add(moment);
            end = moment.time;
        }
        ASSERT_LE(store.bytes(), 1'000'000u);
    }
    EXPECT_GT(end, 3.5);
    view::SceneSnapshot found;
    view::make_room(simulation, found);
    ASSERT_TRUE(store.find(0.0, found));
    EXPECT_NEAR(found.time, 0.01, 1e-9);  // the first one is kept
    ASSERT_TRUE(store.find(100.0, found));
    EXPECT_EQ(found.time, end);
    EXPECT_EQ(store.time_of_neighbour(0.0, 1), store.time_of_neighbour(store.time_of_neighbour(0.0, 1), 0));
    EXPECT_GT(store.time_of_neighbour(0.0, 1), 0.05);  // fewer than initially
    EXPECT_EQ(store.time_of_neighbour(0.0, -3), store.time_of_neighbour(0.0, 0));
    EXPECT_EQ(store.time_of_neighbour(0.0, 1'000'000), end);
}

class PlaybackTest : public testing::Test {
  protected:
    void SetUp() override {
        Simulation simulation(scene_named("fish-slide"));
        StepRecord rows({.scene = "fish-slide", .assignments = {}, .first_step = 0, .changes = {}});
        for (int k = 0; k < 100; ++k) {
            const StepInput input = simulation.scripted_input(10'000'000 * std::int64_t{k});
            rows.add(input, simulation.step(input));
        }
        write_text(file, rows.text());
        record.emplace(RecordedRun::load(file));
        replay.emplace(scene_named("fish-slide"), *record, true);
        playback.emplace(*replay, *record, view);
        for (int k = 0; k < 4000 && playback->buffered() < 1.0 - 1e-9; ++k) {
            std::this_thread::sleep_for(std::chrono::milliseconds(5));
        }
        ASSERT_NEAR(playback->buffered(), 1.0, 1e-9);
    }
    void TearDown() override {
        playback.reset();
        std::filesystem::remove(file);
    }

    std::filesystem::path file =
        std::filesystem::path(testing::TempDir()) / ("haptic-play-" + std::to_string(getpid()) + ".csv");
    FakeView view;
    std::optional<RecordedRun> record;
    std::optional<Replay> replay;
    std::optional<Playback> playback;
};

TEST_F(PlaybackTest, PlaysSeeksPausesStepsAndChangesTheSpeed) {
    ASSERT_EQ(view.introduced.size(), 1u);
    EXPECT_NEAR(view.introduced[0].length, 1.0, 1e-9);
    EXPECT_TRUE(view.introduced[0].parameters.empty());
    view.looking = false;
    playback->advance(0.1);
    EXPECT_EQ(playback->time(), 0.0);  // no viewer yet
    view.looking = true;
    playback->advance(0.1);
    EXPECT_EQ(playback->time(), 0.0);
    playback->advance(0.1);
    EXPECT_NEAR(playback->time(), 0.1, 1e-9);
    EXPECT_EQ(view.samples.size(), 10u);
    EXPECT_EQ(view.moment.run.hand, view::HandSource::Input);
    EXPECT_NEAR(view.moment.run.buffered, 1.0, 1e-9);
    EXPECT_FALSE(view.moment.run.diverged);
    view.commands.push_back(view::Seek{0.5});
    view.commands.push_back(view::SetPaused{true});
    playback->advance(0.1);
    EXPECT_NEAR(playback->time(), 0.5, 1e-9);
    EXPECT_EQ(view.samples.size(), 10u);  // skipped steps are not plotted
    const std::uint64_t at = view.moment.step;
    EXPECT_NEAR(static_cast<double>(at), 50.0, 2.0);
    view.commands.push_back(view::SingleStep{1});
    playback->advance(0.1);
    EXPECT_GT(view.moment.step, at);
    EXPECT_LE(view.moment.step, at + 2);
    view.commands.push_back(view::SetSpeed{2.0});
    view.commands.push_back(view::SetPaused{false});
    const double from = playback->time();
    playback->advance(0.1);
    EXPECT_NEAR(playback->time(), from + 0.2, 1e-9);
    playback->advance(10.0);
    EXPECT_NEAR(playback->time(), 1.0, 1e-9);
    EXPECT_TRUE(playback->paused());
    view.commands.push_back(view::SetPaused{false});
    playback->advance(0.0);
    EXPECT_EQ(playback->time(), 0.0);  // restarted
    view.commands.push_back(view::MoveHand{});
    view.commands.push_back(view::Seek{77.0});
    playback->advance(0.0);
    EXPECT_NEAR(playback->time(), 1.0, 1e-9);
}

TEST_F(PlaybackTest, FollowsTheHandOfAnOldRecordOverTimeInAnyScene) {
    Replay other(scene_named("four-fish"), *record, false);
    StepResult result;
    int made = 0;
    while (other.step(result)) {
        ++made;
    }
    EXPECT_EQ(made, 100);
    EXPECT_FALSE(other.diverged_at());  // no notes to compare with
}

TEST_F(PlaybackTest, AsInputItGivesTheSameBitsWithItsButtons) {
    Simulation scripted(scene_named("fish-slide"));
    Simulation followed(scene_named("fish-slide"));
    HandSources hand({.input = file.string(), .hostile_seed = std::nullopt, .scripted = true}, nullptr);
    hand.begin(followed);
    for (int k = 0; k < 100; ++k) {
        const std::int64_t time_ns = 10'000'000 * std::int64_t{k};
        (void)scripted.step(scripted.scripted_input(time_ns));
        (void)followed.step(hand.at(followed, {.scene_ns = time_ns, .step_ns = time_ns, .now_ns = 0}));
    }
    EXPECT_EQ(hand.source(), view::HandSource::Input);
    EXPECT_EQ(scripted.state_hash(), followed.state_hash());
}

TEST(RecordedRunTest, InterpolatesPosesAndHoldsButtonsBetweenRows) {
    const std::filesystem::path file =
        std::filesystem::path(testing::TempDir()) / ("haptic-rows-" + std::to_string(getpid()) + ".csv");
    std::ofstream(file) << "time_s,x_m,y_m,z_m,curl,buttons\n# a note\n5,0,0,0,0,1\n6,1,0,0,0.5,2\n";
    const RecordedRun run = RecordedRun::load(file);
    EXPECT_FALSE(run.notes());
    EXPECT_EQ(run.begin(), 5.0);
    EXPECT_EQ(run.length(), 2.0);  // the last row's step has the length of the one before
    const StepInput middle = run.at(0.5);
    EXPECT_EQ(middle.device.position.x, 0.5);
    EXPECT_EQ(middle.curl, 0.25);
    EXPECT_EQ(middle.buttons, 1u);
    EXPECT_EQ(run.at(1.0).buttons, 2u);
    EXPECT_EQ(run.at(-3.0).device.position.x, 0.0);
    EXPECT_EQ(run.at(9.0).device.position.x, 1.0);
    EXPECT_FALSE(run.proxy(0));
    std::filesystem::remove(file);
}

TEST(ContactFramePublisherTest, WhileIdleTheStiffnessFadesAndThePlanesRestButFramesContinue) {
    const std::string session = haptic::test::unique_session();
    ContactFramePublisher publisher(session);
    RingReader<ContactFrame> reader(session);
    ContactFrame frame{};
    frame.stiffness = 100.0;
    frame.step_ns = 10'000'000;
    frame.proxy_count = 1;
    frame.proxies[0].plane_count = 1;
    frame.proxies[0].planes[0].normal[1] = 1.0;
    frame.proxies[0].planes[0].velocity = 2.0;
    EXPECT_EQ(publisher.publish_idle(1'000), 0u);  // no frame yet
    std::int64_t now_ns = 1'000'000'000;
    ASSERT_NE(publisher.publish(frame, now_ns, now_ns), 0u);
    ContactFrame read{};
    ASSERT_TRUE(reader.read_newest(read));
    EXPECT_EQ(read.stiffness, 100.0);
    double last = 100.0;
    for (int k = 1; k <= 30; ++k) {
        now_ns += ContactFramePublisher::kIdlePeriodNs;
        EXPECT_NE(publisher.publish_idle(now_ns), 0u);
        ASSERT_TRUE(reader.read_newest(read));
        EXPECT_EQ(haptic::find_defect(read), FrameDefect::None);
        EXPECT_LE(last - read.stiffness, 100.0 * 0.005 / ContactFramePublisher::kFade + 1e-9);
        EXPECT_EQ(read.proxies[0].planes[0].velocity, 0.0);
        EXPECT_EQ(read.publish_time_ns, now_ns);
        last = read.stiffness;
    }
    EXPECT_EQ(last, 0.0);
    EXPECT_TRUE(publisher.faded());
    EXPECT_NE(read.flags & HAPTIC_FRAME_CLUTCHED, 0u);
}

/// Ends the run at the first snapshot of the second simulation.
class EndsAfterReset : public FakeView {
  public:
    explicit EndsAfterReset(std::vector<view::SceneSnapshot>& last) : last_(last) {}
    void publish_snapshot() noexcept override {
        if (introduced.size() == 2) {
            last_.push_back(moment);
            (void)std::raise(SIGINT);
        }
    }

  private:
    std::vector<view::SceneSnapshot>& last_;
};

TEST(RunTest, ASceneThatDivergesUnderChangesRestartsPausedWithItsOwnSettings) {
    RunOptions options;
    options.scene = "cloth-drop";
    options.assignments = {"collisions.ground=false"};
    options.clock = "lockstep";
    options.view = true;
    Plan plan(options);
    plan.scene.solver.gravity.y = -1e308;  // overflows in one step
    std::vector<view::SceneSnapshot> last;
    auto view = std::make_unique<EndsAfterReset>(last);
    view->commands.push_back(view::SetParameter{0, 20.0});
    sim::Run run(options, plan, std::move(view));
    EXPECT_EQ(run.execute(), 0);
    ASSERT_EQ(last.size(), 1u);
    EXPECT_TRUE(last[0].run.paused);
    EXPECT_EQ(last[0].step, 0u);
    EXPECT_EQ(last[0].run.parameters[0], 10.0);
    EXPECT_TRUE(std::isfinite(last[0].vertices[0].y));
}

TEST(RunTest, WithoutChangesADivergenceEndsTheRunWithAnError) {
    RunOptions options;
    options.scene = "cloth-drop";
    options.assignments = {"collisions.ground=false"};
    Plan plan(options);
    EXPECT_EQ(plan.clock, RunClock::Lockstep);
    EXPECT_EQ(plan.duration_s, 2.5);
    plan.scene.solver.gravity.y = -1e308;
    plan.steps = 400;
    sim::Run run(options, plan, nullptr);
    EXPECT_THROW((void)run.execute(), std::runtime_error);
}

TEST(PlanTest, AViewRunsInRealTimeWithoutEndByDefault) {
    RunOptions options;
    options.scene = "cloth-drop";
    options.view = true;
    const Plan watched(options);
    EXPECT_EQ(watched.clock, RunClock::Real);
    EXPECT_EQ(watched.steps, 0u);
    EXPECT_EQ(watched.duration_s, 0.0);
    EXPECT_TRUE(watched.hand.scripted);
    ASSERT_TRUE(watched.view);
    EXPECT_FALSE(watched.view->control);
    EXPECT_EQ(watched.view->address, "127.0.0.1");
    options.clock = "lockstep";
    options.duration_s = 1.0;
    options.view_control = true;
    const Plan said(options);
    EXPECT_EQ(said.clock, RunClock::Lockstep);
    EXPECT_EQ(said.duration_s, 1.0);
    EXPECT_TRUE(said.view->control);
    options.view = false;
    EXPECT_THROW((void)Plan(options), std::runtime_error);
}

class DeviceAndMouse : public testing::Test {
  protected:
    StepInput at(std::int64_t now_ns) {
        return hand.at(simulation, {.scene_ns = 0, .step_ns = now_ns, .now_ns = now_ns});
    }
    void publish(double x, std::int64_t now_ns) {
        DeviceState state{};
        state.position[0] = x;
        state.orientation[0] = 1.0;
        state.latch_time_ns = now_ns;
        (void)device.publish(state, now_ns);
    }

    std::string session = haptic::test::unique_session();
    RingWriter<DeviceState> device{session};
    RingReader<DeviceState> states{session};
    Simulation simulation{scene_named("cloth-drop")};
    HandSources hand{{.input = "", .hostile_seed = std::nullopt, .scripted = true}, &states};
};

TEST_F(DeviceAndMouse, TheDeviceTakesPrecedenceAndTheHandStaysWhenItDisappears) {
    constexpr std::int64_t kSecond = 1'000'000'000;
    hand.begin(simulation);
    (void)at(kSecond);
    EXPECT_EQ(hand.source(), view::HandSource::Script);
    hand.move(simulation, {Vec3(0.1, 0.0, 0.0), std::nullopt, std::nullopt});
    (void)at(kSecond + 1);
    EXPECT_EQ(hand.source(), view::HandSource::Mouse);
    publish(0.01, 2 * kSecond);
    EXPECT_EQ(at(2 * kSecond).device.position.x, 0.01);
    EXPECT_EQ(hand.source(), view::HandSource::Device);
    EXPECT_TRUE(hand.device_appeared());
    hand.move(simulation, {Vec3(0.5, 0.0, 0.0), std::nullopt, std::nullopt});
    hand.follow_script(simulation);
    hand.release();
    EXPECT_EQ(at(2 * kSecond + 1).device.position.x, 0.01);
    EXPECT_EQ(hand.source(), view::HandSource::Device);
    EXPECT_FALSE(hand.device_appeared());
    EXPECT_EQ(at(3 * kSecond).device.position.x, 0.01);  // stale for a second
    EXPECT_EQ(hand.source(), view::HandSource::Still);
    hand.follow_script(simulation);
    (void)at(3 * kSecond + 1);
    EXPECT_EQ(hand.source(), view::HandSource::Script);
}

}  // namespace
}  // namespace haptic::sim
