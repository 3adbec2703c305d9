#include "gpio_request.hpp"

#include <algorithm>
#include <cerrno>
#include <stdexcept>
#include <system_error>

namespace haptic::detail {
namespace {

[[noreturn]] void refuse_gpio(const GpioLine& line, int error, const std::string& what, const std::string& remedy) {
    const bool forbidden = error == EACCES || error == EPERM;
    throw std::runtime_error(line.purpose + ": " + what + ": " +
                             std::system_category().message(error == 0 ? ENOENT : error) + "; " +
                             (forbidden ? "ls -l /dev/gpiochip* shows which group may open it" : remedy));
}

std::string gpio_line_name(const GpioLine& line) {
    return "line '" + line.line + "' of GPIO chip '" + line.chip + "'";
}

}  // namespace

std::optional<unsigned> parse_gpio_number(const std::string& text) {
    const bool digits = std::all_of(text.begin(), text.end(), [](char c) { return c >= '0' && c <= '9'; });
    if (text.empty() || text.size() > 6 || !digits) {
        return std::nullopt;
    }
    return static_cast<unsigned>(std::stoul(text));
}

void throw_no_gpio_chip(const GpioLine& line) {
    const int error = errno;
    refuse_gpio(line, error, "no GPIO chip '" + line.chip + "'",
                "gpiodetect lists names and labels of the existing chips");
}

void throw_no_gpio_line(const GpioLine& line) {
    const int error = errno;
    refuse_gpio(line, error, gpio_line_name(line), "gpioinfo lists the lines of each chip");
}

void throw_gpio_line_refused(const GpioLine& line) {
    const int error = errno;
    refuse_gpio(line, error, gpio_line_name(line), "gpioinfo shows its consumer");
}

}  // namespace haptic::detail
