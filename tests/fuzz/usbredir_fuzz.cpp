// Fuzz target: a usbredir session with arbitrary guest input in pieces of any size, in front of an SH4 board that
// ignores invalid packets. The session must bound its memory, stop answering once ended, and release the device.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "emulated/make_firmware.hpp"
#include "haptic/device/dac_codes.hpp"
#include "haptic/device/emulated_device.hpp"
#include "require.hpp"
#include "usbredir/usbredir_session.hpp"

namespace {

using haptic::device::UsbredirSession;

// Limit of the answers to one message: the endpoints, the interfaces and a status. The board's data come on top.
constexpr std::size_t kMaxAnswered = (16 + 160) + (16 + 132) + (16 + 10);
constexpr std::size_t kShortestMessage = 16;

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    static const haptic::device::DeviceGeometry geometry = haptic::device::spidar_g6_x3r();  // parsed once
    haptic::device::EmulatedDevice device({.geometry = geometry});
    const auto firmware = haptic::device::make_firmware(haptic::device::BoardKind::Sh4, device);
    if (size == 0) {
        return 0;
    }
    // The first byte: size of the pieces, and the speed.
    const std::size_t piece = 1 + data[0];
    haptic::device::ServedUsbDevice served(
        haptic::device::BoardKind::Sh4, *firmware,
        (data[0] & 1U) != 0 ? haptic::device::UsbSpeed::High : haptic::device::UsbSpeed::Full);
    std::span<const std::byte> rest = std::as_bytes(std::span(data, size)).subspan(1);
    {
        UsbredirSession session(served, true);
        const std::size_t hello = session.output().size();
        std::int64_t now_ns = 0;
        while (!rest.empty()) {
            const bool had_ended = session.ended();
            const std::size_t before = session.output().size();
            session.receive(rest.first(std::min(piece, rest.size())), now_ns);
            session.complete_pending(now_ns);
            require(!had_ended || session.output().size() == before, "an ended session answers nothing");
            require(!session.ended() || !session.connected(), "an ended session has no device");
            rest = rest.subspan(std::min(piece, rest.size()));
            now_ns += 1'000'000;
        }
        const std::size_t messages = size / kShortestMessage + 2;
        require(session.output().size() <= hello + messages * (kMaxAnswered + haptic::device::kPieceBytes),
                "answers are bounded");
        for (const std::int16_t dac_code : device.dac_codes()) {
            require(dac_code >= 0 && dac_code <= haptic::device::kMaxDacCode, "DAC codes have 12 bits");
        }
    }
    require(!served.waits_for_firmware(), "nothing stays pending");
    return 0;
}
