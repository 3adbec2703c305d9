// A run controlled by a viewer, and the playback of a recording, through the real server.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "process.hpp"
#include "unique_session.hpp"
#include "view_client.hpp"

namespace haptic::test {
namespace {

using std::chrono::seconds;
using ::testing::HasSubstr;

class Viewed {
  public:
    explicit Viewed(const std::vector<std::string>& arguments) : process_(command(arguments), folder_ / "log") {
        if (process_.wait_for_text("the live view is at", seconds(30))) {
            client_ = std::make_unique<ViewClient>(view_port_in(process_.output()).value_or(0));
        }
    }
    [[nodiscard]] bool there() {
        return client_ && until([&] { return client_->frames() > 0; });
    }
    [[nodiscard]] ViewClient& client() { return *client_; }
    [[nodiscard]] Process& process() { return process_; }
    bool until(const std::function<bool()>& condition) { return take_until({client_.get()}, seconds(30), condition); }
    /// Waits for some more frames.
    bool sees_more(std::uint64_t frames = 10) {
        const std::uint64_t before = client_->frames();
        return until([&] { return client_->frames() >= before + frames; });
    }
    nlohmann::json end() {
        process_.signal(SIGINT);
        EXPECT_EQ(process_.wait_for(seconds(20)), 0) << process_.output();
        std::ifstream report(folder_ / "report.json");
        return report ? nlohmann::json::parse(report) : nlohmann::json();
    }
    [[nodiscard]] std::string scene() const {
        return nlohmann::json::parse(client_->newest("scene")).at("name").get<std::string>();
    }

  private:
    std::vector<std::string> command(const std::vector<std::string>& arguments) const {
        std::vector<std::string> all{HOST_SIM};
        all.insert(all.end(), arguments.begin(), arguments.end());
        if (arguments.front() == "run") {
            all.insert(all.end(), {"--report", (folder_ / "report.json").string()});
        }
        return all;
    }

    ScratchFolder folder_;
    Process process_;
    std::unique_ptr<ViewClient> client_;
};

std::vector<std::string> run_of(const std::string& scene, const std::string& clock) {
    return {"run", scene, "--clock", clock, "--session", unique_session(), "--view", "127.0.0.1:0", "--view-control"};
}

class ViewRun : public testing::TestWithParam<const char*> {};

TEST_P(ViewRun, PausesResumesRestartsAndChangesItsScene) {
    Viewed run(run_of("cloth-drop", GetParam()));
    ASSERT_TRUE(run.there()) << run.process().output();
    ViewClient& viewer = run.client();
    ASSERT_TRUE(viewer.say(R"({"type":"pause","on":true})"));
    double stands = -1.0;
    ASSERT_TRUE(run.until([&] {
        const bool same = viewer.step() == stands;
        stands = viewer.step();
        return same && run.sees_more(3) && viewer.step() == stands;
    })) << "it was never paused";
    ASSERT_TRUE(viewer.say(R"({"type":"step","steps":3})"));
    EXPECT_TRUE(run.until([&] { return viewer.step() == stands + 3; }));
    EXPECT_TRUE(run.sees_more());
    EXPECT_EQ(viewer.step(), stands + 3);
    ASSERT_TRUE(viewer.say(R"({"type":"pause","on":false})"));
    EXPECT_TRUE(run.until([&] { return viewer.step() > stands + 20; }));
    ASSERT_TRUE(viewer.say(R"({"type":"set","key":"coupling.stiffness","value":20})"));
    ASSERT_TRUE(viewer.say(R"({"type":"reset"})"));
    EXPECT_TRUE(run.until([&] { return viewer.count("scene") == 2; }));
    EXPECT_EQ(run.scene(), "cloth-drop");
    ASSERT_TRUE(viewer.say(R"({"type":"scene","name":"fish-slide"})"));
    EXPECT_TRUE(run.until([&] { return viewer.count("scene") == 3; }));
    EXPECT_EQ(run.scene(), "fish-slide");
    EXPECT_TRUE(run.sees_more());
    const nlohmann::json report = run.end();
    EXPECT_EQ(report.at("scene"), "fish-slide");
    EXPECT_EQ(report.at("view").at("changes"), 1);
    EXPECT_EQ(report.at("view").at("resets"), 1);
    EXPECT_EQ(report.at("view").at("scenes"), 1);
}

INSTANTIATE_TEST_SUITE_P(Clocks, ViewRun, testing::Values("real", "lockstep"),
                         [](const auto& clock) { return std::string(clock.param); });

TEST(ViewPlay, PlaysARecordingExactlyAndSeeks) {
    ScratchFolder folder;
    const std::string record = (folder / "r.csv").string();
    ASSERT_EQ(run({HOST_SIM, "run", "fish-slide", "--steps", "300", "--record", record}).status, 0);
    Viewed play({"play", record, "--view", "127.0.0.1:0"});
    ASSERT_TRUE(play.there()) << play.process().output();
    ViewClient& viewer = play.client();
    const auto scene = nlohmann::json::parse(viewer.newest("scene"));
    EXPECT_EQ(scene.at("mode"), "play");
    EXPECT_NEAR(scene.at("length").get<double>(), 3.0, 1e-9);
    EXPECT_TRUE(play.until([&] { return viewer.time() > 0.5; }));
    ASSERT_TRUE(viewer.say(R"({"type":"pause","on":true})"));
    // A time that is not computed yet cannot be reached, so repeat the request.
    EXPECT_TRUE(play.until([&] {
        (void)viewer.say(R"({"type":"seek","time":2.5})");
        return play.sees_more(3) && viewer.time() == 2.5;
    }));
    ASSERT_TRUE(viewer.say(R"({"type":"pause","on":false})"));
    EXPECT_TRUE(play.until([&] { return viewer.time() == 3.0; }));
    (void)play.end();
    EXPECT_THAT(play.process().output(), ::testing::Not(HasSubstr("differs from the recording")));
}

TEST(ViewPlay, NamesTheMissingOption) {
    ScratchFolder folder;
    const std::string record = (folder / "r.csv").string();
    std::ofstream(record) << "time_s,x_m,y_m,z_m\n0,0,0,0\n1,0,0,0\n";
    const Finished unwatched = run({HOST_SIM, "play", record});
    EXPECT_EQ(unwatched.status, 1);
    EXPECT_THAT(unwatched.output, HasSubstr("--view"));
    const Finished of_what = run({HOST_SIM, "play", record, "--view", "127.0.0.1:0"});
    EXPECT_EQ(of_what.status, 1);
    EXPECT_THAT(of_what.output, HasSubstr("--scene"));
    const Finished control = run({HOST_SIM, "run", "cloth-drop", "--view-control"});
    EXPECT_EQ(control.status, 1);
    EXPECT_THAT(control.output, HasSubstr("--view"));
}

}  // namespace
}  // namespace haptic::test
