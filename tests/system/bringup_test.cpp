// `rt-core bringup` as a person uses it, at a pseudo terminal, with UART boards on another one.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <csignal>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <thread>

#include "bringup_person.hpp"
#include "haptic/clock.hpp"
#include "haptic/csv.hpp"
#include "haptic/device/device_geometry_file.hpp"
#include "haptic/device/wiring.hpp"
#include "haptic/frames.hpp"
#include "haptic/ring.hpp"
#include "patient_loop.hpp"
#include "process.hpp"
#include "unique_session.hpp"

namespace haptic::test {
namespace {

using namespace std::chrono_literals;
using testing::AllOf;
using testing::AnyOf;
using testing::HasSubstr;
using testing::Not;

constexpr const char* kGeometry = "SpidarG6X4";
// shared/src/program/exit_status.hpp
constexpr int kExitDone = 0;
constexpr int kExitFaulted = 3;

device::EmulatedDevice::Settings wired(const std::string& wiring) {
    device::EmulatedDevice::Settings settings{
        .geometry = device::built_in_geometry(kGeometry), .hand_waits = true, .mechanics = device::GripMechanics()};
    device::add_wiring(settings.wiring, wiring);
    settings.hand = PoseTrack({0.0, 0.5}, {Pose{}, Pose{{0.012, 0.008, -0.005}, {1.0, 0.0, 0.0, 0.0}}});
    return settings;
}

class Bringup : public testing::Test {
  protected:
    /// Fast, but for the keys: a loaded machine may delay them.
    [[nodiscard]] std::vector<std::string> bringup(const EmulatedLine& line, int readings = 1) const {
        return {RT_CORE,       "bringup",
                "--device",    "tty:" + line.path(),
                "--geometry",  kGeometry,
                "--set",       std::string("device.geometry=") + kGeometry,
                "--set",       "device.uart_timeout_s=0.04",
                "--set",       "safety.watchdog_s=1",
                "--set",       "loop.period_s=0.02",
                "--out",       out,
                "--ramp",      "0.1",
                "--steady",    "0.1",
                "--silence",   silence_s,
                "--readings",  std::to_string(readings),
                "--exchanges", "100",
                "--dead-man",  "0.4"};
    }
    /// On the device with the geometry that was written.
    [[nodiscard]] std::vector<std::string> run_with(const EmulatedLine& line) const {
        std::vector<std::string> command = {RT_CORE,      "run",
                                            "--session",  unique_session(),
                                            "--device",   "tty:" + line.path(),
                                            "--duration", "2",
                                            "--record",   folder / "run.csv",
                                            "--report",   folder / "run.json",
                                            "--set",      "device.geometry=" + out};
        for (const char* const setting : kPatientLoop) {
            command.insert(command.end(), {"--set", setting});
        }
        return command;
    }
    [[nodiscard]] nlohmann::json protocol() const {
        return nlohmann::json::parse(std::ifstream(folder / "mine.protocol.json"));
    }

    /// A person works until a text appears, or to the end. Where this machine stands still for half a second, the
    /// motors are cut and the bring-up ends with status 3; the person then resumes it.
    std::unique_ptr<BringupPerson> work(EmulatedLine& line, bool resume, const std::string& until, int expected) {
        for (int attempt = 0; attempt < 20; ++attempt) {
            std::vector<std::string> command = bringup(line);
            if (resume || attempt > 0) {
                command.emplace_back("--resume");
            }
            auto person = std::make_unique<BringupPerson>(line, command);
            person->has_weight = has_weight;
            const int status = person->work(until);
            transcript += person->transcript();
            if (status != kExitFaulted) {
                EXPECT_EQ(status, expected) << person->transcript();
                return person;
            }
            EXPECT_THAT(person->transcript(), HasSubstr("The bring-up was interrupted"));
        }
        ADD_FAILURE() << "this machine stands still too often\n" << transcript;
        return nullptr;
    }

    /// Runs rt-core on the line; again if this machine stood still, so that the board or its answers were lost. Any
    /// other fault would be the device's.
    static Finished run_on_the_line(const std::vector<std::string>& command) {
        Finished finished = run(command);
        const auto lost = [&finished] {
            const bool undetected = finished.status == 2 && finished.output.find("motor boards:") != std::string::npos;
            const bool unanswered =
                finished.status == kExitFaulted && (finished.output.find("FAULT: exchange") != std::string::npos ||
                                                    finished.output.find("FAULT: overrun") != std::string::npos ||
                                                    finished.output.find("FAULT: guard") != std::string::npos);
            return undetected || unanswered;
        };
        for (int k = 0; k < 10 && lost(); ++k) {
            finished = run(command);
        }
        return finished;
    }

    /// Holds the key until a motor pulls; false if the program ended because this machine stood still.
    static bool press(EmulatedLine& line, BringupPerson& person) {
        for (int k = 0; k < 200 && line.motors_at_zero() && person.repeat_key(); ++k) {
        }
        return !line.motors_at_zero();
    }

    /// Whether the motors reach zero in a second: the last packet may still be in the terminal's buffer.
    static bool ends_at_zero(EmulatedLine& line) {
        for (int k = 0; k < 100 && !line.motors_at_zero(); ++k) {
            std::this_thread::sleep_for(10ms);
        }
        return line.motors_at_zero();
    }

    ScratchFolder folder;
    std::string transcript;   // of all attempts
    bool has_weight = false;  // of the person
    std::string silence_s = "0.3";
    std::string out = folder / "mine.toml";
};

TEST_F(Bringup, StopsTheMotorWithTheKeyWithCtrlCAndInACrash) {
    EmulatedLine line(wired("none"));
    // The key is held, then let go: a terminal has no key-up.
    auto person = work(line, false, "Channel 0, code", -1);
    ASSERT_TRUE(person);
    ASSERT_TRUE(press(line, *person)) << person->transcript();
    for (int k = 0; k < 300 && !line.motors_at_zero(); ++k) {
        person->look();
        person->listen(10);
    }
    EXPECT_TRUE(line.motors_at_zero()) << "within 3 s, of which the key takes 0.4 s";
    person.reset();
    // Ctrl-C while the motor pulls.
    person = work(line, true, "hold the space bar until", -1);
    ASSERT_TRUE(person);
    ASSERT_TRUE(press(line, *person)) << person->transcript();
    person->type("\x03");
    EXPECT_EQ(person->status(), kExitDone) << person->transcript();
    EXPECT_THAT(person->transcript(), HasSubstr("--resume continues"));
    EXPECT_TRUE(line.motors_at_zero());
    EXPECT_FALSE(protocol().at("finished"));
    EXPECT_EQ(protocol().at("measured").at("pull_outs").size(), kStrings) << "everything measured is in the file";
    // A crash.
    person = work(line, true, "hold the space bar until", -1);
    ASSERT_TRUE(person);
    EXPECT_THAT(person->transcript(), Not(HasSubstr("Step 1 of 7")));
    ASSERT_TRUE(press(line, *person)) << person->transcript();
    person->signal(SIGSEGV);
    EXPECT_EQ(person->status(), 128 + SIGSEGV);
    EXPECT_TRUE(ends_at_zero(line));
}

TEST_F(Bringup, GuardStopsTheMotorOfAKilledOrStoppedProcess) {
    EmulatedLine line(wired("none"));
    auto person = work(line, false, "Channel 0, code", -1);
    ASSERT_TRUE(person);
    ASSERT_TRUE(press(line, *person)) << person->transcript();
    person->signal(SIGKILL);
    EXPECT_EQ(person->status(), 128 + SIGKILL);
    EXPECT_TRUE(ends_at_zero(line));
    // Stopped, it finds itself cut when it continues.
    person = work(line, true, "hold the space bar until", -1);
    ASSERT_TRUE(person);
    ASSERT_TRUE(press(line, *person)) << person->transcript();
    person->signal(SIGSTOP);
    EXPECT_TRUE(ends_at_zero(line));
    person->signal(SIGCONT);
    EXPECT_EQ(person->status(), kExitFaulted) << person->transcript();
    EXPECT_THAT(person->transcript(), HasSubstr("the guard set the motors to zero"));
    EXPECT_TRUE(line.motors_at_zero());
}

TEST_F(Bringup, GuardStopsAMotorThatPullsWhileNothingIsSent) {
    EmulatedLine line(wired("none"));
    silence_s = "5";
    auto person = work(line, false, "Host death: hold the key", -1);
    ASSERT_TRUE(person);
    // After the ramp, 0.1 s, and as much of standstill, the board holds its code without an exchange.
    for (int k = 0; k < 30 && person->repeat_key(); ++k) {
    }
    ASSERT_FALSE(line.motors_at_zero()) << person->transcript();
    person->signal(SIGSTOP);
    EXPECT_TRUE(ends_at_zero(line));
    person->signal(SIGCONT);
    EXPECT_EQ(person->status(), kExitFaulted) << person->transcript();
    EXPECT_THAT(person->transcript(), HasSubstr("the guard set the motors to zero"));
}

TEST_F(Bringup, OfASoundDeviceIsSignedWithoutADeviation) {
    EmulatedLine line(wired("none"));
    ASSERT_TRUE(work(line, false, "", kExitDone));
    EXPECT_THAT(transcript, AllOf(Not(HasSubstr("instead of")), HasSubstr("Signed by Ada Example")));
    EXPECT_TRUE(line.motors_at_zero());
    // 1 N by the nominal geometry, 10.07 mN a code.
    EXPECT_LE(line.largest_code(), 100);
    const device::DeviceGeometry found = device::load_device_geometry(out);
    const device::DeviceGeometry nominal = device::built_in_geometry(kGeometry);
    for (std::size_t i = 0; i < kStrings; ++i) {
        EXPECT_EQ(found.strings[i].motor, nominal.strings[i].motor);
        EXPECT_EQ(found.strings[i].metres_per_count, nominal.strings[i].metres_per_count);
        EXPECT_NEAR(found.strings[i].newtons_per_code, nominal.strings[i].newtons_per_code, 1e-4);
    }
    const nlohmann::json all = protocol();
    EXPECT_EQ(all.at("signature").at("person"), "Ada Example");
    EXPECT_EQ(all.at("measured").at("weighings").size(), kStrings);
    // A calibration ends the signature; a person renews it. Another gain is no calibration.
    device::DeviceGeometry refined = found;
    refined.strings[2].motor.x += 0.5e-3;
    std::ofstream(out) << device::to_toml(refined, "calibrated");
    const std::vector<std::string> sign = {RT_CORE, "bringup", "--sign", "--geometry", kGeometry, "--out", out};
    BringupPerson again(line, sign);
    EXPECT_EQ(again.work(), 0) << again.transcript();
    EXPECT_NE(protocol().at("signature").at("geometry_fingerprint"), all.at("signature").at("geometry_fingerprint"));
    refined.strings[2].newtons_per_code *= 0.5;
    std::ofstream(out) << device::to_toml(refined, "tampered with");
    BringupPerson tampering(line, sign);
    EXPECT_EQ(tampering.work(), 2) << tampering.transcript();
    EXPECT_THAT(tampering.transcript(), HasSubstr("newtons_per_code of string 2 is another one"));
    // The one deviation is that this board keeps its last command.
    // And a busy machine may be slow to answer.
    for (const nlohmann::json& one : all.at("deviations")) {
        EXPECT_FALSE(one.at("must_be_fixed"));
        EXPECT_THAT(one.at("what").get<std::string>(),
                    AnyOf(HasSubstr("before the time was over"), HasSubstr("exchanges")));
    }
}

TEST_F(Bringup, NamesTwoWiringErrorsAndWritesAGeometryThatRunsOnThem) {
    EmulatedLine line(wired("motors:0,4+sign:3"));
    has_weight = true;
    ASSERT_TRUE(work(line, false, "", kExitDone));
    const nlohmann::json weighings = protocol().at("measured").at("weighings");
    const auto lifted =
        std::find_if(weighings.begin(), weighings.end(), [](const auto& one) { return one.at("with") == "weight"; });
    ASSERT_NE(lifted, weighings.end()) << transcript;
    EXPECT_NEAR(lifted->at("newtons").get<double>() / lifted->at("code").get<double>(), 10.07e-3, 1e-3) << "N a code";
    EXPECT_THAT(transcript, AllOf(HasSubstr("the encoder of string 3 ("), HasSubstr(") counts backwards"),
                                  HasSubstr("the motor of string 0 ("), HasSubstr(") is on channel 4 instead of 0"),
                                  HasSubstr(") is on channel 0 instead of 4")));
    std::ifstream file(folder / "mine.protocol.txt");
    EXPECT_NE(std::string(std::istreambuf_iterator<char>(file), {}).find("Signed by Ada Example"), std::string::npos);
    const device::DeviceGeometry found = device::load_device_geometry(out);
    EXPECT_EQ(found.motor_channels, (std::array<std::uint8_t, kStrings>{4, 1, 2, 3, 0, 5, 6, 7}));

    const Finished finished = run_on_the_line(run_with(line));
    if (finished.output.find("not driven without real-time privileges") != std::string::npos) {
        GTEST_SKIP() << "a real device is not driven without real-time privileges";
    }
    ASSERT_EQ(finished.status, 0) << finished.output;
    EXPECT_THAT(finished.output, AllOf(HasSubstr("signed by Ada Example"), Not(HasSubstr("commissioning"))));
}

TEST_F(Bringup, DeviceWithoutASignedProtocolRendersOneNewton) {
    const EmulatedLine line(wired("none"));
    std::ofstream(out) << device::to_toml(device::built_in_geometry(kGeometry), "nobody measured it");
    std::vector<std::string> command = run_with(line);
    command.insert(command.end(), {"--set", "safety.prove=never"});  // which limits the force too
    const std::string session = command[3];
    std::atomic<bool> done{false};
    std::thread simulation([&] {
        // A floor 10 mm above the grip at 400 N/m asks for 4 N.
        RingWriter<ContactFrame> frames(session);
        while (!done) {
            ContactFrame frame{};
            frame.state_time_ns = frame.plane_time_ns = frame.publish_time_ns = monotonic_now_ns();
            frame.step_ns = 10'000'000;
            frame.stiffness = 400.0;
            frame.proxy_count = 1;
            frame.proxies[0].plane_count = 1;
            frame.proxies[0].planes[0].normal[1] = 1.0;
            frame.proxies[0].planes[0].offset = 0.01;
            frames.publish(frame, monotonic_now_ns());
            std::this_thread::sleep_for(5ms);
        }
    });
    const Finished finished = run_on_the_line(command);
    done = true;
    simulation.join();
    if (finished.output.find("not driven without real-time privileges") != std::string::npos) {
        GTEST_SKIP() << "a real device is not driven without real-time privileges";
    }
    EXPECT_THAT(finished.output, HasSubstr("commissioning mode: at most 1 N, because"));
    const nlohmann::json report = nlohmann::json::parse(std::ifstream(folder / "run.json"));
    EXPECT_THAT(report.at("safety").at("notices").dump(), HasSubstr("commissioning"));
    const CsvTable table = CsvTable::load(folder / "run.csv");
    double largest = 0.0;
    for (std::size_t i = 0; i < table.rows(); ++i) {
        EXPECT_NE(static_cast<std::uint32_t>(table.column("flags")[i]) & HAPTIC_TICK_COMMISSIONING, 0U);
        largest =
            std::max(largest, std::hypot(table.column("fx_n")[i], table.column("fy_n")[i], table.column("fz_n")[i]));
    }
    EXPECT_GT(largest, 0.05) << "the floor was felt\n" << finished.output;
    EXPECT_LE(largest, 1.0 + 1e-9);
}

}  // namespace
}  // namespace haptic::test
