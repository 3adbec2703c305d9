#include "haptic/device/sh4_board.hpp"

#include <algorithm>

namespace haptic::device {
namespace {

constexpr std::uint32_t kWordMask = 0xFFFF;
// PIO word.
constexpr std::uint32_t kButtonMask = 0x0007;
constexpr unsigned kRotaryShift = 4;
constexpr std::uint32_t kRotaryMask = 0x000F;

/// Raw counters and the host's are each other's negatives.
std::uint32_t negated(std::uint32_t counter) HAPTIC_RT {
    return (0U - counter) & kWordMask;
}

}  // namespace

ExchangeStatus Sh4Board::exchange(const MotorCommand& command, BoardReading& reading, std::int64_t now_ns) HAPTIC_RT {
    Sh4Command sent;
    for (std::size_t i = 0; i < kStrings; ++i) {
        sent.digits[i] = static_cast<std::uint16_t>(std::max<std::int16_t>(command.digits[i], 0));
    }
    encode(sent, out_);
    PacketExchange packets{{std::span<const std::byte>(out_)}, std::span<std::byte>(in_)};
    const ExchangeStatus status = transport_->exchange(packets, now_ns);
    if (status != ExchangeStatus::Ok) {
        return status;
    }
    Sh4Reply reply;
    if (decode(std::span<const std::byte>(in_).first(packets.received), reply) != PacketDefect::None) {
        return ExchangeStatus::Short;
    }
    for (std::size_t i = 0; i < kStrings; ++i) {
        reading.counters[i] = negated(reply.counters[i]);
    }
    reading.analog = reply.analog;
    reading.buttons = reply.pio & kButtonMask;
    reading.rotary = static_cast<std::uint8_t>((reply.pio >> kRotaryShift) & kRotaryMask);
    return ExchangeStatus::Ok;
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
    reply.pio = static_cast<std::uint16_t>(device_->buttons() | (device_->rotary() << kRotaryShift));
    encode(reply, waiting_);
    has_reply_ = true;
}

std::size_t Sh4Firmware::reply(std::span<std::byte> in, std::int64_t /*now_ns*/) HAPTIC_RT {
    if (!has_reply_) {
        return 0;
    }
    has_reply_ = false;
    const std::size_t count = std::min(in.size(), waiting_.size());
    std::copy_n(waiting_.begin(), count, in.begin());
    return count;
}

}  // namespace haptic::device
