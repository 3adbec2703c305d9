#include <memory>
#include <string>
#include <utility>

#include "haptic/gpio.hpp"
#include "process/stop_input.hpp"

namespace haptic::rt {
namespace {

class GpioStopLine final : public StopLine {
  public:
    GpioStopLine(std::unique_ptr<InputLine> line, bool stop_when_high)
        : line_(std::move(line)), stop_when_high_(stop_when_high) {}

    [[nodiscard]] bool says_stop() override { return line_->is_up() == stop_when_high_; }

  private:
    std::unique_ptr<InputLine> line_;
    bool stop_when_high_;
};

}  // namespace

std::unique_ptr<StopLine> open_gpio_stop_line(const GpioStopSettings& settings) {
    const GpioLine line{.chip = settings.chip,
                        .line = std::to_string(settings.line),
                        .purpose = "stop line (safety.stop_chip, safety.stop_line)",
                        .user = "rt-core stop"};
    const GpioBias bias = settings.stop_when_high ? GpioBias::Up : GpioBias::Down;
    return std::make_unique<GpioStopLine>(open_input_line(line, bias), settings.stop_when_high);
}

}  // namespace haptic::rt
