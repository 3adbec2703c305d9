#include "transport/usb_syscalls.hpp"

#include <linux/usbdevice_fs.h>
#include <poll.h>
#include <sys/ioctl.h>

#include <algorithm>
#include <cerrno>
#include <cstddef>
#include <ctime>

#include "haptic/clock.hpp"
#include "haptic/types.hpp"

namespace haptic::device::usb {
namespace {

/// One bulk transfer in either direction; the kernel copies from or to `data`. Returns its length, or a negative errno.
int transfer_now(int node, unsigned char endpoint, void* data, std::size_t size, unsigned timeout_ms) HAPTIC_RT {
    usbdevfs_bulktransfer bulk{};
    bulk.ep = endpoint;
    bulk.len = static_cast<unsigned>(size);
    bulk.timeout = timeout_ms;
    bulk.data = data;
    int result = 0;
    HAPTIC_RT_EXCEPTION_BEGIN("the kernel gives up after timeout_ms; called only on exit paths, never by a tick")
    result = ioctl(node, USBDEVFS_BULK, &bulk);
    result = result < 0 ? -errno : result;
    HAPTIC_RT_EXCEPTION_END
    return result;
}

}  // namespace

int submit(libusb_transfer* transfer) HAPTIC_RT {
    int result = 0;
    HAPTIC_RT_EXCEPTION_BEGIN(
        "USBDEVFS_SUBMITURB queues and returns. libusb allocates one URB (56 bytes) and takes locks that no other "
        "thread of this process takes; part of the exchange, whose bound is device.usb_timeout_s")
    result = libusb_submit_transfer(transfer);
    HAPTIC_RT_EXCEPTION_END
    return result;
}

void wait_for_transfer(int node, std::int64_t deadline_ns) HAPTIC_RT {
    const std::int64_t left_ns = std::max<std::int64_t>(deadline_ns - monotonic_now_ns(), 0);
    const timespec left{left_ns / kNanosecondsPerSecond, left_ns % kNanosecondsPerSecond};
    pollfd ended{node, POLLOUT, 0};
    HAPTIC_RT_EXCEPTION_BEGIN(
        "waiting is the purpose; it ends at the deadline, device.usb_timeout_s after the start of the exchange. A "
        "signal ends it early, and the caller waits again for the remaining time")
    // ppoll instead of libusb's wait, which has a resolution of milliseconds.
    static_cast<void>(ppoll(&ended, 1, &left, nullptr));
    HAPTIC_RT_EXCEPTION_END
}

void reap_transfers(libusb_context* context) HAPTIC_RT {
    timeval none{0, 0};
    HAPTIC_RT_EXCEPTION_BEGIN(
        "USBDEVFS_REAPURBNDELAY for each ended transfer, at most three, and once more to find no other; libusb frees "
        "their URBs. Its poll does not wait")
    static_cast<void>(libusb_handle_events_timeout_completed(context, &none, nullptr));
    HAPTIC_RT_EXCEPTION_END
}

void wake(sem_t& semaphore) HAPTIC_RT {
    HAPTIC_RT_EXCEPTION_BEGIN("sem_post: one atomic increment, and a futex wake-up if the thread sleeps; takes no lock")
    sem_post(&semaphore);
    HAPTIC_RT_EXCEPTION_END
}

int send_now(int node, unsigned char endpoint, std::span<const std::byte> out, unsigned timeout_ms) HAPTIC_RT {
    // The kernel only reads the packet.
    const int result = transfer_now(node, endpoint, const_cast<std::byte*>(out.data()), out.size(), timeout_ms);
    return result < 0 ? -result : 0;
}

int receive_now(int node, unsigned char endpoint, std::span<std::byte> in, unsigned timeout_ms) noexcept {
    return transfer_now(node, endpoint, in.data(), in.size(), timeout_ms);
}

void clear_halt_now(int node, unsigned char endpoint) HAPTIC_RT {
    unsigned number = endpoint;
    HAPTIC_RT_EXCEPTION_BEGIN("one control transfer, at most 5 s in the kernel; called only on exit paths")
    static_cast<void>(ioctl(node, USBDEVFS_CLEAR_HALT, &number));
    HAPTIC_RT_EXCEPTION_END
}

}  // namespace haptic::device::usb
