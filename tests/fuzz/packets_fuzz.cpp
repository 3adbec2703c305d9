// Fuzz target: the codecs of all boards. A decoder must not read beyond its input, and a decoded packet must survive
// encoding and decoding unchanged. Firmware and driver of each board receive arbitrary packets: all values must stay in
// range, and the line must be usable afterwards.
//
// The first byte selects the interpretation of the others.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "boards/make_board.hpp"
#include "codecs/sh4_codec.hpp"
#include "codecs/simple_codec.hpp"
#include "codecs/uart_codec.hpp"
#include "emulated/make_firmware.hpp"
#include "haptic/device/emulated_device.hpp"
#include "require.hpp"

namespace {

using namespace haptic::device;  // NOLINT(google-build-using-namespace): used throughout
using haptic::kStrings;
using Bytes = std::span<const std::byte>;

/// Packets of USB boards: one decoder and one encoder, fixed length.
template <typename Value, std::size_t kBytes>
void go_round(Bytes input) {
    Value first;
    const Value untouched = first;
    if (decode(input, first) != PacketDefect::None) {
        require(first == untouched, "what is refused changes nothing");
        return;
    }
    require(input.size() == kBytes, "only packets of their length are understood");
    std::array<std::byte, kBytes> packet{};
    encode(first, packet);
    Value second;
    require(decode(Bytes(packet), second) == PacketDefect::None && second == first, "decode(encode(x)) is x");
    std::array<std::byte, kBytes> again{};
    encode(second, again);
    require(again == packet, "encode(decode(packet)) is the packet");
}

void go_round_uart(Bytes input) {
    if (input.empty()) {
        return;
    }
    const int id = decode_header(input[0]).id;
    for (const UartBoardInfo& info : {kUartB3M, kUartB5M}) {
        UartReply reply;
        if (decode_reply(input, id, info, reply) == PacketDefect::None) {
            std::vector<std::byte> packet(uart_current_reply_bytes(info));
            require(encode_reply(id, info, reply, packet) == PacketDefect::None, "its own length fits");
            require(std::equal(packet.begin(), packet.end(), input.begin(), input.end()), "replies lose nothing");
        }
        UartCurrents currents{};
        if (decode_currents(input, id, info, currents) == PacketDefect::None) {
            std::vector<std::byte> packet(uart_current_command_bytes(info));
            require(encode_currents(id, info, currents, packet) == PacketDefect::None, "its own length fits");
            require(std::equal(packet.begin(), packet.end(), input.begin(), input.end()), "currents lose nothing");
        }
    }
    UartBoardInfo info;
    if (decode_info(input, id, info) == PacketDefect::None) {
        std::array<std::byte, kUartInfoReplyBytes> packet{};
        require(encode_info(id, info, packet) == PacketDefect::None, "its own length fits");
        require(std::equal(packet.begin(), packet.end(), input.begin(), input.end()), "info loses nothing");
        if (is_usable(info)) {
            require(uart_current_reply_bytes(info) <= kUartLongestCurrentReply, "no answer is longer than the longest");
            const UartLengths lengths = uart_lengths(info);
            require(*std::max_element(lengths.begin(), lengths.end()) <= kUartLongestCommand,
                    "no command is longer than the longest");
        }
    }
    UartLengths lengths{};
    if (decode_lengths(input, id, lengths) == PacketDefect::None) {
        std::array<std::byte, kUartLengthsBytes> packet{};
        require(encode_lengths(id, lengths, packet) == PacketDefect::None, "its own length fits");
        require(std::equal(packet.begin(), packet.end(), input.begin(), input.end()), "lengths lose nothing");
    }
}

DeviceGeometry geometry_of(BoardKind kind) {
    DeviceGeometry geometry = spidar_g6_x3r();
    geometry.board = kind;
    if (kind == BoardKind::Uart) {
        geometry.uart_boards = {4, 4};
    }
    return geometry;
}

/// Feeds a firmware with packets; the first byte of each is its length.
void feed_firmware(BoardKind kind, Bytes input) {
    EmulatedDevice device({.geometry = geometry_of(kind)});
    const std::unique_ptr<Firmware> firmware = make_firmware(kind, device);
    std::array<std::byte, 512> in{};
    const std::int16_t least = kind == BoardKind::Uart ? -kMaxDacCode : 0;
    while (!input.empty()) {
        const std::size_t asked = std::to_integer<std::size_t>(input[0]);
        // 0 means the length of an SH4 packet, which does not fit in a byte.
        const std::size_t length = std::min(input.size() - 1, asked == 0 ? kSh4PacketBytes : asked);
        const std::vector<std::byte> packet(input.begin() + 1, input.begin() + 1 + static_cast<std::ptrdiff_t>(length));
        input = input.subspan(1 + length);
        firmware->receive(packet, 0);
        require(firmware->reply(in, 0) <= in.size(), "an answer is no longer than there is room for");
        for (const std::int16_t dac_code : device.dac_codes()) {
            require(dac_code >= least && dac_code <= kMaxDacCode, "motors get no more than twelve bits");
        }
    }
    // After any input the firmware must respond again: a USB board at once, a serial line after its longest command.
    const std::vector<std::byte> silence(4 * 256, std::byte{0});
    firmware->receive(silence, 0);
    while (firmware->reply(in, 0) > 0) {
    }
}

/// Replies with pieces of the input; the first byte of each is its length, 0 for that of an SH4 packet, 255 for no
/// reply.
class AnyAnswer final : public Transport {
  public:
    explicit AnyAnswer(Bytes input) : input_(input) {}
    ExchangeStatus exchange(PacketExchange& packets, std::int64_t /*now_ns*/) HAPTIC_RT override {
        packets.received = 0;
        if (input_.empty() || packets.in.empty()) {
            return packets.in.empty() ? ExchangeStatus::Ok : ExchangeStatus::Timeout;
        }
        const std::size_t asked = std::to_integer<std::size_t>(input_[0]);
        input_ = input_.subspan(1);
        if (asked == kNothing) {
            return ExchangeStatus::Timeout;
        }
        packets.received = std::min({packets.in.size(), input_.size(), asked == 0 ? kSh4PacketBytes : asked});
        std::copy_n(input_.begin(), packets.received, packets.in.begin());
        input_ = input_.subspan(packets.received);
        return packets.received > 0 ? ExchangeStatus::Ok : ExchangeStatus::Timeout;
    }
    void send_last(Bytes /*out*/, std::int64_t /*now_ns*/) HAPTIC_RT override {}
    void drain() override {}
    [[nodiscard]] bool over() const { return input_.empty(); }

  private:
    static constexpr std::size_t kNothing = 255;
    Bytes input_;
};

void feed_driver(BoardKind kind, bool check_echo, Bytes input) {
    AnyAnswer transport(input);
    const std::unique_ptr<Board> board = make_board(kind, transport, {.check_echo = check_echo, .uart = {}});
    try {
        board->start();
    } catch (const BoardError&) {
        return;
    }
    BoardReading reading;
    while (!transport.over()) {
        const BoardReading before = reading;
        if (board->exchange({}, reading, 0) != ExchangeStatus::Ok) {
            require(reading == before, "a failed exchange leaves the reading");
        }
        for (const std::uint32_t counter : reading.counters) {
            require(counter >> static_cast<unsigned>(counter_bits(kind)) == 0, "counters have their bits");
        }
        require(reading.buttons <= 7 && reading.rotary <= 15, "switches have their bits");
    }
    board->zero_motors(0);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    if (size == 0) {
        return 0;
    }
    // A copy of exactly this size, so that the sanitizer finds a read beyond it.
    const std::vector<std::byte> copy(reinterpret_cast<const std::byte*>(data) + 1,
                                      reinterpret_cast<const std::byte*>(data) + size);
    switch (data[0] % 12) {
        case 0:
            go_round<Sh4Command, kSh4PacketBytes>(copy);
            break;
        case 1:
            go_round<Sh4Reply, kSh4PacketBytes>(copy);
            break;
        case 2:
            go_round<SimpleCommand, kSimplePacketBytes>(copy);
            break;
        case 3:
            go_round<SimpleReply, kSimplePacketBytes>(copy);
            break;
        case 4:
            go_round_uart(copy);
            break;
        case 5:
            feed_firmware(BoardKind::Sh4, copy);
            break;
        case 6:
            feed_firmware(BoardKind::Simple, copy);
            break;
        case 7:
            feed_firmware(BoardKind::Uart, copy);
            break;
        case 8:
            feed_driver(BoardKind::Sh4, true, copy);
            break;
        case 9:
            feed_driver(BoardKind::Sh4, false, copy);
            break;
        case 10:
            feed_driver(BoardKind::Simple, true, copy);
            break;
        default:
            feed_driver(BoardKind::Uart, true, copy);
            break;
    }
    return 0;
}
