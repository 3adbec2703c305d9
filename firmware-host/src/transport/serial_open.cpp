#include "transport/serial_open.hpp"

#include <fcntl.h>
#include <linux/serial.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <string>
#include <utility>

#include "haptic/device/exchange_status.hpp"
#include "transport/handover.hpp"

namespace haptic::device {
namespace {

constexpr std::pair<int, speed_t> kSpeeds[] = {
    {115'200, B115200},    {230'400, B230400},    {460'800, B460800},    {921'600, B921600},
    {1'000'000, B1000000}, {1'500'000, B1500000}, {2'000'000, B2000000}, {3'000'000, B3000000},
};

speed_t speed_of(int baud) noexcept {
    for (const auto& [bits, speed] : kSpeeds) {
        if (bits == baud) {
            return speed;
        }
    }
    return B0;
}

const char* remedy_of(int error) noexcept {
    switch (error) {
        case ENOENT:
        case ENXIO:
        case ENODEV:
            return "is the adapter plugged in? `ls /dev/serial/by-id` lists the connected ones";
        case EACCES:
        case EPERM:
            return "your user must be in the group that owns it: `sudo usermod -aG dialout $USER`, then log in again";
        case EBUSY:
        case EWOULDBLOCK:
            return "it is in use by another process: end that process first";
        case ENOTTY:
            return "it is not a serial line";
        default:
            return "check the kernel's messages: `dmesg`";
    }
}

[[noreturn]] void fail(const std::filesystem::path& path, const char* what, int error) {
    throw BoardError(path.string() + ": " + what + ": " + std::strerror(error) + "; " + remedy_of(error));
}

/// Owns a descriptor until release().
class Descriptor {
  public:
    explicit Descriptor(int value) noexcept : value_(value) {}
    Descriptor(const Descriptor&) = delete;
    Descriptor& operator=(const Descriptor&) = delete;
    ~Descriptor() { close_serial_line(value_); }
    [[nodiscard]] int get() const noexcept { return value_; }
    [[nodiscard]] int release() noexcept { return std::exchange(value_, -1); }

  private:
    int value_;
};

/// Asks adapters that buffer input to deliver it immediately. Ignored by drivers without this option.
void ask_for_low_latency(int descriptor) noexcept {
    serial_struct serial{};
    if (ioctl(descriptor, TIOCGSERIAL, &serial) == 0) {
        serial.flags |= static_cast<int>(ASYNC_LOW_LATENCY);
        (void)ioctl(descriptor, TIOCSSERIAL, &serial);
    }
}

}  // namespace

bool is_serial_speed(int baud) noexcept {
    return speed_of(baud) != B0;
}

void close_serial_line(int descriptor) noexcept {
    if (descriptor >= 0) {
        // A guard that shares the line must not keep it locked.
        (void)flock(descriptor, LOCK_UN);
        (void)close(descriptor);
    }
}

int open_serial_line(const std::filesystem::path& path, int baud) {
    const speed_t speed = speed_of(baud);
    if (speed == B0) {
        throw BoardError(path.string() + ": unsupported baud rate " + std::to_string(baud) +
                         " bit/s; the boards use 2000000");
    }
    Descriptor line(open(path.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
    if (line.get() < 0) {
        fail(path, "cannot be opened", errno);
    }
    termios wanted{};
    if (tcgetattr(line.get(), &wanted) != 0) {
        fail(path, "cannot be set up", errno);
    }
    // flock, because TIOCEXCL does not exclude root and persists after the process.
    if (!take_over([&line] { return flock(line.get(), LOCK_EX | LOCK_NB) == 0; })) {
        fail(path, "cannot be locked for exclusive use", errno);
    }
    // Raw 8N1: no modem control, no flow control, receiver on.
    cfmakeraw(&wanted);
    wanted.c_cflag |= static_cast<tcflag_t>(CLOCAL | CREAD);
    wanted.c_cflag &= ~static_cast<tcflag_t>(CRTSCTS | CSTOPB | HUPCL);
    wanted.c_iflag &= ~static_cast<tcflag_t>(IXON | IXOFF | IXANY);
    wanted.c_cc[VMIN] = 1;  // with 0, read() returns 0 both without input and after a hang-up
    wanted.c_cc[VTIME] = 0;
    if (cfsetspeed(&wanted, speed) != 0 || tcsetattr(line.get(), TCSANOW, &wanted) != 0) {
        fail(path, "cannot be set to raw mode at that speed", errno);
    }
    // tcsetattr() succeeds if it could set any one attribute: read the rate back.
    termios got{};
    if (tcgetattr(line.get(), &got) != 0 || cfgetospeed(&got) != speed || cfgetispeed(&got) != speed) {
        throw BoardError(path.string() + ": the adapter did not accept " + std::to_string(baud) +
                         " bit/s; use an adapter that supports this rate");
    }
    ask_for_low_latency(line.get());
    return line.release();
}

}  // namespace haptic::device
