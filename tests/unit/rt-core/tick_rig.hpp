// Test rig: a tick with real rings and an emulated board, under a virtual clock.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "haptic/device/emulated_board.hpp"
#include "haptic/ring.hpp"
#include "rendering/floor_frame.hpp"
#include "tick/tick.hpp"
#include "unique_session.hpp"

namespace haptic::rt::test {

using haptic::test::unique_session;

inline std::int64_t still_clock() HAPTIC_RT {
    return 0;
}

/// Board that can be made to fail, or to report wrong counters.
class FaultyBoard final : public device::Board {
  public:
    explicit FaultyBoard(device::Board& board) : board_(&board) {}
    device::ExchangeStatus exchange(const device::MotorCommand& command, device::BoardReading& reading,
                                    std::int64_t now_ns) HAPTIC_RT override {
        if (failing) {
            return device::ExchangeStatus::Timeout;
        }
        const device::ExchangeStatus status = board_->exchange(command, reading, now_ns);
        for (std::size_t i = 0; i < kStrings; ++i) {
            // 16-bit counters, as on the board of most tests.
            reading.counters[i] = added[i] == 0 ? reading.counters[i] : (reading.counters[i] + added[i]) & 0xFFFFU;
        }
        return status;
    }
    device::ExchangeStatus send(const device::MotorCommand& command, std::int64_t now_ns) HAPTIC_RT override {
        return failing ? device::ExchangeStatus::Timeout : board_->send(command, now_ns);
    }
    [[nodiscard]] bool answer_due() const HAPTIC_RT override { return board_->answer_due(); }
    device::ExchangeStatus collect(std::int64_t now_ns) HAPTIC_RT override {
        const device::ExchangeStatus status = board_->collect(now_ns);
        return failing || losing_answers ? device::ExchangeStatus::Timeout : status;
    }
    void zero_motors(std::int64_t now_ns) HAPTIC_RT override { board_->zero_motors(now_ns); }

    bool failing = false;
    bool losing_answers = false;                  // to motor commands, which arrive
    std::array<std::uint32_t, kStrings> added{};  // offset of each counter

  private:
    device::Board* board_;
};

class TickRig {
  public:
    explicit TickRig(PoseTrack hand = PoseTrack(), const TickSettings& tick_settings = {},
                     const std::optional<device::GripMechanics>& mechanics = {})
        : settings(tick_settings),
          session(unique_session()),
          board({.geometry = tick_settings.geometry,
                 .hand = std::move(hand),
                 .power_up = {100, 65500, 3, 40000, 0, 7, 12345, 65535},
                 .mechanics = mechanics}),
          faulty(board),
          frames_in(session),
          states_out(session),
          frames_out(session),
          states_in(session),
          tick(tick_settings, faulty, frames_in, states_out, still_clock) {}

    /// Runs one tick, a period after the last one and `late_ns` after its deadline.
    void step(std::int64_t late_ns = 0, std::int64_t missed = 0) {
        tick.run({now_ns, now_ns + late_ns, missed});
        now_ns += settings.period_ns;
    }
    void steps(int count) {
        for (int i = 0; i < count; ++i) {
            step();
        }
    }
    /// Arms and steps until Running. The hand must hold still at the centre until then.
    void run_up() {
        tick.arm();
        steps(static_cast<int>(arming_time_ns(settings.safety) / settings.period_ns) + 5);
    }
    void publish(ContactFrame frame) { frames_out.publish(frame, now_ns); }

    TickSettings settings;
    std::string session;
    device::EmulatedBoard board;
    FaultyBoard faulty;
    RingReader<ContactFrame> frames_in;
    RingWriter<DeviceState> states_out;
    RingWriter<ContactFrame> frames_out;
    RingReader<DeviceState> states_in;
    Tick tick;
    std::int64_t now_ns = 1'000'000'000;
};

}  // namespace haptic::rt::test
