// Ticks as rows of a CSV recording; a recording is valid as `--hand` again.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "haptic/csv.hpp"
#include "haptic/rt/recorder.hpp"
#include "haptic/rt/tick_record.hpp"

namespace haptic::rt {

inline constexpr std::size_t kRecordColumns = 29;

/// time_s, pose (x_m..qz), rendered wrench (fx_n..tz_nm), local proxy of the first particle, tensions, frame_age_ms
/// (-1: no frame yet), period_us, compute_us, flags.
[[nodiscard]] const std::vector<std::string>& record_columns();

/// One row; time_s counts from start_ns.
[[nodiscard]] std::array<double, kRecordColumns> record_row(const TickRecord& record, std::int64_t start_ns);

/// Writes what a Recorder holds, as it comes. time_s counts from the first tick.
class RecordFile {
  public:
    /// Throws CsvError.
    RecordFile(const std::filesystem::path& file, Recorder& recorder);
    /// Writes all that waits.
    void drain();
    /// Drains and puts the file in its place.
    void close();

  private:
    CsvWriter writer_;
    Recorder* recorder_;
    std::int64_t start_ns_ = 0;
    bool started_ = false;
};

/// The last ticks before a fault. Throws CsvError.
void write_black_box(const std::filesystem::path& file, const BlackBox& box);

}  // namespace haptic::rt
