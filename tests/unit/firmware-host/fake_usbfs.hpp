// USB devices that are not there: a usbfs and its sysfs, made by umockdev, whose requests for transfers are answered by
// the project's own firmware and emulated device. libusb and everything above it run as they are.
//
// The process (and what it starts) has to run under umockdev's preloaded library, as ctest has it do.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "haptic/device/emulated_device.hpp"
#include "haptic/device/usb_discovery.hpp"

namespace haptic::test {

class FakeUsbfs;

/// A board on the fake bus. Members may be called while another thread or process drives it.
class FakeUsbBoard {
  public:
    /// What it does instead of answering.
    enum class Fault {
        None,
        Silent,    // takes commands, never answers
        Short,     // answers with the first 100 bytes only
        Overflow,  // sends more than was asked for
        StallIn,   // the answer's endpoint halts, until its halt is cleared
        StallOut,  // refuses the command likewise
        Protocol,  // the answer is damaged on the bus
        Blocked    // does not even take commands
    };

    ~FakeUsbBoard();
    FakeUsbBoard(const FakeUsbBoard&) = delete;
    FakeUsbBoard& operator=(const FakeUsbBoard&) = delete;

    /// From the next command on.
    void misbehave(Fault fault);
    /// Answers that are held back since Silent or Blocked come now.
    void release_answers();
    /// An answer that nobody has asked for waits to be read.
    void leave_stale_answer(std::vector<std::byte> packet);
    /// Unplugged: after so many more commands; at once for 0, in the middle of what is going on.
    void unplug_after(int commands);
    /// Another program has the interface.
    void occupy();

    [[nodiscard]] std::array<std::int16_t, kStrings> digits() const;
    [[nodiscard]] Pose grip_pose() const;
    [[nodiscard]] int commands() const;  // packets that it took
    [[nodiscard]] int halts_cleared() const;
    [[nodiscard]] int resets() const;
    [[nodiscard]] int early_commands() const;  // that came while no answer was awaited

  private:
    friend class FakeUsbfs;
    struct State;
    explicit FakeUsbBoard(std::unique_ptr<State> state);
    std::unique_ptr<State> state_;
};

class FakeUsbfs {
  public:
    /// Throws std::runtime_error where umockdev is not preloaded.
    FakeUsbfs();
    FakeUsbfs(const FakeUsbfs&) = delete;
    FakeUsbfs& operator=(const FakeUsbfs&) = delete;
    ~FakeUsbfs();

    struct Settings {
        device::EmulatedDevice::Settings device{.variant = device::spidar_g6_x3r()};
        std::string port = "1-1";
        int number = 2;  // on its bus
        device::UsbId id{0x0cec, 0x0205};
        unsigned char endpoint_in = 0x86;
        unsigned char endpoint_attributes = 0x02;  // bulk
    };
    /// Plugs a board in. It lives as long as this does, plugged in or not.
    FakeUsbBoard& plug(Settings settings);
    /// Takes its files away, as the kernel does after an unplugging.
    void remove(FakeUsbBoard& board);

  private:
    struct State;
    std::unique_ptr<State> state_;
};

}  // namespace haptic::test
