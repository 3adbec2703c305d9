// `rt-core doctor`: what of this machine keeps the loop from its period.
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

/// Prints the findings. 0 if none is bad, kExitUnfit otherwise. Throws ConfigError, std::runtime_error for a file that
/// cannot be written.
int doctor_command(const DoctorOptions& options);

}  // namespace haptic::rt
