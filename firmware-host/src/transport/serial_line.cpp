#include "transport/serial_line.hpp"

#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <ctime>

#include "haptic/types.hpp"

namespace haptic::device {
namespace {

/// Interprets the result of read() or write() on a non-blocking descriptor.
LineResult result_of(ssize_t count) HAPTIC_RT {
    if (count > 0) {
        return {LineState::Moved, static_cast<std::size_t>(count)};
    }
    int error = 0;
    HAPTIC_RT_EXCEPTION_BEGIN("errno is the address of a thread-local variable")
    error = errno;
    HAPTIC_RT_EXCEPTION_END
    // 0 means that the line was hung up.
    const bool idle = count < 0 && (error == EAGAIN || error == EINTR);
    return {idle ? LineState::Idle : LineState::Gone, 0};
}

}  // namespace

LineResult line_write(int descriptor, std::span<const std::byte> out) HAPTIC_RT {
    ssize_t count = 0;
    HAPTIC_RT_EXCEPTION_BEGIN("does not wait (O_NONBLOCK): copies as much as fits into the kernel's buffer")
    count = write(descriptor, out.data(), out.size());
    HAPTIC_RT_EXCEPTION_END
    return result_of(count);
}

LineResult line_read(int descriptor, std::span<std::byte> in) HAPTIC_RT {
    ssize_t count = 0;
    HAPTIC_RT_EXCEPTION_BEGIN("does not wait (O_NONBLOCK): copies the contents of the kernel's buffer")
    count = read(descriptor, in.data(), in.size());
    HAPTIC_RT_EXCEPTION_END
    return result_of(count);
}

LineState line_wait(int descriptor, LineEvent event, std::int64_t max_wait_ns) HAPTIC_RT {
    pollfd watched{};
    watched.fd = descriptor;
    watched.events = event == LineEvent::Input ? POLLIN : POLLOUT;
    const std::int64_t left_ns = std::max<std::int64_t>(max_wait_ns, 0);
    const timespec time{left_ns / kNanosecondsPerSecond, left_ns % kNanosecondsPerSecond};
    int count = 0;
    HAPTIC_RT_EXCEPTION_BEGIN("waiting for the board is the purpose; at most max_wait_ns, less after a signal")
    count = ppoll(&watched, 1, &time, nullptr);
    HAPTIC_RT_EXCEPTION_END
    if (count <= 0) {
        return LineState::Idle;
    }
    // Input that arrived before a hang-up can still be read.
    return (watched.revents & watched.events) != 0 ? LineState::Moved : LineState::Gone;
}

}  // namespace haptic::device
