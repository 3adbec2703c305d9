#include "haptic/csv.hpp"

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <iterator>
#include <system_error>
#include <utility>

#include "haptic/text_file.hpp"
#include "joined.hpp"
#include "parsed_number.hpp"
#include "trimmed.hpp"

namespace haptic {
namespace {

using detail::trimmed;

constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";

bool is_note(std::string_view line) {
    return trimmed(line).starts_with('#');
}

/// A note without # and surrounding blanks.
std::string note_of(std::string_view line) {
    return std::string(trimmed(trimmed(line).substr(1)));
}

void split_cells(std::string_view line, std::vector<std::string_view>& cells) {
    cells.clear();
    for (std::size_t begin = 0;;) {
        const std::size_t comma = line.find(',', begin);
        cells.push_back(trimmed(line.substr(begin, comma - begin)));
        if (comma == std::string_view::npos) {
            return;
        }
        begin = comma + 1;
    }
}

std::optional<double> finite_number(std::string_view cell) {
    const std::optional<double> value = detail::parsed_signed_number<double>(cell);
    return value && std::isfinite(*value) ? value : std::nullopt;
}

/// Appends a number in its shortest exact form, after a comma unless the line is empty.
template <class Number>
void append(std::string& line, Number value) {
    char buffer[32];
    if (!line.empty()) {
        line += ',';
    }
    line.append(buffer, std::to_chars(std::begin(buffer), std::end(buffer), value).ptr);
}

[[noreturn]] void fail(const std::string& file, std::size_t line, const std::string& problem) {
    throw CsvError(file + ":" + std::to_string(line) + ": " + problem);
}

[[noreturn]] void no_such_column(const std::string& file, std::string_view column,
                                 const std::vector<std::string>& names) {
    fail(file, 1, "there is no column " + std::string(column) + "; the file has: " + detail::joined(names, ", "));
}

void require_width(const std::string& file, std::size_t cells, std::size_t columns) {
    if (cells != columns) {
        throw CsvError(file + ": a row of " + std::to_string(cells) + " values for " + std::to_string(columns) +
                       " columns");
    }
}

}  // namespace

std::string text_of(const CsvCell& cell) {
    std::string text;
    std::visit([&text](auto value) { append(text, value); }, cell);
    return text;
}

void append_row(std::string& text, std::span<const double> values) {
    char buffer[32];
    for (std::size_t i = 0; i < values.size(); ++i) {
        if (i > 0) {
            text += ',';
        }
        text.append(buffer, std::to_chars(std::begin(buffer), std::end(buffer), values[i]).ptr);
    }
    text += '\n';
}

void append_row(std::string& text, std::span<const CsvCell> cells) {
    std::string line;
    for (const CsvCell& cell : cells) {
        std::visit([&line](auto value) { append(line, value); }, cell);
    }
    text += line;
    text += '\n';
}

CsvReader::CsvReader(const std::filesystem::path& file) : file_(file.string()) {
    if (std::filesystem::is_directory(file)) {
        throw CsvError(file_ + ": cannot be read: is a directory");
    }
    errno = 0;
    stream_.open(file, std::ios::binary);
    if (!stream_) {
        throw CsvError(file_ + ": cannot be read: " + std::generic_category().message(errno));
    }
    std::error_code unknown;  // of a pipe: its length is not known before its end
    const std::uintmax_t size = std::filesystem::file_size(file, unknown);
    size_ = unknown ? 0 : size;
    // Notes before the header.
    while (next_line() && is_note(line_)) {
        notes_.push_back(note_of(line_));
    }
    line_number_ = std::max<std::size_t>(line_number_, 1);  // for messages about an empty file
    // Header: column names, possibly after a byte order mark.
    std::string_view header = line_;
    if (header.starts_with(kByteOrderMark)) {
        header.remove_prefix(kByteOrderMark.size());
    }
    split_cells(trimmed(header), cells_);
    for (const std::string_view name : cells_) {
        if (name.empty() || finite_number(name)) {
            fail("the first line must name the columns, as in \"time_s,x_m,y_m,z_m\"");
        }
        if (std::find(names_.begin(), names_.end(), name) != names_.end()) {
            fail("two columns are named \"" + std::string(name) + "\"");
        }
        names_.emplace_back(name);
    }
}

bool CsvReader::next_line() {
    if (!std::getline(stream_, line_)) {
        line_.clear();
        return false;
    }
    ++line_number_;
    read_ += line_.size() + 1;
    return true;
}

double CsvReader::share() const noexcept {
    return size_ == 0 ? 1.0 : std::min(1.0, static_cast<double>(read_) / static_cast<double>(size_));
}

bool CsvReader::next() {
    while (next_line()) {
        const std::string_view line = trimmed(line_);
        if (is_note(line)) {
            notes_.push_back(note_of(line));
            continue;
        }
        if (line.empty()) {
            continue;
        }
        split_cells(line, cells_);
        const bool torn = stream_.eof();  // without a line end
        if (torn && cells_.size() < names_.size()) {
            return false;
        }
        if (cells_.size() != names_.size()) {
            fail("has " + std::to_string(cells_.size()) + " cells, the header has " + std::to_string(names_.size()));
        }
        return true;
    }
    return false;
}

void CsvReader::fail(const std::string& problem) const {
    haptic::fail(file_, line_number_, problem);
}

void CsvReader::refuse(std::size_t column, const char* wanted) const {
    fail("column " + names_[column] + ": \"" + std::string(cells_[column]) + "\" is not " + wanted);
}

std::optional<std::size_t> CsvReader::find(std::string_view column) const {
    const auto found = std::find(names_.begin(), names_.end(), column);
    return found == names_.end() ? std::nullopt : std::optional(static_cast<std::size_t>(found - names_.begin()));
}

std::size_t CsvReader::index(std::string_view column) const {
    if (const auto found = find(column)) {
        return *found;
    }
    no_such_column(file_, column, names_);
}

double CsvReader::number(std::size_t column) const {
    const std::optional<double> value = finite_number(cells_[column]);
    if (!value) {
        refuse(column, "a finite number");
    }
    return *value;
}

std::int64_t CsvReader::integer(std::size_t column) const {
    const std::optional<std::int64_t> value = detail::parsed_number<std::int64_t>(cells_[column]);
    if (!value) {
        refuse(column, "an integer of 64 bits");
    }
    return *value;
}

std::uint64_t CsvReader::natural(std::size_t column) const {
    const std::optional<std::uint64_t> value = detail::parsed_number<std::uint64_t>(cells_[column]);
    if (!value) {
        refuse(column, "a natural number of 64 bits");
    }
    return *value;
}

CsvTable CsvTable::load(const std::filesystem::path& file) {
    CsvReader reader(file);
    CsvTable table;
    table.file_ = reader.name();
    table.names_ = reader.columns();
    table.header_line_ = reader.line();
    table.values_.resize(table.names_.size());
    while (reader.next()) {
        for (std::size_t i = 0; i < table.names_.size(); ++i) {
            table.values_[i].push_back(reader.number(i));
        }
        ++table.rows_;
    }
    table.notes_ = reader.notes();
    return table;
}

std::optional<std::span<const double>> CsvTable::find(std::string_view column) const {
    const auto found = std::find(names_.begin(), names_.end(), column);
    if (found == names_.end()) {
        return std::nullopt;
    }
    return std::span<const double>(values_[static_cast<std::size_t>(found - names_.begin())]);
}

std::span<const double> CsvTable::column(std::string_view column) const {
    if (const auto found = find(column)) {
        return *found;
    }
    no_such_column(file_, column, names_);
}

CsvWriter::CsvWriter(const std::filesystem::path& file, const std::vector<std::string>& columns,
                     const std::vector<std::string>& notes)
    : file_(file), columns_(columns.size()) {
    for (const std::string& note : notes) {
        text_ += "# " + note + '\n';
    }
    text_ += detail::joined(columns, ",") + '\n';
}

void CsvWriter::row(std::span<const double> values) {
    require_width(file_.string(), values.size(), columns_);
    append_row(text_, values);
}

void CsvWriter::row(std::span<const CsvCell> cells) {
    require_width(file_.string(), cells.size(), columns_);
    append_row(text_, cells);
}

void CsvWriter::close() {
    write_text(file_, text_);
}

CsvStream::CsvStream(const std::filesystem::path& file, const std::vector<std::string>& columns)
    : file_(file), name_(file.string()), columns_(columns.size()), rows_(detail::joined(columns, ",") + '\n') {}

void CsvStream::row(std::span<const CsvCell> cells) {
    require_width(name_, cells.size(), columns_);
    append_row(rows_, cells);
}

bool CsvStream::flush() noexcept {
    const bool written = file_.append(rows_);
    rows_.clear();
    return written;
}

void CsvStream::close() {
    (void)flush();
    file_.close();
}

}  // namespace haptic
