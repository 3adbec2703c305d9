#include "commands/tty_device.hpp"

#include "transport/serial_transport.hpp"
#include "boards/uart_board.hpp"

namespace haptic::rt {
namespace {

class TtyDevice final : public OpenedDevice {
  public:
    TtyDevice(const std::filesystem::path& path, const Settings& settings)
        : transport_(path, settings.serial),
          board_(transport_, settings.board.uart),
          variant_(settings.tick.variant.name),
          timeout_ns_(settings.serial.timeout_ns) {
        board_.start();
    }

    [[nodiscard]] device::Board& board() override { return board_; }
    [[nodiscard]] bool real() const override { return true; }
    [[nodiscard]] std::string description() const override {
        return "a " + variant_ + " on " + transport_.path().string() + " (" + board_.found() + ")";
    }

    [[nodiscard]] std::int64_t exchange_bound_ns() const override { return kMostExchanges * timeout_ns_; }
    void reopen() override {
        transport_.reopen();
        board_.start();
    }

    static constexpr std::int64_t kMostExchanges = 2;  // after one that failed the line is first brought to rest

  private:
    device::SerialTransport transport_;
    device::UartBoard board_;
    std::string variant_;
    std::int64_t timeout_ns_;
};

}  // namespace

std::unique_ptr<OpenedDevice> open_tty_device(const std::filesystem::path& path, const Settings& settings) {
    if (settings.tick.variant.board != device::BoardKind::Uart) {
        throw Refusal("--device tty:" + path.string() + ": the board of variant " + settings.tick.variant.name +
                      " has no serial line; set device.variant to the frame that hangs on it");
    }
    if (settings.tick.exchanges * TtyDevice::kMostExchanges * settings.serial.timeout_ns >=
        settings.watchdog.limit_ns) {
        throw Refusal("--device tty:" + path.string() +
                      ": device.uart_timeout_s lets a tick wait for longer than safety.watchdog_s does");
    }
    return std::make_unique<TtyDevice>(path, settings);
}

}  // namespace haptic::rt
