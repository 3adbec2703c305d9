// GPIO lines with libgpiod 2 (Debian 13, Ubuntu 24.04). gpio_libgpiod1.cpp has the same functions with version 1.6; no
// other file uses libgpiod.
#include <gpiod.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <new>
#include <optional>
#include <set>
#include <string>
#include <system_error>

#include "gpio_request.hpp"
#include "haptic/gpio.hpp"

namespace haptic {
namespace {

template <auto release>
struct Release {
    template <typename Object>
    void operator()(Object* object) const {
        release(object);
    }
};
using Chip = std::unique_ptr<gpiod_chip, Release<gpiod_chip_close>>;
using ChipInfo = std::unique_ptr<gpiod_chip_info, Release<gpiod_chip_info_free>>;
using LineSettings = std::unique_ptr<gpiod_line_settings, Release<gpiod_line_settings_free>>;
using LineConfig = std::unique_ptr<gpiod_line_config, Release<gpiod_line_config_free>>;
using RequestConfig = std::unique_ptr<gpiod_request_config, Release<gpiod_request_config_free>>;
using LineRequest = std::unique_ptr<gpiod_line_request, Release<gpiod_line_request_release>>;
using EdgeBuffer = std::unique_ptr<gpiod_edge_event_buffer, Release<gpiod_edge_event_buffer_free>>;

/// Returns a new object of libgpiod, or throws std::bad_alloc.
template <typename Object>
Object* allocated(Object* object) {
    if (object == nullptr) {
        throw std::bad_alloc();
    }
    return object;
}

/// The first chip with this label. None: errno is EACCES if a chip could not be opened, otherwise ENOENT.
Chip open_labelled_chip(const std::string& label) {
    std::set<std::filesystem::path> paths;
    std::error_code ignored;  // without /dev there is no chip
    for (const auto& entry : std::filesystem::directory_iterator("/dev", ignored)) {
        if (entry.path().filename().string().starts_with("gpiochip")) {
            paths.insert(entry.path());
        }
    }
    bool forbidden = false;
    for (const std::filesystem::path& path : paths) {
        Chip chip(gpiod_chip_open(path.c_str()));
        forbidden = forbidden || (!chip && (errno == EACCES || errno == EPERM));
        const ChipInfo info(chip ? gpiod_chip_get_info(chip.get()) : nullptr);
        if (info && label == gpiod_chip_info_get_label(info.get())) {
            return chip;
        }
    }
    errno = forbidden ? EACCES : ENOENT;
    return nullptr;
}

/// Searches as version 1 does: by number, or by label, then name or path. None: errno is the reason.
Chip open_chip(const std::string& chip) {
    if (detail::parse_gpio_number(chip)) {
        return Chip(gpiod_chip_open(("/dev/gpiochip" + chip).c_str()));
    }
    if (Chip labelled = open_labelled_chip(chip)) {
        return labelled;
    }
    const int error = errno;
    Chip named(gpiod_chip_open((chip.starts_with("/dev/") ? chip : "/dev/" + chip).c_str()));
    if (!named && errno == ENOENT) {
        errno = error;  // a chip that may not be opened may have the label
    }
    return named;
}

/// The line's offset in its chip. Throws if the chip has no such line.
unsigned find_offset(gpiod_chip* chip, const GpioLine& which) {
    if (const std::optional<unsigned> offset = detail::parse_gpio_number(which.line)) {
        const ChipInfo info(gpiod_chip_get_info(chip));
        if (!info || *offset >= gpiod_chip_info_get_num_lines(info.get())) {
            errno = info ? EINVAL : errno;
            detail::throw_no_gpio_line(which);
        }
        return *offset;
    }
    const int offset = gpiod_chip_get_line_offset_from_name(chip, which.line.c_str());
    if (offset < 0) {
        detail::throw_no_gpio_line(which);
    }
    return static_cast<unsigned>(offset);
}

/// How a line is requested. An output starts low.
struct LineUse {
    gpiod_line_direction direction = GPIOD_LINE_DIRECTION_INPUT;
    gpiod_line_bias bias = GPIOD_LINE_BIAS_AS_IS;
    gpiod_line_edge edges = GPIOD_LINE_EDGE_NONE;
};

/// A line that this process holds.
class RequestedLine {
  public:
    RequestedLine(const GpioLine& which, const LineUse& use) {
        errno = 0;
        const Chip chip = open_chip(which.chip);
        if (!chip) {
            detail::throw_no_gpio_chip(which);
        }
        offset_ = find_offset(chip.get(), which);
        const LineConfig line = line_config(use);
        const RequestConfig config(allocated(gpiod_request_config_new()));
        gpiod_request_config_set_consumer(config.get(), which.user.c_str());
        gpiod_request_config_set_event_buffer_size(config.get(), detail::kEdgeBufferSize);
        request_ = LineRequest(gpiod_chip_request_lines(chip.get(), config.get(), line.get()));
        if (!request_) {
            detail::throw_gpio_line_refused(which);
        }
    }

    [[nodiscard]] gpiod_line_request* request() const { return request_.get(); }
    [[nodiscard]] unsigned offset() const { return offset_; }

  private:
    [[nodiscard]] LineConfig line_config(const LineUse& use) const {
        const LineSettings settings(allocated(gpiod_line_settings_new()));
        // These fail only for values that libgpiod does not know.
        gpiod_line_settings_set_direction(settings.get(), use.direction);
        gpiod_line_settings_set_bias(settings.get(), use.bias);
        gpiod_line_settings_set_edge_detection(settings.get(), use.edges);
        gpiod_line_settings_set_event_clock(settings.get(), GPIOD_LINE_CLOCK_MONOTONIC);
        gpiod_line_settings_set_output_value(settings.get(), GPIOD_LINE_VALUE_INACTIVE);
        LineConfig config(allocated(gpiod_line_config_new()));
        if (gpiod_line_config_add_line_settings(config.get(), &offset_, 1, settings.get()) != 0) {
            throw std::bad_alloc();
        }
        return config;
    }

    unsigned offset_ = 0;
    LineRequest request_;
};

class GpioOutput final : public OutputLine {
  public:
    explicit GpioOutput(const GpioLine& which) : line_(which, {.direction = GPIOD_LINE_DIRECTION_OUTPUT}) {}

    int set(bool up) HAPTIC_RT override {
        int error = 0;
        HAPTIC_RT_EXCEPTION_BEGIN(
            "GPIO_V2_LINE_SET_VALUES_IOCTL: libgpiod puts one value on its stack and calls ioctl() once; the kernel's "
            "driver writes one register. Slower lines are refused when a probe is opened")
        const gpiod_line_value value = up ? GPIOD_LINE_VALUE_ACTIVE : GPIOD_LINE_VALUE_INACTIVE;
        error = gpiod_line_request_set_value(line_.request(), line_.offset(), value) == 0 ? 0 : errno;
        HAPTIC_RT_EXCEPTION_END
        return error;
    }

  private:
    RequestedLine line_;
};

gpiod_line_bias bias_of(GpioBias bias) {
    switch (bias) {
        case GpioBias::Up:
            return GPIOD_LINE_BIAS_PULL_UP;
        case GpioBias::Down:
            return GPIOD_LINE_BIAS_PULL_DOWN;
        case GpioBias::None:
            break;
    }
    return GPIOD_LINE_BIAS_AS_IS;
}

class GpioInput final : public InputLine {
  public:
    GpioInput(const GpioLine& which, GpioBias bias) : line_(which, {.bias = bias_of(bias)}) {
        (void)GpioInput::is_up();  // fail now rather than at the first use
    }

    [[nodiscard]] bool is_up() override {
        const gpiod_line_value level = gpiod_line_request_get_value(line_.request(), line_.offset());
        if (level == GPIOD_LINE_VALUE_ERROR) {
            throw std::system_error(errno, std::system_category(), "reading a GPIO line");
        }
        return level == GPIOD_LINE_VALUE_ACTIVE;
    }

  private:
    RequestedLine line_;
};

class GpioEdges final : public EdgeSource {
  public:
    GpioEdges(const GpioLine& which, EdgeKind kind)
        : line_(which, {.edges = kind == EdgeKind::Both ? GPIOD_LINE_EDGE_BOTH : GPIOD_LINE_EDGE_RISING}),
          buffer_(allocated(gpiod_edge_event_buffer_new(detail::kEdgeBufferSize))) {}

    [[nodiscard]] std::size_t read(std::span<Edge> edges, std::int64_t max_wait_ns) override {
        const int waiting = gpiod_line_request_wait_edge_events(line_.request(), max_wait_ns);
        if (waiting == 0 || (waiting < 0 && errno == EINTR) || edges.empty()) {
            return 0;
        }
        if (waiting < 0) {
            throw std::system_error(errno, std::system_category(), "waiting for an edge of a GPIO line");
        }
        const std::size_t limit = std::min(detail::kEdgeBufferSize, edges.size());
        const int count = gpiod_line_request_read_edge_events(line_.request(), buffer_.get(), limit);
        if (count < 0) {
            throw std::system_error(errno, std::system_category(), "reading edges of a GPIO line");
        }
        for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) {
            gpiod_edge_event* const event = gpiod_edge_event_buffer_get_event(buffer_.get(), i);  // the buffer's
            edges[i] = Edge{static_cast<std::int64_t>(gpiod_edge_event_get_timestamp_ns(event)),
                            gpiod_edge_event_get_event_type(event) == GPIOD_EDGE_EVENT_RISING_EDGE};
        }
        return static_cast<std::size_t>(count);
    }

  private:
    RequestedLine line_;
    EdgeBuffer buffer_;
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
