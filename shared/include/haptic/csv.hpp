// Recordings: CSV with a header line that names column and unit ("time_s,x_m,..."), numbers only.
#pragma once

#include <cstddef>
#include <filesystem>
#include <fstream>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace haptic {

/// what() is "FILE:LINE: problem".
class CsvError : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
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

  private:
    std::string file_;
    std::vector<std::string> names_;
    std::vector<std::vector<double>> values_;
    std::size_t rows_ = 0;
};

/// Writes rows as they come, to a temporary file that close() renames into place, so that a reader never sees half a
/// recording. Values are written in the shortest form that reads back to the same bits. Throws CsvError.
class CsvWriter {
  public:
    CsvWriter(const std::filesystem::path& file, const std::vector<std::string>& columns);
    CsvWriter(const CsvWriter&) = delete;
    CsvWriter& operator=(const CsvWriter&) = delete;
    /// Closes without renaming if close() was not reached; the temporary file is removed.
    ~CsvWriter();

    void row(std::span<const double> values);
    void close();

  private:
    std::filesystem::path file_;
    std::filesystem::path temporary_;
    std::ofstream stream_;
    std::size_t columns_;
    std::string line_;
};

}  // namespace haptic
