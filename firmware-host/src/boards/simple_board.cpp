#include "boards/simple_board.hpp"

#include <algorithm>
#include <string>

#include "codecs/pio.hpp"

namespace haptic::device {
namespace {

constexpr std::uint32_t kCounterMask = 0xFFFFFF;
constexpr std::uint8_t kAllChannels = 0xFF;

}  // namespace

void SimpleBoard::start() {
    transport_->drain();
    owed_ = false;
    SimplePacket phase;
    SimplePacket clear;
    encode(SimpleCommand{.request = SimpleRequest::Phase, .channels = phase_}, phase);
    encode(SimpleCommand{.request = SimpleRequest::Clear, .channels = kAllChannels}, clear);
    for (const SimplePacket* packet : {&phase, &clear}) {
        PacketExchange packets{{std::span<const std::byte>(*packet)}, {}};
        const ExchangeStatus status = transport_->exchange(packets, 0);
        if (status != ExchangeStatus::Ok) {
            throw BoardError("board 0cec:0203 does not take its start-up packets: " + std::string(describe(status)) +
                             "; unplug it, plug it in again and see what `lsusb -d 0cec:` says");
        }
    }
}

ExchangeStatus SimpleBoard::exchange(const MotorCommand& command, BoardReading& reading,
                                     std::int64_t now_ns) HAPTIC_RT {
    if (owed_) {
        PacketExchange late{{}, std::span<std::byte>(in_)};
        (void)transport_->exchange(late, now_ns);  // whether it came or not, none is awaited any more
        owed_ = false;
    }
    SimpleCommand sent{.request = SimpleRequest::Digits};
    for (std::size_t i = 0; i < kStrings; ++i) {
        sent.digits[i] = static_cast<std::uint16_t>(std::max<std::int16_t>(command.digits[i], 0));
    }
    encode(sent, digits_);
    encode(SimpleCommand{.request = SimpleRequest::Latch}, latch_);
    PacketExchange packets{{std::span<const std::byte>(digits_), std::span<const std::byte>(latch_)},
                           std::span<std::byte>(in_)};
    const ExchangeStatus status = transport_->exchange(packets, now_ns);
    if (status != ExchangeStatus::Ok) {
        owed_ = status == ExchangeStatus::Timeout;
        return status;
    }
    SimpleReply reply;
    if (decode(std::span<const std::byte>(in_).first(packets.received), reply) != PacketDefect::None) {
        return ExchangeStatus::Short;
    }
    reading.counters = reply.counters;
    reading.analog = {};
    reading.buttons = pio_buttons(reply.pio);
    reading.rotary = pio_rotary(reply.pio);
    return ExchangeStatus::Ok;
}

void SimpleBoard::zero_motors(std::int64_t now_ns) HAPTIC_RT {
    SimplePacket out;  // its own: another thread may be within exchange()
    encode(SimpleCommand{.request = SimpleRequest::Digits}, out);
    transport_->send_last(out, now_ns);
}

SimpleFirmware::SimpleFirmware(EmulatedDevice& device)
    : device_(&device), base_(device.counters()), origin_(device.counters()) {}

void SimpleFirmware::receive(std::span<const std::byte> out, std::int64_t now_ns) HAPTIC_RT {
    SimpleCommand command;
    if (decode(out, command) != PacketDefect::None) {
        return;
    }
    switch (command.request) {
        case SimpleRequest::Phase:
            set_counters(counters());
            phase_ = command.channels;
            break;
        case SimpleRequest::Clear: {
            Counters cleared = counters();
            for (std::size_t i = 0; i < kStrings; ++i) {
                if (((static_cast<unsigned>(command.channels) >> i) & 1U) != 0) {
                    cleared[i] = 0;
                }
            }
            set_counters(cleared);
            break;
        }
        case SimpleRequest::Digits: {
            std::array<std::int16_t, kStrings> digits{};
            for (std::size_t i = 0; i < kStrings; ++i) {
                digits[i] = static_cast<std::int16_t>(command.digits[i]);
            }
            device_->advance(now_ns);  // until now the motors had what they were sent before
            device_->set_digits(digits);
            break;
        }
        case SimpleRequest::Latch: {
            device_->advance(now_ns);
            SimpleReply reply;
            reply.counters = counters();
            reply.pio = pio_of(device_->buttons(), device_->rotary());
            SimplePacket in;
            encode(reply, in);
            replies_.push(in);
            break;
        }
    }
}

std::size_t SimpleFirmware::reply(std::span<std::byte> in, std::int64_t /*now_ns*/) HAPTIC_RT {
    return replies_.pop(in);
}

SimpleFirmware::Counters SimpleFirmware::counters() const HAPTIC_RT {
    Counters counters = device_->counters();
    for (std::size_t i = 0; i < kStrings; ++i) {
        const std::uint32_t moved = counters[i] - origin_[i];
        const bool forward = ((phase_ >> i) & 1U) != 0;
        counters[i] = (forward ? base_[i] + moved : base_[i] - moved) & kCounterMask;
    }
    return counters;
}

void SimpleFirmware::set_counters(const Counters& counters) HAPTIC_RT {
    base_ = counters;
    origin_ = device_->counters();
}

}  // namespace haptic::device
