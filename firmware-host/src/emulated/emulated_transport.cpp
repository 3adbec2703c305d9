#include "emulated/emulated_transport.hpp"

#include <array>

namespace haptic::device {
namespace {

constexpr std::size_t kLongestReply = 512;

}  // namespace

ExchangeStatus EmulatedTransport::exchange(PacketExchange& packets, std::int64_t now_ns) HAPTIC_RT {
    if (!firmware_->connected(now_ns)) {
        return ExchangeStatus::Disconnected;
    }
    for (const std::span<const std::byte> out : packets.out) {
        if (!out.empty()) {
            firmware_->receive(out, now_ns);
        }
    }
    if (packets.in.empty()) {
        return ExchangeStatus::Ok;
    }
    // In process there is nothing to wait for: a reply is available now or has missed its time.
    packets.received = firmware_->reply(packets.in, now_ns);
    return packets.received > 0 ? ExchangeStatus::Ok : ExchangeStatus::Timeout;
}

void EmulatedTransport::send_last(std::span<const std::byte> out, std::int64_t now_ns) HAPTIC_RT {
    firmware_->receive(out, now_ns);
}

void EmulatedTransport::drain() {
    std::array<std::byte, kLongestReply> discarded{};
    while (firmware_->reply(discarded, 0) > 0) {
    }
}

}  // namespace haptic::device
