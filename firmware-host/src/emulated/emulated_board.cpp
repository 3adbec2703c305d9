#include <haptic/device/emulated_board.hpp>

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "emulated/faulty_firmware.hpp"
#include "boards/sh4_board.hpp"
#include "boards/simple_board.hpp"
#include "boards/uart_board.hpp"

namespace haptic::device {
namespace {

constexpr std::size_t kLongestReply = 512;

}  // namespace

std::string_view describe(ExchangeStatus status) noexcept {
    switch (status) {
        case ExchangeStatus::Ok:
            return "answered";
        case ExchangeStatus::Timeout:
            return "no answer in time";
        case ExchangeStatus::Short:
            return "an answer of another length";
        case ExchangeStatus::Malformed:
            return "a malformed answer";
        case ExchangeStatus::Stale:
            return "the answer to another command";
        case ExchangeStatus::Stalled:
            return "the endpoint stalled";
        case ExchangeStatus::Disconnected:
            return "disconnected";
        case ExchangeStatus::Failed:
            return "a transfer that the bus did not carry";
    }
    return "unknown status";
}

ExchangeStatus EmulatedTransport::exchange(PacketExchange& packets, std::int64_t now_ns) HAPTIC_RT {
    if (!firmware_->connected(now_ns)) {
        return ExchangeStatus::Disconnected;
    }
    for (const std::span<const std::byte> out : packets.out) {
        if (!out.empty()) {
            firmware_->receive(out, now_ns);
        }
    }
    if (packets.in.empty()) {
        return ExchangeStatus::Ok;
    }
    packets.received = firmware_->reply(packets.in, now_ns);
    return packets.received > 0 ? ExchangeStatus::Ok : ExchangeStatus::Timeout;
}

void EmulatedTransport::send_last(std::span<const std::byte> out, std::int64_t now_ns) HAPTIC_RT {
    firmware_->receive(out, now_ns);
}

void EmulatedTransport::drain() {
    std::array<std::byte, kLongestReply> thrown_away{};
    while (firmware_->reply(thrown_away, 0) > 0) {
    }
}

namespace {

std::unique_ptr<Firmware> make_sound_firmware(BoardKind kind, EmulatedDevice& device) {
    switch (kind) {
        case BoardKind::Sh4:
            return std::make_unique<Sh4Firmware>(device);
        case BoardKind::Simple:
            return std::make_unique<SimpleFirmware>(device);
        case BoardKind::Uart:
            return std::make_unique<UartFirmware>(device);
    }
    throw std::invalid_argument("emulated board: variant '" + device.variant().name + "' has a board without firmware");
}

}  // namespace

std::unique_ptr<Firmware> make_firmware(BoardKind kind, EmulatedDevice& device) {
    std::unique_ptr<Firmware> firmware = make_sound_firmware(kind, device);
    const std::vector<Fault>& faults = device.faults();
    if (std::any_of(faults.begin(), faults.end(), [](const Fault& fault) { return is_of_packets(fault.kind); })) {
        firmware = std::make_unique<FaultyFirmware>(std::move(firmware), device, faults);
    }
    return firmware;
}

std::unique_ptr<Board> make_board(BoardKind kind, Transport& transport, const BoardOptions& options) {
    switch (kind) {
        case BoardKind::Sh4:
            return std::make_unique<Sh4Board>(transport, options.check_echo);
        case BoardKind::Simple:
            return std::make_unique<SimpleBoard>(transport, options.simple_phase);
        case BoardKind::Uart:
            return std::make_unique<UartBoard>(transport, options.uart);
    }
    throw std::invalid_argument("no driver for this kind of board");
}

EmulatedBoard::EmulatedBoard(Settings settings, const BoardOptions& options)
    : device_(std::move(settings)),
      firmware_(make_firmware(device_.variant().board, device_)),
      transport_(*firmware_),
      board_(make_board(device_.variant().board, transport_, options)) {
    board_->start();
}

}  // namespace haptic::device
