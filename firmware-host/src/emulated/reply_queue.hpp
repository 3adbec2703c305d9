// Queue of replies that wait in an emulated board until the host fetches them.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <span>

#include "haptic/realtime.hpp"

namespace haptic::device {

/// Packets of a fixed length, oldest first. An EZ-USB bulk endpoint holds at most four packets of 512 bytes. A reply
/// that does not fit is lost, so a host that fell behind receives old replies first, as from a real endpoint.
template <std::size_t Bytes>
class ReplyQueue {
  public:
    static constexpr std::size_t kPackets = 4;
    using Packet = std::array<std::byte, Bytes>;

    void push(const Packet& packet) HAPTIC_RT {
        if (count_ < kPackets) {
            packets_[(first_ + count_) % kPackets] = packet;
            ++count_;
        }
    }

    /// Removes the oldest packet and copies as much of it as fits. Returns the number of bytes, 0 if the queue is
    /// empty.
    std::size_t pop(std::span<std::byte> in) HAPTIC_RT {
        if (count_ == 0) {
            return 0;
        }
        const std::size_t taken = std::min(in.size(), Bytes);
        std::copy_n(packets_[first_].begin(), taken, in.begin());
        first_ = (first_ + 1) % kPackets;
        --count_;
        return taken;
    }

  private:
    std::array<Packet, kPackets> packets_{};
    std::size_t first_ = 0;
    std::size_t count_ = 0;
};

}  // namespace haptic::device
