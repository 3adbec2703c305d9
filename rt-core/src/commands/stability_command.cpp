#include "commands/stability_command.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <limits>
#include <stdexcept>
#include <string_view>

#include "rendering/passivity.hpp"
#include "process/settings.hpp"
#include "measure/stability.hpp"
#include "commands/run_command.hpp"

namespace haptic::rt {
namespace {

constexpr double kSoftest = 10.0;  // N/m
constexpr double kStiffest = 2000.0;
constexpr double kLongestS = 0.02;  // delay
constexpr double kMillimetre = 1e-3;

struct Cell {
    LateAnswer late = LateAnswer::Planes;
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
        throw std::invalid_argument("stability: a map has two rows and two columns at least");
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
    Config config = options.config ? Config::load(*options.config) : Config();
    for (const std::string& assignment : options.assignments) {
        config.set(assignment);
    }
    Settings settings = read_settings(config);
    if (settings.tick.passivity.control == PassivityControl::Observe) {
        config.fail("passivity.control", "must be bound or damp: the map without a controller is drawn anyway");
    }
    return settings;
}

std::ofstream opened(const std::filesystem::path& file) {
    std::ofstream stream(file);
    if (!stream) {
        throw std::runtime_error(file.string() + ": cannot be written");
    }
    return stream;
}

void write_csv(const std::filesystem::path& file, const std::vector<Cell>& cells) {
    std::ofstream csv = opened(file);
    csv << "answer,controlled,stiffness_n_m,delay_ms,first_mm,last_mm,energy_min_j,peak_force_n,controlled_share,"
           "faults,"
           "grows,row,column\n";
    for (const Cell& cell : cells) {
        const StabilityOutcome& outcome = cell.outcome;
        csv << name_of(cell.late) << ',' << (cell.controlled ? 1 : 0) << ',' << cell.stiffness << ','
            << seconds(cell.delay_ns) * 1e3 << ',' << outcome.first_amplitude / kMillimetre << ','
            << outcome.last_amplitude / kMillimetre << ',' << outcome.least_energy << ',' << outcome.peak_force << ','
            << outcome.controlled << ',' << outcome.faults << ',' << (outcome.grows ? 1 : 0) << ',' << cell.row << ','
            << cell.column << '\n';
    }
    csv.close();
    if (!csv) {
        throw std::runtime_error(file.string() + ": cannot be written");
    }
}

std::string title_of(LateAnswer late) {
    switch (late) {
        case LateAnswer::Planes:
            return "planes late";
        case LateAnswer::Contact:
            return "contact flag late";
        case LateAnswer::Force:
            return "force late";
    }
    return "";
}

/// Rows and columns are drawn as such; the axes are labelled with what they stand for.
void write_gnuplot(const std::filesystem::path& file, const Axes& axes, const TickSettings& tick) {
    std::ofstream gp = opened(file);
    const int rows = static_cast<int>(axes.stiffnesses.size());
    const int columns = static_cast<int>(axes.delays_ns.size());
    gp << "# gnuplot stability.gp, in the folder of stability.csv\n"
          "set terminal pngcairo size 1280,860 font 'sans,11'\n"
          "set output 'stability.png'\n"
          "set datafile separator ','\n"
          "set multiplot layout 2,3 margins 0.07,0.88,0.10,0.90 spacing 0.02,0.11 "
          "title \"A grip of 0.1 kg and 0.3 N s/m is pressed on a virtual wall: how far it still vibrates at the end\\n"
          "cross: the vibration grows or is kept up; dashed: passive below 2 b / T, for a late force 2 b / (T + 2 "
          "delay)\"\n"
          "set palette defined (0 '#f7fbf4', 0.35 '#9fd0a8', 0.55 '#f2c14e', 0.8 '#d1495b', 1 '#5b1a3a')\n"
          "set logscale cb\n"
          "set cbrange [0.01:20]\n"
          "set tics out nomirror\n"
          "set xtics offset 0,0.4\n"
          "unset key\n";
    gp << "set xrange [-0.5:" << columns - 0.5 << "]\nset yrange [-0.5:" << rows - 0.5 << "]\n";
    gp << "set xtics (";
    for (int i = 0; i < columns; i += columns > 12 ? 2 : 1) {
        gp << (i > 0 ? "," : "") << "'" << seconds(axes.delays_ns[static_cast<std::size_t>(i)]) * 1e3 << "' " << i;
    }
    gp << ")\n";
    // Where the sampled and late spring stops being passive: 2 b / (T + 2 delay), in rows and columns.
    const double step_s = kLongestS / (columns - 1.0);
    gp << "row(k) = " << rows - 1 << " * log(k / " << kSoftest << ") / log(" << kStiffest / kSoftest << ")\n";
    gp << "late(x) = row(2 * " << tick.passivity.damping << " / (" << seconds(tick.period_ns) << " + 2 * x * " << step_s
       << "))\n";
    gp << "prompt(x) = row(2 * " << tick.passivity.damping << " / " << seconds(tick.period_ns) << ")\n";
    for (const bool controlled : {false, true}) {
        for (const LateAnswer late : kLateAnswers) {
            const bool left = late == LateAnswer::Planes;
            gp << "set title '" << title_of(late) << (controlled ? ", controlled" : ", not controlled") << "'\n";
            gp << (controlled ? "set xlabel 'delay (ms)'\n" : "unset xlabel\n");
            gp << (left ? "set ylabel 'stiffness (N/m)'\n" : "unset ylabel\n");
            gp << "set ytics (";
            for (int i = 0; i < rows; ++i) {
                std::array<char, 32> label{};
                std::snprintf(label.data(), label.size(), "%.0f", axes.stiffnesses[static_cast<std::size_t>(i)]);
                gp << (i > 0 ? "," : "") << "'" << (left ? label.data() : "") << "' " << i;
            }
            gp << ")\n";
            if (late == LateAnswer::Force) {
                gp << "set colorbox user origin 0.90,0.10 size 0.018,0.80\nset cblabel 'last 0.4 s, lowest to highest "
                      "(mm)'\n";
            } else {
                gp << "unset colorbox\n";
            }
            const auto chosen = [&](const std::string& value) {
                return "(strcol(1) eq '" + std::string(name_of(late)) + "' && $2 == " + (controlled ? "1" : "0") +
                       " ? " + value + " : NaN)";
            };
            gp << "plot 'stability.csv' skip 1 using " << chosen("$13")
               << ":12:(0.5):(0.5):($6 < 0.01 ? 0.01 : $6) with boxxyerror fillstyle solid noborder fillcolor palette "
                  ", \\\n"
               << "     '' skip 1 using 13:" << chosen("($11 == 1 ? $12 : NaN)")
               << " with points pt 2 ps 0.9 lc rgb 'black', \\\n"
               << "     " << (late == LateAnswer::Force ? "late(x)" : "prompt(x)")
               << " with lines lw 2 dt 2 lc rgb '#22577a'\n";
        }
    }
    gp << "unset multiplot\n";
}

void print_summary(const std::vector<Cell>& cells) {
    std::printf("%-10s %-12s %8s %8s %14s %12s\n", "late", "controller", "trials", "growing", "least energy",
                "largest end");
    for (const LateAnswer late : kLateAnswers) {
        for (const bool controlled : {false, true}) {
            int trials = 0;
            int growing = 0;
            double energy = 0.0;
            double largest = 0.0;
            for (const Cell& cell : cells) {
                if (cell.late == late && cell.controlled == controlled) {
                    ++trials;
                    growing += cell.outcome.grows ? 1 : 0;
                    energy = std::min(energy, cell.outcome.least_energy);
                    largest = std::max(largest, cell.outcome.last_amplitude);
                }
            }
            std::printf("%-10s %-12s %8d %8d %12.2e J %9.2f mm\n", std::string(name_of(late)).c_str(),
                        controlled ? "on" : "off", trials, growing, energy, largest / kMillimetre);
        }
    }
}

}  // namespace

int stability_command(const StabilityOptions& options) {
    const Settings settings = settings_of(options);
    const Axes axes = axes_of(options, settings.tick.period_ns);
    std::filesystem::create_directories(options.out);
    std::vector<Cell> cells;
    for (const LateAnswer late : kLateAnswers) {
        for (const bool controlled : {false, true}) {
            for (int row = 0; row < options.rows; ++row) {
                for (int column = 0; column < options.columns; ++column) {
                    Cell cell;
                    cell.late = late;
                    cell.controlled = controlled;
                    cell.row = row;
                    cell.column = column;
                    cell.stiffness = axes.stiffnesses[static_cast<std::size_t>(row)];
                    cell.delay_ns = axes.delays_ns[static_cast<std::size_t>(column)];
                    StabilityTrial trial;
                    trial.late = late;
                    trial.stiffness = cell.stiffness;
                    trial.delay_ns = cell.delay_ns;
                    trial.duration_s = options.duration_s;
                    trial.tick = settings.tick;
                    trial.tick.frames.largest_stiffness = std::numeric_limits<double>::infinity();
                    if (!controlled) {
                        trial.tick.passivity.control = PassivityControl::Observe;
                    }
                    trial.mechanics.hand_stiffness = options.hand_stiffness;
                    trial.mechanics.hand_damping = options.hand_damping;
                    cell.outcome = try_contact(trial);
                    cells.push_back(cell);
                }
            }
        }
    }
    write_csv(options.out / "stability.csv", cells);
    write_gnuplot(options.out / "stability.gp", axes, settings.tick);
    print_summary(cells);
    std::printf("written: %s; (cd %s && gnuplot stability.gp) draws stability.png\n",
                (options.out / "stability.csv").c_str(), options.out.c_str());
    const bool held = std::none_of(cells.begin(), cells.end(),
                                   [](const Cell& cell) { return cell.controlled && cell.outcome.grows; });
    return held ? 0 : kExitFaulted;
}

}  // namespace haptic::rt
