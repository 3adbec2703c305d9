#include "commands/bringup_board.hpp"

#include <pthread.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <system_error>
#include <thread>

#include "haptic/clock.hpp"

namespace haptic::rt {
namespace {

constexpr int kKeyWaitMs = 5;
constexpr std::int64_t kIdleNs = 5'000'000;
constexpr std::int64_t kShowNs = 100'000'000;
constexpr int kPriority = 20;
// Longest standstill of this process while a motor pulls.
constexpr std::int64_t kStandstillNs = 200'000'000;
// Time without a movement after which the device is still; longest wait for it.
constexpr std::int64_t kStillNs = 100'000'000;
constexpr int kStillAnswers = 10;
constexpr std::int64_t kLongestStillWaitNs = 5'000'000'000;
constexpr std::int64_t kRetryNs = 200'000'000;
// m: wound in before a motor is cut, and paid out while nothing was wound in. A string that snaps tight may jerk
// others.
constexpr double kMostWoundIn = 0.35;
constexpr double kMostPaidOut = 0.015;
constexpr std::int64_t kPauseNs = 1'000'000;  // between two measured exchanges

}  // namespace

/// State of one hold.
struct BringupBoard::Progress {
    HoldResult result;
    std::array<std::int64_t, kStrings> start{};
    std::int64_t begin_ns = 0;                   // since the key is held; 0: not yet
    std::array<std::int64_t, kStrings> still{};  // counts since which nothing has moved
    std::int64_t still_ns = 0;                   // and the time
    int still_answers = 0;                       // of the board since then: without them nothing is known
    std::int64_t shown_ns = 0;
    bool over = false;
};

BringupBoard::BringupBoard(OpenedDevice& device, const BringupConsole& console, int counter_bits, const Limits& limits)
    : device_(&device),
      console_(&console),
      limits_(limits),
      counter_bits_(counter_bits),
      gate_(device.board()),
      guard_(gate_),
      answered_ns_(monotonic_now_ns()) {
    // Where it is allowed: no other process delays the end of a pull.
    const sched_param parameters{.sched_priority = kPriority};
    if (const int error = pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameters); error != 0) {
        console_->say("Without real-time priority (" + std::generic_category().message(error) +
                      ") other processes may delay the end of a pull, by at most 0.2 s.");
    }
    gate_.obey(shared_.page().cut);
    if (device.is_real()) {
        const GuardSettings guard{.silence_ns = kStandstillNs, .lost_ns = kLostNs};
        guard_link_ = std::make_unique<GuardLink>(guard, shared_, device.board().zero_packet(), -1);
    }
}

BringupBoard::~BringupBoard() {
    gate_.close();
}

bool BringupBoard::exchange(std::size_t channel, std::int16_t code) {
    device::MotorCommand command;
    // The cap, whatever the caller asks for.
    command.dac_codes[channel] = static_cast<std::int16_t>(std::clamp<int>(code, -limits_.cap_code, limits_.cap_code));
    const std::int64_t now_ns = monotonic_now_ns();
    shared_.page().loop_beat(code != 0 ? now_ns : 0);
    check_.check(now_ns);
    if (gate_.exchange(command, reading_, now_ns) != device::ExchangeStatus::Ok) {
        return false;
    }
    answered_ns_ = monotonic_now_ns();
    count(reading_);
    return true;
}

void BringupBoard::count(const device::BoardReading& reading) {
    // Sign-extends the difference of two counters, so that it survives a wrap-around.
    const unsigned unused = 32U - static_cast<unsigned>(counter_bits_);
    for (std::size_t i = 0; i < kStrings && counted_; ++i) {
        counts_[i] += static_cast<std::int32_t>((reading.counters[i] - last_[i]) << unused) >> unused;
    }
    last_ = reading.counters;
    counted_ = true;
}

void BringupBoard::require_guard() {
    if (shared_.page().is_cut()) {
        throw BoardLost("this process stood still for too long while a motor pulled; the guard set the motors to zero");
    }
    if (shared_.page().has_lost()) {
        throw BoardLost("the guard process is gone");
    }
}

void BringupBoard::require_answers() {
    require_guard();
    if (monotonic_now_ns() - answered_ns_ > kLostNs) {
        throw BoardLost("the board does not answer any more; check its power and cable");
    }
}

void BringupBoard::idle() {
    const std::int64_t now_ns = monotonic_now_ns();
    if (now_ns - idle_ns_ < kIdleNs) {
        return;
    }
    // A pause of the dialogue is no silence of the board.
    answered_ns_ = std::max(answered_ns_, now_ns - idle_ns_ > kLostNs ? now_ns : answered_ns_);
    idle_ns_ = now_ns;
    (void)exchange(0, 0);
    require_answers();
}

void BringupBoard::refresh() {
    answered_ns_ = monotonic_now_ns();
    while (!exchange(0, 0)) {
        console_->check_signals();
        require_answers();
    }
}

bool BringupBoard::key_pressed(const RawKeys::Pressed& keys) const {
    return limits_.button >= 0 ? (reading_.buttons >> static_cast<unsigned>(limits_.button) & 1U) != 0 : keys.space;
}

std::int16_t BringupBoard::code_at(const Hold& hold, std::int64_t held_ns) const {
    const double share = std::min(1.0, static_cast<double>(held_ns) / static_cast<double>(hold.ramp_ns));
    return static_cast<std::int16_t>(std::lround(share * hold.code));
}

void BringupBoard::note_movement(Progress& progress) const {
    for (std::size_t i = 0; i < kStrings; ++i) {
        if (progress.still_ns == 0 || std::llabs(counts_[i] - progress.still[i]) > still_counts()) {
            progress.still = counts_;
            progress.still_ns = monotonic_now_ns();
            progress.still_answers = 0;
        }
    }
    ++progress.still_answers;
}

void BringupBoard::limit_movement(const Hold& hold, HoldResult& result) const {
    double wound_in = 0.0;
    double paid_out = 0.0;
    for (std::size_t i = 0; i < kStrings; ++i) {
        const double movement = static_cast<double>(result.counts[i]) * hold.metres_per_count[i];
        wound_in = std::max(wound_in, -movement);
        // What was paid out before, by hand or by a motor that pushed, may be wound in again.
        const double before = static_cast<double>(counts_[i] - result.counts[i]) * hold.metres_per_count[i];
        result.travelled = result.travelled || -movement > kMostWoundIn + std::max(0.0, before);
        paid_out = std::max(paid_out, movement);
        result.travelled =
            result.travelled || (hold.metres_per_count[i] == 0.0 && std::llabs(result.counts[i]) > limits_.most_counts);
    }
    result.pushed = paid_out > kMostPaidOut && wound_in < kMostPaidOut && !result.steady;
}

void BringupBoard::pull(const Hold& hold, const RawKeys& keys, Progress& progress) {
    const std::int64_t held_ns = monotonic_now_ns() - progress.begin_ns;
    const std::int16_t code = code_at(hold, held_ns);
    const bool answered = exchange(hold.channel, code);
    if (!answered && monotonic_now_ns() - answered_ns_ > kLostNs && hold.board_may_vanish) {
        progress.result.vanished = progress.over = true;
        return;
    }
    require_answers();
    if (!answered) {
        progress.still_ns = 0;  // the strings may move unseen
        return;
    }
    HoldResult& result = progress.result;
    for (std::size_t i = 0; i < kStrings; ++i) {
        result.counts[i] = counts_[i] - progress.start[i];
    }
    limit_movement(hold, result);
    if (result.travelled || result.pushed || held_ns > limits_.longest_hold_ns) {
        progress.over = true;
        return;
    }
    // Steady: the full code for long enough, and the string has been reeled in.
    note_movement(progress);
    const bool still = monotonic_now_ns() - progress.still_ns >= kStillNs && progress.still_answers >= kStillAnswers;
    if (held_ns >= hold.ramp_ns + hold.steady_ns && still && !result.steady) {
        result.steady = true;
        if (hold.on_steady) {
            hold.on_steady(code);
        }
        if (hold.silent_ns > 0) {
            stay_silent(hold, keys);
            progress.over = true;
        }
    }
}

void BringupBoard::stay_silent(const Hold& hold, const RawKeys& keys) {
    // The board keeps the code; nothing is sent. A release of the key ends the silence with zeros; with a button, which
    // cannot be read meanwhile, any key does.
    DeadManKey key(limits_.key_timeout_ns);
    const std::int64_t begin_ns = monotonic_now_ns();
    key.update(begin_ns, true, false);
    key.update(begin_ns, true, false);  // it is held
    while (monotonic_now_ns() - begin_ns < hold.silent_ns) {
        console_->check_signals();
        // The motor pulls: the guard watches this process as it does during exchanges.
        const std::int64_t now_ns = monotonic_now_ns();
        shared_.page().loop_beat(now_ns);
        check_.check(now_ns);
        require_guard();
        const RawKeys::Pressed pressed = keys.read(kKeyWaitMs);
        key.update(monotonic_now_ns(), pressed.space, pressed.other != '\0');
        const bool ended = limits_.button < 0 ? key.released() : pressed.space;
        if (ended || pressed.other != '\0') {
            return;
        }
    }
}

void BringupBoard::wait_until_still() {
    const std::int64_t begin_ns = monotonic_now_ns();
    std::int64_t still_ns = begin_ns;
    std::array<std::int64_t, kStrings> start = counts_;
    while (monotonic_now_ns() - still_ns < kStillNs && monotonic_now_ns() - begin_ns < kLongestStillWaitNs) {
        console_->check_signals();
        idle();
        for (std::size_t i = 0; i < kStrings; ++i) {
            if (std::llabs(counts_[i] - start[i]) > still_counts()) {
                start = counts_;
                still_ns = monotonic_now_ns();
            }
        }
        std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
}

HoldResult BringupBoard::hold(const Hold& hold) {
    Progress progress;
    const RawKeys keys;
    DeadManKey key(limits_.key_timeout_ns);
    answered_ns_ = monotonic_now_ns();
    try {
        while (!progress.over) {
            console_->check_signals();
            const RawKeys::Pressed pressed = keys.read(kKeyWaitMs);
            const std::int64_t now_ns = monotonic_now_ns();
            const bool down = key_pressed(pressed);
            key.update(now_ns, down, pressed.other != '\0' || (limits_.button >= 0 && !down));
            if (!key.held()) {
                // Not yet, or no more: zeros.
                (void)exchange(hold.channel, 0);
                if (!hold.board_may_vanish) {
                    require_answers();
                }
                progress.result.skipped = pressed.other == 's' && progress.begin_ns == 0;
                if (pressed.other == 'q') {
                    throw BringupStopped("stopped by q");
                }
                progress.over = progress.result.skipped || key.released();
                continue;
            }
            if (progress.begin_ns == 0) {
                progress.begin_ns = now_ns;
                progress.start = counts_;
            }
            progress.result.last_code = down ? code_at(hold, now_ns - progress.begin_ns) : progress.result.last_code;
            const bool was_steady = progress.result.steady;
            pull(hold, keys, progress);
            if (now_ns - progress.shown_ns > kShowNs || progress.result.steady != was_steady) {
                progress.shown_ns = now_ns;
                std::string line = "code " + std::to_string(code_at(hold, now_ns - progress.begin_ns)) + ", counters";
                for (const std::int64_t count : progress.result.counts) {
                    line += " " + std::to_string(count);
                }
                console_->show(line + (progress.result.steady ? "  - steady: release the key" : ""));
            }
        }
    } catch (...) {
        device_->board().zero_motors(monotonic_now_ns());
        throw;
    }
    // Zeros at once, twice: one packet may be lost.
    (void)exchange(hold.channel, 0);
    (void)exchange(hold.channel, 0);
    console_->end_show();
    return progress.result;
}

RoundTrips BringupBoard::measure_round_trips(std::size_t exchanges) {
    RoundTrips trips;
    for (std::size_t k = 0; k < exchanges; ++k) {
        console_->check_signals();
        const std::int64_t begin_ns = monotonic_now_ns();
        if (exchange(0, 0)) {
            trips.times_ns.push_back(monotonic_now_ns() - begin_ns);
        } else {
            ++trips.failed;
        }
        require_answers();
        std::this_thread::sleep_for(std::chrono::nanoseconds(kPauseNs));
    }
    return trips;
}

void BringupBoard::wait_for_device() {
    while (!exchange(0, 0)) {
        console_->check_signals();
        try {
            device_->reopen();
            if (guard_link_) {
                guard_link_->renew(device_->board().zero_packet());
            }
        } catch (const device::BoardError& error) {
            console_->show(std::string("not yet: ") + error.what());
        }
        std::this_thread::sleep_for(std::chrono::nanoseconds(kRetryNs));
    }
    answered_ns_ = monotonic_now_ns();
    counted_ = false;  // the counters may have another zero
    (void)exchange(0, 0);
}

}  // namespace haptic::rt
