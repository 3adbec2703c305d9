#include "commands/tty_device.hpp"

#include "haptic/device/tty_board.hpp"

namespace haptic::rt {
namespace {

class TtyDevice final : public OpenedDevice {
  public:
    TtyDevice(const std::filesystem::path& path, const Settings& settings)
        : board_(path, settings.serial, settings.board.uart),
          geometry_(settings.tick.geometry.name),
          baud_(settings.serial.baud),
          timeout_ns_(settings.serial.timeout_ns) {
        board_.start();
    }

    [[nodiscard]] device::Board& board() override { return board_; }
    [[nodiscard]] bool is_real() const override { return true; }
    [[nodiscard]] std::string description() const override {
        return "a " + geometry_ + " on " + board_.path().string() + " (" + board_.found() + ")";
    }

    [[nodiscard]] PeriodDemand demand() const override {
        return {.route = route_of_line(board_.path()), .baud = baud_, .packets = board_.packets()};
    }
    [[nodiscard]] std::int64_t exchange_bound_ns() const override { return kMaxExchanges * timeout_ns_; }
    void reopen() override { board_.reopen(); }

    static constexpr std::int64_t kMaxExchanges = 2;  // after a failed exchange the line is drained first

  private:
    device::TtyBoard board_;
    std::string geometry_;
    int baud_;
    std::int64_t timeout_ns_;
};

}  // namespace

std::unique_ptr<OpenedDevice> open_tty_device(const std::filesystem::path& path, const Settings& settings) {
    if (settings.tick.geometry.board != device::BoardKind::Uart) {
        throw Refusal("--device tty:" + path.string() + ": the board of geometry " + settings.tick.geometry.name +
                      " has no serial line; set device.geometry to the device on this line");
    }
    if (settings.tick.exchanges * TtyDevice::kMaxExchanges * settings.serial.timeout_ns >= settings.watchdog.limit_ns) {
        throw Refusal("--device tty:" + path.string() +
                      ": device.uart_timeout_s lets a tick wait longer than safety.watchdog_s allows");
    }
    return std::make_unique<TtyDevice>(path, settings);
}

}  // namespace haptic::rt
