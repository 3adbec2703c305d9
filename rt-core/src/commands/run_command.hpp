// `rt-core run`: everything around the real-time thread.
#pragma once

#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "tick/tick_record.hpp"

namespace haptic::rt {

/// Follows a run that is recorded, in the thread that writes, some milliseconds after each tick.
class RunObserver {
  public:
    virtual ~RunObserver() = default;
    virtual void saw(const TickRecord& tick) = 0;
    /// The run is to stop.
    [[nodiscard]] virtual bool done() const = 0;
};

struct RunOptions {
    std::optional<std::filesystem::path> config;
    std::vector<std::string> assignments;  // --set
    std::string device = "emulated";
    std::optional<std::filesystem::path> hand;
    std::vector<std::string> faults;  // of the emulated device, device/fault.hpp
    std::string session = "default";
    std::optional<double> duration_s;
    std::optional<std::filesystem::path> report;
    std::optional<std::filesystem::path> record;
    bool rearm = false;  // as safety.rearm
    RunObserver* observer = nullptr;
};

// Exit statuses beside 0, which means that the run held.
inline constexpr int kExitError = 1;    // configuration, files, session
inline constexpr int kExitRefused = 2;  // this device cannot be driven here
inline constexpr int kExitFaulted = 3;  // the run ended in a fault
inline constexpr int kExitDiffers = 4;  // a replay did not come out as it was recorded
inline constexpr int kExitUnfit = 5;    // doctor found something bad

/// The device cannot be driven, in this version or with these privileges.
class Refusal : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
};

/// Runs until it is stopped or faulted; returns the exit status. Throws Refusal, ConfigError, CsvError, RingError.
int run_command(const RunOptions& options);

}  // namespace haptic::rt
