#include "commands/stability_command.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <sstream>
#include <stdexcept>
#include <string_view>
#include <system_error>

#include "commands/run_command.hpp"
#include "commands/scene_stability.hpp"
#include "haptic/html.hpp"
#include "haptic/text_file.hpp"
#include "measure/stability.hpp"
#include "measure/svg_plot.hpp"
#include "process/settings.hpp"
#include "program/exit_status.hpp"
#include "program/progress_bar.hpp"
#include "rendering/passivity.hpp"

namespace haptic::rt {
namespace {

constexpr double kSoftest = 10.0;     // N/m
constexpr double kStiffest = 2000.0;  // N/m
constexpr double kLongestS = 0.02;    // s, delay
// Amplitudes at the ends of the colour scale.
constexpr double kFaintest = 0.01 * kMillimetre;   // m
constexpr double kStrongest = 20.0 * kMillimetre;  // m

/// One trial and its outcome.
struct Cell {
    DelayedPart late = DelayedPart::Planes;
    bool controlled = false;
    int row = 0;
    int column = 0;
    double stiffness = 0.0;
    std::int64_t delay_ns = 0;
    StabilityOutcome outcome;
};

struct Axes {
    std::vector<double> stiffnesses;
    std::vector<std::int64_t> delays_ns;
};

Axes axes_of(const StabilityOptions& options, std::int64_t period_ns) {
    if (options.rows < 2 || options.columns < 2) {
        throw std::invalid_argument("stability: a map needs at least two rows and two columns");
    }
    Axes axes;
    for (int row = 0; row < options.rows; ++row) {
        axes.stiffnesses.push_back(kSoftest * std::pow(kStiffest / kSoftest, row / (options.rows - 1.0)));
    }
    for (int column = 0; column < options.columns; ++column) {
        const double ticks = kLongestS * column / (options.columns - 1.0) / seconds(period_ns);
        axes.delays_ns.push_back(static_cast<std::int64_t>(std::lround(ticks)) * period_ns);
    }
    return axes;
}

Settings settings_of(const StabilityOptions& options) {
    const Config config = load_config(options.config, options.assignments);
    Settings settings = read_settings(config);
    if (settings.tick.passivity.control == PassivityControl::Observe) {
        config.fail("passivity.control", "must be bound or damp: the map without a controller is always drawn too");
    }
    return settings;
}

void write_csv(const std::filesystem::path& file, const std::vector<Cell>& cells) {
    std::ostringstream csv;
    csv << "answer,controlled,stiffness_n_m,delay_ms,first_mm,last_mm,energy_min_j,peak_force_n,controlled_share,"
           "faults,"
           "grows,row,column\n";
    for (const Cell& cell : cells) {
        const StabilityOutcome& outcome = cell.outcome;
        csv << name_of(cell.late) << ',' << (cell.controlled ? 1 : 0) << ',' << cell.stiffness << ','
            << seconds(cell.delay_ns) * 1e3 << ',' << outcome.first_amplitude / kMillimetre << ','
            << outcome.last_amplitude / kMillimetre << ',' << outcome.min_energy << ',' << outcome.peak_force << ','
            << outcome.controlled << ',' << outcome.faults << ',' << (outcome.grows ? 1 : 0) << ',' << cell.row << ','
            << cell.column << '\n';
    }
    write_text(file, csv.str());
}

std::string title_of(DelayedPart late) {
    switch (late) {
        case DelayedPart::Planes:
            return "planes late";
        case DelayedPart::Contact:
            return "contact flag late";
        case DelayedPart::Force:
            return "force late";
    }
    return "";
}

/// Colour of an amplitude (m), from green at kFaintest through yellow to dark red at kStrongest on a logarithmic scale.
std::string colour_of(double amplitude) {
    struct Stop {
        double at;
        std::array<double, 3> rgb;
    };
    constexpr std::array<Stop, 5> stops{{{0.0, {247, 251, 244}},
                                         {0.35, {159, 208, 168}},
                                         {0.55, {242, 193, 78}},
                                         {0.8, {209, 73, 91}},
                                         {1.0, {91, 26, 58}}}};
    const double share = std::log(std::max(amplitude, kFaintest) / kFaintest) / std::log(kStrongest / kFaintest);
    std::size_t i = 1;
    while (i + 1 < stops.size() && share > stops[i].at) {
        ++i;
    }
    // Linear interpolation between the two stops around the value.
    const double t = std::clamp((share - stops[i - 1].at) / (stops[i].at - stops[i - 1].at), 0.0, 1.0);
    std::array<int, 3> rgb{};
    for (std::size_t c = 0; c < rgb.size(); ++c) {
        rgb[c] = static_cast<int>(std::lround(std::lerp(stops[i - 1].rgb[c], stops[i].rgb[c], t)));
    }
    std::array<char, 16> text{};
    std::snprintf(text.data(), text.size(), "#%02x%02x%02x", rgb[0] & 0xff, rgb[1] & 0xff, rgb[2] & 0xff);
    return text.data();
}

/// One map: stiffness against delay, a cell for each trial, and the passivity limit as a line.
std::string map_of(const std::vector<Cell>& cells, DelayedPart late, bool controlled, const StabilityOptions& options,
                   const TickSettings& tick) {
    // Half the distance between neighbouring cells: a ratio of stiffnesses, a difference of delays.
    const double half_ratio = std::pow(kStiffest / kSoftest, 0.5 / (options.rows - 1.0));
    const double half_step_ms = 500.0 * kLongestS / (options.columns - 1.0);
    SvgPlot plot({-half_step_ms, kLongestS * 1e3 + half_step_ms}, {kSoftest / half_ratio, kStiffest * half_ratio},
                 "delay, ms", "stiffness, N/m", true);
    for (const Cell& cell : cells) {
        if (cell.late != late || cell.controlled != controlled) {
            continue;
        }
        // Cells keep their equal widths although the delays are rounded to whole ticks.
        const double delay_ms = 2.0 * half_step_ms * cell.column;
        plot.cell({delay_ms - half_step_ms, delay_ms + half_step_ms},
                  {cell.stiffness / half_ratio, cell.stiffness * half_ratio}, colour_of(cell.outcome.last_amplitude));
        if (cell.outcome.grows) {
            plot.cross(delay_ms, cell.stiffness);
        }
    }
    // A sampled spring with delay is passive up to K = 2 b / (T + 2 delay); only a late force feels the delay.
    std::vector<std::pair<double, double>> limit;
    constexpr int points = 100;
    for (int i = 0; i <= points; ++i) {
        const double delay_s = kLongestS * i / points;
        const double felt_s = late == DelayedPart::Force ? delay_s : 0.0;
        limit.emplace_back(delay_s * 1e3,
                           passive_stiffness(tick.passivity.damping, 0.0, 0.0, seconds(tick.period_ns), felt_s));
    }
    plot.line(limit, "first");
    const std::string title = title_of(late) + (controlled ? ", controlled" : ", not controlled");
    return "<figure>" + plot.svg(title) + "<figcaption>" + title + "</figcaption></figure>\n";
}

void write_page(const std::filesystem::path& file, const std::vector<Cell>& cells, const StabilityOptions& options,
                const TickSettings& tick) {
    std::ostringstream page;
    page << page_top("Stability of a virtual wall")
         << "<p>A grip of 0.1 kg and 0.3 N s/m is pressed against a virtual wall. Colour: amplitude of the vibration "
            "in the last 0.4 s, lowest to highest:";
    for (const double amplitude_mm : {0.01, 0.1, 1.0, 5.0, 20.0}) {
        page << "<span class=\"swatch\" style=\"background:" << colour_of(amplitude_mm * kMillimetre) << "\"></span>"
             << amplitude_mm << " mm";
    }
    page << ". Cross: the vibration grows or is sustained. Line: the passivity limit 2 b / T, for a late force "
            "2 b / (T + 2 delay).</p>\n<div class=\"pictures\">\n";
    for (const bool controlled : {false, true}) {
        for (const DelayedPart late : kDelayedParts) {
            page << map_of(cells, late, controlled, options, tick);
        }
    }
    page << "</div>\n</body></html>\n";
    write_text(file, page.str());
}

void print_summary(const std::vector<Cell>& cells) {
    std::printf("%-10s %-12s %8s %8s %14s %14s\n", "late", "controller", "trials", "growing", "min energy",
                "max amplitude");
    for (const DelayedPart late : kDelayedParts) {
        for (const bool controlled : {false, true}) {
            // Aggregate the trials of one map.
            int trials = 0;
            int growing = 0;
            double energy = 0.0;
            double largest = 0.0;
            for (const Cell& cell : cells) {
                if (cell.late == late && cell.controlled == controlled) {
                    ++trials;
                    growing += cell.outcome.grows ? 1 : 0;
                    energy = std::min(energy, cell.outcome.min_energy);
                    largest = std::max(largest, cell.outcome.last_amplitude);
                }
            }
            std::printf("%-10s %-12s %8d %8d %12.2e J %11.2f mm\n", std::string(name_of(late)).c_str(),
                        controlled ? "on" : "off", trials, growing, energy, largest / kMillimetre);
        }
    }
}

/// Runs the trial of one cell with the settings of this map.
StabilityOutcome run_cell(const Cell& cell, const StabilityOptions& options, const TickSettings& tick) {
    StabilityTrial trial;
    trial.late = cell.late;
    trial.stiffness = cell.stiffness;
    trial.delay_ns = cell.delay_ns;
    trial.duration_s = options.duration_s.value_or(trial.duration_s);
    trial.tick = tick;
    // The map shows the controller alone, so the stiffness limit is switched off.
    trial.tick.frames.max_stiffness = std::numeric_limits<double>::infinity();
    if (!cell.controlled) {
        trial.tick.passivity.control = PassivityControl::Observe;
    }
    trial.mechanics.hand_stiffness = options.hand_stiffness.value_or(trial.mechanics.hand_stiffness);
    trial.mechanics.hand_damping = options.hand_damping.value_or(trial.mechanics.hand_damping);
    return run_stability_trial(trial);
}

}  // namespace

int stability_command(const StabilityOptions& options) {
    if (!options.scene.empty()) {
        return scene_stability_command(options);
    }
    const Settings settings = settings_of(options);
    const Axes axes = axes_of(options, settings.tick.period_ns);
    std::filesystem::create_directories(options.out);
    // One trial per cell of the six maps.
    std::vector<Cell> cells;
    ProgressBar progress("measuring the maps");
    const double all = 2.0 * static_cast<double>(std::size(kDelayedParts)) * options.rows * options.columns;
    for (const DelayedPart late : kDelayedParts) {
        for (const bool controlled : {false, true}) {
            for (int row = 0; row < options.rows; ++row) {
                for (int column = 0; column < options.columns; ++column) {
                    Cell cell{.late = late,
                              .controlled = controlled,
                              .row = row,
                              .column = column,
                              .stiffness = axes.stiffnesses[static_cast<std::size_t>(row)],
                              .delay_ns = axes.delays_ns[static_cast<std::size_t>(column)],
                              .outcome = {}};
                    progress.show(static_cast<double>(cells.size()) / all);
                    cell.outcome = run_cell(cell, options, settings.tick);
                    cells.push_back(cell);
                }
            }
        }
    }
    // Write data, maps and summary.
    write_csv(options.out / "stability.csv", cells);
    write_page(options.out / "stability.html", cells, options, settings.tick);
    print_summary(cells);
    std::printf("written: %s and %s\n", (options.out / "stability.csv").c_str(),
                (options.out / "stability.html").c_str());
    const bool stable = std::none_of(cells.begin(), cells.end(),
                                     [](const Cell& cell) { return cell.controlled && cell.outcome.grows; });
    return stable ? 0 : kExitFaulted;
}

}  // namespace haptic::rt
