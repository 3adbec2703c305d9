// Device protocol: whether a person has measured a device and signed for it. `rt-core bringup` writes the protocol; a
// real device without a signed one is driven in commissioning mode, with at most 1 N.
//
// The signature carries a fingerprint of the geometry, so it ends when the geometry changes. It guards against
// mistakes, not against forgery: anybody who can write the file can sign it.
#pragma once

#include <filesystem>
#include <string>

#include "haptic/device/device_geometry.hpp"
#include "tick/tick_settings.hpp"

namespace haptic::rt {

/// Largest wrench of a device without a signed protocol. The torque is as much weaker as the force.
inline constexpr double kCommissioningForce = 1.0;    // N
inline constexpr double kCommissioningTorque = 0.02;  // N*m

/// Sixteen hexadecimal digits that change with every value of the geometry: FNV-1a, 64 bits, of its file without
/// comments.
/// @source G. Fowler, L. Noll, K.-P. Vo, draft-eastlake-fnv
[[nodiscard]] std::string fingerprint(const device::DeviceGeometry& geometry);

/// The protocol beside a geometry file: F.protocol.json for F.toml. Empty for the name of a built-in geometry, of which
/// there are many devices.
[[nodiscard]] std::filesystem::path protocol_beside(const std::string& geometry);

struct DeviceProtocol {
    std::string person;  // who signed
    std::string date;    // when, ISO 8601
    std::string lacks;   // why it does not hold; empty: it is signed for this geometry

    [[nodiscard]] bool holds() const noexcept { return lacks.empty(); }
};

/// Reads the protocol and compares it with the geometry. Never throws: a file that cannot be read is a protocol that
/// does not hold.
[[nodiscard]] DeviceProtocol read_protocol(const std::filesystem::path& file, const device::DeviceGeometry& geometry);

/// The settings with the limits of the commissioning mode, where those are lower, and its flag in every tick.
[[nodiscard]] TickSettings commissioning(const TickSettings& settings);

}  // namespace haptic::rt
