// Recordings: CSV with a header line that names column and unit ("time_s,x_m,..."), numbers only. Lines that begin with
// # are notes, of which readers of numbers take no notice.
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

namespace haptic {

/// what() is "FILE:LINE: problem".
class CsvError : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
};

/// A number of a recording. Integers are written and read without passing through a double, so that no bit is lost.
using CsvCell = std::variant<double, std::int64_t, std::uint64_t>;

/// The shortest form that reads back to the same bits, as CsvWriter writes it.
[[nodiscard]] std::string text_of(const CsvCell& cell);

/// Appends numbers in that form, with commas between them, and ends the line.
void append_row(std::string& text, std::span<const double> values);

/// A CSV file row by row, for recordings of any length.
class CsvReader {
  public:
    /// Throws CsvError: missing file, no header.
    explicit CsvReader(const std::filesystem::path& file);

    [[nodiscard]] const std::vector<std::string>& columns() const noexcept { return names_; }
    /// Where a column is; empty where there is none.
    [[nodiscard]] std::optional<std::size_t> find(std::string_view column) const;
    /// Throws CsvError that lists the columns the file does have.
    [[nodiscard]] std::size_t index(std::string_view column) const;

    /// Goes on to the next row; false at the end. Throws CsvError for a row with another number of cells.
    bool next();
    /// A cell of the present row. Throws CsvError for what is not a finite number.
    [[nodiscard]] double number(std::size_t column) const;
    /// Throws CsvError for what is not an integer, or not within 64 bits.
    [[nodiscard]] std::int64_t integer(std::size_t column) const;
    [[nodiscard]] std::uint64_t natural(std::size_t column) const;
    /// As it is written.
    [[nodiscard]] std::string_view cell(std::size_t column) const { return cells_[column]; }
    /// Throws CsvError that names file and line of the present row.
    [[noreturn]] void fail(const std::string& problem) const;
    [[nodiscard]] const std::string& name() const noexcept { return file_; }
    [[nodiscard]] std::size_t line() const noexcept { return line_number_; }
    /// What stands before the header, without the # and the blanks round it.
    [[nodiscard]] const std::vector<std::string>& notes() const noexcept { return notes_; }

  private:
    bool next_line();
    [[noreturn]] void refuse(std::size_t column, const char* wanted) const;

    std::string file_;
    std::ifstream stream_;
    std::string line_;
    std::size_t line_number_ = 0;
    std::vector<std::string> notes_;
    std::vector<std::string> names_;
    std::vector<std::string_view> cells_;  // of line_
};

/// A whole CSV file in memory, column by column.
class CsvTable {
  public:
    /// Throws CsvError: missing file, no header, a row with another number of cells, a cell that is not a finite
    /// number.
    [[nodiscard]] static CsvTable load(const std::filesystem::path& file);

    [[nodiscard]] std::size_t rows() const noexcept { return rows_; }
    [[nodiscard]] const std::vector<std::string>& columns() const noexcept { return names_; }
    /// Empty where there is no such column.
    [[nodiscard]] std::optional<std::span<const double>> find(std::string_view column) const;
    /// Throws CsvError that lists the columns the file does have.
    [[nodiscard]] std::span<const double> column(std::string_view column) const;
    [[nodiscard]] const std::string& name() const noexcept { return file_; }
    /// As CsvReader's.
    [[nodiscard]] const std::vector<std::string>& notes() const noexcept { return notes_; }
    /// The number of the line with the header.
    [[nodiscard]] std::size_t header_line() const noexcept { return header_line_; }

  private:
    std::string file_;
    std::vector<std::string> notes_;
    std::vector<std::string> names_;
    std::size_t header_line_ = 1;
    std::vector<std::vector<double>> values_;
    std::size_t rows_ = 0;
};

/// Writes rows as they come, to a temporary file that close() renames into place, so that a reader never sees half a
/// recording. Values are written in the shortest form that reads back to the same bits. Throws CsvError.
class CsvWriter {
  public:
    /// `notes` of one line each go before the header.
    CsvWriter(const std::filesystem::path& file, const std::vector<std::string>& columns,
              const std::vector<std::string>& notes = {});
    CsvWriter(const CsvWriter&) = delete;
    CsvWriter& operator=(const CsvWriter&) = delete;
    /// Closes without renaming if close() was not reached; the temporary file is removed.
    ~CsvWriter();

    void row(std::span<const double> values);
    void row(std::span<const CsvCell> cells);
    void close();

  private:
    void begin_row(std::size_t cells);
    void end_row();
    void write_row();

    std::filesystem::path file_;
    std::filesystem::path temporary_;
    std::ofstream stream_;
    std::size_t columns_;
    std::string line_;
};

}  // namespace haptic
