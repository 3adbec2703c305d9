#include "boards/sh4_board.hpp"

#include <algorithm>

#include "codecs/pio.hpp"

namespace haptic::device {
namespace {

constexpr std::uint32_t kWordMask = 0xFFFF;

/// Raw counters and the host's are each other's negatives.
std::uint32_t negated(std::uint32_t counter) HAPTIC_RT {
    return (0U - counter) & kWordMask;
}

}  // namespace

void Sh4Board::start() {
    transport_->drain();
    owed_ = false;
    sent_ = {};
}

ExchangeStatus Sh4Board::exchange(const MotorCommand& command, BoardReading& reading, std::int64_t now_ns) HAPTIC_RT {
    Sh4Reply reply;
    if (owed_ && !check_echo_) {
        (void)fetch({}, reply, now_ns);  // whether it came or not, none is awaited any more
    }
    owed_ = false;
    Sh4Command sent;
    for (std::size_t i = 0; i < kStrings; ++i) {
        sent.digits[i] = static_cast<std::uint16_t>(std::clamp<int>(command.digits[i], 0, kMaximumDigit));
    }
    encode(sent, out_);
    ExchangeStatus status = fetch(out_, reply, now_ns);
    if (status == ExchangeStatus::Ok && check_echo_ && reply.digits != sent.digits) {
        status = ExchangeStatus::Stale;
        if (sent_lately(reply.digits) && fetch({}, reply, now_ns) == ExchangeStatus::Ok &&
            reply.digits == sent.digits) {
            status = ExchangeStatus::Ok;
        }
    }
    sent_[next_] = sent.digits;
    next_ = (next_ + 1) % kRemembered;
    if (status != ExchangeStatus::Ok) {
        owed_ = status == ExchangeStatus::Timeout;
        return status;
    }
    for (std::size_t i = 0; i < kStrings; ++i) {
        reading.counters[i] = negated(reply.counters[i]);
    }
    reading.analog = reply.analog;
    reading.buttons = pio_buttons(reply.pio);
    reading.rotary = pio_rotary(reply.pio);
    return ExchangeStatus::Ok;
}

ExchangeStatus Sh4Board::fetch(std::span<const std::byte> out, Sh4Reply& reply, std::int64_t now_ns) HAPTIC_RT {
    PacketExchange packets{{out}, std::span<std::byte>(in_)};
    const ExchangeStatus status = transport_->exchange(packets, now_ns);
    if (status != ExchangeStatus::Ok) {
        return status;
    }
    const bool whole = decode(std::span<const std::byte>(in_).first(packets.received), reply) == PacketDefect::None;
    return whole ? ExchangeStatus::Ok : ExchangeStatus::Short;
}

bool Sh4Board::sent_lately(const Digits& digits) const HAPTIC_RT {
    return std::find(sent_.begin(), sent_.end(), digits) != sent_.end();
}

void Sh4Board::zero_motors(std::int64_t now_ns) HAPTIC_RT {
    Sh4Packet out;  // its own: another thread may be within exchange()
    encode(Sh4Command{}, out);
    transport_->send_last(out, now_ns);
}

void Sh4Firmware::receive(std::span<const std::byte> out, std::int64_t now_ns) HAPTIC_RT {
    Sh4Command command;
    if (decode(out, command) != PacketDefect::None) {
        return;
    }
    std::array<std::int16_t, kStrings> digits{};
    for (std::size_t i = 0; i < kStrings; ++i) {
        digits[i] = static_cast<std::int16_t>(command.digits[i]);
    }
    device_->advance(now_ns);
    device_->set_digits(digits);

    Sh4Reply reply;
    for (std::size_t i = 0; i < kStrings; ++i) {
        reply.digits[i] = static_cast<std::uint16_t>(device_->echo()[i]);
    }
    const std::array<std::uint32_t, kStrings> counters = device_->counters();
    for (std::size_t i = 0; i < kStrings; ++i) {
        reply.counters[i] = static_cast<std::uint16_t>(negated(counters[i]));
    }
    reply.pio = pio_of(device_->buttons(), device_->rotary());
    Sh4Packet in;
    encode(reply, in);
    replies_.push(in);
}

std::size_t Sh4Firmware::reply(std::span<std::byte> in, std::int64_t /*now_ns*/) HAPTIC_RT {
    return replies_.pop(in);
}

}  // namespace haptic::device
