// Host driver of the UART motor boards on one serial line.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "codecs/uart_codec.hpp"
#include "haptic/device/board.hpp"
#include "haptic/device/board_options.hpp"
#include "haptic/device/exchange_packets.hpp"
#include "transport/transport.hpp"

namespace haptic::device {

inline constexpr std::size_t kUartMinZeros = 5;

/// Zeros to send after a command so that its reply is clocked out.
[[nodiscard]] constexpr std::size_t uart_zeros(const UartOptions& options, std::size_t command,
                                               std::size_t reply) HAPTIC_RT {
    const auto wanted = static_cast<std::size_t>(options.padding) + reply;
    return std::max(kUartMinZeros, wanted > command ? wanted - command : 0);
}

/// start() detects the boards. Ordered by id, their motors are strings 0 to 7. An exchange sends each board its
/// currents, followed by the zeros that clock its reply out, and receives all replies. Currents have a sign; counters
/// are the positions modulo 65536; `analog` is the raw value of the force sensors.
///
/// Nothing in a reply identifies its command. After an exchange that failed, the next one therefore first flushes the
/// line; an exchange takes at most twice the transport's time limit.
class UartBoard final : public Board {
  public:
    /// The transport must outlive the board.
    explicit UartBoard(Transport& transport, const UartOptions& options = {});

    /// Ends a command that was sent in part, asks each id for its board info, and tells all boards the lengths of the
    /// commands to the others. Throws BoardError unless the line has eight motors. Waits for an id that does not reply
    /// for five times the transport's time limit, 10 ms by default.
    void start() override;
    ExchangeStatus exchange(const MotorCommand& command, BoardReading& reading, std::int64_t now_ns) HAPTIC_RT override;
    void zero_motors(std::int64_t now_ns) HAPTIC_RT override;
    [[nodiscard]] ZeroPacket zero_packet() const override;

    /// Boards that start() detected, for reports: "id 0: model 5, 4 motors; id 1: ..."
    [[nodiscard]] std::string found() const;
    /// Bytes of an exchange with them.
    [[nodiscard]] ExchangePackets packets() const noexcept { return {{out_.size(), 0}, in_.size()}; }

  private:
    struct Node {
        int id = 0;
        UartBoardInfo info;
        std::size_t first = 0;    // string of its first motor
        std::size_t command = 0;  // offset of its command in out_
        std::size_t reply = 0;    // offset of its reply in in_
    };

    void discover_boards();
    void prepare_packets();
    /// Sends a packet and receives up to in.size() bytes; returns their number. Throws BoardError if the line fails.
    std::size_t query(std::span<const std::byte> out, std::span<std::byte> in);
    /// Ends any partial command and discards the replies of an exchange that failed.
    void flush_line(std::int64_t now_ns) HAPTIC_RT;
    [[nodiscard]] PacketDefect decode_node(const Node& node, BoardReading& reading) const HAPTIC_RT;

    Transport* transport_;
    UartOptions options_;
    std::vector<Node> nodes_;     // written by start(), read-only afterwards
    std::vector<std::byte> out_;  // commands of one exchange, all boards
    std::vector<std::byte> in_;   // replies of one exchange, all boards
    bool failed_ = false;         // the last exchange failed
    // For zero_motors(), which any thread may call while start() runs: zeros that end a partial command, then zero
    // current for every board. zero_bytes_ is 0 while the packet is incomplete.
    std::array<std::byte, 2 * kUartLongestCurrentCommand + kUartIds> zero_{};
    std::atomic<std::size_t> zero_bytes_{0};
    static_assert(std::atomic<std::size_t>::is_always_lock_free, "required in a signal handler");
};

}  // namespace haptic::device
