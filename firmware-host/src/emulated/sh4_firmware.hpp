// Emulated firmware of the Cyverse "USB2.0 SH4" board (0CEC:0205).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "codecs/sh4_codec.hpp"
#include "emulated/firmware.hpp"
#include "emulated/reply_queue.hpp"
#include "haptic/device/emulated_device.hpp"

namespace haptic::device {

/// Replies once to each well-formed command. Ignores a packet of another length or opcode, or with a DAC code above 12
/// bits.
class Sh4Firmware final : public Firmware {
  public:
    /// The device must outlive its firmware.
    explicit Sh4Firmware(EmulatedDevice& device) : device_(&device) {}

    void receive(std::span<const std::byte> out, std::int64_t now_ns) HAPTIC_RT override;
    std::size_t reply(std::span<std::byte> in, std::int64_t now_ns) HAPTIC_RT override;

  private:
    EmulatedDevice* device_;
    ReplyQueue<kSh4PacketBytes> replies_;
};

}  // namespace haptic::device
