// Every call out of this process that a USB exchange makes: libusb's, and the kernel's own where libusb's would lock.
#pragma once

#include <libusb.h>
#include <semaphore.h>

#include <cstdint>
#include <span>

#include <haptic/realtime.hpp>

namespace haptic::device::usb {

/// 0, or one of libusb_error.
[[nodiscard]] int submit(libusb_transfer* transfer) HAPTIC_RT;

/// Sleeps until a transfer of this node has ended, or until an instant of CLOCK_MONOTONIC.
void wait_for_transfer(int node, std::int64_t deadline_ns) HAPTIC_RT;

/// Takes the transfers that have ended, and calls their callbacks; waits for none.
void take_ended(libusb_context* context) HAPTIC_RT;

/// Wakes the thread that waits for it.
void wake(sem_t& semaphore) HAPTIC_RT;

/// Sends a packet to an endpoint by one system call that waits for the board to take it. 0, or the error.
int send_now(int node, unsigned char endpoint, std::span<const std::byte> out) HAPTIC_RT;

/// Lets a stalled endpoint go on.
void clear_halt_now(int node, unsigned char endpoint) HAPTIC_RT;

}  // namespace haptic::device::usb
