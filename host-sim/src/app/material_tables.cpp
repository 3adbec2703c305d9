#include "app/material_tables.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <iomanip>
#include <ostream>
#include <sstream>
#include <utility>

#include "haptic/csv.hpp"
#include "haptic/plot.hpp"
#include "haptic/text_file.hpp"

namespace haptic::sim {
namespace {

constexpr int kShownDigits = 4;

std::string digits(double value, int significant) {
    std::ostringstream text;
    text << std::setprecision(significant) << value;
    return text.str();
}

/// Measured by requested value; none where that is none or 0.
std::optional<double> ratio_of(const TestLine& line) {
    if (!line.requested || *line.requested == 0.0) {
        return std::nullopt;
    }
    return line.measured / *line.requested;
}

std::string fixed(double value, int decimals) {
    std::ostringstream text;
    text << std::fixed << std::setprecision(decimals) << value;
    return text.str();
}

}  // namespace

std::string with_unit(double value, const std::string& unit) {
    if (unit.empty()) {
        return digits(value, kShownDigits);
    }
    static constexpr std::array<std::pair<double, const char*>, 6> prefixes{
        {{1e9, "G"}, {1e6, "M"}, {1e3, "k"}, {1.0, ""}, {1e-3, "m"}, {1e-6, "u"}}};
    for (const auto& [factor, prefix] : prefixes) {
        if (std::abs(value) >= factor || factor == prefixes.back().first) {
            return digits(value / factor, kShownDigits) + ' ' + prefix + unit;
        }
    }
    return {};
}

void print(std::ostream& out, const TestTable& table) {
    std::vector<std::array<std::string, 7>> rows{
        {"specimen", "quantity", "requested", "measured", "ratio", "sub-steps", "time"}};
    bool moving = false;
    for (const TestLine& line : table.lines) {
        const std::optional<double> ratio = ratio_of(line);
        rows.push_back({line.specimen, line.quantity, line.requested ? with_unit(*line.requested, line.unit) : "-",
                        with_unit(line.measured, line.unit) + (line.at_rest ? "" : " *"),
                        ratio ? fixed(*ratio, 3) : "-", std::to_string(line.substeps), fixed(line.time_s, 1) + " s"});
        moving = moving || !line.at_rest;
    }
    std::array<std::size_t, 7> width{};
    for (const auto& row : rows) {
        for (std::size_t k = 0; k < row.size(); ++k) {
            width[k] = std::max(width[k], row[k].size());
        }
    }
    out << table.title << '\n';
    for (const auto& row : rows) {
        out << ' ';
        for (std::size_t k = 0; k < row.size(); ++k) {
            // Texts on the left, numbers on the right.
            out << ' ' << (k < 2 ? std::left : std::right) << std::setw(static_cast<int>(width[k])) << row[k]
                << (k + 1 < row.size() ? " " : "");
        }
        out << '\n';
    }
    if (moving) {
        out << "  * still moving when it was measured\n";
    }
    out << '\n';
}

std::string csv_of(const TestTable& table) {
    std::string text = "specimen,number,quantity,unit,requested,measured,ratio,substeps,time_s,at_rest\n";
    for (const TestLine& line : table.lines) {
        const std::optional<double> ratio = ratio_of(line);
        text += line.specimen + ',' + text_of(line.number) + ',' + line.quantity + ',' + line.unit + ',' +
                (line.requested ? text_of(*line.requested) : "-") + ',' + text_of(line.measured) + ',' +
                (ratio ? text_of(*ratio) : "-") + ',' + std::to_string(line.substeps) + ',' + text_of(line.time_s) +
                ',' + (line.at_rest ? '1' : '0') + '\n';
    }
    return text;
}

std::string write_table(const std::filesystem::path& folder, const TestTable& table, const std::string& axis,
                        const std::string& plotted) {
    write_text(folder / (table.name + ".csv"), csv_of(table));
    // One curve for each quantity.
    std::vector<std::string> quantities;
    for (const TestLine& line : table.lines) {
        if (ratio_of(line) && std::find(quantities.begin(), quantities.end(), line.quantity) == quantities.end()) {
            quantities.push_back(line.quantity);
        }
    }
    if (quantities.empty()) {
        return {};
    }
    std::string commands = "set xlabel " + gnuplot_text(axis) + "\nset ylabel " + gnuplot_text(plotted) +
                           "\nset yrange [0:1.2<*]\nplot 1 lc 5 dt 2 notitle";
    std::size_t type = 0;
    for (const std::string& quantity : quantities) {
        ++type;
        commands += ", " + gnuplot_text(table.name + ".csv") + " using 'number':(stringcolumn('quantity') eq " +
                    gnuplot_text(quantity) + " ? column('ratio') : NaN) every ::1 with points pt 7 ps 1.2 lc " +
                    std::to_string(type) + " title " + gnuplot_text(quantity);
    }
    commands += '\n';
    write_text(folder / (table.name + ".gp"),
               std::string(plot_style()) + "set output " + gnuplot_text(table.name + ".svg") + "\n" + commands);
    const DrawnPlot drawn = draw_plot(commands, folder);
    if (!drawn.svg.empty()) {
        write_text(folder / (table.name + ".svg"), drawn.svg);
    }
    return drawn.problem;
}

}  // namespace haptic::sim
