// Guard channel: the messages between a run and its guard, over a pair of sockets.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <optional>

#include "haptic/device/zero_packet.hpp"

namespace haptic::rt {

enum class GuardOrder : std::uint32_t {
    Begin,  // with all descriptors
    Renew,  // the device was opened again: with its descriptor
    Leave   // the motors are at zero, and the run ends
};

/// From the run to the guard. Descriptors travel beside it, in this order: page, black box, device.
struct GuardMessage {
    GuardOrder order = GuardOrder::Begin;
    std::int32_t priority = 0;     // SCHED_FIFO, wanted
    std::int32_t loop_cpu = -1;    // processor to avoid
    std::int64_t silence_ns = 0;   // without a tick, after which the loop counts as frozen
    std::int64_t lost_ns = 0;      // Supervision::limit_ns
    device::ZeroPacket zero = {};  // its descriptor is replaced by the one received
};

/// From the guard to the run, after Begin and Renew.
struct GuardGrant {
    std::int32_t process = 0;
    std::int32_t priority = 0;  // SCHED_FIFO; 0: ordinary scheduling
    std::int32_t oom_score_adj = 0;
    bool memory_locked = false;
};

/// Descriptors of a message; -1: none.
struct GuardDescriptors {
    int page = -1;
    int black_box = -1;
    int device = -1;
};

/// Sends a message with copies of the descriptors. False if the guard is gone.
[[nodiscard]] bool send_message(int socket, const GuardMessage& message, const GuardDescriptors& descriptors) noexcept;

/// What the guard finds on its socket.
enum class Received : std::uint8_t { Message, Nothing, Ended };
/// Receives a message without waiting; the descriptors belong to the caller. Ended: the run's process is gone.
[[nodiscard]] Received receive_message(int socket, GuardMessage& message, GuardDescriptors& descriptors) noexcept;

[[nodiscard]] bool send_grant(int socket, const GuardGrant& grant) noexcept;
/// Waits for the guard's answer; empty if it does not come in time.
[[nodiscard]] std::optional<GuardGrant> receive_grant(int socket, std::int64_t max_wait_ns) noexcept;

}  // namespace haptic::rt
