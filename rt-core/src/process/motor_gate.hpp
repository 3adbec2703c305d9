// Motor gate: the last stage before the board. Once closed, it replaces every command by zeros.
//
// An abnormal exit (a crash, exit(), the watchdog) sends zeros from one thread while the loop may still run in another.
// Without the gate the loop's next command would override them.
#pragma once

#include <atomic>
#include <cstdint>

#include "haptic/device/board.hpp"
#include "haptic/realtime.hpp"

namespace haptic::rt {

class MotorGate final : public device::Board {
  public:
    /// The board must outlive the gate.
    explicit MotorGate(device::Board& board) : board_(&board) {}

    void start() override { board_->start(); }
    device::ExchangeStatus exchange(const device::MotorCommand& command, device::BoardReading& reading,
                                    std::int64_t now_ns) HAPTIC_RT override;
    device::ExchangeStatus send(const device::MotorCommand& command, std::int64_t now_ns) HAPTIC_RT override;
    [[nodiscard]] bool answer_due() const HAPTIC_RT override { return board_->answer_due(); }
    device::ExchangeStatus collect(std::int64_t now_ns) HAPTIC_RT override { return board_->collect(now_ns); }
    /// Closes the gate and sends zeros once.
    void zero_motors(std::int64_t now_ns) HAPTIC_RT override;

    /// Closes the gate and sends zeros. If an exchange is under way, waits for its end, at most kLongestWaitNs, and
    /// sends zeros again. From any thread or signal handler, any number of times.
    void close() noexcept;
    [[nodiscard]] bool closed() const HAPTIC_RT { return closed_.load(); }
    /// From now on behaves as if closed while `cut` is not 0, which another process may set at any time: a guard that
    /// has sent zeros itself. Call before the loop starts; must outlive it.
    void obey(const std::atomic<std::uint32_t>& cut) noexcept { cut_ = &cut; }

    static constexpr std::int64_t kLongestWaitNs = 5'000'000;  // ns

  private:
    /// Sends the command, or zeros, by this call of the board.
    template <class Call>
    device::ExchangeStatus pass(const device::MotorCommand& command, std::int64_t now_ns, const Call& call) HAPTIC_RT;
    [[nodiscard]] bool is_cut() const HAPTIC_RT { return cut_ != nullptr && cut_->load() != 0; }

    device::Board* board_;
    const std::atomic<std::uint32_t>* cut_ = nullptr;
    // Both sequentially consistent: when an exchange begins while the gate closes, at least one sees the other.
    std::atomic<bool> closed_{false};
    std::atomic<bool> exchanging_{false};
};

}  // namespace haptic::rt
