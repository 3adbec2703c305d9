// `firmware-host reach`: whether a device reaches the poses and the wrenches of a recording.
#pragma once

#include <CLI/CLI.hpp>
#include <cstddef>
#include <filesystem>
#include <string>

#include "haptic/device/device_geometry.hpp"

namespace haptic::device {

/// Use of a device's reach by a recording.
struct ReachUse {
    std::size_t rows = 0;
    double excursion = 0.0;     // m, largest distance of the grip from the centre
    double rotation = 0.0;      // rad, largest rotation of the grip
    std::size_t open = 0;       // rows at poses where the strings are not wrench-closed
    double force = 0.0;         // N, largest
    double torque = 0.0;        // N*m, largest
    double share = 0.0;         // largest share of what the strings exert at the pose in the wrench's direction
    double share_at_s = 0.0;    // s, time of that row
    std::size_t unreached = 0;  // rows whose wrench the strings do not exert
};

/// Reads the columns time_s, x_m ... qz, fx_n, fy_n, fz_n, tx_nm, ty_nm and tz_nm, as host-sim and rt-core record them:
/// device frame, torque about the grip's origin. Throws CsvError.
[[nodiscard]] ReachUse reach_use(const DeviceGeometry& geometry, const std::filesystem::path& recording);

/// Command line after `reach`.
struct ReachArguments {
    std::string recording;
    std::string geometry = "SpidarG6X3R";
};

/// Adds the subcommand. The arguments must outlive the parsing.
CLI::App* add_reach(CLI::App& app, ReachArguments& arguments);

/// Prints the use of the reach, one quantity per line. Throws CsvError, and ConfigError for an invalid geometry.
void run_reach(const ReachArguments& arguments);

}  // namespace haptic::device
