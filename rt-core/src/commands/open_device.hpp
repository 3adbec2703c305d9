// The device that --device names, opened, with everything that it stands on.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include <haptic/device/board.hpp>
#include "process/settings.hpp"
#include "tick/tick.hpp"
#include "commands/run_command.hpp"

namespace haptic::rt {

class OpenedDevice {
  public:
    OpenedDevice() = default;
    OpenedDevice(const OpenedDevice&) = delete;
    OpenedDevice& operator=(const OpenedDevice&) = delete;
    virtual ~OpenedDevice() = default;

    /// What the tick drives; the same object for as long as this lives.
    [[nodiscard]] virtual device::Board& board() = 0;
    /// Its motors pull at a person: a loop that may be late must not drive them.
    [[nodiscard]] virtual bool real() const = 0;
    /// What and where, as a noun with its article.
    [[nodiscard]] virtual std::string description() const = 0;
    /// ns, longest that one exchange() with its board waits; 0 if it never does.
    [[nodiscard]] virtual std::int64_t exchange_bound_ns() const { return 0; }
    /// After an exchange fault: makes the device ready again, its motors at zero. Throws device::BoardError as long as
    /// it is not there. Only while no loop runs.
    virtual void reopen();
    /// The tick that is going to drive it, told before the loop starts.
    virtual void follow(const Tick& /*tick*/) {}
};

/// Throws Refusal for a device that is not known or cannot be opened, and CsvError for a recording that it is to
/// follow.
[[nodiscard]] std::unique_ptr<OpenedDevice> open_device(const RunOptions& options, const Settings& settings);

}  // namespace haptic::rt
