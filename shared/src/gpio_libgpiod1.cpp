// GPIO lines with libgpiod 1.6 (Debian 12). gpio_libgpiod2.cpp has the same functions with version 2; no other file
// uses libgpiod.
#include <gpiod.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <ctime>
#include <memory>
#include <optional>
#include <system_error>

#include "gpio_request.hpp"
#include "haptic/gpio.hpp"
#include "haptic/types.hpp"

namespace haptic {
namespace {

struct CloseChip {
    void operator()(gpiod_chip* chip) const { gpiod_chip_close(chip); }  // releases its lines too
};
using Chip = std::unique_ptr<gpiod_chip, CloseChip>;

/// A line of an open chip, not yet requested.
class OpenedLine {
  public:
    explicit OpenedLine(const GpioLine& which) {
        errno = 0;
        chip_ = Chip(gpiod_chip_open_lookup(which.chip.c_str()));
        if (!chip_) {
            detail::throw_no_gpio_chip(which);
        }
        const std::optional<unsigned> offset = detail::parse_gpio_number(which.line);
        line_ =
            offset ? gpiod_chip_get_line(chip_.get(), *offset) : gpiod_chip_find_line(chip_.get(), which.line.c_str());
        if (line_ == nullptr) {
            detail::throw_no_gpio_line(which);
        }
    }

    [[nodiscard]] gpiod_line* line() const { return line_; }

  private:
    Chip chip_;
    gpiod_line* line_ = nullptr;  // owned by the chip
};

/// Throws if the request was refused.
void check_request(int result, const GpioLine& which) {
    if (result != 0) {
        detail::throw_gpio_line_refused(which);
    }
}

class GpioOutput final : public OutputLine {
  public:
    explicit GpioOutput(const GpioLine& which) : opened_(which) {
        check_request(gpiod_line_request_output(opened_.line(), which.user.c_str(), 0), which);
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
        check_request(gpiod_line_request_input_flags(opened_.line(), which.user.c_str(), flag_of(bias)), which);
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
        check_request(request(opened_.line(), which.user.c_str()), which);
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
        std::array<gpiod_line_event, detail::kEdgeBufferSize> events{};
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
