#include "boards/uart_board.hpp"

#include <algorithm>

namespace haptic::device {
namespace {

// Multiples of the transport's time limit that discovery waits for an id.
constexpr int kQueryAttempts = 5;
// Zeros after a request for board info, as the published driver sends them.
constexpr std::size_t kInfoZeros = 26;

// As many zeros as the longest command has bytes: they end any command that was sent in part.
constexpr std::array<std::byte, kUartLongestCommand> kFlush{};

}  // namespace

UartBoard::UartBoard(Transport& transport, const UartOptions& options) : transport_(&transport), options_(options) {}

void UartBoard::start() {
    zero_bytes_.store(0);  // zero_motors() sends nothing until the packet is rebuilt
    nodes_.clear();
    failed_ = false;
    transport_->drain();
    discover_boards();
    if (options_.set_lengths) {
        for (const Node& node : nodes_) {
            std::array<std::byte, kUartLengthsBytes + kUartMinZeros> out{};
            encode_lengths(node.id, uart_lengths(node.info), std::span(out).first(kUartLengthsBytes));
            query(out, {});
        }
    }
    transport_->drain();
    prepare_packets();
}

void UartBoard::discover_boards() {
    query(kFlush, {});
    std::size_t motors = 0;
    for (int id = 0; id < kUartIds; ++id) {
        std::array<std::byte, kUartInfoCommandBytes + kInfoZeros> out{};
        out[0] = encode_header({id, static_cast<std::uint8_t>(UartCommand::BoardInfo)});
        std::array<std::byte, kUartInfoReplyBytes> in{};
        const std::size_t received = query(out, in);
        if (received == 0) {
            continue;
        }
        UartBoardInfo info;
        bool known = decode_info(std::span<const std::byte>(in).first(received), id, info) == PacketDefect::None;
        if (!known) {  // bytes of an earlier session may precede the reply: flush and ask again
            query(kFlush, {});
            transport_->drain();
            known = decode_info(std::span<const std::byte>(in).first(query(out, in)), id, info) == PacketDefect::None;
        }
        if (!known || !is_usable(info)) {
            throw BoardError("motor boards: the reply to id " + std::to_string(id) +
                             " is not a board info; do two boards share this id, or is the baud rate wrong?");
        }
        nodes_.push_back({.id = id, .info = info, .first = motors});
        motors += info.motors;
    }
    if (motors != kStrings) {
        const std::string detected = nodes_.empty() ? "nothing" : found();
        nodes_.clear();
        throw BoardError("motor boards: eight motors are required, the line has " + std::to_string(motors) + " (" +
                         detected + "); is every board powered, with an id of its own?");
    }
}

void UartBoard::prepare_packets() {
    // The zero packet starts with zeros that end the longest current command.
    std::size_t out = 0;
    std::size_t in = 0;
    std::size_t zero = kUartLongestCurrentCommand;
    std::fill(zero_.begin(), zero_.end(), std::byte{0});
    for (Node& node : nodes_) {
        const std::size_t command = uart_current_command_bytes(node.info);
        const std::size_t reply = uart_current_reply_bytes(node.info);
        node.command = out;
        node.reply = in;
        out += command + uart_zeros(options_, command, reply);
        in += reply;
        encode_currents(node.id, node.info, {}, std::span(zero_).subspan(zero, command));
        zero += command;
    }
    out_.assign(out, std::byte{0});
    in_.assign(in, std::byte{0});
    // Release: a thread that reads a length other than 0 also sees the bytes of zero_.
    zero_bytes_.store(zero, std::memory_order_release);
}

std::size_t UartBoard::query(std::span<const std::byte> out, std::span<std::byte> in) {
    std::size_t received = 0;
    for (int attempt = 0; attempt == 0 || (attempt < kQueryAttempts && received < in.size()); ++attempt) {
        // Send once, then only wait for the rest of the reply.
        PacketExchange packets{{attempt == 0 ? out : std::span<const std::byte>()}, in.subspan(received)};
        const ExchangeStatus status = transport_->exchange(packets, 0);
        if (status == ExchangeStatus::Ok) {
            received += packets.received;
        } else if (status != ExchangeStatus::Timeout) {
            throw BoardError("motor boards: the serial line fails: " + std::string(describe(status)) +
                             "; is its adapter plugged in?");
        }
    }
    return received;
}

void UartBoard::flush_line(std::int64_t now_ns) HAPTIC_RT {
    PacketExchange packets{{std::span<const std::byte>(kFlush)}, std::span<std::byte>(in_)};
    (void)transport_->exchange(packets, now_ns);  // any reply belongs to the exchange that failed
}

ExchangeStatus UartBoard::exchange(const MotorCommand& command, BoardReading& reading, std::int64_t now_ns) HAPTIC_RT {
    if (nodes_.empty()) {
        return ExchangeStatus::Disconnected;
    }
    if (failed_) {
        flush_line(now_ns);
    }
    failed_ = true;  // until all replies are decoded

    // One packet with the currents of all boards. The zeros between the commands were set by prepare_packets().
    for (const Node& node : nodes_) {
        UartCurrents currents{};
        std::copy_n(command.dac_codes.begin() + static_cast<std::ptrdiff_t>(node.first), node.info.motors,
                    currents.begin());
        encode_currents(node.id, node.info, currents,
                        std::span(out_).subspan(node.command, uart_current_command_bytes(node.info)));
    }
    PacketExchange packets{{std::span<const std::byte>(out_)}, std::span<std::byte>(in_)};
    const ExchangeStatus status = transport_->exchange(packets, now_ns);
    if (status != ExchangeStatus::Ok) {
        return status;
    }
    if (packets.received != in_.size()) {
        return ExchangeStatus::Short;
    }

    // `reading` is written only if every board's reply is well-formed.
    BoardReading decoded;
    for (const Node& node : nodes_) {
        if (decode_node(node, decoded) != PacketDefect::None) {
            return ExchangeStatus::Malformed;
        }
    }
    reading = decoded;
    failed_ = false;
    return ExchangeStatus::Ok;
}

PacketDefect UartBoard::decode_node(const Node& node, BoardReading& reading) const HAPTIC_RT {
    UartReply reply;
    const PacketDefect defect =
        decode_reply(std::span<const std::byte>(in_).subspan(node.reply, uart_current_reply_bytes(node.info)), node.id,
                     node.info, reply);
    for (std::size_t i = 0; i < node.info.motors; ++i) {
        reading.counters[node.first + i] = reply.positions[i];
    }
    for (std::size_t i = 0; i < node.info.forces && node.first + i < kStrings; ++i) {
        reading.analog[node.first + i] = static_cast<std::uint16_t>(reply.forces[i]);
    }
    return defect;
}

void UartBoard::zero_motors(std::int64_t now_ns) HAPTIC_RT {
    // Acquire: pairs with the release in prepare_packets(), so that zero_ is complete.
    const std::size_t bytes = zero_bytes_.load(std::memory_order_acquire);
    if (bytes > 0) {
        transport_->send_last(std::span<const std::byte>(zero_).first(bytes), now_ns);
    }
}

ZeroPacket UartBoard::zero_packet() const {
    ZeroPacket zero{.link = transport_->link()};
    zero.set_packet(std::span<const std::byte>(zero_).first(zero_bytes_.load(std::memory_order_acquire)));
    return zero;
}

std::string UartBoard::found() const {
    std::string text;
    for (const Node& node : nodes_) {
        text += (text.empty() ? "id " : "; id ") + std::to_string(node.id) + ": model " +
                std::to_string(node.info.model) + ", " + std::to_string(node.info.motors) + " motors";
    }
    return text;
}

}  // namespace haptic::device
