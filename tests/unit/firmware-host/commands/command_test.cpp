// The executable firmware-host: its output and exit status.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>

namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

struct Outcome {
    int status = -1;
    std::string text;  // standard output and standard error
};

Outcome run(const std::string& arguments) {
    const std::string command = std::string("'") + FIRMWARE_HOST + "' " + arguments + " 2>&1";
    Outcome outcome;
    FILE* pipe = popen(command.c_str(), "r");
    if (pipe == nullptr) {
        return outcome;
    }
    std::array<char, 4096> buffer{};
    while (const std::size_t count = fread(buffer.data(), 1, buffer.size(), pipe)) {
        outcome.text.append(buffer.data(), count);
    }
    const int ended = pclose(pipe);
    outcome.status = WIFEXITED(ended) ? WEXITSTATUS(ended) : -1;
    return outcome;
}

TEST(FirmwareHostCommand, HelpNamesCommandsAndOptions) {
    const Outcome help = run("--help");
    EXPECT_EQ(help.status, 0);
    EXPECT_THAT(help.text, HasSubstr("exchange"));
    EXPECT_THAT(help.text, AllOf(HasSubstr("geometries"), Not(HasSubstr("variants"))));
    const Outcome exchange = run("exchange --help");
    EXPECT_EQ(exchange.status, 0);
    for (const char* option : {"--hand", "--at", "--pose", "--tension ", "--tensions", "--hex"}) {
        EXPECT_THAT(exchange.text, HasSubstr(option));
    }
    EXPECT_EQ(run("geometries --help").status, 0);
}

TEST(FirmwareHostCommand, GeometriesListsMotorsAndKnots) {
    const Outcome outcome = run("geometries");
    EXPECT_EQ(outcome.status, 0);
    EXPECT_THAT(outcome.text, HasSubstr("SpidarG6X3R"));
    EXPECT_THAT(outcome.text, HasSubstr("tensions 0.3 to 20 N"));
    EXPECT_THAT(
        outcome.text,
        HasSubstr("-84.8528  -76.0000   +0.0000 |  -15.9099   +0.0000  +15.9099 |  103.8376  +16.6555   +6.5964"));
}

TEST(FirmwareHostCommand, GeometriesWarnsOfDevicesThatCannotExertEveryWrench) {
    const std::string text = run("geometries").text;
    for (const char* name : {"SpidarG6X3L", "SpidarG6X3F", "SpidarG6X4", "SpidarG6X5R", "SpidarG6X5L", "SpidarG6T1"}) {
        EXPECT_THAT(text, HasSubstr(name));
    }
    const auto between = [&](const char* from, const char* to) {
        return text.substr(text.find(from), text.find(to) - text.find(from));
    };
    EXPECT_THAT(between("SpidarG6X3F", "SpidarG6X4"), HasSubstr("warning not_wrench_closed"));
    EXPECT_THAT(between("SpidarG6X4", "SpidarG6X5R"), Not(HasSubstr("warning")));
}

TEST(FirmwareHostCommand, GeometriesChecksAFileOfTheUser) {
    const std::filesystem::path file =
        std::filesystem::path(testing::TempDir()) / ("device-" + std::to_string(getpid()) + ".toml");
    std::filesystem::copy_file(GEOMETRIES "/x5r.toml", file, std::filesystem::copy_options::overwrite_existing);
    const Outcome good = run("geometries '" + file.string() + "'");
    EXPECT_EQ(good.status, 0);
    EXPECT_THAT(good.text, HasSubstr("SpidarG6X5R"));
    EXPECT_THAT(good.text, Not(HasSubstr("SpidarG6X3R")));
    std::ofstream(file, std::ios::app) << "mottor = 1\n";
    const Outcome wrong = run("geometries '" + file.string() + "'");
    EXPECT_EQ(wrong.status, 1);
    EXPECT_THAT(wrong.text, HasSubstr(file.string() + ":"));
    EXPECT_THAT(wrong.text, HasSubstr("string.7.mottor: unknown key"));
    std::filesystem::remove(file);
}

TEST(FirmwareHostCommand, AcceptsTheFormerNamesOfSubcommandAndOption) {
    const Outcome current = run("geometries");
    const Outcome former = run("variants");
    EXPECT_EQ(former.status, 0);
    EXPECT_THAT(former.text, AllOf(HasSubstr("`variants` is now called `geometries`"), HasSubstr(current.text)));

    EXPECT_THAT(run("serve --help").text, AllOf(HasSubstr("--geometry"), Not(HasSubstr("--variant"))));
    for (const char* option : {"--geometry", "--variant"}) {
        const Outcome outcome = run(std::string("serve ") + option + " SpidarG7");
        EXPECT_EQ(outcome.status, 64) << option;
        EXPECT_THAT(outcome.text, HasSubstr("no built-in device geometry is named 'SpidarG7'")) << option;
    }
    EXPECT_EQ(run("serve --geometry SpidarG6X3R --variant SpidarG6X3R").status, 64);
}

TEST(FirmwareHostCommand, NotesTheFormerNameOfAKeyWithItsLine) {
    const std::filesystem::path file =
        std::filesystem::path(testing::TempDir()) / ("former-" + std::to_string(getpid()) + ".toml");
    std::ifstream source(GEOMETRIES "/x5r.toml");
    std::string text{std::istreambuf_iterator<char>(source), {}};
    const std::string key = "newtons_per_code = ";
    for (std::size_t at = text.find(key); at != std::string::npos; at = text.find(key, at)) {
        text.replace(at, key.size(), "newtons_per_digit = ");
    }
    std::ofstream(file) << text;
    const Outcome outcome = run("geometries '" + file.string() + "'");
    EXPECT_EQ(outcome.status, 0);
    EXPECT_THAT(outcome.text,
                testing::ContainsRegex("toml:[0-9]+: newtons_per_digit: is the former name of newtons_per_code"));
    std::filesystem::remove(file);
}

TEST(FirmwareHostCommand, ExchangeAtTheCentreShowsThePublishedPacketAndForce) {
    const Outcome outcome = run("exchange --hex");
    EXPECT_EQ(outcome.status, 0);
    EXPECT_THAT(outcome.text, HasSubstr("0  01 0e 2d 00 2d 00 2d 00 2d 00 2d 00 2d 00 2d 00"));
    // DAC code 45 is 0.29684 N; equal tension leaves 0.0575 N per newton on x and z.
    EXPECT_THAT(outcome.text, HasSubstr("+0.01706   +0.00000   +0.01706  N"));
}

TEST(FirmwareHostCommand, ExchangeShowsNoBytesUnlessAsked) {
    const Outcome outcome = run("exchange --tension 1.5");
    EXPECT_EQ(outcome.status, 0);
    EXPECT_THAT(outcome.text, HasSubstr("1.5000    227"));  // trunc(1.5 * 0.365296803653 * 415)
    EXPECT_THAT(outcome.text, Not(HasSubstr("01 0e")));
}

TEST(FirmwareHostCommand, ExchangeTakesPosesAndTensionsOfEachString) {
    const Outcome outcome = run("exchange --pose -0.01,0.005,0,0.8,0,0.6,0 --tensions 0.3,1,2,3,4,5,6,20");
    EXPECT_EQ(outcome.status, 0);
    EXPECT_THAT(outcome.text, HasSubstr("-10.0000    +5.0000    +0.0000  mm"));
    EXPECT_THAT(outcome.text, HasSubstr("+0.8000000 +0.0000000 +0.6000000 +0.0000000"));
    EXPECT_THAT(outcome.text, HasSubstr("20.0000   3031 |   3031"));
}

TEST(FirmwareHostCommand, ExchangeFollowsARecording) {
    const std::filesystem::path file =
        std::filesystem::path(testing::TempDir()) / ("hand-" + std::to_string(getpid()) + ".csv");
    std::ofstream(file) << "time_s,x_m,y_m,z_m\n0,0,0,0\n2,0.02,0,-0.01\n";
    const Outcome half_way = run("exchange --hand '" + file.string() + "' --at 1");
    EXPECT_EQ(half_way.status, 0);
    EXPECT_THAT(half_way.text, HasSubstr("+10.0000    +0.0000    -5.0000  mm"));
    std::ofstream(file) << "time_s,x_m,y_m,z_m\n0,0,0,nought\n";
    const Outcome malformed = run("exchange --hand '" + file.string() + "'");
    EXPECT_EQ(malformed.status, 1);
    EXPECT_THAT(malformed.text, HasSubstr(file.string() + ":2"));
    std::filesystem::remove(file);
}

TEST(FirmwareHostCommand, AMissingRecordingIsAFailureThatNamesIt) {
    const Outcome outcome = run("exchange --hand /nowhere/hand.csv");
    EXPECT_EQ(outcome.status, 1);
    EXPECT_THAT(outcome.text, HasSubstr("/nowhere/hand.csv"));
}

TEST(FirmwareHostCommand, WrongArgumentsAreRefusedWithTheirName) {
    const struct {
        const char* arguments;
        const char* reason;
    } cases[] = {
        {"", "A command (exchange, "},
        {"frobnicate", "there is no command frobnicate"},
        {"exchange --frobnicate", "--frobnicate"},
        {"exchange --pose 1,2", "--pose"},
        {"exchange --pose 0,0,nan", "'nan' is not a finite number"},
        {"exchange --pose 0,0,inf", "'inf' is not a finite number"},
        {"exchange --pose 0,,0", "'' is not a finite number"},
        {"exchange --pose 0,0,0x", "'0x' is not a finite number"},
        {"exchange --pose 0,0,0,1,1,0,0", "the quaternion has length 1.41"},
        {"exchange --pose 0,0,0,0,0,0,0", "the quaternion has length 0"},
        {"exchange --pose 3,0,0", "0.5 m"},
        {"exchange --pose 0,0,0 --hand h.csv", "excludes"},
        {"exchange --at 1", "--hand"},
        {"exchange --hand h.csv --at -1", "--at"},
        {"exchange --hand h.csv --at nan", "--at"},
        {"exchange --tension 20.1", "--tension"},
        {"exchange --tension -1", "--tension"},
        {"exchange --tension nan", "--tension"},
        {"exchange --tension much", "--tension"},
        {"exchange --tensions 1,2,3", "8 numbers"},
        {"exchange --tensions 1,2,3,4,5,6,7,21", "--tensions"},
        {"exchange --tensions 1,1,1,1,1,1,1,1 --tension 1", "excludes"},
    };
    for (const auto& [arguments, reason] : cases) {
        const Outcome outcome = run(arguments);
        EXPECT_EQ(outcome.status, 64) << arguments;
        EXPECT_THAT(outcome.text, HasSubstr(reason)) << arguments;
    }
}

TEST(FirmwareHostCommand, ReachComparesARecordingWithADevice) {
    // At the centre of an X3R the strings exert 32 N along x in the weaker sense (docs/geometry.md): 6.5 N is within
    // reach, 65 N is not. The second row turns the grip by 2 rad about y, where its strings are not wrench-closed
    // (WrenchClosure tests).
    const std::filesystem::path file =
        std::filesystem::path(testing::TempDir()) / ("haptic-reach-test-" + std::to_string(getpid()) + ".csv");
    std::ofstream(file) << "time_s,x_m,y_m,z_m,qw,qx,qy,qz,fx_n,fy_n,fz_n,tx_nm,ty_nm,tz_nm\n"
                           "0,0,0,0,1,0,0,0,6.5,0,0,0,0,0\n"
                           "0.5,0.003,0,0.004,0.5403023058681398,0,0.8414709848078965,0,0,0,0,0,0,0\n"
                           "1,0,0,0,1,0,0,0,65,0,0,0,0,0\n";
    const Outcome outcome = run("reach " + file.string());
    EXPECT_EQ(outcome.status, 0) << outcome.text;
    EXPECT_THAT(outcome.text, HasSubstr("poses                        3\n"));
    EXPECT_THAT(outcome.text, HasSubstr("largest excursion            5.00 mm\n"));
    EXPECT_THAT(outcome.text, HasSubstr("largest rotation             114.6 deg\n"));
    EXPECT_THAT(outcome.text, HasSubstr("poses not wrench-closed      1\n"));
    EXPECT_THAT(outcome.text, HasSubstr("peak force                   65.000 N\n"));
    EXPECT_THAT(outcome.text, HasSubstr("at 1.000 s\n"));
    EXPECT_THAT(outcome.text, HasSubstr("wrenches out of reach        1\n"));
    std::filesystem::remove(file);
    const Outcome missing = run("reach /nonexistent.csv");
    EXPECT_EQ(missing.status, 1);
    EXPECT_THAT(missing.text, HasSubstr("/nonexistent.csv"));
}

}  // namespace
