// Guard: the work of the process `rt-core guard`, which outlives the loop and sets the motors to zero.
//
// The boards hold what they were sent last. A process that is killed (SIGKILL, the out-of-memory killer, systemd)
// sends nothing more, and one that stands still (SIGSTOP, a debugger) sends nothing for as long as it does. The guard
// shares the descriptor of the device. It sends zeros
//
//   as soon as its socket to the run is closed without a message Leave, whatever closed it; then again for 40 ms,
//   because
//     a command of the loop may still be on its way; then it closes the device
//   when the loop has not beaten for silence_ns; then again until the loop's process ends. The loop, if it ever
//     continues, finds itself cut: MotorGate replaces its commands, and the tick is disarmed
//
// It is killed as rarely as the system allows: a session of its own, no signal of a terminal or of systemd's stop,
// locked memory, the lowest oom_score_adj, SCHED_FIFO above the loop and the watchdog. If it is killed all the same,
// the run stops (supervision.hpp).
#pragma once

#include <cstdint>
#include <memory>

#include "haptic/device/zero_packet.hpp"
#include "process/guard_channel.hpp"
#include "process/supervision.hpp"

namespace haptic::rt {

class Guard {
  public:
    /// Time between two looks at the loop.
    static constexpr std::int64_t kPollNs = 2'000'000;  // ns

    /// Takes the order Begin from the socket and waits for it as long as it takes. Throws std::runtime_error if it does
    /// not come.
    explicit Guard(int socket);
    Guard(const Guard&) = delete;
    Guard& operator=(const Guard&) = delete;
    ~Guard();

    enum class End : std::uint8_t {
        Left,      // the run has ended in an orderly way
        Outlived,  // the run's process is gone, and the motors were set to zero
    };
    /// Guards until the run ends.
    [[nodiscard]] End run();

    /// Of the black box's file, to be saved after Outlived; -1: none.
    [[nodiscard]] int black_box() const noexcept { return black_box_; }
    [[nodiscard]] bool black_box_kept() const noexcept { return shared_->page().black_box_kept.load() != 0; }
    /// Result of the first zeros after the end.
    [[nodiscard]] device::ExchangeStatus status() const noexcept { return status_; }
    /// Zero packets sent in all.
    [[nodiscard]] int sent() const noexcept { return sent_; }

  private:
    [[nodiscard]] Received take_messages();
    void send_zeros() noexcept;
    void zero_for_good() noexcept;
    void watch_loop(std::int64_t now_ns, bool late) noexcept;
    void cut(std::int64_t now_ns, std::int64_t beat_ns) noexcept;
    void close_device() noexcept;

    int socket_;
    std::unique_ptr<SharedSupervision> shared_;
    device::ZeroPacket zero_;
    std::int64_t silence_ns_ = 0;
    std::int64_t lost_ns_ = 0;
    int black_box_ = -1;
    device::ExchangeStatus status_ = device::ExchangeStatus::Failed;
    int sent_ = 0;

    bool excused_ = false;          // its own last look was late
    bool cut_ = false;              // the loop was found frozen
    std::int64_t cut_beat_ns_ = 0;  // beat of the loop at the last zeros
    std::int64_t resend_ns_ = 0;    // when zeros are due again
};

/// Makes the calling process hard to kill and to delay, and says what was granted. Called by `rt-core guard`.
[[nodiscard]] GuardGrant protect_guard(int priority, int loop_cpu);

}  // namespace haptic::rt
