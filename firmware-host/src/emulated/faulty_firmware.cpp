#include "emulated/faulty_firmware.hpp"

#include <algorithm>
#include <utility>

namespace haptic::device {

FaultyFirmware::FaultyFirmware(std::unique_ptr<Firmware> firmware, const EmulatedDevice& device,
                               std::vector<Fault> faults)
    : firmware_(std::move(firmware)), device_(&device), faults_(std::move(faults)) {
    std::erase_if(faults_, [](const Fault& fault) { return !is_packet_fault(fault.kind); });
    affected_.resize(faults_.size());
}

bool FaultyFirmware::connected(std::int64_t now_ns) const HAPTIC_RT {
    const std::int64_t time_ns = device_->fault_time_ns(now_ns);
    return std::none_of(faults_.begin(), faults_.end(), [&](const Fault& fault) HAPTIC_RT {
        return fault.kind == FaultKind::Unplug && fault.active(time_ns);
    });
}

void FaultyFirmware::receive(std::span<const std::byte> out, std::int64_t now_ns) HAPTIC_RT {
    if (!connected(now_ns)) {
        return;
    }
    if (out.size() > kLongestPacket) {  // not a packet of any board: pass it on, so that its length stays wrong
        firmware_->receive(out, now_ns);
        return;
    }
    packet_.size = out.size();
    std::copy(out.begin(), out.end(), packet_.bytes.begin());
    transmit(commands_, packet_, true, now_ns);
    deliver_commands(now_ns);
}

std::size_t FaultyFirmware::reply(std::span<std::byte> in, std::int64_t now_ns) HAPTIC_RT {
    if (!connected(now_ns)) {
        return 0;
    }
    deliver_commands(now_ns);
    fetch_replies(now_ns);
    const Packet* packet = take(replies_, now_ns);
    if (packet == nullptr) {
        return 0;
    }
    const std::size_t count = std::min(packet->size, in.size());
    std::copy_n(packet->bytes.begin(), count, in.begin());
    return count;
}

void FaultyFirmware::deliver_commands(std::int64_t now_ns) HAPTIC_RT {
    while (const Packet* packet = take(commands_, now_ns)) {
        firmware_->receive(std::span<const std::byte>(packet->bytes).first(packet->size), now_ns);
        fetch_replies(now_ns);
    }
}

void FaultyFirmware::fetch_replies(std::int64_t now_ns) HAPTIC_RT {
    // Bounded, in case a firmware's replies never end.
    for (std::size_t k = 0; k < kMaxWaiting; ++k) {
        packet_.size = firmware_->reply(packet_.bytes, now_ns);
        if (packet_.size == 0) {
            return;
        }
        transmit(replies_, packet_, false, now_ns);
    }
}

void FaultyFirmware::transmit(Queue& queue, Packet& packet, bool command, std::int64_t now_ns) HAPTIC_RT {
    // Every active fault of this direction that has packets left applies.
    packet.sent_ns = device_->fault_time_ns(now_ns);
    packet.due_ns = now_ns;
    bool lost = false;
    std::size_t copies = 1;
    for (std::size_t k = 0; k < faults_.size(); ++k) {
        const Fault& fault = faults_[k];
        if (fault.commands != command || !fault.active(packet.sent_ns) ||
            (fault.packets > 0 && affected_[k] >= fault.packets)) {
            continue;
        }
        ++affected_[k];
        switch (fault.kind) {
            case FaultKind::Drop:
                lost = true;
                break;
            case FaultKind::Delay:
                packet.due_ns += fault.delay_ns;
                break;
            case FaultKind::Duplicate:
                ++copies;
                break;
            case FaultKind::Truncate:
                packet.size = std::min(
                    packet.size, fault.bytes == Fault::kAny ? packet.size / 2 : static_cast<std::size_t>(fault.bytes));
                break;
            case FaultKind::Flip: {
                const std::size_t bits = 8 * packet.size;
                const std::size_t bit =
                    fault.bit == Fault::kAny ? random_bit(bits) : static_cast<std::size_t>(fault.bit);
                if (bit < bits) {
                    packet.bytes[bit / 8] ^= std::byte{1} << (bit % 8);
                }
                break;
            }
            default:
                break;
        }
    }
    // An empty packet is no packet. A full queue loses the rest.
    if (lost || packet.size == 0) {
        return;
    }
    for (std::size_t k = 0; k < copies && queue.count < kMaxWaiting; ++k) {
        queue.packets[(queue.first + queue.count) % kMaxWaiting] = packet;
        ++queue.count;
    }
}

const FaultyFirmware::Packet* FaultyFirmware::take(Queue& queue, std::int64_t now_ns) HAPTIC_RT {
    const std::int64_t time_ns = device_->fault_time_ns(now_ns);
    while (queue.count > 0) {
        const Packet& packet = queue.packets[queue.first];
        // The cable was unplugged after the packet was sent.
        const bool unplugged = std::any_of(faults_.begin(), faults_.end(), [&](const Fault& fault) HAPTIC_RT {
            return fault.kind == FaultKind::Unplug && packet.sent_ns < fault.begin_ns && fault.begin_ns <= time_ns;
        });
        if (!unplugged && packet.due_ns > now_ns) {
            return nullptr;
        }
        queue.first = (queue.first + 1) % kMaxWaiting;
        --queue.count;
        if (!unplugged) {
            return &packet;
        }
    }
    return nullptr;
}

std::size_t FaultyFirmware::random_bit(std::size_t bits) HAPTIC_RT {
    // Marsaglia's xorshift: reproducible.
    random_ ^= random_ << 13U;
    random_ ^= random_ >> 7U;
    random_ ^= random_ << 17U;
    return bits > 0 ? static_cast<std::size_t>(random_ % bits) : 0;
}

}  // namespace haptic::device
