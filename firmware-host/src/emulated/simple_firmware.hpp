// Emulated firmware of the Cyverse "USB2.0 Simple" board (0CEC:0203).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "codecs/simple_codec.hpp"
#include "emulated/firmware.hpp"
#include "emulated/reply_queue.hpp"
#include "haptic/device/emulated_device.hpp"

namespace haptic::device {

/// Ignores a packet of another length or opcode, or with a DAC code above 12 bits. Until the counting directions are
/// set it counts with the wrong sign, so that a driver which forgets to set them is detected.
class SimpleFirmware final : public Firmware {
  public:
    /// The device must outlive its firmware.
    explicit SimpleFirmware(EmulatedDevice& device);

    void receive(std::span<const std::byte> out, std::int64_t now_ns) HAPTIC_RT override;
    std::size_t reply(std::span<std::byte> in, std::int64_t now_ns) HAPTIC_RT override;

  private:
    using Counters = std::array<std::uint32_t, kStrings>;
    [[nodiscard]] Counters counters() const HAPTIC_RT;
    /// Sets the counters to these values; they continue to count from there.
    void set_counters(const Counters& counters) HAPTIC_RT;

    EmulatedDevice* device_;
    Counters base_{};    // this board's counters at the last set_counters()
    Counters origin_{};  // the device's encoders at that time
    std::uint8_t phase_ = 0;
    ReplyQueue<kSimplePacketBytes> replies_;
};

}  // namespace haptic::device
