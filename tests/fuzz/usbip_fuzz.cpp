// A session of the USB/IP server, fed with anything a client may send, in pieces of any size, before an SH4 board that
// refuses what is no packet of its own. Promises: it never keeps more than it says, answers nothing once it has ended,
// and gives the device back.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <span>

#include "haptic/device/digits.hpp"
#include "haptic/device/emulated_board.hpp"
#include "usbip/usbip_session.hpp"

namespace {

using haptic::device::UsbipExport;
using haptic::device::UsbipSession;

// A message of the client is answered by less than this, but for the data of transfers, which the board has to make.
constexpr std::size_t kMostAnswered = 12 + 312 + 4;
constexpr std::size_t kShortestMessage = 8;

void require(bool held, const char* what) {
    if (!held) {
        std::fprintf(stderr, "broken promise: %s\n", what);
        std::abort();
    }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    static const haptic::device::Variant variant = haptic::device::spidar_g6_x3r();  // read from its file once
    haptic::device::EmulatedDevice device({.variant = variant});
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
            session.fill(now_ns);
            require(!had_ended || session.output().size() == before, "an ended session answers nothing");
            require(!session.ended() || !session.owns_device(), "an ended session has no device");
            rest = rest.subspan(std::min(piece, rest.size()));
            now_ns += 1'000'000;
        }
        answered = session.output().size();
        const std::size_t messages = size / kShortestMessage + 1;
        require(answered <= messages * (kMostAnswered + haptic::device::kBulkPacketBytes), "answers are bounded");
        for (const std::int16_t digit : device.digits()) {
            require(digit >= 0 && digit <= haptic::device::kMaximumDigit, "digits have 12 bits");
        }
    }
    require(exported.owner() == nullptr, "the device is given back");
    return 0;
}
