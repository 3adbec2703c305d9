#include "haptic/csv.hpp"

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <iterator>
#include <sstream>
#include <system_error>
#include <utility>

#include "file_replacement.hpp"

namespace haptic {
namespace {

constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";

std::string_view trimmed(std::string_view text) {
    const std::size_t begin = text.find_first_not_of(" \t\r");
    return begin == std::string_view::npos ? std::string_view{}
                                           : text.substr(begin, text.find_last_not_of(" \t\r") - begin + 1);
}

/// Takes the first line off the text, without its end.
std::string_view next_line(std::string_view& text) {
    const std::size_t end = text.find('\n');
    const std::string_view line = text.substr(0, end);
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    return trimmed(line);
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
    if (cell.starts_with('+')) {
        cell.remove_prefix(1);
    }
    double value = 0.0;
    const auto [end, error] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
    const bool whole = error == std::errc{} && end == cell.data() + cell.size();
    return whole && std::isfinite(value) ? std::optional(value) : std::nullopt;
}

std::string read_file(const std::filesystem::path& file) {
    if (std::filesystem::is_directory(file)) {
        throw CsvError(file.string() + ": cannot be read: is a directory");
    }
    errno = 0;
    std::ifstream stream(file, std::ios::binary);
    if (!stream) {
        throw CsvError(file.string() + ": cannot be read: " + std::generic_category().message(errno));
    }
    return {std::istreambuf_iterator<char>(stream), {}};
}

[[noreturn]] void fail(const std::string& file, std::size_t line, const std::string& problem) {
    throw CsvError(file + ":" + std::to_string(line) + ": " + problem);
}

}  // namespace

CsvTable CsvTable::load(const std::filesystem::path& file) {
    const std::string content = read_file(file);
    CsvTable table;
    table.file_ = file.string();
    std::size_t line_number = 0;
    std::string_view rest = content;
    if (rest.starts_with(kByteOrderMark)) {
        rest.remove_prefix(kByteOrderMark.size());
    }
    std::vector<std::string_view> cells;
    ++line_number;
    split_cells(next_line(rest), cells);
    for (const std::string_view name : cells) {
        if (name.empty() || finite_number(name)) {
            fail(table.file_, line_number, "the first line must name the columns, as in \"time_s,x_m,y_m,z_m\"");
        }
        if (std::find(table.names_.begin(), table.names_.end(), name) != table.names_.end()) {
            fail(table.file_, line_number, "two columns are named \"" + std::string(name) + "\"");
        }
        table.names_.emplace_back(name);
    }
    table.values_.resize(table.names_.size());
    while (!rest.empty()) {
        ++line_number;
        const std::string_view line = next_line(rest);
        if (line.empty()) {
            continue;
        }
        split_cells(line, cells);
        if (cells.size() != table.names_.size()) {
            fail(table.file_, line_number,
                 "has " + std::to_string(cells.size()) + " cells, the header has " +
                     std::to_string(table.names_.size()));
        }
        for (std::size_t i = 0; i < cells.size(); ++i) {
            const std::optional<double> value = finite_number(cells[i]);
            if (!value) {
                fail(table.file_, line_number,
                     "column " + table.names_[i] + ": \"" + std::string(cells[i]) + "\" is not a finite number");
            }
            table.values_[i].push_back(*value);
        }
        ++table.rows_;
    }
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
    std::string list;
    for (const std::string& name : names_) {
        list += (list.empty() ? "" : ", ") + name;
    }
    throw CsvError(file_ + ":1: there is no column " + std::string(column) + "; the file has: " + list);
}

CsvWriter::CsvWriter(const std::filesystem::path& file, const std::vector<std::string>& columns)
    : file_(file), temporary_(detail::temporary_beside(file)), columns_(columns.size()) {
    errno = 0;
    stream_.open(temporary_, std::ios::binary | std::ios::trunc);
    if (!stream_) {
        throw CsvError(file_.string() + ": cannot be written: " + std::generic_category().message(errno));
    }
    for (const std::string& column : columns) {
        line_ += (line_.empty() ? "" : ",") + column;
    }
    stream_ << line_ << '\n';
}

CsvWriter::~CsvWriter() {
    if (stream_.is_open()) {
        stream_.close();
        detail::discard(temporary_, file_);
    }
}

void CsvWriter::row(std::span<const double> values) {
    if (values.size() != columns_) {
        throw CsvError(file_.string() + ": a row of " + std::to_string(values.size()) + " values for " +
                       std::to_string(columns_) + " columns");
    }
    line_.clear();
    char digits[32];
    for (const double value : values) {
        if (!line_.empty()) {
            line_ += ',';
        }
        line_.append(digits, std::to_chars(std::begin(digits), std::end(digits), value).ptr);
    }
    line_ += '\n';
    stream_.write(line_.data(), static_cast<std::streamsize>(line_.size()));
}

void CsvWriter::close() {
    errno = 0;
    stream_.close();
    if (!stream_) {
        const int error = errno != 0 ? errno : EIO;
        detail::discard(temporary_, file_);
        throw CsvError(file_.string() + ": could not be written whole: " + std::generic_category().message(error));
    }
    if (const std::error_code error = detail::put_in_place(temporary_, file_)) {
        throw CsvError(file_.string() + ": cannot be put in place: " + error.message());
    }
}

}  // namespace haptic
