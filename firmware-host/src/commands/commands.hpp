// Commands of the executable firmware-host, after the command line was parsed.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "haptic/device/device_geometry.hpp"
#include "haptic/frames.hpp"
#include "haptic/types.hpp"

namespace haptic::device {

inline constexpr double kMilli = 1e3;  // mm in m, mN*m in N*m

struct ExchangeRequest {
    Pose grip;                                // pose of the grip
    std::array<double, kStrings> tensions{};  // N
    bool hex = false;                         // also print the packets' bytes
};

/// Sends one OUT packet to an emulated board and prints both packets and the resulting wrench. Returns false, with the
/// reason on stderr, if the board did not reply.
bool run_exchange(const DeviceGeometry& geometry, const ExchangeRequest& request);

/// Prints geometry, constants, reach and warnings of the device geometries in these files, or of the built-in ones if
/// there are no files. Throws ConfigError for an invalid file.
void run_geometries(const std::vector<std::string>& files);

}  // namespace haptic::device
