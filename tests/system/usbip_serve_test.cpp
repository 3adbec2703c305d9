// `firmware-host serve`, over USB/IP and usbredir: independent clients, and how it ends.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <memory>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "process.hpp"

namespace haptic::test {
namespace {

using std::chrono::seconds;
using testing::AllOf;
using testing::HasSubstr;

class UsbipServe : public testing::Test {
  protected:
    /// Serves on a free port with additional arguments.
    void serve(const std::vector<std::string>& more = {}) {
        std::vector<std::string> command = {FIRMWARE_HOST, "serve", "--usbip", "127.0.0.1:0"};
        command.insert(command.end(), more.begin(), more.end());
        server = std::make_unique<Process>(command, folder / "serve.log");
        ASSERT_TRUE(server->wait_for_text("listening on 127.0.0.1:", seconds(10))) << server->output();
        const std::string said = server->output();
        port = said.substr(said.find("127.0.0.1:") + 10);
        port = port.substr(0, port.find_first_not_of("0123456789"));
    }

    ScratchFolder folder;
    std::unique_ptr<Process> server;
    std::string port;
};

TEST_F(UsbipServe, DebiansUsbipToolListsTheBoardWithItsInterface) {
    const std::string usbip = "/usr/sbin/usbip";
    if (!std::filesystem::exists(usbip)) {
        GTEST_SKIP() << "needs the package usbip";
    }
    serve();
    const Finished listed = run({usbip, "--tcp-port", port, "list", "-r", "127.0.0.1"});
    EXPECT_EQ(listed.status, 0) << listed.output;
    EXPECT_THAT(listed.output, AllOf(HasSubstr("1-1:"), HasSubstr("(0cec:0205)"), HasSubstr("(ff/00/00)")));
}

TEST_F(UsbipServe, AFrameWithASimpleBoardIsListedAsThatBoard) {
    const std::string usbip = "/usr/sbin/usbip";
    if (!std::filesystem::exists(usbip)) {
        GTEST_SKIP() << "needs the package usbip";
    }
    std::stringstream frame;
    frame << std::ifstream(X3R).rdbuf();
    std::string text = frame.str();
    const std::size_t board = text.find("board = \"sh4\"");
    ASSERT_NE(board, std::string::npos) << X3R;
    text.replace(board, 13, "board = \"simple\"");
    const std::string file = folder / "simple.toml";
    std::ofstream(file) << text;
    serve({"--geometry", file});
    const Finished listed = run({usbip, "--tcp-port", port, "list", "-r", "127.0.0.1"});
    EXPECT_THAT(listed.output, HasSubstr("(0cec:0203)"));
}

TEST_F(UsbipServe, AnIndependentClientDrivesItAndItsCountersAgreeWithTheGeometry) {
    const Finished hand = run({PYTHON, CLIENT, "--hand"});
    ASSERT_EQ(hand.status, 0) << hand.output;
    const std::string file = folder / "hand.csv";
    std::ofstream(file) << hand.output;
    serve({"--hand", file});
    const Finished client = run({PYTHON, CLIENT, "127.0.0.1", port});
    EXPECT_EQ(client.status, 0) << client.output;
    EXPECT_THAT(client.output, HasSubstr("0cec:0205 with bulk 0x02 and 0x86"));
    EXPECT_THAT(server->output(), AllOf(HasSubstr("imported by 127.0.0.1:"), HasSubstr("another client has the device"),
                                        HasSubstr("has lost the device")));
}

TEST_F(UsbipServe, UnpluggedOnCommandItIsGoneForItsClientAndThenThereAgain) {
    const std::string file = folder / "hand.csv";
    std::ofstream(file) << run({PYTHON, CLIENT, "--hand"}).output;
    serve({"--hand", file, "--fault", "unplug@0.9/1"});
    const Finished cut = run({PYTHON, CLIENT, "127.0.0.1", port});
    EXPECT_EQ(cut.status, 1);
    EXPECT_THAT(cut.output, HasSubstr("the server keeps the connection"));
    EXPECT_THAT(server->output(), HasSubstr("has lost the device: unplugged"));
    Finished again = cut;
    for (int tries = 0; tries < 100 && again.status != 0; ++tries) {
        std::this_thread::sleep_for(std::chrono::milliseconds(100));
        again = run({PYTHON, CLIENT, "127.0.0.1", port});
    }
    EXPECT_EQ(again.status, 0) << again.output;
    EXPECT_THAT(server->output(), HasSubstr("plugged in"));
}

TEST_F(UsbipServe, EndsWithStatusZeroOnEachSignalThatAsksForIt) {
    for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
        serve();
        server->signal(signal);
        EXPECT_EQ(server->wait_for(seconds(10)), 0) << signal << server->output();
    }
}

TEST_F(UsbipServe, AtFullSpeedItIsListedWithThatSpeed) {
    serve({"--speed", "full"});
    EXPECT_THAT(server->output(), HasSubstr("0cec:0205, full speed, bus id 1-1"));
    const Finished client = run({PYTHON, CLIENT, "127.0.0.1", port});
    EXPECT_EQ(client.status, 1);
    EXPECT_THAT(client.output, HasSubstr("the device is of high speed"));
}

TEST_F(UsbipServe, OverUsbredirItListensAtASocketAndRemovesItAtTheEnd) {
    const std::string socket = folder / "board";
    const std::vector<std::string> command = {FIRMWARE_HOST, "serve", "--usbredir", socket, "--speed", "full"};
    Process redir(command, folder / "redir.log");
    ASSERT_TRUE(redir.wait_for_text("0cec:0205, full speed, listening at " + socket, seconds(10))) << redir.output();
    EXPECT_TRUE(std::filesystem::is_socket(socket));
    const Finished second = run(command);
    EXPECT_EQ(second.status, 1);
    EXPECT_THAT(second.output, AllOf(HasSubstr(socket), HasSubstr("in use")));
    redir.signal(SIGTERM);
    EXPECT_EQ(redir.wait_for(seconds(10)), 0) << redir.output();
    EXPECT_FALSE(std::filesystem::exists(socket));
}

TEST_F(UsbipServe, APortThatIsTakenIsAFailureThatNamesIt) {
    serve();
    const Finished second = run({FIRMWARE_HOST, "serve", "--usbip", "127.0.0.1:" + port});
    EXPECT_EQ(second.status, 1);
    EXPECT_THAT(second.output, AllOf(HasSubstr("127.0.0.1:" + port), HasSubstr("in use")));
}

TEST_F(UsbipServe, WrongArgumentsAreRefusedWithTheirName) {
    const struct {
        std::vector<std::string> arguments;
        const char* reason;
    } cases[] = {
        {{"--usbip", "nowhere"}, "127.0.0.1:3240"},
        {{"--usbip", "127.0.0.1:99999"}, "port"},
        {{"--usbip", "127.0.0.1:0", "--geometry", "SpidarG7"}, "SpidarG7"},
        {{"--usbip", "127.0.0.1:0", "--geometry", "SpidarG6X5R"}, "serial line"},
        {{"--usbip", "127.0.0.1:0", "--hand-delay", "-1"}, "--hand-delay"},
        {{"--usbip", "127.0.0.1:0", "--hand-delay", "nan"}, "--hand-delay"},
        {{"--usbip", "127.0.0.1:0", "--speed", "low"}, "--speed"},
        {{"--usbredir", folder / "board", "--usbip", "127.0.0.1:0"}, "excludes"},
        {{"--usbredir", folder / "board", "--tty"}, "excludes"},
        {{"--usbredir", folder / "board", "--geometry", "SpidarG6X5R"}, "serial line"},
        {{"--usbredir", std::string(200, 'x')}, "1 to 107 characters"},
        {{"--tty", "--geometry", "SpidarG6X5R", "--speed", "full"}, "excludes"},
        {{"--frobnicate"}, "--frobnicate"},
    };
    for (const auto& [arguments, reason] : cases) {
        std::vector<std::string> command = {FIRMWARE_HOST, "serve"};
        command.insert(command.end(), arguments.begin(), arguments.end());
        const Finished finished = run(command);
        EXPECT_EQ(finished.status, 64) << finished.output;
        EXPECT_THAT(finished.output, HasSubstr(reason));
    }
    const Finished missing = run({FIRMWARE_HOST, "serve", "--usbip", "127.0.0.1:0", "--hand", "/nowhere/hand.csv"});
    EXPECT_EQ(missing.status, 1);
    EXPECT_THAT(missing.output, HasSubstr("/nowhere/hand.csv"));
}

}  // namespace
}  // namespace haptic::test
