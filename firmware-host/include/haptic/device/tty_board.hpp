// UART motor boards on a serial line: the line opened, the boards on it found.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>

#include "haptic/device/board.hpp"
#include "haptic/device/board_options.hpp"
#include "haptic/device/exchange_packets.hpp"
#include "haptic/realtime.hpp"

namespace haptic::device {

class SerialTransport;
class UartBoard;

class TtyBoard final : public Board {
  public:
    struct Settings {
        std::int64_t timeout_ns = 2'000'000;  // ns, for a whole exchange
        int baud = 2'000'000;                 // bit/s, one of the rates that the kernel names (Bxxx)
    };

    /// Opens the line exclusively. start() then detects the boards. Throws BoardError with the system's refusal and a
    /// remedy.
    TtyBoard(const std::filesystem::path& path, const Settings& settings, const UartOptions& options);
    ~TtyBoard() override;

    void start() override;
    ExchangeStatus exchange(const MotorCommand& command, BoardReading& reading, std::int64_t now_ns) HAPTIC_RT override;
    void zero_motors(std::int64_t now_ns) HAPTIC_RT override;
    [[nodiscard]] ZeroPacket zero_packet() const override;

    /// Closes the line, opens it again and restarts the boards, for example after the adapter was reconnected. Must not
    /// run while another thread is inside an exchange. Throws as the constructor and start() do.
    void reopen();

    [[nodiscard]] const std::filesystem::path& path() const noexcept;
    /// Boards that start() detected, for reports: "id 0: model 5, 4 motors; id 1: ..."
    [[nodiscard]] std::string found() const;
    /// Bytes of an exchange with those boards.
    [[nodiscard]] ExchangePackets packets() const noexcept;

  private:
    std::unique_ptr<SerialTransport> transport_;
    std::unique_ptr<UartBoard> board_;
};

}  // namespace haptic::device
