#include "commands/bringup_board.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cstdlib>
#include <string>
#include <thread>

#include "commands/run.hpp"
#include "haptic/clock.hpp"
#include "haptic/device/device_geometry_file.hpp"
#include "haptic/device/emulated_board.hpp"

namespace haptic::rt {
namespace {

using namespace std::chrono_literals;

class DeviceWithButtons final : public OpenedDevice {
  public:
    [[nodiscard]] device::Board& board() override { return emulated_board; }
    [[nodiscard]] bool is_real() const override { return false; }
    [[nodiscard]] std::string description() const override { return "a device with buttons"; }

    device::EmulatedBoard emulated_board{{.geometry = device::spidar_g6_x3r()}};
};

/// A terminal as standard input, for the time of a test.
class TerminalAsInput {
  public:
    TerminalAsInput() : before_(dup(STDIN_FILENO)), keyboard_(posix_openpt(O_RDWR | O_NOCTTY)) {
        grantpt(keyboard_);
        unlockpt(keyboard_);
        const int terminal = open(ptsname(keyboard_), O_RDWR | O_NOCTTY);
        dup2(terminal, STDIN_FILENO);
        close(terminal);
    }
    TerminalAsInput(const TerminalAsInput&) = delete;
    TerminalAsInput& operator=(const TerminalAsInput&) = delete;
    ~TerminalAsInput() {
        dup2(before_, STDIN_FILENO);
        close(before_);
        close(keyboard_);
    }
    void type(char key) const { EXPECT_EQ(write(keyboard_, &key, 1), 1); }

  private:
    int before_;
    int keyboard_;
};

TEST(BringupBoard, EndsAPullWithoutExchangesByAnyKeyIfItsButtonReplacesTheKey) {
    for (const char key : {' ', 'x'}) {
        const TerminalAsInput terminal;
        DeviceWithButtons device;
        device.emulated_board.device().set_buttons(1);
        // Within 0.3 s the code is reached and steady; nothing is sent from then on.
        std::thread person([&] {
            std::this_thread::sleep_for(1s);
            terminal.type(key);
        });
        const StopSignals signals;
        const BringupConsole console(signals);
        BringupBoard board(device, console, 16, {.cap_code = 50, .button = 0});
        board.refresh();
        const std::int64_t begin_ns = monotonic_now_ns();
        const HoldResult result =
            board.hold({.code = 30, .ramp_ns = 100'000'000, .silent_ns = 5 * kNanosecondsPerSecond});
        EXPECT_TRUE(result.steady);
        EXPECT_LT(monotonic_now_ns() - begin_ns, 4 * kNanosecondsPerSecond) << "key '" << key << "'";
        EXPECT_EQ(device.emulated_board.device().tensions(), (std::array<double, kStrings>{}));
        person.join();
    }
}

}  // namespace
}  // namespace haptic::rt
