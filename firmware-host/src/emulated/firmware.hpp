// Firmware: a board's firmware emulated on Linux, seen from its cable: packets in, packets out.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "haptic/realtime.hpp"

namespace haptic::device {

class Firmware {
  public:
    virtual ~Firmware() = default;

    /// Takes one packet from the host. A packet that the board does not understand is ignored.
    virtual void receive(std::span<const std::byte> out, std::int64_t now_ns) HAPTIC_RT = 0;

    /// Takes the oldest pending reply; returns its length, at most in.size(), or 0 if there is none.
    virtual std::size_t reply(std::span<std::byte> in, std::int64_t now_ns) HAPTIC_RT = 0;

    /// Whether the cable is plugged in. Packets sent while it is not are lost.
    [[nodiscard]] virtual bool connected(std::int64_t /*now_ns*/) const HAPTIC_RT { return true; }
};

}  // namespace haptic::device
