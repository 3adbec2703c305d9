// `rt-core measure` as users run it: output files, text and refusals.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <pthread.h>
#include <sched.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "process.hpp"
#include "unique_session.hpp"

namespace haptic::test {
namespace {

using testing::AllOf;
using testing::AnyOf;
using testing::ContainsRegex;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::StartsWith;

/// A thread of higher priority than the loop, which takes a processor for 60 ms every half a second.
class Hog {
  public:
    explicit Hog(std::size_t processor)
        : thread_([this, processor] {
              pthread_setname_np(pthread_self(), "test-hog");
              cpu_set_t only;
              CPU_ZERO(&only);
              CPU_SET(processor, &only);
              const sched_param urgent{.sched_priority = 90};
              granted_ = pthread_setaffinity_np(pthread_self(), sizeof only, &only) == 0 &&
                         pthread_setschedparam(pthread_self(), SCHED_FIFO, &urgent) == 0;
              while (!end_) {
                  std::this_thread::sleep_for(std::chrono::milliseconds(440));
                  const auto until = std::chrono::steady_clock::now() + std::chrono::milliseconds(60);
                  while (!end_ && granted_ && std::chrono::steady_clock::now() < until) {
                  }
              }
          }) {}
    Hog(const Hog&) = delete;
    Hog& operator=(const Hog&) = delete;
    ~Hog() {
        end_ = true;
        thread_.join();
    }

  private:
    std::atomic<bool> granted_{false};
    std::atomic<bool> end_{false};
    std::thread thread_;
};

class Measure : public testing::Test {
  protected:
    [[nodiscard]] Finished measure(const std::vector<std::string>& arguments) const {
        // Scheduling delays of the test machine must not cause a fault.
        std::vector<std::string> command = {RT_CORE,      "measure", "--session", session,
                                            "--duration", "1.5",     "--set",     "safety.late_share=1"};
        command.insert(command.end(), arguments.begin(), arguments.end());
        return run(command);
    }
    [[nodiscard]] nlohmann::json report() const { return nlohmann::json::parse(std::ifstream(folder / "m.json")); }
    void TearDown() override { EXPECT_THAT(segments_of(session), IsEmpty()); }

    ScratchFolder folder;
    std::string session = unique_session();
};

TEST_F(Measure, WritesTextReportAndPageOfOneRun) {
    const Finished finished = measure({"--report", folder / "m.json", "--html", folder / "m.html"});
    ASSERT_EQ(finished.status, 0) << finished.output;
    EXPECT_THAT(finished.output,
                AllOf(HasSubstr("wake-up"), HasSubstr("motion to force"), ContainsRegex("deadlines? missed")));
    const nlohmann::json written = report();
    const nlohmann::json& latencies = written.at("measure").at("latency_us");
    EXPECT_EQ(latencies.at("compute").at("count"), written.at("ticks"));
    EXPECT_EQ(latencies.at("motion_to_force").at("count"), written.at("ticks"));
    EXPECT_LE(latencies.at("motion_to_force").at("p50"), latencies.at("compute").at("p50"));
    EXPECT_FALSE(written.at("measure").at("worst_ticks").empty());
    std::ostringstream page;
    page << std::ifstream(folder / "m.html").rdbuf();
    EXPECT_THAT(page.str(), AllOf(AnyOf(HasSubstr("<svg "), HasSubstr("gnuplot is missing")), HasSubstr("</html>")));

    const Finished again = run({RT_CORE, "measure", "--from", folder / "m.json"});
    EXPECT_EQ(again.status, 0);
    EXPECT_THAT(finished.output, HasSubstr(again.output)) << "a report says the same later";
    const Finished compared = run({RT_CORE, "measure", "--compare", folder / "m.json", folder / "m.json"});
    EXPECT_EQ(compared.status, 0);
    EXPECT_THAT(compared.output, HasSubstr("second / first            1.00"));
}

TEST_F(Measure, AlternatesWithCyclictest) {
    if (access("/usr/bin/cyclictest", X_OK) != 0) {
        GTEST_SKIP() << "there is no cyclictest: package rt-tests";
    }
    if (geteuid() != 0) {
        GTEST_SKIP() << "cyclictest asks for real-time priority also where rt-core goes on without";
    }
    const Finished finished = measure({"--cyclictest", "--alternate", "1", "--report", folder / "m.json"});
    ASSERT_EQ(finished.status, 0) << finished.output;
    const nlohmann::json cyclictest = report().at("measure").at("cyclictest");
    EXPECT_GT(cyclictest.at("wakeup_us").at("count"), 0);
    EXPECT_TRUE(cyclictest.at("ratio").at("p50").is_number());
    EXPECT_THAT(cyclictest.at("command").get<std::string>(), HasSubstr("--interval=1000"));
}

TEST_F(Measure, RunsThePeerToolsThatAreThereAndSaysWhatIsMissing) {
    // None is there.
    const Finished finished =
        run({"/usr/bin/env", "PATH=" + (folder / "nowhere").string(), RT_CORE, "measure", "--session", session,
             "--duration", "1.5", "--set", "safety.late_share=1", "--peers", "all", "--report", folder / "m.json"});
    ASSERT_EQ(finished.status, 0) << finished.output;
    for (const char* name : {"cyclictest", "timerlat", "osnoise"}) {
        const std::string missing = report().at("measure").at(name).at("missing");
        EXPECT_THAT(missing, HasSubstr("sudo apt install")) << name;
        EXPECT_THAT(finished.output, HasSubstr(std::string(name) + " was not run: " + missing));
    }
    EXPECT_THAT(report().at("measure").at("latency_us").at("wakeup").at("count"), report().at("ticks"));
}

TEST_F(Measure, KeepsWhatAToolFoundUntilItFailed) {
    // In its first turn it measures, in its second it fails.
    std::filesystem::create_directory(folder / "bin");
    const std::filesystem::path tool = folder / "bin" / "cyclictest";
    std::ofstream(tool)
        << "#!/bin/sh\n"
           "for word; do case $word in --json=*) file=${word#--json=} ;; esac; done\n"
           "[ ! -e \"$0.ran\" ] || { echo no more; exit 3; }\n"
           ": >\"$0.ran\"\n"
           "echo '{\"thread\": {\"0\": {\"histogram\": {\"5000\": 10}, \"cycles\": 10, \"max\": 5000}}}' >\"$file\"\n";
    std::filesystem::permissions(tool, std::filesystem::perms::owner_all);
    const Finished finished = run({"/usr/bin/env", "PATH=" + (folder / "bin").string() + ":/usr/bin:/bin", RT_CORE,
                                   "measure", "--session", session, "--duration", "3.5", "--set", "safety.late_share=1",
                                   "--cyclictest", "--alternate", "1", "--report", folder / "m.json"});
    ASSERT_EQ(finished.status, 0) << finished.output;
    const nlohmann::json cyclictest = report().at("measure").at("cyclictest");
    EXPECT_EQ(cyclictest.at("wakeup_us").at("count"), 10);
    EXPECT_THAT(cyclictest.at("failure").get<std::string>(), HasSubstr("failed with status 3: no more"));
    EXPECT_THAT(finished.output, HasSubstr("cyclictest was not run again: "));
    EXPECT_EQ(report().at("measure").at("latency_us").at("wakeup").at("count"), report().at("ticks"));
}

TEST_F(Measure, BreaksAtALateTickAndNamesTheThreadThatCausedIt) {
    // The kernel's tracer, in a mount namespace of the test's own. Not every kernel has one.
    const std::vector<std::string> with_tracer = {
        "/usr/bin/unshare",
        "--mount",
        "/bin/sh",
        "-c",
        "{ mountpoint -q /sys/kernel/tracing || mount -t tracefs nodev /sys/kernel/tracing; } && exec \"$@\"",
        "sh"};
    std::vector<std::string> look = with_tracer;
    look.insert(look.end(), {"test", "-w", "/sys/kernel/tracing/instances"});
    if (const Finished looked = run(look); looked.status != 0) {
        GTEST_SKIP() << "there is no tracefs for this user: " << looked.output;
    }
    const std::size_t processor = std::thread::hardware_concurrency() - 1;
    const Hog hog(processor);
    std::vector<std::string> command = with_tracer;
    // A stalled test machine is late by some milliseconds; the hog is by up to 60. The trace breaks once.
    command.insert(command.end(), {RT_CORE,         "measure",
                                   "--session",     session,
                                   "--duration",    "20",
                                   "--set",         "safety.late_share=1",
                                   "--set",         "safety.encoder_age_s=0.5",
                                   "--set",         "safety.watchdog_s=1",
                                   "--set",         "loop.cpu=" + std::to_string(processor),
                                   "--break-above", "30000",
                                   "--trace",       folder / "late.txt",
                                   "--report",      folder / "m.json"});
    const Finished finished = run(command);
    ASSERT_TRUE(std::filesystem::exists(folder / "m.json")) << finished.output;
    const nlohmann::json written = report();
    const nlohmann::json& broken = written.at("measure").at("break");
    ASSERT_TRUE(broken.is_object()) << finished.output;
    EXPECT_EQ(broken.at("cause"), "higher_priority") << finished.output;
    EXPECT_THAT(broken.at("thread").get<std::string>(), StartsWith("test-hog-"));
    EXPECT_GT(broken.at("late_us"), 30000.0);
    EXPECT_LT(written.at("duration_s"), 10.0) << "the tick ends the run";
    EXPECT_THAT(finished.output, AllOf(HasSubstr("stopping: late tick"), HasSubstr("test-hog")));
    std::ostringstream trace;
    trace << std::ifstream(folder / "late.txt").rdbuf();
    EXPECT_THAT(trace.str(), HasSubstr("test-hog-"));
}

TEST_F(Measure, NamesThePackageOfAProgramThatIsMissing) {
    const std::filesystem::path nowhere = folder / "nowhere";
    for (const auto& [argument, value, package] : {std::tuple("--load", "stress-ng", "apt install stress-ng"),
                                                   {"--cyclictest", "", "apt install rt-tests"},
                                                   {"--peers", "timerlat", "apt install rtla"}}) {
        std::vector<std::string> command = {"/usr/bin/env", "PATH=" + nowhere.string(), RT_CORE, "measure", argument};
        if (*value != '\0') {
            command.emplace_back(value);
        }
        const Finished finished = run(command);
        EXPECT_EQ(finished.status, 2) << finished.output;
        EXPECT_THAT(finished.output, HasSubstr(package));
    }
}

TEST_F(Measure, RefusesWhatItCannotMeasureOrRead) {
    Finished finished = measure({"--device", "replay:x.csv"});
    EXPECT_EQ(finished.status, 2);
    EXPECT_THAT(finished.output, HasSubstr("cannot measure latency"));
    finished = measure({"--load", "make"});
    EXPECT_EQ(finished.status, 2);
    EXPECT_THAT(finished.output, HasSubstr("must be none, stress-ng"));
    finished = measure({"--trace", folder / "t.txt"});
    EXPECT_EQ(finished.status, 64);
    EXPECT_THAT(finished.output, HasSubstr("--break-above"));
    finished = measure({"--alternate", "2"});
    EXPECT_EQ(finished.status, 64);
    EXPECT_THAT(finished.output, AllOf(HasSubstr("--alternate"), HasSubstr("--peers")));
    finished = measure({"--peers", "cyclictest,latencytop"});
    EXPECT_EQ(finished.status, 2);
    EXPECT_THAT(finished.output, AllOf(HasSubstr("latencytop"), HasSubstr("all, cyclictest, timerlat, osnoise")));
    std::ofstream(folder / "other.json") << "{\"ticks\": 3}";
    finished = run({RT_CORE, "measure", "--from", folder / "other.json"});
    EXPECT_EQ(finished.status, 1);
    EXPECT_THAT(finished.output, AllOf(HasSubstr("other.json"), HasSubstr("not a measurement report")));
    finished = run({RT_CORE, "measure", "--compare", folder / "other.json", folder / "missing.json"});
    EXPECT_EQ(finished.status, 1);
}

}  // namespace
}  // namespace haptic::test
