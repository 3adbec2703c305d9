// Transport to a firmware in the same process.
#pragma once

#include "emulated/firmware.hpp"
#include "transport/transport.hpp"

namespace haptic::device {

class EmulatedTransport final : public Transport {
  public:
    /// The firmware must outlive the transport.
    explicit EmulatedTransport(Firmware& firmware) : firmware_(&firmware) {}

    ExchangeStatus exchange(PacketExchange& packets, std::int64_t now_ns) HAPTIC_RT override;
    void send_last(std::span<const std::byte> out, std::int64_t now_ns) HAPTIC_RT override;
    void drain() override;

  private:
    Firmware* firmware_;
};

}  // namespace haptic::device
