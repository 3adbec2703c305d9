// Replay: feeds the recorded inputs of the board, the ring and the clock through the same tick, and compares the
// results.
//
//     F.csv         now_ns, deadline_ns, missed, requests ---> TickTime, arm(), stop()
//                   counters, switches, exchange status -----> ReplayBoard
//                   overlays --------------------------------> ReplaySource
//     F.frames.csv  contact frames --------------------------> ReplaySource
//
// With the settings of the recording and the same machine code, every pose, wrench, tension and DAC code is identical
// to the last bit. (sin() may differ in its last bits between C libraries.) Ticks run as fast as possible.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "haptic/csv.hpp"
#include "haptic/device/board.hpp"
#include "haptic/ring.hpp"
#include "measure/frame_recording.hpp"
#include "tick/slot_source.hpp"
#include "tick/tick.hpp"

namespace haptic::rt {

/// Board that returns the recorded answers and ignores the motor commands.
class ReplayBoard final : public device::Board {
  public:
    struct Answers {
        std::int8_t in = kNoExchange;  // device::ExchangeStatus
        std::int8_t out = kNoExchange;
        std::int8_t collected = kNoExchange;
        device::BoardReading reading;
    };
    /// Sets the answers to the exchanges of the next tick.
    void load(const Answers& answers) HAPTIC_RT {
        answers_ = answers;
        exchanges_ = 0;
    }

    /// Returns the next recorded answer. An exchange that was not recorded, as when a tick now has two instead of one,
    /// succeeds.
    device::ExchangeStatus exchange(const device::MotorCommand& command, device::BoardReading& reading,
                                    std::int64_t now_ns) HAPTIC_RT override;
    /// That of the tick before, as this tick's row says.
    [[nodiscard]] bool answer_due() const HAPTIC_RT override {
        return answers_.collected != kNoExchange && exchanges_ == 0;
    }
    device::ExchangeStatus collect(std::int64_t /*now_ns*/) HAPTIC_RT override {
        return static_cast<device::ExchangeStatus>(answers_.collected);
    }
    void zero_motors(std::int64_t /*now_ns*/) HAPTIC_RT override {}

  private:
    Answers answers_;
    int exchanges_ = 0;  // of this tick
};

/// Source that returns the loaded slot once.
template <class Slot>
class ReplaySource final : public SlotSource<Slot> {
  public:
    /// nullptr: none in this tick.
    void load(const Slot* slot) HAPTIC_RT { slot_ = slot; }
    [[nodiscard]] bool read_newest(Slot& slot) HAPTIC_RT override {
        if (slot_ == nullptr) {
            return false;
        }
        slot = *slot_;
        slot_ = nullptr;
        return true;
    }

  private:
    const Slot* slot_ = nullptr;
};

/// Differences between the replayed and the recorded values of a column.
struct ColumnDifference {
    std::uint64_t first_tick = 0;
    std::size_t line = 0;  // of the recording
    std::string recorded;
    std::string replayed;
    double largest = 0.0;  // absolute difference over all ticks, in the column's unit
};

struct ReplayResult {
    std::uint64_t ticks = 0;
    std::uint64_t differing_ticks = 0;
    std::uint64_t frames = 0;
    std::size_t compared_columns = 0;
    std::map<std::string, ColumnDifference> columns;  // only those that differ

    [[nodiscard]] bool identical() const noexcept { return differing_ticks == 0; }
    /// The column that differs first; the leftmost one if several differ in that tick. Only if not identical().
    [[nodiscard]] const std::pair<const std::string, ColumnDifference>& first() const;
};

class Replay {
  public:
    /// Opens the recording. `states` must outlive the replay. Throws CsvError if the recording lacks required columns.
    Replay(const std::filesystem::path& recording, const TickSettings& settings, RingWriter<DeviceState>& states,
           StageClock clock);

    /// Runs the next tick and compares it; false at the end. Throws CsvError if ticks or frames are missing.
    bool step(Recorder* recorder = nullptr);

    [[nodiscard]] const ReplayResult& result() const noexcept { return result_; }
    /// The tick; valid after the first step().
    [[nodiscard]] const Tick& tick() const { return *tick_; }
    /// Share of the recording that has been replayed, 0 to 1.
    [[nodiscard]] double share() { return recording_.share(); }
    /// Recorded time from the first to the latest tick, ns.
    [[nodiscard]] std::int64_t recorded_ns() const noexcept { return now_ns_ - start_ns_; }

  private:
    struct Inputs;
    [[nodiscard]] Inputs read_inputs() const;
    void check_order(const Inputs& inputs);
    void load_frame(const Inputs& inputs);
    void load_overlay();
    void compare();
    [[nodiscard]] std::size_t required(const char* column) const;

    CsvReader recording_;
    FrameReader frame_reader_;
    TickSettings settings_;
    RingWriter<DeviceState>* states_;
    StageClock clock_;
    ReplayBoard board_;
    ReplaySource<ContactFrame> frames_;
    ReplaySource<WrenchOverlay> overlays_;
    std::unique_ptr<Tick> tick_;
    RecordedFrame frame_;
    WrenchOverlay overlay_{};
    std::map<std::string, std::size_t> inputs_;  // column of each input in the recording
    std::vector<std::optional<std::size_t>>
        compared_columns_;  // column of each of record_columns(); empty: not compared
    std::vector<CsvCell> row_;
    ReplayResult result_;
    std::uint64_t last_number_ = 0;
    std::int64_t start_ns_ = 0;
    std::int64_t now_ns_ = 0;
};

}  // namespace haptic::rt
