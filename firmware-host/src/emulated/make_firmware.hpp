// Factory of the emulated firmwares.
#pragma once

#include <memory>

#include "emulated/firmware.hpp"
#include "haptic/device/device_geometry.hpp"
#include "haptic/device/emulated_device.hpp"

namespace haptic::device {

/// Makes the firmware of a kind of board for a device, which must outlive it. If the device's settings contain packet
/// faults, the firmware is wrapped in a FaultyFirmware.
[[nodiscard]] std::unique_ptr<Firmware> make_firmware(BoardKind kind, EmulatedDevice& device);

}  // namespace haptic::device
