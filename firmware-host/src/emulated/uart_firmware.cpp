#include "emulated/uart_firmware.hpp"

#include <algorithm>
#include <stdexcept>
#include <string>

namespace haptic::device {
namespace {

constexpr std::uint32_t kPositionMask = 0xFFFF;

std::vector<UartFirmware::ConnectedBoard> boards_of(const DeviceGeometry& geometry) {
    std::vector<UartFirmware::ConnectedBoard> boards;
    int motors = 0;
    for (const int count : geometry.uart_boards) {
        if (count != kUartB3M.motors && count != kUartB5M.motors) {
            throw std::invalid_argument("emulated motor boards: device geometry '" + geometry.name +
                                        "': no known board has " + std::to_string(count) + " motors; 4 and 8 are");
        }
        boards.push_back({static_cast<int>(boards.size()), count == kUartB3M.motors ? kUartB3M : kUartB5M});
        motors += count;
    }
    if (motors != static_cast<int>(kStrings)) {
        throw std::invalid_argument("emulated motor boards: device geometry '" + geometry.name +
                                    "': uart_boards have " + std::to_string(motors) + " motors, not 8");
    }
    return boards;
}

}  // namespace

UartFirmware::UartFirmware(EmulatedDevice& device) : UartFirmware(device, boards_of(device.geometry())) {}

UartFirmware::UartFirmware(EmulatedDevice& device, const std::vector<ConnectedBoard>& boards) : device_(&device) {
    std::size_t motors = 0;
    for (const ConnectedBoard& board : boards) {
        const bool taken =
            std::any_of(nodes_.begin(), nodes_.end(), [&](const Node& node) { return node.id == board.id; });
        if (board.id < 0 || board.id >= kUartIds || taken || !is_usable(board.info) ||
            motors + board.info.motors > kStrings) {
            throw std::invalid_argument(
                "emulated motor boards: ids must be unique and within 0..7, with at most 8 motors in total");
        }
        Node node;
        node.id = board.id;
        node.info = board.info;
        node.first = motors;
        // A board knows the lengths of its own commands; those of the others must be announced.
        node.lengths[static_cast<std::size_t>(board.id)] = uart_lengths(board.info);
        nodes_.push_back(node);
        motors += board.info.motors;
    }
}

void UartFirmware::receive(std::span<const std::byte> out, std::int64_t now_ns) HAPTIC_RT {
    for (const std::byte byte : out) {
        // Each received byte clocks one byte of a pending reply out of the boards.
        if (waiting_ > 0) {
            --waiting_;
            ++clocked_;
        }
        // All boards listen to the same line.
        for (Node& node : nodes_) {
            feed(node, byte, now_ns);
        }
    }
}

std::size_t UartFirmware::reply(std::span<std::byte> in, std::int64_t /*now_ns*/) HAPTIC_RT {
    const std::size_t taken = std::min(in.size(), clocked_);
    for (std::size_t i = 0; i < taken; ++i) {
        in[i] = queue_[(first_ + i) % kQueueBytes];
    }
    first_ = (first_ + taken) % kQueueBytes;
    clocked_ -= taken;
    return taken;
}

void UartFirmware::feed(Node& node, std::byte byte, std::int64_t now_ns) HAPTIC_RT {
    // A header determines the packet's length. A command of unknown length counts as one byte.
    if (node.received == 0) {
        const UartHeader header = decode_header(byte);
        const UartLengths& lengths = node.lengths[static_cast<std::size_t>(header.id)];
        const bool is_lengths = header.command == static_cast<std::uint8_t>(UartCommand::SetLengths);
        const std::size_t announced = header.command < kUartCommands ? lengths[header.command] : 0;
        node.expected = is_lengths ? kUartLengthsBytes : std::max<std::size_t>(announced, 1);
    }
    if (node.received < node.packet.size()) {
        node.packet[node.received] = byte;
    }
    ++node.received;
    if (node.received == node.expected) {
        handle_packet(node, now_ns);
        node.received = 0;
    }
}

void UartFirmware::handle_packet(Node& node, std::int64_t now_ns) HAPTIC_RT {
    const std::span<const std::byte> packet =
        std::span<const std::byte>(node.packet).first(std::min(node.received, node.packet.size()));
    const UartHeader header = decode_header(packet[0]);
    const auto command = static_cast<UartCommand>(header.command);
    // A packet for another board only matters for its command lengths.
    if (header.id != node.id) {
        if (command == UartCommand::SetLengths) {
            (void)decode_lengths(packet, header.id, node.lengths[static_cast<std::size_t>(header.id)]);
        }
        return;
    }
    if (command == UartCommand::BoardInfo) {
        reply_info(node);
    } else if (command == UartCommand::Current) {
        reply_currents(node, packet, now_ns);
    }
}

void UartFirmware::reply_info(const Node& node) HAPTIC_RT {
    std::array<std::byte, kUartInfoReplyBytes> reply{};
    encode_info(node.id, node.info, reply);
    queue(reply);
}

void UartFirmware::reply_currents(const Node& node, std::span<const std::byte> packet, std::int64_t now_ns) HAPTIC_RT {
    UartCurrents currents{};
    if (decode_currents(packet, node.id, node.info, currents) != PacketDefect::None) {
        return;
    }
    // Move the device with the old currents, then set those of this board's motors.
    device_->advance(now_ns);
    std::array<std::int16_t, kStrings> dac_codes = device_->dac_codes();
    std::copy_n(currents.begin(), node.info.motors, dac_codes.begin() + static_cast<std::ptrdiff_t>(node.first));
    device_->set_dac_codes(dac_codes);

    const std::array<std::uint32_t, kStrings> counters = device_->counters();
    UartReply reply;
    for (std::size_t i = 0; i < node.info.motors; ++i) {
        reply.positions[i] = static_cast<std::uint16_t>(counters[node.first + i] & kPositionMask);
    }
    std::array<std::byte, kUartLongestCurrentReply> buffer{};
    const auto packed = std::span(buffer).first(uart_current_reply_bytes(node.info));
    encode_reply(node.id, node.info, reply, packed);
    queue(packed);
}

void UartFirmware::queue(std::span<const std::byte> reply) HAPTIC_RT {
    if (clocked_ + waiting_ + reply.size() > kQueueBytes) {
        return;  // the host reads no replies: drop the whole reply
    }
    for (const std::byte byte : reply) {
        queue_[(first_ + clocked_ + waiting_) % kQueueBytes] = byte;
        ++waiting_;
    }
}

}  // namespace haptic::device
