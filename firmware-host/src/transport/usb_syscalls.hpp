// System calls of a USB exchange: through libusb, or directly to the kernel where libusb would take a lock.
#pragma once

#include <libusb.h>
#include <semaphore.h>

#include <cstddef>
#include <cstdint>
#include <span>

#include "haptic/realtime.hpp"

namespace haptic::device::usb {

/// Returns 0 or a libusb_error.
[[nodiscard]] int submit(libusb_transfer* transfer) HAPTIC_RT;

/// Sleeps until a transfer of this node has ended, or until the deadline (CLOCK_MONOTONIC).
void wait_for_transfer(int node, std::int64_t deadline_ns) HAPTIC_RT;

/// Reaps the transfers that have ended and calls their callbacks. Does not wait.
void reap_transfers(libusb_context* context) HAPTIC_RT;

/// Wakes the thread that waits on the semaphore.
void wake(sem_t& semaphore) HAPTIC_RT;

/// Longest wait of the kernel for a board to accept a packet on an exit path.
inline constexpr unsigned kSendTimeoutMs = 20;

/// Sends a packet to an endpoint with one system call that waits until the board accepts it. Returns 0 or an errno.
int send_now(int node, unsigned char endpoint, std::span<const std::byte> out,
             unsigned timeout_ms = kSendTimeoutMs) HAPTIC_RT;

/// Receives a packet from an endpoint with one system call. Returns its length, or a negative errno.
int receive_now(int node, unsigned char endpoint, std::span<std::byte> in, unsigned timeout_ms) noexcept;

/// Clears the halt of a stalled endpoint.
void clear_halt_now(int node, unsigned char endpoint) HAPTIC_RT;

}  // namespace haptic::device::usb
