// Contact frames in a recording: one row for each proxy particle of each frame that a tick took, sound or not.
//
// Beside F.csv they are in F.frames.csv. Each row repeats what belongs to the frame, so that any tool can use it.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <haptic/csv.hpp>
#include "tick/recorder.hpp"

namespace haptic::rt {

/// F.frames.csv for F.csv.
[[nodiscard]] std::filesystem::path frames_file(const std::filesystem::path& recording);

[[nodiscard]] const std::vector<std::string>& frame_columns();

class FrameWriter {
  public:
    /// Throws CsvError.
    explicit FrameWriter(const std::filesystem::path& file) : writer_(file, frame_columns()) {}
    /// A frame without particles has one row, with particle -1. Numbers that are not finite, which only a frame with a
    /// defect has, are written as 0.
    void write(const RecordedFrame& recorded);
    void close() { writer_.close(); }

  private:
    CsvWriter writer_;
    std::vector<CsvCell> row_;
};

class FrameReader {
  public:
    /// Throws CsvError: no such file, columns missing.
    explicit FrameReader(const std::filesystem::path& file);
    /// The next frame; false at the end. A frame that had a defect has one again, if not always the same. Throws
    /// CsvError for rows that do not make a frame.
    bool next(RecordedFrame& recorded);
    [[nodiscard]] const std::string& name() const noexcept { return reader_.name(); }

  private:
    void read_row(RecordedFrame& recorded, std::int64_t particle);

    CsvReader reader_;
    std::vector<std::size_t> order_;  // where each of frame_columns() is
    bool more_ = false;               // the reader is at a row that was not taken yet
};

}  // namespace haptic::rt
