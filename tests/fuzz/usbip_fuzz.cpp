// Fuzz target: a USB/IP session with arbitrary client input in pieces of any size, in front of an SH4 board that
// ignores invalid packets. The session must bound its memory, stop replying once ended, and release the device.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "emulated/make_firmware.hpp"
#include "haptic/device/dac_codes.hpp"
#include "haptic/device/emulated_device.hpp"
#include "require.hpp"
#include "usbip/usbip_session.hpp"

namespace {

using haptic::device::UsbipExport;
using haptic::device::UsbipSession;

// Limit of the reply to one message, without the data of transfers, which the board produces.
constexpr std::size_t kMaxAnswered = 12 + 312 + 4;
constexpr std::size_t kShortestMessage = 8;

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    static const haptic::device::DeviceGeometry geometry = haptic::device::spidar_g6_x3r();  // parsed once
    haptic::device::EmulatedDevice device({.geometry = geometry});
    const auto firmware = haptic::device::make_firmware(haptic::device::BoardKind::Sh4, device);
    UsbipExport exported(haptic::device::BoardKind::Sh4, *firmware);
    if (size == 0) {
        return 0;
    }
    const std::size_t piece = 1 + data[0];
    std::span<const std::byte> rest = std::as_bytes(std::span(data, size)).subspan(1);
    {
        UsbipSession session(exported);
        std::int64_t now_ns = 0;
        std::size_t answered = 0;
        while (!rest.empty()) {
            const bool had_ended = session.ended();
            const std::size_t before = session.output().size();
            session.receive(rest.first(std::min(piece, rest.size())), now_ns);
            session.complete_pending(now_ns);
            require(!had_ended || session.output().size() == before, "an ended session answers nothing");
            require(!session.ended() || !session.owns_device(), "an ended session has no device");
            rest = rest.subspan(std::min(piece, rest.size()));
            now_ns += 1'000'000;
        }
        answered = session.output().size();
        const std::size_t messages = size / kShortestMessage + 1;
        require(answered <= messages * (kMaxAnswered + haptic::device::kPieceBytes), "answers are bounded");
        for (const std::int16_t dac_code : device.dac_codes()) {
            require(dac_code >= 0 && dac_code <= haptic::device::kMaxDacCode, "DAC codes have 12 bits");
        }
    }
    require(exported.owner() == nullptr, "the device is given back");
    return 0;
}
