// The rt-core executable on the emulated device: exit statuses and messages.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <csignal>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <vector>

#include "haptic/csv.hpp"
#include "haptic/ring.hpp"
#include "process.hpp"
#include "unique_session.hpp"

namespace haptic::test {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::IsSubsetOf;

class RtCore : public testing::Test {
  protected:
    [[nodiscard]] std::vector<std::string> run_for(const std::string& duration_s) const {
        return {RT_CORE, "run", "--session", session, "--duration", duration_s};
    }
    void TearDown() override { EXPECT_THAT(segments_of(session), IsEmpty()); }

    ScratchFolder folder;
    std::string session = unique_session();
};

TEST_F(RtCore, EndsWithTheFaultsNameAndTheLastTicksWhenAnEncoderJumps) {
    const std::string hand = folder / "hand.csv";
    // Jumps of 0.1 m in 1 ms, there and back: a tick that comes late sees an ordinary motion, but not each time.
    std::ofstream(hand) << "time_s,x_m,y_m,z_m\n0,0,0,0\n0.2,0,0,0\n0.201,0.1,0,0\n0.7,0.1,0,0\n0.701,0,0,0\n"
                           "1.2,0,0,0\n1.201,0.1,0,0\n1.7,0.1,0,0\n1.701,0,0,0\n9,0,0,0\n";
    std::vector<std::string> command = run_for("20");
    for (const std::string& argument :
         {std::string("--hand"), hand, std::string("--report"), std::string(folder / "run.json")}) {
        command.push_back(argument);
    }
    const Finished finished = run(command);
    EXPECT_EQ(finished.status, 3);
    EXPECT_THAT(finished.output, AllOf(HasSubstr("FAULT: encoder_jump"), HasSubstr("run.fault.csv")));
    const nlohmann::json report = nlohmann::json::parse(std::ifstream(folder / "run.json"));
    // Where a busy machine delays the next tick, it also finds that the lengths no longer agree.
    EXPECT_THAT(report.at("safety").at("faults").get<std::vector<std::string>>(),
                AllOf(Contains("encoder_jump"), IsSubsetOf({"encoder_jump", "residual"})));
    EXPECT_EQ(report.at("safety").at("state"), "disarmed");
    const CsvTable last_ticks = CsvTable::load(folder / "run.fault.csv");
    EXPECT_GT(last_ticks.rows(), 500u);
    EXPECT_EQ(last_ticks.column("t0_n").back(), 0.0);
}

TEST_F(RtCore, RefusesADeviceThatItCannotDrive) {
    for (const char* device : {"usb"}) {
        std::vector<std::string> command = run_for("1");
        command.insert(command.end(), {"--device", device, "--set", "device.usb_path=nowhere"});
        const Finished finished = run(command);
        EXPECT_EQ(finished.status, 2);
        EXPECT_THAT(finished.output, AllOf(HasSubstr(device), testing::AnyOf(HasSubstr("emulated"),
                                                                             HasSubstr("no USB device 0cec:0205"))));
    }
}

TEST_F(RtCore, RefusesAHandThatNoDeviceWouldFollow) {
    std::ofstream(folder / "hand.csv") << "time_s,x_m,y_m,z_m\n0,0,0,0\n";
    std::vector<std::string> command = run_for("0.1");
    command.insert(command.end(), {"--hand", folder / "hand.csv", "--device", "usb"});
    Finished finished = run(command);
    EXPECT_EQ(finished.status, 2);
    EXPECT_THAT(finished.output, HasSubstr("--hand: only the emulated device follows a recorded hand"));

    // A pipe without a writer would be waited for with the stop signals blocked.
    const std::string pipe = folder / "pipe";
    ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
    command = run_for("0.1");
    command.insert(command.end(), {"--hand", pipe});
    finished = run(command);
    EXPECT_EQ(finished.status, 2);
    EXPECT_THAT(finished.output, HasSubstr("pipe: is a pipe, but is read more than once"));
}

TEST_F(RtCore, RecoversALostDeviceWithReconnectWhenAPersonArms) {
    std::vector<std::string> command = run_for("3");
    for (const std::string& argument :
         {std::string("--fault"), std::string("unplug@0.2/0.5"), std::string("--set"),
          std::string("safety.tension_ramp_s=0.1"), std::string("--report"), std::string(folder / "run.json")}) {
        command.push_back(argument);
    }
    const Finished ended = run(command);
    EXPECT_EQ(ended.status, 3) << ended.output;
    EXPECT_THAT(ended.output, HasSubstr("FAULT: exchange (disconnected)"));
    EXPECT_THAT(nlohmann::json::parse(std::ifstream(folder / "run.json")).at("interruptions"), IsEmpty());

    command.emplace_back("--reconnect");
    Process process(command, folder / "log.txt");
    ASSERT_TRUE(process.wait_for_text("disarmed until a person arms", std::chrono::seconds(20))) << process.output();
    EXPECT_EQ(run({RT_CORE, "arm", "--session", session}).status, 0);
    EXPECT_EQ(process.wait_for(std::chrono::seconds(30)), 0) << process.output();
    EXPECT_THAT(process.output(), HasSubstr("interrupted at"));
    const nlohmann::json report = nlohmann::json::parse(std::ifstream(folder / "run.json"));
    ASSERT_EQ(report.at("interruptions").size(), 1U);
    EXPECT_EQ(report.at("interruptions").at(0).at("cause"), "disconnected");
    EXPECT_EQ(report.at("safety").at("faults"), nlohmann::json({"stop"}));
}

TEST_F(RtCore, EndsWhenASignalComesAsTheLoopEndsByTheLossOfTheDevice) {
    Process process({RT_CORE, "run", "--session", session, "--fault", "unplug@0.2/3600", "--reconnect", "--set",
                     "safety.tension_ramp_s=0.1", "--report", folder / "run.json"},
                    folder / "log.txt");
    ASSERT_TRUE(process.wait_for_text("running", std::chrono::seconds(20))) << process.output();
    // The last tick reports the disarmed state; what supervises the loop looks for its end every 20 ms.
    RingReader<DeviceState> states(session);
    DeviceState state{};
    while (!process.wait_for(std::chrono::milliseconds(0)) &&
           !(states.read_newest(state) && state.safety_state == HAPTIC_DISARMED && state.faults != 0)) {
        std::this_thread::sleep_for(std::chrono::microseconds(100));
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
    process.signal(SIGTERM);
    EXPECT_EQ(process.wait_for(std::chrono::seconds(10)), 3) << process.output();
    EXPECT_THAT(process.output(), HasSubstr("FAULT: exchange (disconnected)"));
}

/// Makes a pipe that is full, as when the program that reads it has stopped. Returns its reader; -1: failed.
int full_pipe(const std::string& pipe) {
    if (mkfifo(pipe.c_str(), 0600) != 0) {
        return -1;
    }
    const int reader = open(pipe.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
    const int writer = open(pipe.c_str(), O_WRONLY | O_NONBLOCK | O_CLOEXEC);
    const std::string text(4096, '-');
    while (write(writer, text.data(), text.size()) > 0) {
    }
    close(writer);
    return writer < 0 ? -1 : reader;
}

TEST_F(RtCore, StopsThoughNobodyReadsItsOutput) {
    const std::string pipe = folder / "log";
    const int reader = full_pipe(pipe);
    ASSERT_GE(reader, 0);
    Process process(
        {"/bin/sh", "-c",
         std::string("exec ") + RT_CORE + " run --session " + session + " --set safety.tension_ramp_s=0.1 --report " +
             (folder / "run.json").string() + " >" + pipe + " 2>&1"},
        folder / "unused.txt");
    RingReader<DeviceState> states(session);
    DeviceState state{};
    const auto running = [&] { return states.read_newest(state) && state.safety_state == HAPTIC_RUNNING; };
    for (int i = 0; i < 2000 && !running(); ++i) {
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    EXPECT_EQ(state.safety_state, HAPTIC_RUNNING);
    process.signal(SIGTERM);
    EXPECT_EQ(process.wait_for(std::chrono::seconds(10)), 1) << "its output is missing";
    const nlohmann::json report = nlohmann::json::parse(std::ifstream(folder / "run.json"));
    EXPECT_EQ(report.at("safety").at("state"), "disarmed");
    EXPECT_EQ(report.at("safety").at("stop"), "signal");
    close(reader);
}

TEST_F(RtCore, KeepsTheOrderOfItsOutputForAReaderThatIsLate) {
    const std::string pipe = folder / "log";
    const int reader = full_pipe(pipe);
    ASSERT_GE(reader, 0);
    Process process(
        {"/bin/sh", "-c",
         std::string("exec ") + RT_CORE + " run --duration 0.5 --session " + session + " >" + pipe + " 2>&1"},
        folder / "unused.txt");
    // All that is left to do is to wait for the reader.
    EXPECT_FALSE(process.wait_for(std::chrono::seconds(4)));
    std::string output;
    std::string text(4096, '-');
    for (int i = 0; i < 1000 && !process.wait_for(std::chrono::milliseconds(10));) {
        const ssize_t count = read(reader, text.data(), text.size());
        output.append(text, 0, count > 0 ? static_cast<std::size_t>(count) : 0);
        i += count > 0 ? 0 : 1;
    }
    for (ssize_t count = 0; (count = read(reader, text.data(), text.size())) > 0;) {
        output.append(text, 0, static_cast<std::size_t>(count));
    }
    EXPECT_EQ(process.wait_for(std::chrono::seconds(1)), 0);
    output.erase(0, output.find_first_not_of('-'));
    EXPECT_THAT(output, testing::StartsWith("rt-core info: "));
    EXPECT_LT(output.find("stopping: end of the run"), output.find("ticks"));
    EXPECT_NE(output.find("ticks"), std::string::npos) << output;
    close(reader);
}

TEST_F(RtCore, FailsOnlyIfItsOutputCannotBeWritten) {
    const auto status = [&](const std::string& reader) {
        (void)run({"/bin/sh", "-c",
                   std::string("{ ") + RT_CORE + " run --duration 0.1 --session " + session + "; echo $? >" +
                       (folder / "status").string() + "; } " + reader});
        int number = -1;
        std::ifstream(folder / "status") >> number;
        return number;
    };
    EXPECT_EQ(status("| true"), 0) << "a reader that has seen enough is no error";
    EXPECT_EQ(status(">/dev/full"), 1);
}

TEST_F(RtCore, RefusesARecordingToAPipeThatNobodyReads) {
    const std::string pipe = folder / "run.csv";
    ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
    std::vector<std::string> command = run_for("0.1");
    command.insert(command.end(), {"--record", pipe});
    const Finished finished = run(command);
    EXPECT_EQ(finished.status, 1);
    EXPECT_THAT(finished.output, HasSubstr("run.csv: nobody reads this pipe; start the program that reads it first"));
}

TEST_F(RtCore, KeepsTheBlackBoxOfAnEarlierRun) {
    std::vector<std::string> command = run_for("1");
    command.insert(command.end(), {"--fault", "unplug@0.1", "--report", folder / "run.json"});
    ASSERT_EQ(run(command).status, 3);
    const double first_ns = CsvTable::load(folder / "run.fault.csv").column("now_ns").front();
    ASSERT_EQ(run(command).status, 3);
    EXPECT_EQ(CsvTable::load(folder / "run.fault.csv.bak-1").column("now_ns").front(), first_ns);
    EXPECT_GT(CsvTable::load(folder / "run.fault.csv").column("now_ns").front(), first_ns);
}

TEST_F(RtCore, StopsThoughNobodyReadsItsRecordingAnyMore) {
    // The reader has the pipe open, and takes nothing: it is full after some 100 ticks.
    const std::string pipe = folder / "run.csv";
    ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
    const int reader = open(pipe.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
    ASSERT_GE(reader, 0);
    std::vector<std::string> command = run_for("1");
    command.insert(command.end(), {"--record", pipe, "--report", folder / "run.json"});
    Process process(command, folder / "log.txt");
    EXPECT_TRUE(process.wait_for_text("stopping: end of the run", std::chrono::seconds(20))) << process.output();
    EXPECT_TRUE(process.wait_for_text("the motors are at zero", std::chrono::seconds(10))) << process.output();
    // What is left waits for the reader, until a signal ends that.
    EXPECT_FALSE(process.wait_for(std::chrono::milliseconds(500)));
    process.signal(SIGINT);
    EXPECT_EQ(process.wait_for(std::chrono::seconds(10)), 1) << process.output();
    EXPECT_THAT(process.output(), HasSubstr("run.csv: its end is missing"));
    EXPECT_EQ(nlohmann::json::parse(std::ifstream(folder / "run.json")).at("safety").at("state"), "disarmed");
    close(reader);
}

TEST_F(RtCore, AcceptsTheConfigurationThatItPrints) {
    const Finished printed = run({RT_CORE, "--print-config"});
    ASSERT_EQ(printed.status, 0);
    const std::string config = folder / "rt-core.toml";
    std::ofstream(config) << printed.output;
    std::vector<std::string> command = run_for("0.1");
    command.insert(command.end(), {"--config", config, "--set", "loop.period_s=0.002"});
    const Finished finished = run(command);
    EXPECT_EQ(finished.status, 0) << finished.output;
    EXPECT_THAT(finished.output, HasSubstr("500 Hz"));
}

TEST_F(RtCore, ContinuesWithoutPrivilegesAndNamesTheirRemedies) {
    std::vector<std::string> command = {"/usr/bin/prlimit", "--rtprio=0", "--memlock=65536"};
    if (geteuid() == 0) {
        // User nobody, without capabilities.
        command.insert(command.begin(),
                       {"/usr/bin/setpriv", "--reuid=65534", "--regid=65534", "--clear-groups", "--inh-caps=-all"});
        if (run({"/usr/bin/setpriv", "--reuid=65534", "--regid=65534", "--clear-groups", "/usr/bin/test", "-x",
                 RT_CORE})
                .status != 0) {
            GTEST_SKIP() << "another user may not run " << RT_CORE;
        }
    }
    for (const std::string& word : run_for("0.5")) {
        command.push_back(word);
    }
    const Finished finished = run(command);
    EXPECT_EQ(finished.status, 0) << finished.output;
    EXPECT_THAT(finished.output, AllOf(HasSubstr("degraded: memory is not locked"), HasSubstr("RLIMIT_MEMLOCK"),
                                       HasSubstr("not scheduled as SCHED_FIFO 80"), HasSubstr("RLIMIT_RTPRIO"),
                                       HasSubstr("setcap"), HasSubstr("limits.d")));
}

TEST_F(RtCore, WritesARecordingUsableAsAHand) {
    const std::string first = folder / "first.csv";
    std::vector<std::string> command = run_for("1.2");
    command.insert(command.end(), {"--record", first});
    ASSERT_EQ(run(command).status, 0);
    command = run_for("0.2");
    command.insert(command.end(), {"--hand", first});
    const Finished finished = run(command);
    EXPECT_EQ(finished.status, 0) << finished.output;
    EXPECT_GT(CsvTable::load(first).rows(), 500u);
}

TEST_F(RtCore, DiagnosesTheMachineAndWritesTheFindings) {
    const std::string json = folder / "doctor.json";
    // On a machine without files nothing can be found good.
    const std::filesystem::path empty = folder / "empty";
    std::filesystem::create_directories(empty);
    const Finished finished = run({RT_CORE, "doctor", "--root", empty, "--set", "loop.cpu=2", "--json", json});
    EXPECT_EQ(finished.status, 5);
    EXPECT_THAT(finished.output, HasSubstr("fix:  sudo haptic-tune apply cmdline --cpu 2 && sudo reboot"));
    const nlohmann::json findings = nlohmann::json::parse(std::ifstream(json));
    EXPECT_EQ(findings.at("good"), false);
    EXPECT_EQ(findings.at("processor"), 2);
}

TEST_F(RtCore, FailsToDiagnoseWithInvalidSettingsOrOutput) {
    const Finished setting = run({RT_CORE, "doctor", "--set", "loop.cpu=second"});
    EXPECT_EQ(setting.status, 1);
    EXPECT_THAT(setting.output, HasSubstr("loop.cpu"));
    const Finished file = run({RT_CORE, "doctor", "--json", folder / "missing" / "doctor.json"});
    EXPECT_EQ(file.status, 64);
    EXPECT_THAT(file.output, HasSubstr("missing/doctor.json"));
    EXPECT_EQ(run({RT_CORE, "doctor", "--root", folder / "missing"}).status, 64);
}

}  // namespace
}  // namespace haptic::test
