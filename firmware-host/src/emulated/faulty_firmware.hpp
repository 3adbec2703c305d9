// A firmware behind a cable that loses, delays, repeats, cuts and corrupts packets on command, or is pulled out.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <haptic/device/emulated_device.hpp>
#include <haptic/device/fault.hpp>
#include "emulated/firmware.hpp"
#include <haptic/realtime.hpp>

namespace haptic::device {

/// Applies those faults that are of packets; the device knows when (EmulatedDevice::fault_time_ns). Where several
/// hold at once a packet suffers all of them. What is delayed comes when the caller's time has passed: in process,
/// where nobody waits, an answer that is late is one that did not come, and the next exchange gets it.
class FaultyFirmware final : public Firmware {
  public:
    static constexpr std::size_t kLongestPacket = 512;
    /// Packets that wait each way; what finds no room is lost.
    static constexpr std::size_t kMostWaiting = 16;

    /// The device must outlive its firmware.
    FaultyFirmware(std::unique_ptr<Firmware> firmware, const EmulatedDevice& device, std::vector<Fault> faults);

    void receive(std::span<const std::byte> out, std::int64_t now_ns) HAPTIC_RT override;
    std::size_t reply(std::span<std::byte> in, std::int64_t now_ns) HAPTIC_RT override;
    [[nodiscard]] bool connected(std::int64_t now_ns) const HAPTIC_RT override;

  private:
    struct Packet {
        std::array<std::byte, kLongestPacket> bytes{};
        std::size_t size = 0;
        std::int64_t sent_ns = 0;  // on the faults' clock
        std::int64_t due_ns = 0;   // on the caller's
    };
    struct Queue {
        std::array<Packet, kMostWaiting> packets;
        std::size_t first = 0;
        std::size_t count = 0;
    };

    void fetch_replies(std::int64_t now_ns) HAPTIC_RT;
    void deliver_commands(std::int64_t now_ns) HAPTIC_RT;
    /// What becomes of one packet, put into its queue.
    void suffer(Queue& queue, Packet& packet, bool command, std::int64_t now_ns) HAPTIC_RT;
    /// The oldest one if it is due, else nullptr; what was under way when the cable was pulled is gone.
    const Packet* take(Queue& queue, std::int64_t now_ns) HAPTIC_RT;
    std::size_t random_bit(std::size_t bits) HAPTIC_RT;

    std::unique_ptr<Firmware> firmware_;
    const EmulatedDevice* device_;
    std::vector<Fault> faults_;
    std::vector<std::int64_t> suffered_;  // packets, of each fault
    Queue commands_;
    Queue replies_;
    Packet packet_;
    std::uint64_t random_ = 0x9E3779B97F4A7C15ULL;
};

}  // namespace haptic::device
