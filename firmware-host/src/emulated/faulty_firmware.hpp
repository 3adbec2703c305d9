// Faulty firmware: a firmware behind a cable that loses, delays, repeats, truncates and corrupts packets on command, or
// is unplugged.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "emulated/firmware.hpp"
#include "haptic/device/emulated_device.hpp"
#include "haptic/device/fault.hpp"
#include "haptic/realtime.hpp"

namespace haptic::device {

/// Applies the packet faults at the times of the device's fault clock (EmulatedDevice::fault_time_ns). If several
/// faults are active, a packet is subject to all of them. A delayed packet arrives once the caller's time has passed:
/// in process nobody waits, so a late reply counts as missing and the next exchange receives it.
class FaultyFirmware final : public Firmware {
  public:
    static constexpr std::size_t kLongestPacket = 512;
    /// Capacity of each direction's queue; packets beyond it are lost.
    static constexpr std::size_t kMaxWaiting = 16;

    /// The device must outlive its firmware.
    FaultyFirmware(std::unique_ptr<Firmware> firmware, const EmulatedDevice& device, std::vector<Fault> faults);

    void receive(std::span<const std::byte> out, std::int64_t now_ns) HAPTIC_RT override;
    std::size_t reply(std::span<std::byte> in, std::int64_t now_ns) HAPTIC_RT override;
    [[nodiscard]] bool connected(std::int64_t now_ns) const HAPTIC_RT override;

  private:
    struct Packet {
        std::array<std::byte, kLongestPacket> bytes{};
        std::size_t size = 0;
        std::int64_t sent_ns = 0;  // on the fault clock
        std::int64_t due_ns = 0;   // on the caller's clock
    };
    /// Circular buffer.
    struct Queue {
        std::array<Packet, kMaxWaiting> packets;
        std::size_t first = 0;
        std::size_t count = 0;
    };

    void fetch_replies(std::int64_t now_ns) HAPTIC_RT;
    void deliver_commands(std::int64_t now_ns) HAPTIC_RT;
    /// Applies the active faults to one packet and queues the result.
    void transmit(Queue& queue, Packet& packet, bool command, std::int64_t now_ns) HAPTIC_RT;
    /// Removes the oldest packet if it is due, else returns nullptr. Packets in transit when the cable was unplugged
    /// are discarded.
    const Packet* take(Queue& queue, std::int64_t now_ns) HAPTIC_RT;
    std::size_t random_bit(std::size_t bits) HAPTIC_RT;

    std::unique_ptr<Firmware> firmware_;
    const EmulatedDevice* device_;
    std::vector<Fault> faults_;
    std::vector<std::int64_t> affected_;  // number of packets that each fault has affected
    Queue commands_;
    Queue replies_;
    Packet packet_;
    std::uint64_t random_ = 0x9E3779B97F4A7C15ULL;
};

}  // namespace haptic::device
