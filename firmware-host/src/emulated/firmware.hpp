// A board's firmware hosted on Linux, as its cable sees it: packets in, packets out.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include <haptic/realtime.hpp>

namespace haptic::device {

class Firmware {
  public:
    virtual ~Firmware() = default;

    /// One packet from the host. What the board does not understand it ignores, and answers nothing.
    virtual void receive(std::span<const std::byte> out, std::int64_t now_ns) HAPTIC_RT = 0;

    /// Takes the oldest answer that waits: its length, at most in.size(); 0 if there is none.
    virtual std::size_t reply(std::span<std::byte> in, std::int64_t now_ns) HAPTIC_RT = 0;

    /// Whether the cable is in. What is sent while it is out gets lost.
    [[nodiscard]] virtual bool connected(std::int64_t /*now_ns*/) const HAPTIC_RT { return true; }
};

}  // namespace haptic::device
