// Serves an emulated SH4 board on umockdev's usbfs to a command, which drives it with unmodified libusb:
//     LD_PRELOAD=libumockdev-preload.so.0 serve_usbfs [--hand F.csv] [--fault FAULT ...] [--pull-out S] -- COMMAND ...
// The hand and the faults count their time from the first exchange, and so does --pull-out, after which the board is
// gone from its bus, as when its cable is pulled out. The exit status is the command's.
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <string>
#include <system_error>
#include <thread>
#include <vector>

#include "fake_usbfs.hpp"
#include "haptic/device/fault.hpp"
#include "haptic/device/hand_file.hpp"

namespace {

using haptic::test::FakeUsbBoard;
using haptic::test::FakeUsbfs;

struct Arguments {
    std::string hand;
    std::vector<std::string> faults;
    double pull_out_s = 0.0;
    std::vector<std::string> command;
};

FakeUsbfs::Settings board_settings(const Arguments& arguments) {
    FakeUsbfs::Settings settings;
    if (!arguments.hand.empty()) {
        settings.device.hand = haptic::device::hand_from_centre(arguments.hand);
    }
    for (const std::string& fault : arguments.faults) {
        settings.device.faults.push_back(haptic::device::parse_fault(fault));
    }
    return settings;
}

pid_t start(std::vector<std::string> command) {
    std::vector<char*> words;
    for (std::string& word : command) {
        words.push_back(word.data());
    }
    words.push_back(nullptr);
    pid_t process = 0;
    if (const int error = posix_spawnp(&process, words[0], nullptr, nullptr, words.data(), environ); error != 0) {
        throw std::system_error(error, std::system_category(), command[0]);
    }
    return process;
}

/// Removes the board some time after its first exchange, unless the command has ended.
void pull_out(FakeUsbfs& bus, FakeUsbBoard& board, double seconds, const std::atomic<bool>& ended) {
    const auto pause = std::chrono::milliseconds(1);
    while (!ended && board.commands() == 0) {
        std::this_thread::sleep_for(pause);
    }
    const auto due = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
    while (!ended && std::chrono::steady_clock::now() < due) {
        std::this_thread::sleep_for(pause);
    }
    if (!ended) {
        bus.remove(board);
    }
}

int serve(const Arguments& arguments) {
    FakeUsbfs bus;
    FakeUsbBoard& board = bus.plug(board_settings(arguments));
    const pid_t process = start(arguments.command);
    std::atomic<bool> ended{false};
    std::jthread hand_on_the_plug;
    if (arguments.pull_out_s > 0.0) {
        hand_on_the_plug = std::jthread([&] { pull_out(bus, board, arguments.pull_out_s, ended); });
    }
    int status = 0;
    waitpid(process, &status, 0);
    ended = true;
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

}  // namespace

int main(int argc, char** argv) {
    CLI::App app("Serves an emulated board on umockdev's usbfs to a command");
    Arguments arguments;
    app.add_option("--hand", arguments.hand, "Movement of the hand, CSV");
    app.add_option("--fault", arguments.faults, "Fault to inject (repeatable): " + haptic::device::fault_help())
        ->allow_extra_args(false);
    app.add_option("--pull-out", arguments.pull_out_s, "Time after which the board is gone, s");
    app.add_option("command", arguments.command, "What drives the board, after --")->required();
    CLI11_PARSE(app, argc, argv);
    try {
        return serve(arguments);
    } catch (const std::exception& error) {
        std::fprintf(stderr, "serve_usbfs: %s\n", error.what());
        return 1;
    }
}
