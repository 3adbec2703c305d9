#include "boards/sh4_board.hpp"

#include <algorithm>

#include "codecs/pio.hpp"

namespace haptic::device {

void Sh4Board::start() {
    transport_->drain();
    reply_overdue_ = false;
    answer_due_ = false;
    sent_ = {};
}

const Sh4Board::DacCodes& Sh4Board::prepare(const MotorCommand& command) HAPTIC_RT {
    // The DAC is unsigned: negative codes become zero.
    Sh4Command sent;
    for (std::size_t i = 0; i < kStrings; ++i) {
        sent.dac_codes[i] = static_cast<std::uint16_t>(std::clamp<int>(command.dac_codes[i], 0, kMaxDacCode));
    }
    encode(sent, out_);
    DacCodes& noted = sent_[next_];
    noted = sent.dac_codes;
    next_ = (next_ + 1) % kHistory;
    return noted;
}

ExchangeStatus Sh4Board::check(ExchangeStatus status, const DacCodes& sent, Sh4Reply& reply,
                               std::int64_t now_ns) HAPTIC_RT {
    // The echo of an earlier command means that we are behind: fetch one more reply. An echo that was never sent is a
    // fault of the board, for which another reply would not help.
    if (status == ExchangeStatus::Ok && check_echo_ && reply.dac_codes != sent) {
        status = ExchangeStatus::Stale;
        if (sent_recently(reply.dac_codes) && fetch({}, reply, now_ns) == ExchangeStatus::Ok &&
            reply.dac_codes == sent) {
            status = ExchangeStatus::Ok;
        }
    }
    reply_overdue_ = status == ExchangeStatus::Timeout;
    return status;
}

ExchangeStatus Sh4Board::exchange(const MotorCommand& command, BoardReading& reading, std::int64_t now_ns) HAPTIC_RT {
    // Without the echo only order matches replies to commands: remove an overdue reply first.
    Sh4Reply reply;
    if (answer_due_ || (reply_overdue_ && !check_echo_)) {
        (void)fetch({}, reply, now_ns);  // received or not, none is expected any more
    }
    answer_due_ = false;

    const DacCodes& sent = prepare(command);
    const ExchangeStatus status = check(fetch(out_, reply, now_ns), sent, reply, now_ns);
    if (status != ExchangeStatus::Ok) {
        return status;
    }

    for (std::size_t i = 0; i < kStrings; ++i) {
        reading.counters[i] = negated_counter(reply.counters[i]);
    }
    reading.analog = reply.analog;
    reading.buttons = pio_buttons(reply.pio);
    reading.rotary = pio_rotary(reply.pio);
    return ExchangeStatus::Ok;
}

ExchangeStatus Sh4Board::send(const MotorCommand& command, std::int64_t now_ns) HAPTIC_RT {
    (void)collect(now_ns);  // of an earlier send(), whose reply would be taken for that of this one
    if (reply_overdue_ && !check_echo_) {
        return ExchangeStatus::Timeout;  // only the next exchange, which waits, keeps the replies apart
    }
    due_ = prepare(command);
    PacketExchange packets{.out = {out_}, .in = {}, .reply_later = true};
    const ExchangeStatus status = transport_->exchange(packets, now_ns);
    answer_due_ = status == ExchangeStatus::Ok;
    return status;
}

ExchangeStatus Sh4Board::collect(std::int64_t now_ns) HAPTIC_RT {
    if (!answer_due_) {
        return ExchangeStatus::Ok;
    }
    answer_due_ = false;
    Sh4Reply reply;
    return check(fetch({}, reply, now_ns), due_, reply, now_ns);
}

ExchangeStatus Sh4Board::fetch(std::span<const std::byte> out, Sh4Reply& reply, std::int64_t now_ns) HAPTIC_RT {
    PacketExchange packets{{out}, std::span<std::byte>(in_)};
    const ExchangeStatus status = transport_->exchange(packets, now_ns);
    if (status != ExchangeStatus::Ok) {
        return status;
    }
    const bool complete = decode(std::span<const std::byte>(in_).first(packets.received), reply) == PacketDefect::None;
    return complete ? ExchangeStatus::Ok : ExchangeStatus::Short;
}

bool Sh4Board::sent_recently(const DacCodes& dac_codes) const HAPTIC_RT {
    return std::find(sent_.begin(), sent_.end(), dac_codes) != sent_.end();
}

void Sh4Board::zero_motors(std::int64_t now_ns) HAPTIC_RT {
    Sh4Packet out;  // not out_: another thread may be inside exchange()
    encode(Sh4Command{}, out);
    transport_->send_last(out, now_ns);
}

ZeroPacket Sh4Board::zero_packet() const {
    Sh4Packet out;
    encode(Sh4Command{}, out);
    ZeroPacket zero{.link = transport_->link()};
    zero.set_packet(out);
    return zero;
}

}  // namespace haptic::device
