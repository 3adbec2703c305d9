// Fake USB devices: umockdev provides usbfs and sysfs, and the project's emulated firmware and device reply to the
// transfers. libusb and everything above it run unmodified.
//
// The process and its children must run with umockdev's preloaded library, as ctest arranges.
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

/// A board on the fake bus. Thread-safe with respect to its driver, which may be another process.
class FakeUsbBoard {
  public:
    /// Misbehaviour.
    enum class Fault {
        None,
        Silent,    // accepts commands, never replies
        Short,     // replies with the first 100 bytes only
        Overflow,  // sends more than requested
        StallIn,   // the IN endpoint halts until cleared
        StallOut,  // the OUT endpoint halts until cleared
        Protocol,  // the reply is corrupted on the bus
        Blocked,   // does not accept commands
        Full       // does not accept commands while a reply has not been fetched
    };

    ~FakeUsbBoard();
    FakeUsbBoard(const FakeUsbBoard&) = delete;
    FakeUsbBoard& operator=(const FakeUsbBoard&) = delete;

    /// From the next command on.
    void misbehave(Fault fault);
    /// Releases the replies held back since Silent or Blocked.
    void release_answers();
    /// Queues an unrequested reply.
    void leave_stale_answer(std::vector<std::byte> packet);
    /// Unplugs it after this many more commands; 0: immediately, even during a transfer.
    void unplug_after(int commands);
    /// Bit k: button k is held.
    void hold_buttons(std::uint8_t buttons);
    /// Lets another program claim the interface.
    void occupy();

    [[nodiscard]] std::array<std::int16_t, kStrings> dac_codes() const;
    [[nodiscard]] Pose grip_pose() const;
    [[nodiscard]] int commands() const;  // packets accepted
    [[nodiscard]] int halts_cleared() const;
    [[nodiscard]] int resets() const;
    [[nodiscard]] int early_commands() const;  // packets that arrived while no IN transfer was pending

  private:
    friend class FakeUsbfs;
    struct State;
    explicit FakeUsbBoard(std::unique_ptr<State> state);
    std::unique_ptr<State> state_;
};

/// The identity of a board of kind Sh4.
constexpr device::UsbId kSh4{0x0cec, 0x0205};

class FakeUsbfs {
  public:
    /// Throws std::runtime_error if umockdev is not preloaded.
    FakeUsbfs();
    FakeUsbfs(const FakeUsbfs&) = delete;
    FakeUsbfs& operator=(const FakeUsbfs&) = delete;
    ~FakeUsbfs();

    struct Settings {
        device::EmulatedDevice::Settings device{.geometry = device::spidar_g6_x3r()};
        std::string port = "1-1";
        int number = 2;  // device number on its bus
        int speed_mbit = 480;
        device::UsbId id = kSh4;
        unsigned char endpoint_in = 0x86;
        unsigned char endpoint_attributes = 0x02;  // bulk
    };
    /// Plugs a board in. The object lives as long as this one, even when unplugged.
    FakeUsbBoard& plug(Settings settings);
    /// Removes its files, as the kernel does when a device is unplugged.
    void remove(FakeUsbBoard& board);

  private:
    struct State;
    std::unique_ptr<State> state_;
};

}  // namespace haptic::test
