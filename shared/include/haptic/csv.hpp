// CSV recordings: a header line with column names and units ("time_s,x_m,..."), then rows of numbers. Lines that start
// with # are notes, which readers of numbers skip.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "haptic/streamed_file.hpp"

namespace haptic {

/// what() is "FILE:LINE: problem".
class CsvError : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
};

/// One number of a recording. Integers are written and read exactly, never through a double.
using CsvCell = std::variant<double, std::int64_t, std::uint64_t>;

/// Shortest text that reads back to the same bits, as CsvWriter writes it.
[[nodiscard]] std::string text_of(const CsvCell& cell);

/// Appends numbers in that form, comma-separated, and a newline.
void append_row(std::string& text, std::span<const double> values);
void append_row(std::string& text, std::span<const CsvCell> cells);

/// Reads a CSV file row by row, for recordings of any length.
class CsvReader {
  public:
    /// Throws CsvError: missing file, no header.
    explicit CsvReader(const std::filesystem::path& file);

    [[nodiscard]] const std::vector<std::string>& columns() const noexcept { return names_; }
    /// Index of a column; empty if there is none.
    [[nodiscard]] std::optional<std::size_t> find(std::string_view column) const;
    /// Index of a column. Throws CsvError with the list of existing columns.
    [[nodiscard]] std::size_t index(std::string_view column) const;

    /// Advances to the next row; false at the end. Throws CsvError for a row with the wrong number of cells, except for
    /// a last line without its end: a killed run may leave one, which is skipped.
    bool next();
    /// Cell of the current row. Throws CsvError unless it is a finite number.
    [[nodiscard]] double number(std::size_t column) const;
    /// Throws CsvError unless the cell is an integer of 64 bits.
    [[nodiscard]] std::int64_t integer(std::size_t column) const;
    [[nodiscard]] std::uint64_t natural(std::size_t column) const;
    /// Text of a cell.
    [[nodiscard]] std::string_view cell(std::size_t column) const { return cells_[column]; }
    /// Throws CsvError with file and line of the current row.
    [[noreturn]] void fail(const std::string& problem) const;
    [[nodiscard]] const std::string& name() const noexcept { return file_; }
    [[nodiscard]] std::size_t line() const noexcept { return line_number_; }
    /// Share of the file that has been read, 0 to 1.
    [[nodiscard]] double share() const noexcept;
    /// Notes so far, without # and surrounding blanks: those before the header, and between the rows read.
    [[nodiscard]] const std::vector<std::string>& notes() const noexcept { return notes_; }

  private:
    bool next_line();
    [[noreturn]] void refuse(std::size_t column, const char* wanted) const;

    std::string file_;
    std::ifstream stream_;
    std::string line_;
    std::size_t line_number_ = 0;
    std::uintmax_t read_ = 0;  // bytes
    std::uintmax_t size_ = 0;  // bytes, of the file
    std::vector<std::string> notes_;
    std::vector<std::string> names_;
    std::vector<std::string_view> cells_;  // point into line_
};

/// A whole CSV file in memory, column by column.
class CsvTable {
  public:
    /// Throws CsvError: missing file, no header, a row with the wrong number of cells, a cell that is not a finite
    /// number.
    [[nodiscard]] static CsvTable load(const std::filesystem::path& file);

    [[nodiscard]] std::size_t rows() const noexcept { return rows_; }
    [[nodiscard]] const std::vector<std::string>& columns() const noexcept { return names_; }
    /// Values of a column; empty if there is none.
    [[nodiscard]] std::optional<std::span<const double>> find(std::string_view column) const;
    /// Values of a column. Throws CsvError with the list of existing columns.
    [[nodiscard]] std::span<const double> column(std::string_view column) const;
    [[nodiscard]] const std::string& name() const noexcept { return file_; }
    /// See CsvReader::notes().
    [[nodiscard]] const std::vector<std::string>& notes() const noexcept { return notes_; }
    /// Line number of the header.
    [[nodiscard]] std::size_t header_line() const noexcept { return header_line_; }

  private:
    std::string file_;
    std::vector<std::string> notes_;
    std::vector<std::string> names_;
    std::size_t header_line_ = 1;
    std::vector<std::vector<double>> values_;
    std::size_t rows_ = 0;
};

/// A table that close() writes as a whole (text_file.hpp). Values are written as the shortest text that reads back to
/// the same bits.
class CsvWriter {
  public:
    /// `notes`, one line each, precede the header.
    CsvWriter(const std::filesystem::path& file, const std::vector<std::string>& columns,
              const std::vector<std::string>& notes = {});

    /// Throws CsvError for the wrong number of values.
    void row(std::span<const double> values);
    void row(std::span<const CsvCell> cells);
    /// Throws std::runtime_error. Without it there is no file.
    void close();

  private:
    std::filesystem::path file_;
    std::size_t columns_;
    std::string text_;
};

/// Writes rows under the final name while a run goes on, so that a killed run leaves them.
class CsvStream {
  public:
    /// Throws std::runtime_error.
    CsvStream(const std::filesystem::path& file, const std::vector<std::string>& columns);

    /// Adds a row to those that flush() writes. Throws CsvError for the wrong number of cells.
    void row(std::span<const CsvCell> cells);
    /// Writes all rows since the last call; false once a write has failed.
    bool flush() noexcept;
    /// Flushes. Throws std::runtime_error if a write failed; the file then holds the rows that fitted.
    void close();

  private:
    StreamedFile file_;
    std::string name_;
    std::size_t columns_;
    std::string rows_;  // not yet written
};

}  // namespace haptic
