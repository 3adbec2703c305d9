// Transport to an in-process firmware that loses, delays, changes and repeats packets, for tests.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "emulated/firmware.hpp"
#include "transport/transport.hpp"

namespace haptic::device::test {

class RoughCable final : public Transport {
  public:
    explicit RoughCable(Firmware& firmware) : firmware_(&firmware) {}

    ExchangeStatus exchange(PacketExchange& packets, std::int64_t now_ns) HAPTIC_RT override {
        HAPTIC_RT_EXCEPTION_BEGIN("a test's: it remembers what was sent, and no tick waits for it")
        ++exchanges;
        if (next_status != ExchangeStatus::Ok) {
            return next_status;
        }
        for (const std::span<const std::byte> out : packets.out) {
            if (!out.empty()) {
                sent.emplace_back(out.begin(), out.end());
                firmware_->receive(out, now_ns);
            }
        }
        if (packets.in.empty()) {
            return ExchangeStatus::Ok;
        }
        if (answers_held_back > 0) {  // it stays queued, and the next one follows it
            --answers_held_back;
            return ExchangeStatus::Timeout;
        }
        packets.received = firmware_->reply(packets.in, now_ns);
        if (change && packets.received > 0) {
            packets.received = change(packets.in.first(packets.received));
        }
        return packets.received > 0 ? ExchangeStatus::Ok : ExchangeStatus::Timeout;
        HAPTIC_RT_EXCEPTION_END
    }
    void send_last(std::span<const std::byte> out, std::int64_t now_ns) HAPTIC_RT override {
        HAPTIC_RT_EXCEPTION_BEGIN("tests only")
        sent.emplace_back(out.begin(), out.end());
        firmware_->receive(out, now_ns);
        HAPTIC_RT_EXCEPTION_END
    }
    void drain() override {
        std::array<std::byte, 512> thrown_away{};
        while (firmware_->reply(thrown_away, 0) > 0) {
        }
    }

    ExchangeStatus next_status = ExchangeStatus::Ok;          // result of every exchange, unless Ok
    int answers_held_back = 0;                                // number of replies that miss their time limit
    std::function<std::size_t(std::span<std::byte>)> change;  // modifies a reply; returns its length
    int exchanges = 0;
    std::vector<std::vector<std::byte>> sent;

  private:
    Firmware* firmware_;
};

}  // namespace haptic::device::test
