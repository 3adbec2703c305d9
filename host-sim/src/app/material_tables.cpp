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

/// Measured by requested value; none where that is none or 0, or the specimen was still moving.
std::optional<double> ratio_of(const TestLine& line) {
    if (!line.requested || *line.requested == 0.0 || !line.at_rest) {
        return std::nullopt;
    }
    return line.measured / *line.requested;
}

std::optional<double> ratio_of(const PressLine& line) {
    return line.at_rest ? std::optional(line.measured / line.requested) : std::nullopt;
}

/// In a file.
std::string cell(const std::optional<double>& value) {
    return value ? text_of(*value) : "-";
}

std::string fixed(double value, int decimals) {
    std::ostringstream text;
    text << std::fixed << std::setprecision(decimals) << value;
    return text.str();
}

std::string shown_ratio(const std::optional<double>& ratio) {
    return ratio ? fixed(*ratio, 3) : "-";
}

/// The text of `measured`, marked if the specimen was still moving.
std::string marked(double measured, const std::string& unit, bool at_rest) {
    return with_unit(measured, unit) + (at_rest ? "" : " *");
}

/// Prints rows in columns: the first ones, texts, on the left, numbers on the right.
template <std::size_t Columns>
void print_columns(std::ostream& out, const std::vector<std::array<std::string, Columns>>& rows, std::size_t texts) {
    std::array<std::size_t, Columns> width{};
    for (const auto& row : rows) {
        for (std::size_t k = 0; k < Columns; ++k) {
            width[k] = std::max(width[k], row[k].size());
        }
    }
    for (const auto& row : rows) {
        out << ' ';
        for (std::size_t k = 0; k < Columns; ++k) {
            out << ' ' << (k < texts ? std::left : std::right) << std::setw(static_cast<int>(width[k])) << row[k]
                << (k + 1 < Columns ? " " : "");
        }
        out << '\n';
    }
}

/// Below a table.
void print_end(std::ostream& out, bool moving) {
    out << (moving ? "  * still moving when it was measured: unreliable, and without a ratio\n\n" : "\n");
}

/// Writes NAME.gp and, if gnuplot draws it, NAME.svg. Returns why there is none.
std::string write_plot(const std::filesystem::path& folder, const std::string& name, const std::string& commands) {
    write_text(folder / (name + ".gp"),
               std::string(plot_style()) + "set output " + gnuplot_text(name + ".svg") + "\n" + commands);
    const DrawnPlot drawn = draw_plot(commands, folder);
    if (!drawn.svg.empty()) {
        write_text(folder / (name + ".svg"), drawn.svg);
    }
    return drawn.problem;
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
        rows.push_back({line.specimen, line.quantity, line.requested ? with_unit(*line.requested, line.unit) : "-",
                        marked(line.measured, line.unit, line.at_rest), shown_ratio(ratio_of(line)),
                        std::to_string(line.substeps), fixed(line.time_s, 1) + " s"});
        moving = moving || !line.at_rest;
    }
    out << table.title << '\n';
    print_columns(out, rows, 2);
    print_end(out, moving);
}

void print(std::ostream& out, const PressTable& table) {
    std::vector<std::array<std::string, 8>> rows{
        {"particles", "depth", "Hertz", "Dimitriadis", "requested", "measured", "ratio", "sub-steps"}};
    bool moving = false;
    for (const PressLine& line : table.lines) {
        rows.push_back({std::to_string(line.particles), with_unit(line.depth, "m"), with_unit(line.half_space, "N"),
                        with_unit(line.series, "N"), with_unit(line.requested, "N"),
                        marked(line.measured, "N", line.at_rest), shown_ratio(ratio_of(line)),
                        std::to_string(line.substeps)});
        moving = moving || !line.at_rest;
    }
    out << table.title << '\n';
    print_columns(out, rows, 0);
    print_end(out, moving);
}

std::string csv_of(const TestTable& table) {
    std::string text = "specimen,number,quantity,unit,requested,measured,ratio,substeps,time_s,at_rest\n";
    for (const TestLine& line : table.lines) {
        text += line.specimen + ',' + text_of(line.number) + ',' + line.quantity + ',' + line.unit + ',' +
                cell(line.requested) + ',' + text_of(line.measured) + ',' + cell(ratio_of(line)) + ',' +
                std::to_string(line.substeps) + ',' + text_of(line.time_s) + ',' + (line.at_rest ? '1' : '0') + '\n';
    }
    return text;
}

std::string csv_of(const PressTable& table) {
    std::string text = "particles,depth_m,half_space_n,series_n,requested_n,measured_n,ratio,substeps,at_rest\n";
    for (const PressLine& line : table.lines) {
        text += std::to_string(line.particles) + ',' + text_of(line.depth) + ',' + text_of(line.half_space) + ',' +
                text_of(line.series) + ',' + text_of(line.requested) + ',' + text_of(line.measured) + ',' +
                cell(ratio_of(line)) + ',' + std::to_string(line.substeps) + ',' + (line.at_rest ? '1' : '0') + '\n';
    }
    return text;
}

std::string write_table(const std::filesystem::path& folder, const TestTable& table, const std::string& axis,
                        const std::string& plotted) {
    write_text(folder / (table.name + ".csv"), csv_of(table));
    // One curve for each quantity. Columns by name make gnuplot skip the heading.
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
                    gnuplot_text(quantity) + " ? column('ratio') : NaN) with points pt 7 ps 1.2 lc " +
                    std::to_string(type) + " title " + gnuplot_text(quantity);
    }
    commands += '\n';
    return write_plot(folder, table.name, commands);
}

std::string write_table(const std::filesystem::path& folder, const PressTable& table) {
    write_text(folder / (table.name + ".csv"), csv_of(table));
    const std::string file = gnuplot_text(table.name + ".csv");
    std::vector<std::size_t> counts;
    for (const PressLine& line : table.lines) {
        if (std::find(counts.begin(), counts.end(), line.particles) == counts.end()) {
            counts.push_back(line.particles);
        }
    }
    if (counts.empty()) {
        return {};
    }
    // The lines of one number of particles.
    const auto over_depth = [&](std::size_t particles, const std::string& column) {
        return file + " using (1e3 * column('depth_m')):(column('particles') == " + std::to_string(particles) +
               " ? column('" + column + "') : NaN) with ";
    };
    std::string commands = "set xlabel 'depth, mm'\nset ylabel 'force, N'\nset xrange [0:]\nset yrange [0:]\nplot " +
                           over_depth(counts.front(), "requested_n") + "lines lw 2 lc 5 title 'requested', " +
                           over_depth(counts.front(), "half_space_n") + "lines dt 2 lc 5 title 'half-space (Hertz)'";
    std::size_t type = 0;
    for (const std::size_t particles : counts) {
        ++type;
        commands += ", " + over_depth(particles, "measured_n") + "points pt 7 ps 1.2 lc " + std::to_string(type) +
                    " title '" + std::to_string(particles) + " particles'";
    }
    commands += '\n';
    return write_plot(folder, table.name, commands);
}

}  // namespace haptic::sim
