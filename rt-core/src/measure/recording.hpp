// Ticks as rows of a CSV recording, and the contact frames that they took as rows of another one beside it.
//
// A recording is valid as `--hand` again, and as `--device replay:` (replay.hpp), which makes of what the board and the
// ring gave the same poses and wrenches once more.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <haptic/csv.hpp>
#include "measure/frame_recording.hpp"
#include "tick/recorder.hpp"
#include "tick/tick_record.hpp"

namespace haptic::rt {

/// Names of all columns; see the table in recording.cpp for what each is.
[[nodiscard]] const std::vector<std::string>& record_columns();

/// Whether a column says how long something took here and now: such values differ from run to run.
[[nodiscard]] const std::vector<bool>& measured_columns();

/// One row, one cell a column; time_s counts from start_ns.
void record_row(const TickRecord& record, std::int64_t start_ns, std::vector<CsvCell>& row);

/// Writes what a Recorder holds, as it comes. time_s counts from arming, so that ticks before it have negative times;
/// from the first tick if the recording ends unarmed.
class RecordFile {
  public:
    /// Throws CsvError.
    RecordFile(const std::filesystem::path& file, Recorder& recorder);
    /// Each tick is also given to `seen` from now on, in the thread that drains.
    void tell(std::function<void(const TickRecord&)> seen) { seen_ = std::move(seen); }
    /// Writes all that waits.
    void drain();
    /// Drains and puts both files in their places.
    void close();

  private:
    void write(const TickRecord& record, std::int64_t start_ns);
    void start(std::int64_t start_ns);

    CsvWriter writer_;
    std::optional<FrameWriter> frames_;  // none where the recording is a pipe
    Recorder* recorder_;
    std::function<void(const TickRecord&)> seen_;
    std::vector<TickRecord> before_arming_;
    std::optional<std::int64_t> start_ns_;
    std::vector<CsvCell> row_;
};

/// The last ticks before a fault. Throws CsvError.
void write_black_box(const std::filesystem::path& file, const BlackBox& box);

}  // namespace haptic::rt
