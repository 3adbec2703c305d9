#include "emulated/sh4_firmware.hpp"

#include <array>

#include "codecs/pio.hpp"

namespace haptic::device {

void Sh4Firmware::receive(std::span<const std::byte> out, std::int64_t now_ns) HAPTIC_RT {
    Sh4Command command;
    if (decode(out, command) != PacketDefect::None) {
        return;
    }
    std::array<std::int16_t, kStrings> dac_codes{};
    for (std::size_t i = 0; i < kStrings; ++i) {
        dac_codes[i] = static_cast<std::int16_t>(command.dac_codes[i]);
    }
    device_->advance(now_ns);  // with the DAC codes that the motors had until now
    device_->set_dac_codes(dac_codes);

    // Latch echo, counters and switches into one reply.
    Sh4Reply reply;
    for (std::size_t i = 0; i < kStrings; ++i) {
        reply.dac_codes[i] = static_cast<std::uint16_t>(device_->echo()[i]);
    }
    const std::array<std::uint32_t, kStrings> counters = device_->counters();
    for (std::size_t i = 0; i < kStrings; ++i) {
        reply.counters[i] = static_cast<std::uint16_t>(negated_counter(counters[i]));
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
