#include "emulated/make_firmware.hpp"

#include <algorithm>
#include <stdexcept>
#include <utility>
#include <vector>

#include "emulated/faulty_firmware.hpp"
#include "emulated/sh4_firmware.hpp"
#include "emulated/simple_firmware.hpp"
#include "emulated/uart_firmware.hpp"

namespace haptic::device {
namespace {

std::unique_ptr<Firmware> make_faultless_firmware(BoardKind kind, EmulatedDevice& device) {
    switch (kind) {
        case BoardKind::Sh4:
            return std::make_unique<Sh4Firmware>(device);
        case BoardKind::Simple:
            return std::make_unique<SimpleFirmware>(device);
        case BoardKind::Uart:
            return std::make_unique<UartFirmware>(device);
    }
    throw std::invalid_argument("emulated board: device geometry '" + device.geometry().name +
                                "' has a board without firmware");
}

}  // namespace

std::unique_ptr<Firmware> make_firmware(BoardKind kind, EmulatedDevice& device) {
    std::unique_ptr<Firmware> firmware = make_faultless_firmware(kind, device);
    const std::vector<Fault>& faults = device.faults();
    if (std::any_of(faults.begin(), faults.end(), [](const Fault& fault) { return is_packet_fault(fault.kind); })) {
        firmware = std::make_unique<FaultyFirmware>(std::move(firmware), device, faults);
    }
    return firmware;
}

}  // namespace haptic::device
