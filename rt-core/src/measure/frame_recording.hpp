// Recording of contact frames: one CSV row per proxy of each frame that a tick took, valid or rejected.
//
// The file is F.frames.csv next to F.csv. Each row repeats the values of the whole frame, so that any tool can use it.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "haptic/csv.hpp"
#include "tick/recorder.hpp"

namespace haptic::rt {

/// F.frames.csv for F.csv.
[[nodiscard]] std::filesystem::path frames_file(const std::filesystem::path& recording);

[[nodiscard]] const std::vector<std::string>& frame_columns();

class FrameWriter {
  public:
    /// Throws CsvError.
    explicit FrameWriter(const std::filesystem::path& file) : writer_(file, frame_columns()) {}
    /// Writes a frame. A frame without proxies has one row, with particle -1. Non-finite numbers, which only a
    /// defective frame can contain, are written as 0.
    void write(const RecordedFrame& recorded);
    void close() { writer_.close(); }

  private:
    CsvWriter writer_;
    std::vector<CsvCell> row_;
};

class FrameReader {
  public:
    /// Throws CsvError if the file or a column is missing.
    explicit FrameReader(const std::filesystem::path& file);
    /// Reads the next frame; false at the end. A frame recorded with a defect has a defect again, but not always the
    /// same. Throws CsvError for rows that do not form a frame.
    bool next(RecordedFrame& recorded);
    [[nodiscard]] const std::string& name() const noexcept { return reader_.name(); }

  private:
    void read_row(RecordedFrame& recorded, std::int64_t particle);

    CsvReader reader_;
    std::vector<std::size_t> order_;  // file column of each of frame_columns()
    bool more_ = false;               // the reader holds a row that was not used yet
};

}  // namespace haptic::rt
