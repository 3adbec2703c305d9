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
#include "commands/run_files.hpp"
#include "commands/scene_stability.hpp"
#include "haptic/html.hpp"
#include "haptic/text_file.hpp"
#include "measure/plot_commands.hpp"
#include "measure/stability.hpp"
#include "process/settings.hpp"
#include "program/exit_status.hpp"
#include "program/progress_bar.hpp"
#include "rendering/passivity.hpp"

namespace haptic::rt {
namespace {

constexpr double kSoftest = 10.0;     // N/m
constexpr double kStiffest = 2000.0;  // N/m
constexpr double kLongestS = 0.02;    // s, delay
// Amplitudes at the ends of the scale of colours.
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

FileUses files_of_map(const StabilityOptions& options, const Config& config) {
    FileUses files;
    files.reads("--config ", options.config);
    add_device_files(files, config);
    files.reads("--scene ", options.scene);
    const std::vector<std::string> results = options.scene.empty()
                                                 ? std::vector<std::string>{"stability.csv", "stability.html"}
                                                 : result_names(options.scene);
    for (const std::string& name : results) {
        files.also_writes("--out " + options.out.string(), options.out / name);
    }
    return files;
}

Settings settings_of_map(const Config& config) {
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

/// One map: stiffness against delay, a cell for each trial, and the passivity limit as a line.
PlotCommands map_of(const std::vector<Cell>& cells, DelayedPart late, bool controlled, const StabilityOptions& options,
                    const TickSettings& tick) {
    // Half the distance between neighbouring cells: a ratio of stiffnesses, a difference of delays.
    const double half_ratio = std::pow(kStiffest / kSoftest, 0.5 / (options.rows - 1.0));
    const double half_step_ms = 500.0 * kLongestS / (options.columns - 1.0);
    std::string rectangles;
    // A point outside the axes, with which every map has the same key and size.
    std::string growing = plot_row(-1.0, kSoftest / kStiffest);
    for (const Cell& cell : cells) {
        if (cell.late != late || cell.controlled != controlled) {
            continue;
        }
        // Cells keep their equal widths although the delays are rounded to whole ticks.
        const double delay_ms = 2.0 * half_step_ms * cell.column;
        rectangles += plot_row(delay_ms, cell.stiffness, delay_ms - half_step_ms, delay_ms + half_step_ms,
                               cell.stiffness / half_ratio, cell.stiffness * half_ratio,
                               std::max(cell.outcome.last_amplitude, kFaintest) / kMillimetre);
        growing += cell.outcome.grows ? plot_row(delay_ms, cell.stiffness) : "";
    }
    // A sampled spring with delay is passive up to K = 2 b / (T + 2 delay); only a late force feels the delay.
    std::string limit;
    constexpr int points = 100;
    for (int i = 0; i <= points; ++i) {
        const double delay_s = kLongestS * i / points;
        const double felt_s = late == DelayedPart::Force ? delay_s : 0.0;
        limit += plot_row(delay_s * 1e3,
                          passive_stiffness(tick.passivity.damping, 0.0, 0.0, seconds(tick.period_ns), felt_s));
    }
    // The colours of amplitudes become steadily darker, so that they are in order for any colour vision.
    PlotCommands plot;
    plot.set(
        "eval half_width\nset xlabel 'delay, ms'\nset ylabel 'stiffness, N/m'\nset cblabel 'amplitude, mm'\nset "
        "rmargin 11");
    plot.set("set palette defined (0 '#f7fbf4', 0.35 '#9fd0a8', 0.55 '#f2c14e', 0.8 '#d1495b', 1 '#5b1a3a')");
    plot.set("set logscale cb\nset cbrange [" + plot_number(kFaintest / kMillimetre) + ":" +
             plot_number(kStrongest / kMillimetre) + "]\nset cbtics (0.01, 0.1, 1, 5, 20)\nset format cb '%g'");
    plot.set("set xrange [" + plot_number(-half_step_ms) + ":" + plot_number(kLongestS * 1e3 + half_step_ms) + "]");
    plot.log_axis("y", {kSoftest / half_ratio, kStiffest * half_ratio});
    plot.draw(rectangles, "using 1:2:3:4:5:6:7 with boxxyerror fillcolor palette", "");
    // White sets line and crosses off from cells of any colour.
    plot.draw(limit, "using 1:2 with lines linewidth 6 linecolor 'white'", "");
    plot.draw(limit, "using 1:2 with lines linewidth 3 linecolor 1", "passivity limit");
    plot.draw(growing, "using 1:2 with points pointtype 7 pointsize 1.2 linecolor 'white'", "");
    plot.draw(growing, "using 1:2 with points pointtype 2 pointsize 0.8 linecolor 'black'", "grows or is sustained");
    return plot;
}

void write_page(const std::filesystem::path& file, const std::vector<Cell>& cells, const StabilityOptions& options,
                const TickSettings& tick) {
    std::ostringstream page;
    page << page_top("Stability of a virtual wall")
         << "<p>A grip of 0.1 kg and 0.3 N s/m is pressed against a virtual wall. Colour: amplitude of the vibration "
            "in the last 0.4 s. Cross: the vibration grows or is sustained. Line: the passivity limit 2 b / T, for a "
            "late force 2 b / (T + 2 delay).</p>\n<div class=\"pictures\">\n";
    PageFigures figures("Where it is installed, the same command repeats the same trials.");
    for (const DelayedPart late : kDelayedParts) {
        for (const bool controlled : {false, true}) {
            page << figures.draw(map_of(cells, late, controlled, options, tick),
                                 title_of(late) + (controlled ? ", controlled" : ", not controlled"));
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
    const Config config = load_config(options.config, options.assignments);
    files_of_map(options, config).require_distinct();
    if (!options.scene.empty()) {
        return scene_stability_command(options);
    }
    const Settings settings = settings_of_map(config);
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
