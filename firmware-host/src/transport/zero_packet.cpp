#include "haptic/device/zero_packet.hpp"

#include <termios.h>

#include <algorithm>
#include <cerrno>

#include "haptic/clock.hpp"
#include "transport/serial_line.hpp"
#include "transport/usb_syscalls.hpp"
#include "transport/usb_transport.hpp"

namespace haptic::device {
namespace {

constexpr unsigned kAcceptMs = 3;
constexpr unsigned kAnswerMs = 1;
constexpr int kAttempts = 4;
// Answers that a board may hold back, and one to the zeros.
constexpr int kMaxAnswers = 4;
constexpr std::int64_t kSerialWaitNs = 20'000'000;

/// Reads what the board wants to get rid of, until nothing comes for a millisecond.
void discard_answers(int node) noexcept {
    std::array<std::byte, ZeroPacket::kMaxBytes> answer;  // NOLINT(*-member-init): only overwritten
    for (int i = 0; i < kMaxAnswers && usb::receive_now(node, UsbTransport::kEndpointIn, answer, kAnswerMs) > 0; ++i) {
    }
}

ExchangeStatus send_usb(const ZeroPacket& zero) noexcept {
    const int node = zero.link.descriptor;
    int error = 0;
    for (int attempt = 0; attempt < kAttempts; ++attempt) {
        error = usb::send_now(node, UsbTransport::kEndpointOut, zero.packet(), kAcceptMs);
        if (error == 0 || error == ENODEV || error == ESHUTDOWN) {
            break;
        }
        if (error == EPIPE) {
            usb::clear_halt_now(node, UsbTransport::kEndpointOut);
        } else {
            discard_answers(node);
        }
    }
    switch (error) {
        case 0:
            discard_answers(node);
            return ExchangeStatus::Ok;
        case ETIMEDOUT:
            return ExchangeStatus::Timeout;
        case EPIPE:
            return ExchangeStatus::Stalled;
        case ENODEV:
        case ESHUTDOWN:
            return ExchangeStatus::Disconnected;
        default:
            return ExchangeStatus::Failed;
    }
}

ExchangeStatus send_serial(const ZeroPacket& zero, Waiting waiting) noexcept {
    const int line = zero.link.descriptor;
    // Old answers are of no use to anybody.
    (void)tcflush(line, waiting == Waiting::Drop ? TCIOFLUSH : TCIFLUSH);
    std::span<const std::byte> rest = zero.packet();
    const std::int64_t end_ns = monotonic_now_ns() + kSerialWaitNs;
    while (!rest.empty()) {
        const LineResult written = line_write(line, rest);
        if (written.state == LineState::Gone) {
            return ExchangeStatus::Disconnected;
        }
        rest = rest.subspan(written.bytes);
        const std::int64_t left_ns = end_ns - monotonic_now_ns();
        if (!rest.empty() && (left_ns <= 0 || line_wait(line, LineEvent::Room, left_ns) != LineState::Moved)) {
            return ExchangeStatus::Timeout;
        }
    }
    return ExchangeStatus::Ok;
}

}  // namespace

void ZeroPacket::set_packet(std::span<const std::byte> packet) noexcept {
    size = packet.size() <= bytes.size() ? static_cast<std::uint32_t>(packet.size()) : 0;
    std::copy_n(packet.begin(), size, bytes.begin());
}

ExchangeStatus send_zero_packet(const ZeroPacket& zero, Waiting waiting) noexcept {
    if (zero.size == 0) {
        return ExchangeStatus::Failed;
    }
    switch (zero.link.kind) {
        case LinkKind::Usb:
            return send_usb(zero);
        case LinkKind::Serial:
            return send_serial(zero, waiting);
        case LinkKind::None:
            break;
    }
    return ExchangeStatus::Failed;
}

}  // namespace haptic::device
