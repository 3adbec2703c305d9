// What outlives rt-core on a real device: the guard, the black box and `rt-core zero`, on boards at a pseudo terminal,
// which record what reaches the motors.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <random>
#include <span>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "haptic/clock.hpp"
#include "haptic/csv.hpp"
#include "haptic/types.hpp"
#include "process.hpp"
#include "unique_session.hpp"

namespace haptic::test {
namespace {

using namespace std::chrono_literals;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

// The claim is 20 ms. On a shared machine the pseudo terminal's kernel thread may wait for longer than that, and a loop
// of 1 kHz may stand still by itself. So a trial may be repeated; a guard that does not work is late in each.
constexpr double kZeroWithin = 0.020;
constexpr int kTrials = 8;

// What every run has: boards whose grip a hand holds exactly cannot prove their wiring.
constexpr std::array kAlways = {
    "device.geometry=SpidarG6X4", "safety.tension_ramp_s=0.1", "safety.calibration_hold_s=0.05",
    "safety.prove=never",         "safety.late_share=1",       "safety.exchange_share=1"};
// One of 1 kHz with the default times.
constexpr std::array kExact = {"safety.encoder_age_s=0.2"};
// A loop that a busy machine can sustain, for what does not depend on times.
constexpr std::array kPatient = {"loop.period_s=0.02",  "loop.warm_up_ticks=1", "device.uart_timeout_s=0.04",
                                 "safety.watchdog_s=1", "safety.guard_s=1",     "safety.encoder_age_s=2"};

double now_s() {
    return haptic::seconds(monotonic_now_ns());
}

class Guarded : public testing::Test {
  protected:
    void SetUp() override {
        server = std::make_unique<Process>(std::vector<std::string>{FIRMWARE_HOST, "serve", "--tty", line, "--geometry",
                                                                    "SpidarG6X4", "--record", motors},
                                           folder / "server.log");
        ASSERT_TRUE(server->wait_for_text("tty:", 10s)) << server->output();
        start(kPatient);
        if (!core->wait_for_text("rt-core info: running", 20s)) {
            if (core->output().find("not driven without real-time privileges") != std::string::npos) {
                GTEST_SKIP() << "a real device is not driven without real-time privileges";
            }
            FAIL() << core->output();
        }
        EXPECT_TRUE(pull_at(now_s()));
    }
    void TearDown() override {
        core.reset();
        // Segments that a killed process has left; a later run of the session would remove them.
        for (const std::string& name : segments_of(session)) {
            EXPECT_THAT(name, Not(HasSubstr("blackbox"))) << "the guard has saved it";
            std::filesystem::remove("/dev/shm/" + name);
        }
    }
    void start(std::span<const char* const> settings, const std::vector<std::string>& more = {}) {
        core.reset();
        std::vector<std::string> command = {RT_CORE,    "run",         "--session", session,
                                            "--device", "tty:" + line, "--report",  report_file};
        for (const std::span<const char* const> part : {std::span<const char* const>(kAlways), settings}) {
            for (const char* const setting : part) {
                command.insert(command.end(), {"--set", setting});
            }
        }
        command.insert(command.end(), more.begin(), more.end());
        core = std::make_unique<Process>(command, folder / "core.log");
    }
    /// A loop of 1 kHz with the default times that pulls; false if this machine did not let it run.
    bool start_exactly() {
        std::filesystem::remove(killed_file);
        start(kExact);
        return core->wait_for_text("rt-core info: running", 20s);
    }
    /// Each recorded time with whether a motor pulls from then on.
    [[nodiscard]] std::vector<std::pair<double, bool>> rows() const {
        std::ifstream file(motors);
        std::string text;
        std::getline(file, text);
        std::vector<std::pair<double, bool>> found;
        while (std::getline(file, text) && std::count(text.begin(), text.end(), ',') == 8) {
            const std::size_t comma = text.find(',');
            found.emplace_back(std::stod(text.substr(0, comma)), text.substr(comma) != ",0,0,0,0,0,0,0,0");
        }
        return found;
    }
    [[nodiscard]] bool pull_at(double time_s) const {
        bool pull = false;
        for (const auto& [at_s, pulls] : rows()) {
            pull = at_s <= time_s ? pulls : pull;
        }
        return pull;
    }
    /// Waits until the motors are at zero; false if they are not within 10 s.
    [[nodiscard]] bool zero_soon() const {
        for (int i = 0; i < 1000 && pull_at(now_s()); ++i) {
            std::this_thread::sleep_for(10ms);
        }
        return !pull_at(now_s());
    }
    /// The guard of the run: its child.
    [[nodiscard]] pid_t guard() const {
        std::ifstream file("/proc/" + std::to_string(core->pid()) + "/task/" + std::to_string(core->pid()) +
                           "/children");
        pid_t child = 0;
        return file >> child ? child : -1;
    }
    [[nodiscard]] nlohmann::json report() const { return nlohmann::json::parse(std::ifstream(report_file)); }
    /// Hits a loop at a random time until the motors are at zero in time, with a new loop for each trial. Skips the
    /// test if this machine is too busy to run one.
    template <class Hit, class Check>
    void expect_zero_in_time(Hit hit, Check check) {
        core->signal(SIGTERM);
        EXPECT_EQ(core->wait_for(10s), 0) << core->output();
        std::mt19937 random(static_cast<unsigned>(getpid()));
        int hits = 0;
        for (int trial = 0; trial < kTrials; ++trial) {
            if (!start_exactly()) {
                continue;
            }
            std::this_thread::sleep_for(std::chrono::milliseconds(random() % 300));
            const double at_s = now_s();
            if (!pull_at(at_s)) {
                continue;
            }
            hit();
            ++hits;
            EXPECT_TRUE(zero_soon()) << core->output();
            const bool in_time = !pull_at(at_s + kZeroWithin);
            check();
            if (in_time) {
                return;
            }
        }
        if (hits == 0) {
            GTEST_SKIP() << "this machine is too busy for a loop of 1 kHz";
        }
        ADD_FAILURE() << "late in each of " << hits << " trials";
    }
    /// The end of a run that was killed: its last ticks are saved.
    void expect_black_box() {
        for (int i = 0; i < 1000 && core->output().find("guard: the last ticks are in") == std::string::npos; ++i) {
            std::this_thread::sleep_for(10ms);
        }
        EXPECT_THAT(core->output(), HasSubstr("guard: the last ticks are in " + killed_file));
        const CsvTable ticks = CsvTable::load(killed_file);
        EXPECT_GT(ticks.rows(), 5u);
        EXPECT_NE(ticks.column("t0_n").back(), 0.0) << "the last tick still pulled";
    }

    ScratchFolder folder;
    std::string session = unique_session();
    std::string line = folder / "line";
    std::string motors = folder / "motors.csv";
    std::string report_file = folder / "run.json";
    std::string killed_file = folder / "run.killed.csv";
    std::unique_ptr<Process> server;
    std::unique_ptr<Process> core;
};

TEST_F(Guarded, MotorsAreAtZeroWithin20MillisecondsOfSigkill) {
    expect_zero_in_time([this] { core->signal(SIGKILL); },
                        [this] {
                            EXPECT_EQ(core->wait_for(10s), 128 + SIGKILL);
                            expect_black_box();
                        });
}

TEST_F(Guarded, MotorsAreAtZeroWithin20MillisecondsOfSigstopAndStaySoAfterSigcont) {
    expect_zero_in_time([this] { core->signal(SIGSTOP); },
                        [this] {
                            const double zero_s = now_s();
                            core->signal(SIGCONT);
                            EXPECT_EQ(core->wait_for(10s), 3) << core->output();
                            EXPECT_THAT(core->output(), HasSubstr("FAULT: guard"));
                            const nlohmann::json safety = report().at("safety");
                            EXPECT_EQ(safety.at("faults"), nlohmann::json({"guard"}));
                            EXPECT_GT(safety.at("supervision").at("frozen_ms"), 12.0);
                            // One command that was on its way may come through, and is overridden.
                            const auto all = rows();
                            EXPECT_LE(
                                std::count_if(all.begin(), all.end(),
                                              [zero_s](const auto& row) { return row.second && row.first > zero_s; }),
                                1)
                                << "the loop continued to pull";
                            EXPECT_FALSE(all.back().second);
                        });
}

TEST_F(Guarded, MotorsAreAtZeroWithin20MillisecondsOfABusErrorInTheTick) {
    const std::string segment = "/dev/shm/haptic-" + std::to_string(geteuid()) + "-" + session + "-contact";
    expect_zero_in_time([&] { ASSERT_EQ(truncate(segment.c_str(), 0), 0); },
                        [this] {
                            EXPECT_EQ(core->wait_for(10s), 128 + SIGBUS);
                            expect_black_box();
                        });
}

TEST_F(Guarded, IsNotStoppedByWhatStopsTheLoopAndLeavesWithIt) {
    const pid_t process = guard();
    ASSERT_GT(process, 0);
    EXPECT_NE(getsid(process), getsid(core->pid()));
    for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGTSTP}) {
        ASSERT_EQ(kill(process, signal), 0);
    }
    std::this_thread::sleep_for(300ms);
    EXPECT_EQ(guard(), process);
    core->signal(SIGTERM);
    EXPECT_EQ(core->wait_for(10s), 0) << core->output();
    EXPECT_NE(kill(process, 0), 0) << "it has left";
    EXPECT_FALSE(std::filesystem::exists(killed_file));
    const nlohmann::json supervision = report().at("safety").at("supervision");
    EXPECT_EQ(supervision.at("lost"), "");
    EXPECT_EQ(supervision.at("frozen_ms"), 0.0);
    EXPECT_EQ(supervision.at("guard").at("silence_ms"), 1000.0);
    EXPECT_GE(supervision.at("guard").at("priority"), 80) << "where the loop has real time, so has the guard";
}

TEST_F(Guarded, ThatIsKilledStopsTheRunWithItsName) {
    ASSERT_EQ(kill(guard(), SIGKILL), 0);
    EXPECT_EQ(core->wait_for(10s), 3) << core->output();
    EXPECT_THAT(core->output(), HasSubstr("lost a supervisor of the loop: guard"));
    EXPECT_EQ(report().at("safety").at("supervision").at("lost"), "guard");
    EXPECT_EQ(report().at("safety").at("stop"), "supervision");
    EXPECT_EQ(report().at("safety").at("faults"), nlohmann::json({"stop", "guard"}));
    EXPECT_TRUE(zero_soon()) << "an orderly stop, with its fade";
}

TEST_F(Guarded, ZeroCommandSetsMotorsToZeroThatNobodyGuardsAnyMore) {
    // The loop and its guard die in the same instant, as by a SIGKILL to the whole service.
    const pid_t process = guard();
    ASSERT_EQ(kill(process, SIGSTOP), 0);
    core->signal(SIGKILL);
    ASSERT_EQ(kill(process, SIGKILL), 0);
    EXPECT_EQ(core->wait_for(10s), 128 + SIGKILL);
    std::this_thread::sleep_for(100ms);
    ASSERT_TRUE(pull_at(now_s())) << "nobody is left to send zeros";
    const Finished zero = run({RT_CORE, "zero", "--device", "tty:" + line, "--set", "device.geometry=SpidarG6X4",
                               "--reconnect", "--report", folder / "unused.json"});
    EXPECT_EQ(zero.status, 0) << zero.output;
    EXPECT_THAT(zero.output, HasSubstr("at zero"));
    EXPECT_FALSE(pull_at(now_s()));
    // The black box has waited in memory for the next run of the session, or for the command.
    const Finished saved = run({RT_CORE, "black-box", "--session", session});
    EXPECT_EQ(saved.status, 0) << saved.output;
    EXPECT_THAT(saved.output, HasSubstr(killed_file));
    EXPECT_GT(CsvTable::load(killed_file).rows(), 5u);
    EXPECT_EQ(run({RT_CORE, "black-box", "--session", session}).status, 2) << "it is saved once";
}

TEST_F(Guarded, GuardsADeviceThatWasLostAndOpenedAgain) {
    core->signal(SIGTERM);
    EXPECT_EQ(core->wait_for(10s), 0) << core->output();
    start(kPatient, {"--reconnect"});
    ASSERT_TRUE(core->wait_for_text("rt-core info: running", 20s)) << core->output();
    server->signal(SIGKILL);
    ASSERT_TRUE(core->wait_for_text("not yet", 20s)) << core->output();
    server = std::make_unique<Process>(
        std::vector<std::string>{FIRMWARE_HOST, "serve", "--tty", line, "--geometry", "SpidarG6X4", "--record", motors},
        folder / "second.log");
    ASSERT_TRUE(core->wait_for_text("is back", 20s)) << core->output();
    ASSERT_TRUE(core->wait_for_text("disarmed until a person arms", 20s)) << core->output();
    ASSERT_EQ(run({RT_CORE, "arm", "--session", session}).status, 0);
    for (int i = 0; i < 2000 && !pull_at(now_s()); ++i) {
        std::this_thread::sleep_for(10ms);
    }
    ASSERT_TRUE(pull_at(now_s())) << core->output();
    core->signal(SIGKILL);
    EXPECT_TRUE(zero_soon());
    EXPECT_EQ(core->wait_for(10s), 128 + SIGKILL);
    expect_black_box();
}

TEST(KilledRun, OfTheEmulatedDeviceLeavesItsLastTicksToTheNextRun) {
    const ScratchFolder folder;
    const std::string session = unique_session();
    const std::string report = folder / "run.json";
    {
        Process core({RT_CORE, "run", "--session", session, "--report", report}, folder / "core.log");
        ASSERT_TRUE(core.wait_for_text("rt-core info: running", 20s)) << core.output();
        core.signal(SIGKILL);
        EXPECT_EQ(core.wait_for(10s), 128 + SIGKILL);
    }
    EXPECT_FALSE(std::filesystem::exists(folder / "run.killed.csv"));
    const Finished next = run({RT_CORE, "run", "--session", session, "--duration", "0.1"});
    EXPECT_EQ(next.status, 0) << next.output;
    EXPECT_THAT(next.output, HasSubstr("was killed; its last ticks are in"));
    EXPECT_GT(CsvTable::load(folder / "run.killed.csv").rows(), 100u);
    EXPECT_THAT(segments_of(session), testing::IsEmpty());
}

TEST(GuardCommand, IsNotStartedByHand) {
    const Finished none = run({RT_CORE, "guard", "--socket", "0"});
    EXPECT_EQ(none.status, 2);
    EXPECT_THAT(none.output, HasSubstr("started by rt-core run"));
}

}  // namespace
}  // namespace haptic::test
