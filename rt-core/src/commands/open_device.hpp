// Opened devices: the device named by --device, with its board and everything the board depends on.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "commands/run_command.hpp"
#include "haptic/device/board.hpp"
#include "haptic/device/emulated_device.hpp"
#include "process/period_budget.hpp"
#include "process/settings.hpp"
#include "tick/tick.hpp"

namespace haptic::rt {

class OpenedDevice {
  public:
    OpenedDevice() = default;
    OpenedDevice(const OpenedDevice&) = delete;
    OpenedDevice& operator=(const OpenedDevice&) = delete;
    virtual ~OpenedDevice() = default;

    /// The board that the tick drives; the same object for the lifetime of the device.
    [[nodiscard]] virtual device::Board& board() = 0;
    /// True if its motors can pull a person's hand: a loop without real-time privileges must not drive them.
    [[nodiscard]] virtual bool is_real() const = 0;
    /// Kind and location, as a noun with its article.
    [[nodiscard]] virtual std::string description() const = 0;
    /// How it is connected: route, speed and packets. The default is a device in this process.
    [[nodiscard]] virtual PeriodDemand demand() const { return {}; }
    /// Upper bound (ns) on the wait of one exchange() with the board; 0 if it never waits.
    [[nodiscard]] virtual std::int64_t exchange_bound_ns() const { return 0; }
    /// Makes the device usable again after an exchange fault, with motors at zero. Call only while no loop runs. Throws
    /// device::BoardError while the device is absent.
    virtual void reopen();
    /// The emulated device in this process; nullptr for all others.
    [[nodiscard]] virtual device::EmulatedDevice* emulated() { return nullptr; }
    /// Called with the tick that will drive the device, before the loop starts.
    virtual void attach(const Tick& /*tick*/) {}
};

/// Opens the device of the options. Throws Refusal for a device that is unknown or cannot be opened, and CsvError for a
/// hand recording that cannot be read.
[[nodiscard]] std::unique_ptr<OpenedDevice> open_device(const RunOptions& options, const Settings& settings);

}  // namespace haptic::rt
