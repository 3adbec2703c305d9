// `rt-core run`: options, exit statuses and entry point of a run of the real-time loop.
#pragma once

#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "haptic/config.hpp"
#include "tick/tick_record.hpp"

namespace haptic::rt {

/// Observes the ticks of a recorded run, in the thread that writes the recording, some milliseconds after each tick.
class RunObserver {
  public:
    virtual ~RunObserver() = default;
    virtual void on_tick(const TickRecord& tick) = 0;
    /// True to end the run.
    [[nodiscard]] virtual bool done() const = 0;
};

struct RunOptions {
    std::optional<std::filesystem::path> config;
    std::vector<std::string> assignments;  // --set
    std::string device = "emulated";
    std::optional<std::filesystem::path> hand;
    std::vector<std::string> faults;  // of the emulated device, see haptic/device/fault.hpp
    std::vector<std::string> wiring;  // of the emulated device, see haptic/device/wiring.hpp
    std::string session = "default";
    std::optional<double> duration_s;
    std::optional<std::filesystem::path> report;
    std::optional<std::filesystem::path> record;
    bool reconnect = false;              // like safety.reconnect
    std::optional<std::string> profile;  // like safety.profile
    RunObserver* observer = nullptr;
};

// Exit statuses; 0 is a run without a fault.

/// The device cannot be driven, by this version or with these privileges.
class Refusal : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
};

/// The configuration file, or the defaults without one, with the assignments of --set applied. Throws ConfigError.
[[nodiscard]] Config load_config(const std::optional<std::filesystem::path>& file,
                                 const std::vector<std::string>& assignments);

/// The same for a run: with --profile, and for a real device that has none with the profile `normal`. So a
/// configuration that is saved beside a recording says which profile it was.
[[nodiscard]] Config load_run_config(const RunOptions& options);

/// Runs until stopped or faulted, and returns the exit status. Throws Refusal, ConfigError, CsvError, RingError.
int run_command(const RunOptions& options);

}  // namespace haptic::rt
