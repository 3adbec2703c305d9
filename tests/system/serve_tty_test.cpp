// rt-core on a serial line: a pseudo terminal with emulated UART boards, served by firmware-host or, to observe the
// final DAC codes of the motors, by this test itself.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>

#include <atomic>
#include <cmath>
#include <csignal>
#include <fstream>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "emulated/uart_firmware.hpp"
#include "haptic/clock.hpp"
#include "haptic/csv.hpp"
#include "haptic/device/device_geometry_file.hpp"
#include "haptic/device/emulated_device.hpp"
#include "patient_loop.hpp"
#include "process.hpp"
#include "pty.hpp"
#include "served/tty_server.hpp"
#include "unique_session.hpp"

namespace haptic::test {
namespace {

using namespace std::chrono_literals;
using testing::AllOf;
using testing::HasSubstr;
using testing::IsEmpty;

class ServedTty : public testing::Test {
  protected:
    [[nodiscard]] std::vector<std::string> rt_core(const std::string& geometry, const std::string& path) const {
        std::vector<std::string> command = {RT_CORE,     "run",
                                            "--session", session,
                                            "--device",  "tty:" + path,
                                            "--set",     "device.geometry=" + geometry,
                                            "--set",     "safety.prove=never"};
        for (const char* const setting : kPatientLoop) {
            command.insert(command.end(), {"--set", setting});
        }
        return command;
    }
    /// Whether this machine allows a process to drive a real device.
    static bool refused(const std::string& output) {
        return output.find("not driven without real-time privileges") != std::string::npos;
    }
    void TearDown() override { EXPECT_THAT(segments_of(session), IsEmpty()); }

    ScratchFolder folder;
    std::string session = unique_session();
};

class ServedTtyOfEachGeometry : public ServedTty, public testing::WithParamInterface<const char*> {};

INSTANTIATE_TEST_SUITE_P(Boards, ServedTtyOfEachGeometry, testing::Values("SpidarG6X4", "SpidarG6X5R"),
                         [](const auto& param) { return std::string(param.param); });

TEST_P(ServedTtyOfEachGeometry, BringsTheHandsPosesToRtCore) {
    const std::string hand = folder / "hand.csv";
    // 12 mm to the side, 8 mm up and a rotation of 0.2 rad about y within half a second; then at rest.
    const double half = 0.1;
    std::ofstream(hand) << "time_s,x_m,y_m,z_m,qw,qx,qy,qz\n0,0,0,0,1,0,0,0\n0.5,0.012,0.008,-0.005," << std::cos(half)
                        << ",0," << std::sin(half) << ",0\n";
    const std::string link = folder / "line";
    Process server(
        {FIRMWARE_HOST, "serve", "--tty", link, "--geometry", GetParam(), "--hand", hand, "--hand-delay", "0.7"},
        folder / "server.log");
    ASSERT_TRUE(server.wait_for_text("tty:", 10s)) << server.output();

    std::vector<std::string> command = rt_core(GetParam(), link);
    const std::string record = folder / "run.csv";
    command.insert(command.end(), {"--record", record, "--duration", "3"});
    const Finished finished = run(command);
    if (refused(finished.output)) {
        GTEST_SKIP() << "a real device is not driven without real-time privileges";
    }
    ASSERT_EQ(finished.status, 0) << finished.output << server.output();
    EXPECT_THAT(finished.output, HasSubstr("model"));

    // The final pose, to a few encoder counts of 35 um, and the corresponding angle at 2 cm.
    const CsvTable table = CsvTable::load(record);
    double furthest = 0.0;
    std::size_t at = 0;
    for (std::size_t i = 0; i < table.rows(); ++i) {
        if (table.column("x_m")[i] > furthest) {
            furthest = table.column("x_m")[i];
            at = i;
        }
    }
    EXPECT_NEAR(furthest, 0.012, 1e-4);
    EXPECT_NEAR(table.column("y_m")[at], 0.008, 1e-4);
    EXPECT_NEAR(table.column("z_m")[at], -0.005, 1e-4);
    EXPECT_NEAR(table.column("qy")[at], std::sin(half), 5e-3);

    server.signal(SIGTERM);
    EXPECT_EQ(server.wait_for(10s), 0) << server.output();
    EXPECT_FALSE(std::filesystem::exists(std::filesystem::symlink_status(link))) << "the link goes with the server";
}

TEST_F(ServedTty, FaultsByNameWhenTheServerDies) {
    const std::string link = folder / "line";
    Process server({FIRMWARE_HOST, "serve", "--tty", link, "--geometry", "SpidarG6X4"}, folder / "server.log");
    ASSERT_TRUE(server.wait_for_text("tty:", 10s)) << server.output();
    std::vector<std::string> command = rt_core("SpidarG6X4", link);
    command.insert(command.end(), {"--report", folder / "run.json", "--duration", "60"});
    Process core(command, folder / "core.log");
    if (!core.wait_for_text("running", 20s)) {
        if (refused(core.output())) {
            GTEST_SKIP() << "a real device is not driven without real-time privileges";
        }
        FAIL() << core.output() << server.output();
    }
    server.signal(SIGKILL);
    EXPECT_EQ(core.wait_for(20s), 3) << core.output();
    EXPECT_THAT(core.output(), HasSubstr("FAULT: exchange"));
    const nlohmann::json report = nlohmann::json::parse(std::ifstream(folder / "run.json"));
    EXPECT_EQ(report.at("safety").at("faults"), nlohmann::json({"exchange"}));
    EXPECT_EQ(report.at("safety").at("state"), "disarmed");
    std::filesystem::remove(link);  // left by a killed server
}

TEST_F(ServedTty, GoesOnWhenTheServerIsBack) {
    const std::string link = folder / "line";
    const std::vector<std::string> serve = {FIRMWARE_HOST, "serve", "--tty", link, "--geometry", "SpidarG6X5R"};
    std::vector<std::string> command = rt_core("SpidarG6X5R", link);
    command.insert(command.end(), {"--reconnect", "--report", folder / "run.json"});
    std::optional<Process> server;
    server.emplace(serve, folder / "first.log");
    ASSERT_TRUE(server->wait_for_text("tty:", 10s)) << server->output();
    Process core(command, folder / "core.log");
    if (!core.wait_for_text("rt-core info: running", 20s)) {
        if (refused(core.output())) {
            GTEST_SKIP() << "a real device is not driven without real-time privileges";
        }
        FAIL() << core.output();
    }
    server->signal(SIGKILL);
    ASSERT_TRUE(core.wait_for_text("not yet", 20s)) << core.output();
    server.reset();
    server.emplace(serve, folder / "second.log");
    EXPECT_TRUE(core.wait_for_text("is back, with its motors at zero", 20s)) << core.output();
    core.signal(SIGTERM);
    EXPECT_EQ(core.wait_for(20s), 0) << core.output();
}

/// The boards in this process, so that the motors' DAC codes are visible.
class MotorsOnATty : public ServedTty {
  protected:
    MotorsOnATty() : thread_([this] { serve(); }) {}
    ~MotorsOnATty() override {
        done_ = true;
        thread_.join();
    }
    std::array<std::int16_t, kStrings> dac_codes() {
        const std::scoped_lock lock(mutex_);
        return device_.dac_codes();
    }
    static bool all_zero(const std::array<std::int16_t, kStrings>& dac_codes) {
        return dac_codes == std::array<std::int16_t, kStrings>{};
    }
    [[nodiscard]] std::string path() const { return server_.path(); }
    /// As with the cable pulled: nothing is answered, and the motors keep what they have.
    void set_silent(bool silent) { silent_ = silent; }
    /// Whether any motor is sent anything but zero within this time.
    bool any_pulls_within(std::chrono::milliseconds time) {
        for (const auto end = std::chrono::steady_clock::now() + time; std::chrono::steady_clock::now() < end;) {
            if (!all_zero(dac_codes())) {
                return true;
            }
            std::this_thread::sleep_for(2ms);
        }
        return false;
    }
    /// Lets a running rt-core lose its device and find it again. The motors are at zero then, and stay there.
    void lose_and_return(Process& core) {
        set_silent(true);
        ASSERT_TRUE(core.wait_for_text("not yet", 30s)) << core.output();
        set_silent(false);
        ASSERT_TRUE(core.wait_for_text("with its motors at zero", 30s)) << core.output();
        for (int k = 0; k < 200 && !all_zero(dac_codes()); ++k) {
            std::this_thread::sleep_for(10ms);
        }
        ASSERT_TRUE(core.wait_for_text("disarmed until a person arms the device", 20s)) << core.output();
        ASSERT_FALSE(any_pulls_within(1500ms)) << "three times the time to tension the strings\n" << core.output();
    }
    [[nodiscard]] nlohmann::json armings() const {
        return nlohmann::json::parse(std::ifstream(folder / "run.json")).at("armings");
    }

  private:
    void serve() {
        while (!done_) {
            if (silent_) {
                std::this_thread::sleep_for(5ms);
                continue;
            }
            pollfd watched{server_.descriptor(), POLLIN, 0};
            poll(&watched, 1, 5);
            const std::scoped_lock lock(mutex_);
            server_.step(monotonic_now_ns());
        }
    }

    std::mutex mutex_;
    device::EmulatedDevice device_{{.geometry = device::built_in_geometry("SpidarG6X4")}};
    device::UartFirmware firmware_{device_};
    device::TtyServer server_{firmware_, {}};
    std::atomic<bool> done_{false};
    std::atomic<bool> silent_{false};
    std::thread thread_;
};

TEST_F(MotorsOnATty, AreAtZeroAfterACrashAndAfterAStop) {
    for (const int signal : {SIGSEGV, SIGTERM}) {  // the second run removes what the crash left in /dev/shm
        Process core(rt_core("SpidarG6X4", path()), folder / "core.log");
        if (!core.wait_for_text("running", 20s)) {
            if (refused(core.output())) {
                GTEST_SKIP() << "a real device is not driven without real-time privileges";
            }
            FAIL() << core.output();
        }
        EXPECT_FALSE(all_zero(dac_codes())) << "at least the minimum tension";
        core.signal(signal);
        EXPECT_EQ(core.wait_for(20s), signal == SIGTERM ? 0 : 128 + signal) << core.output();
        // The last packet may still be in the terminal's buffer.
        for (int k = 0; k < 200 && !all_zero(dac_codes()); ++k) {
            std::this_thread::sleep_for(10ms);
        }
        EXPECT_TRUE(all_zero(dac_codes()));
    }
}

TEST_F(MotorsOnATty, PullAfterALostDeviceOnlyWhenAPersonArmsByCommand) {
    std::vector<std::string> command = rt_core("SpidarG6X4", path());
    command.insert(command.end(), {"--reconnect", "--report", folder / "run.json"});
    command.insert(command.end(), {"--set", "device.uart_timeout_s=0.01"});
    Process core(command, folder / "core.log");
    if (!core.wait_for_text("rt-core info: running", 20s)) {
        if (refused(core.output())) {
            GTEST_SKIP() << "a real device is not driven without real-time privileges";
        }
        FAIL() << core.output();
    }
    const Finished early = run({RT_CORE, "arm", "--session", session});
    EXPECT_EQ(early.status, 1);
    EXPECT_THAT(early.output, HasSubstr("already armed: running"));
    lose_and_return(core);
    EXPECT_THAT(run({RT_CORE, "arm", "--session", session, "--state"}).output, HasSubstr("a person must arm"));
    EXPECT_FALSE(any_pulls_within(100ms)) << "asking for the state arms nothing";
    const Finished armed = run({RT_CORE, "arm", "--session", session});
    EXPECT_EQ(armed.status, 0) << armed.output;
    EXPECT_TRUE(core.wait_for_text("armed by a person (command)", 20s)) << core.output();
    EXPECT_TRUE(any_pulls_within(20s));
    core.signal(SIGTERM);
    EXPECT_EQ(core.wait_for(20s), 0) << core.output();
    ASSERT_EQ(armings().size(), 2U);
    EXPECT_EQ(armings().at(0).at("by"), "start");
    EXPECT_EQ(armings().at(1).at("by"), "command");
}

TEST_F(MotorsOnATty, PullAfterALostDeviceOnlyWhenAPersonPressesEnter) {
    // The program in a terminal of its own, as a person has it.
    const device::test::Pty terminal;
    std::vector<std::string> command = {"/bin/sh", "-c", "exec setsid -c \"$@\" <" + terminal.path(), "sh"};
    for (const std::string& word : rt_core("SpidarG6X4", path())) {
        command.push_back(word);
    }
    command.insert(command.end(), {"--reconnect", "--report", folder / "run.json"});
    command.insert(command.end(), {"--set", "device.uart_timeout_s=0.01"});
    const auto type = [&terminal](char key) { terminal.write({static_cast<std::byte>(key)}); };
    Process core(command, folder / "core.log");
    if (!core.wait_for_text("rt-core info: running", 20s)) {
        if (refused(core.output())) {
            GTEST_SKIP() << "a real device is not driven without real-time privileges";
        }
        FAIL() << core.output();
    }
    type('\n');  // before it is awaited: counts for nothing
    lose_and_return(core);
    EXPECT_THAT(core.output(), HasSubstr("press Enter here"));
    type('x');
    EXPECT_FALSE(any_pulls_within(300ms)) << "another key";
    type('\n');
    EXPECT_TRUE(core.wait_for_text("armed by a person (key)", 20s)) << core.output();
    EXPECT_TRUE(any_pulls_within(20s));
    core.signal(SIGTERM);
    EXPECT_EQ(core.wait_for(20s), 0) << core.output();
    EXPECT_EQ(armings().at(1).at("by"), "key");
}

TEST_F(MotorsOnATty, StayAtZeroFromTheStartWhereAPersonArms) {
    std::vector<std::string> command = rt_core("SpidarG6X4", path());
    command.insert(command.end(), {"--set", "safety.arm=person"});
    Process core(command, folder / "core.log");
    if (!core.wait_for_text("disarmed until a person arms the device", 20s)) {
        if (refused(core.output())) {
            GTEST_SKIP() << "a real device is not driven without real-time privileges";
        }
        FAIL() << core.output();
    }
    EXPECT_FALSE(any_pulls_within(1500ms)) << core.output();
    core.signal(SIGTERM);
    EXPECT_EQ(core.wait_for(20s), 0) << core.output();
    EXPECT_TRUE(all_zero(dac_codes()));
}

TEST_F(ServedTty, RefusesALineThatIsNoneAndAGeometryWithoutOne) {
    const Finished none = run(rt_core("SpidarG6X4", "/dev/does-not-exist"));
    EXPECT_EQ(none.status, 2);
    EXPECT_THAT(none.output, AllOf(HasSubstr("tty:/dev/does-not-exist"), HasSubstr("/dev/serial/by-id")));
    const Finished usb = run(rt_core("SpidarG6X3R", "/dev/null"));
    EXPECT_EQ(usb.status, 2);
    EXPECT_THAT(usb.output, AllOf(HasSubstr("SpidarG6X3R"), HasSubstr("device.geometry")));
    const device::test::Pty silent;
    std::vector<std::string> command = rt_core("SpidarG6X4", silent.path());
    command.insert(command.end(), {"--set", "device.uart_timeout_s=0.001"});
    const Finished nobody = run(command);
    EXPECT_EQ(nobody.status, 2);
    EXPECT_THAT(nobody.output, HasSubstr("nothing"));
}

}  // namespace
}  // namespace haptic::test
