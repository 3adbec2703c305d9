#include <algorithm>
#include <stdexcept>

#include "boards/uart_board.hpp"

namespace haptic::device {
namespace {

constexpr std::uint32_t kPositionMask = 0xFFFF;

std::vector<UartFirmware::Place> places_of(const Variant& variant) {
    std::vector<UartFirmware::Place> places;
    int motors = 0;
    for (const int count : variant.uart_boards) {
        if (count != kUartB3M.motors && count != kUartB5M.motors) {
            throw std::invalid_argument("emulated motor boards: variant '" + variant.name + "': no known board has " +
                                        std::to_string(count) + " motors; 4 and 8 are");
        }
        places.push_back({static_cast<int>(places.size()), count == kUartB3M.motors ? kUartB3M : kUartB5M});
        motors += count;
    }
    if (motors != static_cast<int>(kStrings)) {
        throw std::invalid_argument("emulated motor boards: variant '" + variant.name + "': uart_boards have " +
                                    std::to_string(motors) + " motors, not 8");
    }
    return places;
}

}  // namespace

UartFirmware::UartFirmware(EmulatedDevice& device) : UartFirmware(device, places_of(device.variant())) {}

UartFirmware::UartFirmware(EmulatedDevice& device, const std::vector<Place>& places) : device_(&device) {
    std::size_t motors = 0;
    for (const Place& place : places) {
        const bool taken =
            std::any_of(nodes_.begin(), nodes_.end(), [&](const Node& node) { return node.id == place.id; });
        if (place.id < 0 || place.id >= kUartIds || taken || !is_usable(place.info) ||
            motors + place.info.motors > kStrings) {
            throw std::invalid_argument("emulated motor boards: ids are 0 to 7, each once, with 8 motors at most");
        }
        Node node;
        node.id = place.id;
        node.info = place.info;
        node.first = motors;
        node.lengths[static_cast<std::size_t>(place.id)] = uart_lengths(place.info);
        nodes_.push_back(node);
        motors += place.info.motors;
    }
}

void UartFirmware::receive(std::span<const std::byte> out, std::int64_t now_ns) HAPTIC_RT {
    for (const std::byte byte : out) {
        if (waiting_ > 0) {
            --waiting_;
            ++clocked_;
        }
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
    if (node.have == 0) {
        const UartHeader header = decode_header(byte);
        const UartLengths& lengths = node.lengths[static_cast<std::size_t>(header.id)];
        const bool is_lengths = header.command == static_cast<std::uint8_t>(UartCommand::SetLengths);
        const std::size_t told = header.command < kUartCommands ? lengths[header.command] : 0;
        node.awaited = is_lengths ? kUartLengthsBytes : std::max<std::size_t>(told, 1);
    }
    if (node.have < node.packet.size()) {
        node.packet[node.have] = byte;
    }
    ++node.have;
    if (node.have == node.awaited) {
        take_packet(node, now_ns);
        node.have = 0;
    }
}

void UartFirmware::take_packet(Node& node, std::int64_t now_ns) HAPTIC_RT {
    const std::span<const std::byte> packet =
        std::span<const std::byte>(node.packet).first(std::min(node.have, node.packet.size()));
    const UartHeader header = decode_header(packet[0]);
    const auto command = static_cast<UartCommand>(header.command);
    if (header.id != node.id) {
        if (command == UartCommand::SetLengths) {
            (void)decode_lengths(packet, header.id, node.lengths[static_cast<std::size_t>(header.id)]);
        }
        return;
    }
    if (command == UartCommand::BoardInfo) {
        answer_info(node);
    } else if (command == UartCommand::Current) {
        answer_currents(node, packet, now_ns);
    }
}

void UartFirmware::answer_info(const Node& node) HAPTIC_RT {
    std::array<std::byte, kUartInfoReplyBytes> answer{};
    encode_info(node.id, node.info, answer);
    queue(answer);
}

void UartFirmware::answer_currents(const Node& node, std::span<const std::byte> packet, std::int64_t now_ns) HAPTIC_RT {
    UartCurrents currents{};
    if (decode_currents(packet, node.id, node.info, currents) != PacketDefect::None) {
        return;
    }
    device_->advance(now_ns);
    std::array<std::int16_t, kStrings> digits = device_->digits();
    std::copy_n(currents.begin(), node.info.motors, digits.begin() + static_cast<std::ptrdiff_t>(node.first));
    device_->set_digits(digits);

    const std::array<std::uint32_t, kStrings> counters = device_->counters();
    UartReply reply;
    for (std::size_t i = 0; i < node.info.motors; ++i) {
        reply.positions[i] = static_cast<std::uint16_t>(counters[node.first + i] & kPositionMask);
    }
    std::array<std::byte, kUartLongestCurrentReply> answer{};
    const auto used = std::span(answer).first(uart_current_reply_bytes(node.info));
    encode_reply(node.id, node.info, reply, used);
    queue(used);
}

void UartFirmware::queue(std::span<const std::byte> answer) HAPTIC_RT {
    if (clocked_ + waiting_ + answer.size() > kQueueBytes) {
        return;  // nobody fetches answers: they get lost whole
    }
    for (const std::byte byte : answer) {
        queue_[(first_ + clocked_ + waiting_) % kQueueBytes] = byte;
        ++waiting_;
    }
}

}  // namespace haptic::device
