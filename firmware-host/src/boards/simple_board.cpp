#include "boards/simple_board.hpp"

#include <algorithm>
#include <string>

#include "codecs/pio.hpp"

namespace haptic::device {
namespace {

constexpr std::uint8_t kAllChannels = 0xFF;

}  // namespace

void SimpleBoard::start() {
    transport_->drain();
    reply_overdue_ = false;
    answer_due_ = false;
    SimplePacket phase;
    SimplePacket clear;
    encode(SimpleCommand{.request = SimpleRequest::Phase, .channels = phase_}, phase);
    encode(SimpleCommand{.request = SimpleRequest::Clear, .channels = kAllChannels}, clear);
    for (const SimplePacket* packet : {&phase, &clear}) {
        PacketExchange packets{{std::span<const std::byte>(*packet)}, {}};
        const ExchangeStatus status = transport_->exchange(packets, 0);
        if (status != ExchangeStatus::Ok) {
            throw BoardError("board 0cec:0203 does not accept its start-up packets: " + std::string(describe(status)) +
                             "; unplug it, plug it in again and check `lsusb -d 0cec:`");
        }
    }
}

void SimpleBoard::prepare(const MotorCommand& command) HAPTIC_RT {
    // The DAC is unsigned: negative codes become zero.
    SimpleCommand sent{.request = SimpleRequest::DacCodes};
    for (std::size_t i = 0; i < kStrings; ++i) {
        sent.dac_codes[i] = static_cast<std::uint16_t>(std::max<std::int16_t>(command.dac_codes[i], 0));
    }
    encode(sent, dac_codes_);
    encode(SimpleCommand{.request = SimpleRequest::Latch}, latch_);
}

ExchangeStatus SimpleBoard::fetch(const std::array<std::span<const std::byte>, 2>& out, SimpleReply& reply,
                                  std::int64_t now_ns) HAPTIC_RT {
    PacketExchange packets{out, std::span<std::byte>(in_)};
    const ExchangeStatus status = transport_->exchange(packets, now_ns);
    reply_overdue_ = status == ExchangeStatus::Timeout;
    if (status != ExchangeStatus::Ok) {
        return status;
    }
    const bool complete = decode(std::span<const std::byte>(in_).first(packets.received), reply) == PacketDefect::None;
    return complete ? ExchangeStatus::Ok : ExchangeStatus::Short;
}

ExchangeStatus SimpleBoard::exchange(const MotorCommand& command, BoardReading& reading,
                                     std::int64_t now_ns) HAPTIC_RT {
    // Only order matches replies to commands: remove an overdue reply first.
    SimpleReply reply;
    if (answer_due_ || reply_overdue_) {
        (void)fetch({}, reply, now_ns);  // received or not, none is expected any more
    }
    answer_due_ = false;

    prepare(command);
    const ExchangeStatus status = fetch({dac_codes_, latch_}, reply, now_ns);
    if (status != ExchangeStatus::Ok) {
        return status;
    }
    reading.counters = reply.counters;
    reading.analog = {};
    reading.buttons = pio_buttons(reply.pio);
    reading.rotary = pio_rotary(reply.pio);
    return ExchangeStatus::Ok;
}

ExchangeStatus SimpleBoard::send(const MotorCommand& command, std::int64_t now_ns) HAPTIC_RT {
    (void)collect(now_ns);  // of an earlier send(), whose reply would be taken for that of this one
    if (reply_overdue_) {
        return ExchangeStatus::Timeout;  // only the next exchange, which waits, keeps the replies apart
    }
    prepare(command);
    PacketExchange packets{.out = {dac_codes_, latch_}, .in = {}, .reply_later = true};
    const ExchangeStatus status = transport_->exchange(packets, now_ns);
    answer_due_ = status == ExchangeStatus::Ok;
    return status;
}

ExchangeStatus SimpleBoard::collect(std::int64_t now_ns) HAPTIC_RT {
    if (!answer_due_) {
        return ExchangeStatus::Ok;
    }
    answer_due_ = false;
    SimpleReply reply;
    return fetch({}, reply, now_ns);
}

void SimpleBoard::zero_motors(std::int64_t now_ns) HAPTIC_RT {
    SimplePacket out;  // not dac_codes_: another thread may be inside exchange()
    encode(SimpleCommand{.request = SimpleRequest::DacCodes}, out);
    transport_->send_last(out, now_ns);
}

ZeroPacket SimpleBoard::zero_packet() const {
    SimplePacket out;
    encode(SimpleCommand{.request = SimpleRequest::DacCodes}, out);
    ZeroPacket zero{.link = transport_->link()};
    zero.set_packet(out);
    return zero;
}

}  // namespace haptic::device
