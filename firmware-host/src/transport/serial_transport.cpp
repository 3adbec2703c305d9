#include "transport/serial_transport.hpp"

#include <array>
#include <utility>

#include "haptic/clock.hpp"
#include "transport/serial_line.hpp"
#include "transport/serial_open.hpp"

namespace haptic::device {
namespace {

constexpr std::size_t kDiscardBytes = 256;
// Reads that discard old input; four hold more than the input of three exchanges.
constexpr int kDiscardReads = 4;
constexpr std::int64_t kSilenceNs = 20'000'000;
constexpr std::int64_t kLongestDrainNs = 200'000'000;

void discard_input(int descriptor) HAPTIC_RT {
    std::array<std::byte, kDiscardBytes> discarded{};
    for (int k = 0; k < kDiscardReads; ++k) {
        if (line_read(descriptor, discarded).bytes < discarded.size()) {
            return;
        }
    }
}

}  // namespace

SerialTransport::SerialTransport(std::filesystem::path path, const Settings& settings)
    : path_(std::move(path)), settings_(settings), descriptor_(open_serial_line(path_, settings_.baud)) {}

SerialTransport::~SerialTransport() {
    close_serial_line(descriptor_.exchange(-1));
}

void SerialTransport::reopen() {
    close_serial_line(descriptor_.exchange(-1));
    descriptor_ = open_serial_line(path_, settings_.baud);
}

ExchangeStatus SerialTransport::exchange(PacketExchange& packets, std::int64_t /*now_ns*/) HAPTIC_RT {
    const std::int64_t deadline_ns = monotonic_now_ns() + settings_.timeout_ns;
    packets.received = 0;
    // Discard old input once, immediately before the first packet.
    bool input_empty = false;
    for (const std::span<const std::byte> out : packets.out) {
        if (out.empty()) {
            continue;
        }
        if (!input_empty) {
            discard_input(descriptor_.load());
            input_empty = true;
        }
        const ExchangeStatus sent = send(out, deadline_ns);
        if (sent != ExchangeStatus::Ok) {
            return sent;
        }
    }
    return receive(packets, deadline_ns);
}

ExchangeStatus SerialTransport::send(std::span<const std::byte> out, std::int64_t deadline_ns) HAPTIC_RT {
    const int descriptor = descriptor_.load();
    while (!out.empty()) {
        const LineResult written = line_write(descriptor, out);
        if (written.state == LineState::Gone) {
            return ExchangeStatus::Disconnected;
        }
        out = out.subspan(written.bytes);
        if (out.empty()) {
            break;
        }
        // The kernel's buffer holds many exchanges: it is full only if the line is stuck.
        const std::int64_t left_ns = deadline_ns - monotonic_now_ns();
        if (left_ns <= 0 || line_wait(descriptor, LineEvent::Room, left_ns) != LineState::Moved) {
            return ExchangeStatus::Timeout;
        }
    }
    return ExchangeStatus::Ok;
}

ExchangeStatus SerialTransport::receive(PacketExchange& packets, std::int64_t deadline_ns) HAPTIC_RT {
    const int descriptor = descriptor_.load();
    while (packets.received < packets.in.size()) {
        const LineResult read = line_read(descriptor, packets.in.subspan(packets.received));
        if (read.state == LineState::Gone) {
            return ExchangeStatus::Disconnected;
        }
        packets.received += read.bytes;
        const std::int64_t left_ns = deadline_ns - monotonic_now_ns();
        if (packets.received == packets.in.size()) {
            break;
        }
        // Each wait ends with at least one byte or at the deadline, which bounds the iterations by the bytes.
        const LineState waited = left_ns > 0 ? line_wait(descriptor, LineEvent::Input, left_ns) : LineState::Idle;
        if (waited == LineState::Gone) {
            return ExchangeStatus::Disconnected;
        }
        if (waited == LineState::Idle && left_ns <= 0) {
            return packets.received > 0 ? ExchangeStatus::Ok : ExchangeStatus::Timeout;
        }
    }
    return ExchangeStatus::Ok;
}

void SerialTransport::send_last(std::span<const std::byte> out, std::int64_t /*now_ns*/) HAPTIC_RT {
    (void)line_write(descriptor_.load(), out);
}

void SerialTransport::drain() {
    const int descriptor = descriptor_.load();
    const std::int64_t end_ns = monotonic_now_ns() + kLongestDrainNs;
    while (monotonic_now_ns() < end_ns && line_wait(descriptor, LineEvent::Input, kSilenceNs) == LineState::Moved) {
        discard_input(descriptor);
    }
}

}  // namespace haptic::device
