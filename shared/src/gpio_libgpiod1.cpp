// GPIO lines with libgpiod 1.6 (Debian 12). No other file uses libgpiod; version 2 would be a second file with the same
// functions.
#include <gpiod.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <ctime>
#include <memory>
#include <stdexcept>
#include <string>
#include <system_error>

#include "haptic/gpio.hpp"
#include "haptic/types.hpp"

namespace haptic {
namespace {

// Size of the kernel's buffer of edges, and limit of one read.
constexpr std::size_t kMaxEvents = 16;

struct CloseChip {
    void operator()(gpiod_chip* chip) const { gpiod_chip_close(chip); }  // releases its lines too
};
using Chip = std::unique_ptr<gpiod_chip, CloseChip>;

[[noreturn]] void refuse(const GpioLine& line, const std::string& what, const std::string& remedy) {
    const int error = errno;
    const bool forbidden = error == EACCES || error == EPERM;
    throw std::runtime_error(line.purpose + ": " + what + ": " + std::system_category().message(error) + "; " +
                             (forbidden ? "ls -l /dev/gpiochip* shows which group may open it" : remedy));
}

bool is_offset(const std::string& line) {
    return !line.empty() && line.size() <= 6 &&
           std::all_of(line.begin(), line.end(), [](char c) { return c >= '0' && c <= '9'; });
}

/// A line of an open chip, not yet requested.
class OpenedLine {
  public:
    explicit OpenedLine(const GpioLine& which) : name_("line '" + which.line + "' of GPIO chip '" + which.chip + "'") {
        errno = 0;
        chip_ = Chip(gpiod_chip_open_lookup(which.chip.c_str()));
        if (!chip_) {
            errno = errno == 0 ? ENOENT : errno;
            refuse(which, "no GPIO chip '" + which.chip + "'",
                   "gpiodetect lists names and labels of the existing chips");
        }
        line_ = is_offset(which.line) ? gpiod_chip_get_line(chip_.get(), static_cast<unsigned>(std::stoul(which.line)))
                                      : gpiod_chip_find_line(chip_.get(), which.line.c_str());
        if (line_ == nullptr) {
            errno = errno == 0 ? ENOENT : errno;
            refuse(which, name_, "gpioinfo lists the lines of each chip");
        }
    }

    [[nodiscard]] gpiod_line* line() const { return line_; }
    /// Throws if the request was refused.
    void check(int result, const GpioLine& which) const {
        if (result != 0) {
            refuse(which, name_, "gpioinfo shows its consumer");
        }
    }

  private:
    std::string name_;
    Chip chip_;
    gpiod_line* line_ = nullptr;  // owned by the chip
};

class GpioOutput final : public OutputLine {
  public:
    explicit GpioOutput(const GpioLine& which) : opened_(which) {
        opened_.check(gpiod_line_request_output(opened_.line(), which.user.c_str(), 0), which);
    }

    int set(bool up) HAPTIC_RT override {
        int error = 0;
        HAPTIC_RT_EXCEPTION_BEGIN(
            "GPIOHANDLE_SET_LINE_VALUES_IOCTL: libgpiod copies one value on its stack and calls ioctl() once; the "
            "kernel's driver writes one register. Slower lines are refused when a probe is opened")
        error = gpiod_line_set_value(opened_.line(), up ? 1 : 0) == 0 ? 0 : errno;
        HAPTIC_RT_EXCEPTION_END
        return error;
    }

  private:
    OpenedLine opened_;
};

int flag_of(GpioBias bias) {
    switch (bias) {
        case GpioBias::Up:
            return GPIOD_LINE_REQUEST_FLAG_BIAS_PULL_UP;
        case GpioBias::Down:
            return GPIOD_LINE_REQUEST_FLAG_BIAS_PULL_DOWN;
        case GpioBias::None:
            break;
    }
    return 0;
}

class GpioInput final : public InputLine {
  public:
    GpioInput(const GpioLine& which, GpioBias bias) : opened_(which) {
        opened_.check(gpiod_line_request_input_flags(opened_.line(), which.user.c_str(), flag_of(bias)), which);
        (void)GpioInput::is_up();  // fail now rather than at the first use
    }

    [[nodiscard]] bool is_up() override {
        const int level = gpiod_line_get_value(opened_.line());
        if (level < 0) {
            throw std::system_error(errno, std::system_category(), "reading a GPIO line");
        }
        return level == 1;
    }

  private:
    OpenedLine opened_;
};

class GpioEdges final : public EdgeSource {
  public:
    GpioEdges(const GpioLine& which, EdgeKind kind) : opened_(which) {
        const auto request =
            kind == EdgeKind::Both ? gpiod_line_request_both_edges_events : gpiod_line_request_rising_edge_events;
        opened_.check(request(opened_.line(), which.user.c_str()), which);
    }

    [[nodiscard]] std::size_t read(std::span<Edge> edges, std::int64_t max_wait_ns) override {
        const timespec time{max_wait_ns / kNanosecondsPerSecond, max_wait_ns % kNanosecondsPerSecond};
        const int waiting = gpiod_line_event_wait(opened_.line(), &time);
        if (waiting == 0 || (waiting < 0 && errno == EINTR) || edges.empty()) {
            return 0;
        }
        if (waiting < 0) {
            throw std::system_error(errno, std::system_category(), "waiting for an edge of a GPIO line");
        }
        std::array<gpiod_line_event, kMaxEvents> events{};
        const auto limit = static_cast<unsigned>(std::min(events.size(), edges.size()));
        const int count = gpiod_line_event_read_multiple(opened_.line(), events.data(), limit);
        if (count < 0) {
            throw std::system_error(errno, std::system_category(), "reading edges of a GPIO line");
        }
        std::transform(events.begin(), events.begin() + count, edges.begin(), [](const gpiod_line_event& event) {
            return Edge{event.ts.tv_sec * kNanosecondsPerSecond + event.ts.tv_nsec,
                        event.event_type == GPIOD_LINE_EVENT_RISING_EDGE};
        });
        return static_cast<std::size_t>(count);
    }

  private:
    OpenedLine opened_;
};

}  // namespace

std::unique_ptr<OutputLine> open_output_line(const GpioLine& line) {
    return std::make_unique<GpioOutput>(line);
}

std::unique_ptr<InputLine> open_input_line(const GpioLine& line, GpioBias bias) {
    return std::make_unique<GpioInput>(line, bias);
}

std::unique_ptr<EdgeSource> open_edge_source(const GpioLine& line, EdgeKind kind) {
    return std::make_unique<GpioEdges>(line, kind);
}

}  // namespace haptic
