#include "emulated/simple_firmware.hpp"

#include "codecs/pio.hpp"

namespace haptic::device {
namespace {

constexpr std::uint32_t kCounterMask = 0xFFFFFF;

}  // namespace

SimpleFirmware::SimpleFirmware(EmulatedDevice& device)
    : device_(&device), base_(device.counters()), origin_(device.counters()) {}

void SimpleFirmware::receive(std::span<const std::byte> out, std::int64_t now_ns) HAPTIC_RT {
    SimpleCommand command;
    if (decode(out, command) != PacketDefect::None) {
        return;
    }
    switch (command.request) {
        case SimpleRequest::Phase:
            // The present count is kept; only further motion counts in the new direction.
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
        case SimpleRequest::DacCodes: {
            std::array<std::int16_t, kStrings> dac_codes{};
            for (std::size_t i = 0; i < kStrings; ++i) {
                dac_codes[i] = static_cast<std::int16_t>(command.dac_codes[i]);
            }
            device_->advance(now_ns);  // with the DAC codes that the motors had until now
            device_->set_dac_codes(dac_codes);
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
