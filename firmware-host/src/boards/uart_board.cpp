#include "boards/uart_board.hpp"

#include <algorithm>

namespace haptic::device {
namespace {

// So many times the transport's bound an id is waited for while looking for boards.
constexpr int kPatience = 5;
constexpr std::size_t kFewestZeros = 5;
// Zeros after a request for board info, as the published driver sends them.
constexpr std::size_t kInfoZeros = 26;

// Each board gets at least as many zeros as the longest command has bytes: whatever was half sent is then over.
constexpr std::array<std::byte, kUartLongestCommand> kEndOfAnything{};

}  // namespace

UartBoard::UartBoard(Transport& transport, const UartOptions& options) : transport_(&transport), options_(options) {}

void UartBoard::start() {
    zero_bytes_.store(0);
    nodes_.clear();
    failed_ = false;
    transport_->drain();
    look_for_boards();
    if (options_.set_lengths) {
        for (const Node& node : nodes_) {
            std::array<std::byte, kUartLengthsBytes + kFewestZeros> out{};
            encode_lengths(node.id, uart_lengths(node.info), std::span(out).first(kUartLengthsBytes));
            ask(out, {});
        }
    }
    transport_->drain();
    prepare_packets();
}

void UartBoard::look_for_boards() {
    ask(kEndOfAnything, {});
    std::size_t motors = 0;
    for (int id = 0; id < kUartIds; ++id) {
        std::array<std::byte, kUartInfoCommandBytes + kInfoZeros> out{};
        out[0] = encode_header({id, static_cast<std::uint8_t>(UartCommand::BoardInfo)});
        std::array<std::byte, kUartInfoReplyBytes> in{};
        const std::size_t received = ask(out, in);
        if (received == 0) {
            continue;
        }
        UartBoardInfo info;
        bool known = decode_info(std::span<const std::byte>(in).first(received), id, info) == PacketDefect::None;
        if (!known) {  // what was left of an earlier session may stand before it
            ask(kEndOfAnything, {});
            transport_->drain();
            known = decode_info(std::span<const std::byte>(in).first(ask(out, in)), id, info) == PacketDefect::None;
        }
        if (!known || !is_usable(info)) {
            throw BoardError("motor boards: what answers to id " + std::to_string(id) +
                             " is no board info; do two boards have the same id, or is the line's speed another?");
        }
        nodes_.push_back({.id = id, .info = info, .first = motors});
        motors += info.motors;
    }
    if (motors != kStrings) {
        const std::string those = nodes_.empty() ? "nothing" : found();
        nodes_.clear();
        throw BoardError("motor boards: eight motors are needed, and the line has " + std::to_string(motors) + " (" +
                         those + "); has every board power, and an id of its own?");
    }
}

void UartBoard::prepare_packets() {
    std::size_t out = 0;
    std::size_t in = 0;
    std::size_t zero = kUartLongestCurrentCommand;
    std::fill(zero_.begin(), zero_.end(), std::byte{0});
    for (Node& node : nodes_) {
        const std::size_t command = uart_current_command_bytes(node.info);
        const std::size_t reply = uart_current_reply_bytes(node.info);
        node.command = out;
        node.reply = in;
        out += command + padding(command, reply);
        in += reply;
        encode_currents(node.id, node.info, {}, std::span(zero_).subspan(zero, command));
        zero += command;
    }
    out_.assign(out, std::byte{0});
    in_.assign(in, std::byte{0});
    zero_bytes_.store(zero, std::memory_order_release);  // what it is of stands there before
}

std::size_t UartBoard::ask(std::span<const std::byte> out, std::span<std::byte> in) {
    std::size_t received = 0;
    for (int attempt = 0; attempt == 0 || (attempt < kPatience && received < in.size()); ++attempt) {
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

std::size_t UartBoard::padding(std::size_t command, std::size_t reply) const HAPTIC_RT {
    const auto wanted = static_cast<std::size_t>(options_.padding) + reply;
    return std::max(kFewestZeros, wanted > command ? wanted - command : 0);
}

void UartBoard::come_to_rest(std::int64_t now_ns) HAPTIC_RT {
    PacketExchange packets{{std::span<const std::byte>(kEndOfAnything)}, std::span<std::byte>(in_)};
    (void)transport_->exchange(packets, now_ns);  // whatever comes is of the exchange that failed
}

ExchangeStatus UartBoard::exchange(const MotorCommand& command, BoardReading& reading, std::int64_t now_ns) HAPTIC_RT {
    if (nodes_.empty()) {
        return ExchangeStatus::Disconnected;
    }
    if (failed_) {
        come_to_rest(now_ns);
    }
    failed_ = true;
    for (const Node& node : nodes_) {
        UartCurrents currents{};
        std::copy_n(command.digits.begin() + static_cast<std::ptrdiff_t>(node.first), node.info.motors,
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
    BoardReading found;
    for (const Node& node : nodes_) {
        if (take(node, found) != PacketDefect::None) {
            return ExchangeStatus::Malformed;
        }
    }
    reading = found;
    failed_ = false;
    return ExchangeStatus::Ok;
}

PacketDefect UartBoard::take(const Node& node, BoardReading& reading) const HAPTIC_RT {
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
    const std::size_t bytes = zero_bytes_.load(std::memory_order_acquire);
    if (bytes > 0) {
        transport_->send_last(std::span<const std::byte>(zero_).first(bytes), now_ns);
    }
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
