// Recording of a run: one CSV row per tick, and a second file with the contact frames.
//
// A recording can be used as `--hand`, and as `--device replay:` (replay.hpp), which recomputes the same poses and
// wrenches from the recorded inputs of the board and the ring.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "haptic/csv.hpp"
#include "measure/frame_recording.hpp"
#include "tick/recorder.hpp"
#include "tick/tick_record.hpp"

namespace haptic::rt {

/// Names of all columns; the table in recording.cpp describes them.
[[nodiscard]] const std::vector<std::string>& record_columns();

/// For each column, whether it holds a duration measured by the clock, which differs from run to run.
[[nodiscard]] const std::vector<bool>& nondeterministic_columns();

/// Converts a tick to one row; time_s counts from start_ns.
void record_row(const TickRecord& record, std::int64_t start_ns, std::vector<CsvCell>& row);

/// Writes the contents of a Recorder while the run goes on, under the final names, so that a killed run leaves them.
/// time_s counts from arming, so that earlier ticks have negative times; from the first tick if the loop was not armed
/// within its first 200,000 ticks. A write that fails ends the recording there, and the run goes on.
class RecordFile {
  public:
    /// Throws std::runtime_error.
    RecordFile(const std::filesystem::path& file, Recorder& recorder);
    /// Calls `observer` with each tick from now on, in the thread that calls drain().
    void set_observer(std::function<void(const TickRecord&)> observer) { observer_ = std::move(observer); }
    /// Writes everything that is queued.
    void drain();
    /// Drains. Throws std::runtime_error if the recording is incomplete.
    void close();

  private:
    void write(const TickRecord& record, std::int64_t start_ns);
    void start(std::int64_t start_ns);
    void take_ticks();
    void take_frames();
    void flush();

    CsvStream ticks_;
    std::optional<FrameWriter> frames_;  // none if the recording is a pipe
    Recorder* recorder_;
    std::function<void(const TickRecord&)> observer_;
    std::vector<TickRecord> before_arming_;
    std::optional<std::int64_t> start_ns_;
    std::vector<CsvCell> row_;
    bool failed_ = false;
};

/// Writes the last ticks before a fault or a stop; time_s counts from arming, or from the oldest tick if nobody has
/// armed. An existing file of that name is renamed to F.bak-1, the next one to F.bak-2, and so on to F.bak-9, so that
/// in a series of faults the first nine and the last one stay. Throws std::runtime_error.
void write_black_box(const std::filesystem::path& file, const BlackBox& box);

}  // namespace haptic::rt
