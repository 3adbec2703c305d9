// Emulated firmware of the UART motor boards on one serial line.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "codecs/uart_codec.hpp"
#include "emulated/firmware.hpp"
#include "haptic/device/emulated_device.hpp"

namespace haptic::device {

/// Up to eight boards on one line; the stream may arrive in pieces of any size. Where the behaviour of real boards is
/// unknown, the strict one is emulated: one byte of a reply leaves for each byte that follows the command, no earlier;
/// a board that was not told the lengths of another board's commands interprets their contents as headers; a command
/// with a current beyond +-4095 is ignored; only the commands board info, set lengths and current have an effect.
class UartFirmware final : public Firmware {
  public:
    /// A board on the line.
    struct ConnectedBoard {
        int id = 0;
        UartBoardInfo info;
    };

    /// Boards of the device's geometry, with ids from 0. The device must outlive its firmware. Throws
    /// std::invalid_argument if the boards do not drive eight motors.
    explicit UartFirmware(EmulatedDevice& device);
    /// Any boards: at most eight, different ids, at most eight motors in total. Their motors are strings 0, 1, ... in
    /// the given order.
    UartFirmware(EmulatedDevice& device, const std::vector<ConnectedBoard>& boards);

    /// Takes a piece of the stream, of any length.
    void receive(std::span<const std::byte> out, std::int64_t now_ns) HAPTIC_RT override;
    /// Takes the bytes that the boards have sent, at most in.size().
    std::size_t reply(std::span<std::byte> in, std::int64_t now_ns) HAPTIC_RT override;

  private:
    struct Node {
        int id = 0;
        UartBoardInfo info;
        std::size_t first = 0;                        // string of its first motor
        std::array<UartLengths, kUartIds> lengths{};  // of the commands to each id; 0 if not announced
        std::array<std::byte, kUartLongestCommand> packet{};
        std::size_t received = 0;  // bytes of the present packet
        std::size_t expected = 0;  // its length, known once its header has arrived
    };

    void feed(Node& node, std::byte byte, std::int64_t now_ns) HAPTIC_RT;
    void handle_packet(Node& node, std::int64_t now_ns) HAPTIC_RT;
    void reply_info(const Node& node) HAPTIC_RT;
    void reply_currents(const Node& node, std::span<const std::byte> packet, std::int64_t now_ns) HAPTIC_RT;
    void queue(std::span<const std::byte> reply) HAPTIC_RT;

    static constexpr std::size_t kQueueBytes = 512;

    EmulatedDevice* device_;
    std::vector<Node> nodes_;
    // Circular buffer: first the bytes that have left the boards, then those still waiting to be clocked out.
    std::array<std::byte, kQueueBytes> queue_{};
    std::size_t first_ = 0;    // index of the oldest byte
    std::size_t clocked_ = 0;  // bytes that have left the boards and that the host has not read
    std::size_t waiting_ = 0;  // bytes behind them, still in a board
};

}  // namespace haptic::device
