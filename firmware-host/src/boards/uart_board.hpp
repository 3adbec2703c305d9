// The UART motor boards of one line, both ends: how a host drives them, and their firmware hosted on Linux.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include <haptic/device/board.hpp>
#include <haptic/device/board_options.hpp>
#include <haptic/device/emulated_device.hpp>
#include "emulated/firmware.hpp"
#include "transport/transport.hpp"
#include "codecs/uart_codec.hpp"

namespace haptic::device {

/// Host side. start() looks for boards; those that answer, by rising id, are strings 0 to 7 in the order of their
/// motors. An exchange sends all boards their currents, each followed by the zeros that clock its answer out, and takes
/// all answers. Currents have a sign; counters are the positions, modulo 65536. `analog` is the force sensors' raw
/// value.
///
/// Nothing in an answer tells to which command it belongs, so that after an exchange that failed the next one first
/// brings the line to rest: an exchange takes at most twice the transport's bound.
class UartBoard final : public Board {
  public:
    /// The transport must outlive the board.
    explicit UartBoard(Transport& transport, const UartOptions& options = {});

    /// Ends what may be half sent, asks each id in turn who it is, and tells all boards how long the commands to the
    /// others are. Throws BoardError where there are not eight motors on the line. An id that does not answer is waited
    /// for five times the transport's bound, 10 ms with the usual one.
    void start() override;
    ExchangeStatus exchange(const MotorCommand& command, BoardReading& reading, std::int64_t now_ns) HAPTIC_RT override;
    void zero_motors(std::int64_t now_ns) HAPTIC_RT override;

    /// What start() found, for people: "id 0: model 5, 4 motors; id 1: ..."
    [[nodiscard]] std::string found() const;

  private:
    struct Node {
        int id = 0;
        UartBoardInfo info;
        std::size_t first = 0;    // string of its first motor
        std::size_t command = 0;  // where its command begins in out_
        std::size_t reply = 0;    // where its answer begins in in_
    };

    void look_for_boards();
    void prepare_packets();
    std::size_t ask(std::span<const std::byte> out, std::span<std::byte> in);
    void come_to_rest(std::int64_t now_ns) HAPTIC_RT;
    [[nodiscard]] std::size_t padding(std::size_t command, std::size_t reply) const HAPTIC_RT;
    [[nodiscard]] PacketDefect take(const Node& node, BoardReading& reading) const HAPTIC_RT;

    Transport* transport_;
    UartOptions options_;
    std::vector<Node> nodes_;     // made by start(), read only after it
    std::vector<std::byte> out_;  // of an exchange, all boards
    std::vector<std::byte> in_;
    bool failed_ = false;  // the last exchange
    // Of zero_motors(), in any thread and while start() may run: ends what is half sent, then no current anywhere.
    std::array<std::byte, 2 * kUartLongestCurrentCommand + kUartIds> zero_{};
    std::atomic<std::size_t> zero_bytes_{0};
    static_assert(std::atomic<std::size_t>::is_always_lock_free, "only then may a signal handler use it");
};

/// Board side: up to eight boards on one line, fed with any part of the stream at a time. It takes the strict side
/// where the real boards are unknown: an answer comes out one byte for each byte that follows the command, no sooner; a
/// board that was not told how long another's commands are takes their contents for headers; a current beyond +-4095 is
/// not answered and changes nothing; of the commands only board info, set lengths and current do anything.
class UartFirmware final : public Firmware {
  public:
    struct Place {
        int id = 0;
        UartBoardInfo info;
    };

    /// The boards of the device's variant, with ids from 0. The device must outlive its firmware. Throws
    /// std::invalid_argument for a variant whose boards do not drive eight motors.
    explicit UartFirmware(EmulatedDevice& device);
    /// Any boards: at most eight, different ids, at most eight motors together, string by string in their order.
    UartFirmware(EmulatedDevice& device, const std::vector<Place>& places);

    /// A part of the stream, of any length.
    void receive(std::span<const std::byte> out, std::int64_t now_ns) HAPTIC_RT override;
    /// As much of the boards' stream as there is.
    std::size_t reply(std::span<std::byte> in, std::int64_t now_ns) HAPTIC_RT override;

  private:
    struct Node {
        int id = 0;
        UartBoardInfo info;
        std::size_t first = 0;                        // string of its first motor
        std::array<UartLengths, kUartIds> lengths{};  // of the commands to each id; 0 where it was not told
        std::array<std::byte, kUartLongestCommand> packet{};
        std::size_t have = 0;     // bytes of the packet
        std::size_t awaited = 0;  // its length, once its header is there
    };

    void feed(Node& node, std::byte byte, std::int64_t now_ns) HAPTIC_RT;
    void take_packet(Node& node, std::int64_t now_ns) HAPTIC_RT;
    void answer_info(const Node& node) HAPTIC_RT;
    void answer_currents(const Node& node, std::span<const std::byte> packet, std::int64_t now_ns) HAPTIC_RT;
    void queue(std::span<const std::byte> answer) HAPTIC_RT;

    static constexpr std::size_t kQueueBytes = 512;

    EmulatedDevice* device_;
    std::vector<Node> nodes_;
    std::array<std::byte, kQueueBytes> queue_{};  // a ring: what the boards have to say
    std::size_t first_ = 0;                       // oldest byte
    std::size_t clocked_ = 0;                     // bytes that have left the boards and wait for the host
    std::size_t waiting_ = 0;                     // bytes behind them, still in a board
};

}  // namespace haptic::device
