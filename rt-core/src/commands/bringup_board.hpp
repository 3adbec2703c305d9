// Bring-up board: drives a device slowly and weakly, one channel at a time, and leaves its motors at zero on every way
// out of the process. A guard (process/guard.hpp) does so if this process is killed or stands still.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>

#include "commands/bringup_console.hpp"
#include "commands/open_device.hpp"
#include "device/bringup.hpp"
#include "process/crash_guard.hpp"
#include "process/guard_link.hpp"
#include "process/motor_gate.hpp"
#include "process/supervision.hpp"

namespace haptic::rt {

/// The board did not answer for too long, or the guard cut the motors or is gone.
class BoardLost : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
};

/// How a motor pulls while the dead-man key is held.
struct Hold {
    std::size_t channel = 0;
    std::int16_t code = 0;  // at the end of the ramp, with its sign; its size is at most the cap
    std::int64_t ramp_ns = 500'000'000;
    std::int64_t steady_ns = 0;  // at the full code after which the person may release; 0: to the end of the ramp
    std::int64_t silent_ns = 0;  // at the full code, without any exchange, before zeros
    std::array<double, kStrings> metres_per_count{};  // of the channels; 0: unknown, then Limits::most_counts holds
    bool board_may_vanish = false;                    // the person cuts power
    std::function<void(std::int16_t code)> on_steady = {};  // called once, while the motor pulls
};

struct HoldResult {
    bool skipped = false;                         // with s, before the key was held
    bool steady = false;                          // the full code was held for long enough
    bool travelled = false;                       // the motor was cut, because a string was wound in too far
    bool pushed = false;                          // the motor was cut, because a string was paid out
    bool vanished = false;                        // the board did not answer any more
    std::int16_t last_code = 0;                   // at the last press of the key
    std::array<std::int64_t, kStrings> counts{};  // change of the counters until the release
};

class BringupBoard {
  public:
    struct Limits {
        int cap_code = 0;                           // largest magnitude that is ever sent
        std::int64_t key_timeout_ns = 300'000'000;  // of the dead-man key
        std::int64_t longest_hold_ns = 20'000'000'000;
        std::int64_t most_counts = 6'000;  // of a movement of 0.2 m
        int button = -1;                   // switch of the board that replaces the key; -1: none
    };

    /// All references must outlive it. Throws std::runtime_error if there is no guard for a real device.
    BringupBoard(OpenedDevice& device, const BringupConsole& console, int counter_bits, const Limits& limits);
    BringupBoard(const BringupBoard&) = delete;
    BringupBoard& operator=(const BringupBoard&) = delete;
    ~BringupBoard();

    /// Sends zeros and reads the counters, at most every 5 ms. For use while a question waits.
    void idle();
    /// Reads the counters now, with motors at zero. Throws BoardLost if the board does not answer.
    void refresh();
    /// Changes of the counters since the start, without wrap-around.
    [[nodiscard]] const std::array<std::int64_t, kStrings>& counts() const noexcept { return counts_; }
    /// Lets one motor pull while the person holds the space bar, or the button. At its end all motors are at zero.
    [[nodiscard]] HoldResult hold(const Hold& hold);
    /// Waits until no counter has moved for a moment: a motor without current runs on. At most some seconds.
    void wait_until_still();
    /// Exchanges zeros and measures.
    [[nodiscard]] RoundTrips measure_round_trips(std::size_t exchanges);
    /// Waits until the device answers again.
    void wait_for_device();
    [[nodiscard]] const Limits& limits() const noexcept { return limits_; }

  private:
    static constexpr std::int64_t kLostNs = 500'000'000;  // ns, longest silence of the board, and of the guard

    struct Progress;

    /// One exchange with one code on one channel; false if the board did not answer.
    bool exchange(std::size_t channel, std::int16_t code);
    void count(const device::BoardReading& reading);
    /// Throws BoardLost where the guard has cut the motors or is gone.
    void require_guard();
    /// As require_guard(), and after half a second without an answer.
    void require_answers();
    [[nodiscard]] bool key_pressed(const RawKeys::Pressed& keys) const;
    [[nodiscard]] std::int16_t code_at(const Hold& hold, std::int64_t held_ns) const;
    /// m in counts: 0.5 mm, more than a hand trembles.
    [[nodiscard]] std::int64_t still_counts() const noexcept { return limits_.most_counts / 400; }
    void note_movement(Progress& progress) const;
    void limit_movement(const Hold& hold, HoldResult& result) const;
    void pull(const Hold& hold, const RawKeys& keys, Progress& progress);
    void stay_silent(const Hold& hold, const RawKeys& keys);

    OpenedDevice* device_;
    const BringupConsole* console_;
    Limits limits_;
    int counter_bits_;
    MotorGate gate_;
    AlternateSignalStack signal_stack_;
    CrashGuard guard_;
    std::array<std::uint32_t, kStrings> last_{};
    std::array<std::int64_t, kStrings> counts_{};
    device::BoardReading reading_;
    bool counted_ = false;
    std::int64_t answered_ns_ = 0;
    std::int64_t idle_ns_ = 0;
    // Shared with the guard: the loop's beat is the last time this process attended to a motor that pulls, 0 if none
    // does.
    SharedSupervision shared_;
    SupervisorCheck check_{{&shared_.page(), kLostNs}, std::nullopt};
    std::unique_ptr<GuardLink> guard_link_;  // none for a device in this process
};

}  // namespace haptic::rt
