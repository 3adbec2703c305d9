// Settings of the emulated device: table [emulated] of a configuration.
#pragma once

#include <cstdint>
#include <optional>

#include "haptic/config.hpp"
#include "haptic/device/grip_mechanics.hpp"
#include "haptic/device/tremor.hpp"
#include "haptic/setting.hpp"

namespace haptic::device {

/// How the emulated grip moves.
enum class EmulatedMechanics : std::uint8_t {
    Ideal,      // exactly along the recorded track, whatever the strings do
    Impedance,  // a rigid body held by a hand with stiffness and damping
    Free        // a rigid body, held until the loop runs and then released
};

struct EmulatedSettings {
    EmulatedMechanics mechanics = EmulatedMechanics::Ideal;
    GripMechanics grip;  // not used by Ideal
    TremorSettings tremor;
};

[[nodiscard]] const SettingTable<EmulatedSettings>& emulated_settings();

/// The mechanics for these settings; none for Ideal.
[[nodiscard]] std::optional<GripMechanics> grip_mechanics(const EmulatedSettings& settings);

/// Reads the table [emulated]. Throws ConfigError.
[[nodiscard]] EmulatedSettings read_emulated(const Config& config);

}  // namespace haptic::device
