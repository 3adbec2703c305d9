// Recording of contact frames: one CSV row per proxy of each frame that a tick took, valid or rejected.
//
// The file is F.frames.csv next to F.csv. Each row repeats the values of the whole frame, so that any tool can use it.
// F.compliance.csv has one row per row r of a frame's relative compliance k W (no unit), element s in `columnS`. It
// ends at the diagonal: the elements behind it are written as 0. There is no such file if no frame has a compliance.
#pragma once

#include <exception>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "haptic/csv.hpp"
#include "tick/recorder.hpp"

namespace haptic::rt {

/// F.frames.csv for F.csv.
[[nodiscard]] std::filesystem::path frames_file(const std::filesystem::path& recording);

/// F.compliance.csv for F.frames.csv.
[[nodiscard]] std::filesystem::path compliance_file(const std::filesystem::path& frames);

[[nodiscard]] const std::vector<std::string>& frame_columns();
[[nodiscard]] const std::vector<std::string>& compliance_columns();

class FrameWriter {
  public:
    /// Replaces the files of an earlier recording. Throws std::runtime_error.
    explicit FrameWriter(const std::filesystem::path& file);
    /// Adds a frame to those that flush() writes. A frame without proxies has one row, with particle -1. Non-finite
    /// numbers, which only a defective frame can contain, are written as 0. If the file of compliances cannot be
    /// opened, that is a write that failed.
    void write(const RecordedFrame& recorded);
    /// Writes all frames since the last call; false once a write has failed.
    bool flush() noexcept;
    /// Flushes. Throws std::runtime_error if a write failed.
    void close();

  private:
    void write_compliance(const RecordedFrame& recorded);

    CsvStream frames_;
    std::filesystem::path compliance_file_;
    std::optional<CsvStream> compliance_;  // from the first frame on that has one
    std::exception_ptr no_compliance_;     // why it could not be opened
    std::vector<CsvCell> row_;
};

class FrameReader {
  public:
    /// Throws CsvError if the file or a column is missing. Recordings of earlier versions lack compliance_rows,
    /// body_work_j or radius_m; their forces have another meaning, so they are refused. Columns other than
    /// frame_columns() are ignored.
    explicit FrameReader(const std::filesystem::path& file);
    /// Reads the next frame; false at the end. A frame recorded with a defect has a defect again, but not always the
    /// same. If a killed run has left only a part of the last frame, that frame is skipped. Throws CsvError for rows
    /// that do not form a frame.
    bool next(RecordedFrame& recorded);
    [[nodiscard]] const std::string& name() const noexcept { return reader_.name(); }

  private:
    void read_row(RecordedFrame& recorded, std::int64_t particle);
    void read_compliance(RecordedFrame& recorded);

    CsvReader reader_;
    std::filesystem::path compliance_file_;
    std::optional<CsvReader> compliance_;  // from the first frame on that has one
    std::vector<std::size_t> order_;       // file column of each of frame_columns()
    bool more_ = false;                    // the reader holds a row that was not used yet
};

}  // namespace haptic::rt
