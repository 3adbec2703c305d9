// The last thing before the board: once it is closed, the motors get zeros, whatever the tick goes on to send.
//
// A way out of the process (a crash, exit(), the watchdog) sends zeros from one thread while the loop may still be
// running in another, and the loop's next command would undo them. So every command goes through here.
#pragma once

#include <atomic>
#include <cstdint>

#include <haptic/device/board.hpp>
#include <haptic/realtime.hpp>

namespace haptic::rt {

class MotorGate final : public device::Board {
  public:
    /// The board must outlive the gate.
    explicit MotorGate(device::Board& board) : board_(&board) {}

    void start() override { board_->start(); }
    device::ExchangeStatus exchange(const device::MotorCommand& command, device::BoardReading& reading,
                                    std::int64_t now_ns) HAPTIC_RT override;
    /// Closes, and sends zeros once.
    void zero_motors(std::int64_t now_ns) HAPTIC_RT override;

    /// Closes, sends zeros, and sends them again when an exchange that was under way is over; waits for that end no
    /// longer than kLongestWaitNs. From any thread or signal handler, any number of times.
    void close() noexcept;
    [[nodiscard]] bool closed() const HAPTIC_RT { return closed_.load(); }

    static constexpr std::int64_t kLongestWaitNs = 5'000'000;  // ns

  private:
    device::Board* board_;
    // Both sequentially consistent: of an exchange that begins and a gate that closes, at least one sees the other.
    std::atomic<bool> closed_{false};
    std::atomic<bool> exchanging_{false};
};

}  // namespace haptic::rt
