// A recorded run once more: what the board, the ring and the clock gave then, through the same tick.
//
//     F.csv         now_ns, deadline_ns, missed, requests ---> TickTime, arm(), stop()
//                   counters, switches, exchange status -----> ReplayBoard
//     F.frames.csv  contact frames --------------------------> ReplayFrames
//
// With the settings of the recording, every pose, wrench, tension and digit has the same bits again, on the same
// machine code: the last bits of sin() may differ between C libraries. Ticks follow one another as fast as they can.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <haptic/csv.hpp>
#include <haptic/device/board.hpp>
#include <haptic/ring.hpp>
#include "measure/frame_recording.hpp"
#include "tick/frame_source.hpp"
#include "tick/tick.hpp"

namespace haptic::rt {

/// Answers what the recorded board answered, whatever the motors are told.
class ReplayBoard final : public device::Board {
  public:
    struct Answers {
        std::int8_t in = kNoExchange;  // device::ExchangeStatus
        std::int8_t out = kNoExchange;
        device::BoardReading reading;
    };
    /// For the exchanges of the next tick, in their order.
    void load(const Answers& answers) HAPTIC_RT {
        answers_ = answers;
        exchanges_ = 0;
    }

    /// An exchange that was not recorded, as when two a tick are made of one, succeeds.
    device::ExchangeStatus exchange(const device::MotorCommand& command, device::BoardReading& reading,
                                    std::int64_t now_ns) HAPTIC_RT override;
    void zero_motors(std::int64_t /*now_ns*/) HAPTIC_RT override {}

  private:
    Answers answers_;
    int exchanges_ = 0;  // of this tick
};

/// Gives the frame that it was loaded with, once.
class ReplayFrames final : public FrameSource {
  public:
    void load(const ContactFrame* frame) HAPTIC_RT { frame_ = frame; }
    [[nodiscard]] bool read_newest(ContactFrame& frame) HAPTIC_RT override;

  private:
    const ContactFrame* frame_ = nullptr;
};

/// How a column of the replay differs from the recorded one.
struct ColumnDifference {
    std::uint64_t first_tick = 0;
    std::size_t line = 0;  // of the recording
    std::string recorded;
    std::string replayed;
    double largest = 0.0;  // of all ticks, in the column's unit
};

struct ReplayResult {
    std::uint64_t ticks = 0;
    std::uint64_t differing_ticks = 0;
    std::uint64_t frames = 0;
    std::size_t compared_columns = 0;
    std::map<std::string, ColumnDifference> columns;  // those that differ

    [[nodiscard]] bool identical() const noexcept { return differing_ticks == 0; }
    /// The column that differed first; of several in one tick the one furthest left. Only if not identical().
    [[nodiscard]] const std::pair<const std::string, ColumnDifference>& first() const;
};

class Replay {
  public:
    /// Throws CsvError for a recording that lacks what a replay needs. `states` must outlive the replay.
    Replay(const std::filesystem::path& recording, const TickSettings& settings, RingWriter<DeviceState>& states,
           StageClock clock);

    /// Runs the next tick and compares; false at the end. Throws CsvError where ticks or frames are missing.
    bool step(Recorder* recorder = nullptr);

    [[nodiscard]] const ReplayResult& result() const noexcept { return result_; }
    /// After the first step().
    [[nodiscard]] const Tick& tick() const { return *tick_; }
    /// From the first to the last tick so far, ns, as recorded.
    [[nodiscard]] std::int64_t recorded_ns() const noexcept { return now_ns_ - start_ns_; }

  private:
    struct Inputs;
    [[nodiscard]] Inputs read_inputs() const;
    void check_order(const Inputs& inputs);
    void load_frame(const Inputs& inputs);
    void compare();
    [[nodiscard]] std::size_t required(const char* column) const;

    CsvReader recording_;
    FrameReader frame_reader_;
    TickSettings settings_;
    RingWriter<DeviceState>* states_;
    StageClock clock_;
    ReplayBoard board_;
    ReplayFrames frames_;
    std::unique_ptr<Tick> tick_;
    RecordedFrame frame_;
    std::map<std::string, std::size_t> inputs_;                 // where they are in the recording
    std::vector<std::optional<std::size_t>> compared_columns_;  // likewise, for each of record_columns()
    std::vector<CsvCell> row_;
    ReplayResult result_;
    std::uint64_t last_number_ = 0;
    std::int64_t start_ns_ = 0;
    std::int64_t now_ns_ = 0;
};

}  // namespace haptic::rt
