// Rewired device: a device whose motors are not on the channels of their strings, as its geometry says.
#pragma once

#include <memory>

#include "commands/open_device.hpp"
#include "haptic/device/device_geometry.hpp"

namespace haptic::rt {

/// The same device with the code of each string sent to the channel that drives its motor; `opened` itself if those are
/// the channels of the strings already.
[[nodiscard]] std::unique_ptr<OpenedDevice> with_motor_channels(std::unique_ptr<OpenedDevice> opened,
                                                                const device::DeviceGeometry& geometry);

}  // namespace haptic::rt
