// The one file that knows libgpiod (version 1.6).
#include <gpiod.h>

#include <cerrno>
#include <memory>
#include <stdexcept>
#include <system_error>

#include "haptic/rt/stop_input.hpp"

namespace haptic::rt {
namespace {

struct CloseChip {
    void operator()(gpiod_chip* chip) const { gpiod_chip_close(chip); }  // releases its lines too
};
using Chip = std::unique_ptr<gpiod_chip, CloseChip>;

[[noreturn]] void refuse(const std::string& what, const std::string& remedy) {
    const std::string why = std::system_category().message(errno);
    throw std::runtime_error("stop line: " + what + ": " + why + "; " + remedy);
}

class GpioStopLine final : public StopLine {
  public:
    explicit GpioStopLine(const GpioStopSettings& settings) : stop_level_(settings.stop_when_high ? 1 : 0) {
        chip_ = Chip(gpiod_chip_open_lookup(settings.chip.c_str()));
        if (!chip_) {
            refuse("no GPIO chip '" + settings.chip + "' (safety.stop_chip)",
                   "gpiodetect lists names and labels of those that there are");
        }
        const std::string name =
            "line " + std::to_string(settings.line) + " of GPIO chip '" + settings.chip + "' (safety.stop_line)";
        line_ = gpiod_chip_get_line(chip_.get(), static_cast<unsigned>(settings.line));
        if (line_ == nullptr) {
            refuse(name, "gpioinfo lists the lines of each chip");
        }
        const int bias =
            settings.stop_when_high ? GPIOD_LINE_REQUEST_FLAG_BIAS_PULL_UP : GPIOD_LINE_REQUEST_FLAG_BIAS_PULL_DOWN;
        if (gpiod_line_request_input_flags(line_, "rt-core stop", bias) != 0) {
            refuse(name, "gpioinfo says who uses it");
        }
        (void)says_stop();  // fails now rather than in the first look
    }

    [[nodiscard]] bool says_stop() override {
        const int level = gpiod_line_get_value(line_);
        if (level < 0) {
            throw std::system_error(errno, std::system_category(), "reading a GPIO line");
        }
        return level == stop_level_;
    }

  private:
    Chip chip_;
    gpiod_line* line_ = nullptr;  // the chip's
    int stop_level_;
};

}  // namespace

std::unique_ptr<StopLine> open_gpio_stop_line(const GpioStopSettings& settings) {
    return std::make_unique<GpioStopLine>(settings);
}

}  // namespace haptic::rt
