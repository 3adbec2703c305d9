// `rt-core doctor`: checks whether this machine is set up for a real-time loop.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace haptic::rt {

struct DoctorOptions {
    std::optional<std::filesystem::path> config;
    std::vector<std::string> assignments;  // --set
    std::optional<std::filesystem::path> json;
    std::filesystem::path root = "/";
};

/// Prints the findings. Returns 0 if none is bad, else kExitUnfit. Throws ConfigError, and std::runtime_error for a
/// file that cannot be written.
int doctor_command(const DoctorOptions& options);

}  // namespace haptic::rt
