#include "reproduce/growth_figure.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <span>
#include <string>
#include <utility>

#include "haptic/csv.hpp"
#include "haptic/sim/progress.hpp"
#include "program/progress_bar.hpp"
#include "reproduce/scene_growth.hpp"
#include "reproduce/scene_run.hpp"

namespace haptic::sim::reproduce {
namespace {

constexpr std::size_t kCompared = 2;  // the largest sizes
constexpr const char* kParticleAxis =
    "eval log_axis('x', 400, 1.5e5)\nset xtics ('1,000' 1e3, '10,000' 1e4, '100,000' 1e5)\n";

/// A scene in several sizes. Another number of threads would be another series of the same sizes.
struct GrowthSeries {
    std::string name;   // of its files
    std::string title;  // "heaps of fish"
    std::size_t sizes = 0;
    std::function<GrowthCase(std::size_t)> size;  // 0 to `sizes` - 1, ascending
};

std::vector<SceneCost> measure(const GrowthSeries& series, Simulation::ClockFunction clock) {
    std::vector<GrowthCase> cases;
    cases.reserve(series.sizes);
    for (std::size_t k = 0; k < series.sizes; ++k) {
        cases.push_back(series.size(k));
    }
    // Those that fit into caches one by one, as users run them. The two largest, which are compared, side by side.
    std::vector<std::span<const GrowthCase>> groups;
    const std::span<const GrowthCase> all(cases);
    const std::size_t alone = all.size() > kCompared ? all.size() - kCompared : 0;
    groups.reserve(alone + 1);
    for (std::size_t k = 0; k < alone; ++k) {
        groups.push_back(all.subspan(k, 1));
    }
    groups.push_back(all.subspan(alone));
    // The bar advances by estimated work: copies times vertices of a copy times steps.
    const auto work_of = [](std::span<const GrowthCase> sizes) {
        double work = 0.0;
        for (const GrowthCase& c : sizes) {
            work += static_cast<double>(c.steps * expected_triangles(c.scene.model));
        }
        return work;
    };
    const double work = work_of(all);
    ProgressBar bar("measuring " + series.title);
    const Progress whole = [&bar](double share) { bar.show(share); };
    std::vector<SceneCost> costs;
    double done = 0.0;
    for (const std::span<const GrowthCase> group : groups) {
        const double begin = done / work;
        done += work_of(group);
        const std::vector<SceneCost> measured = measure_growth(group, clock, part_of(whole, begin, done / work));
        costs.insert(costs.end(), measured.begin(), measured.end());
    }
    return costs;
}

void write_costs(const Study& study, Figure& figure, const std::string& name, std::span<const SceneCost> costs) {
    std::vector<std::string> columns{"bodies",  "particles", "vertices",   "triangles",    "build_s",
                                     "held_mb", "peak_mb",   "free_steps", "contact_steps"};
    for (const char* when : {"_free_us", "_contact_us"}) {
        for (const GrowthStage& stage : kGrowthStages) {
            columns.push_back(stage.name + std::string(when));
        }
    }
    CsvWriter csv(study.data(figure, name), columns);
    for (const SceneCost& cost : costs) {
        std::vector<double> row;
        for (const std::size_t count : {cost.bodies, cost.particles, cost.vertices, cost.triangles}) {
            row.push_back(static_cast<double>(count));
        }
        row.insert(row.end(), {cost.build_s, cost.held_mb, cost.peak_mb});
        row.insert(row.end(), {static_cast<double>(cost.free_steps), static_cast<double>(cost.contact_steps)});
        row.insert(row.end(), cost.free_us.begin(), cost.free_us.end());
        row.insert(row.end(), cost.contact_us.begin(), cost.contact_us.end());
        csv.row(row);
    }
    csv.close();
}

/// Exponent of each stage since the size before, and its time over n log n relative to the smallest size.
void write_growth(const Study& study, Figure& figure, const std::string& name, std::span<const SceneCost> costs) {
    std::vector<std::string> columns{"particles"};
    for (const char* what : {"_free_exponent", "_contact_exponent", "_free_per_n_log_n", "_contact_per_n_log_n"}) {
        for (const GrowthStage& stage : kGrowthStages) {
            columns.push_back(stage.name + std::string(what));
        }
    }
    CsvWriter csv(study.data(figure, name), columns);
    for (std::size_t k = 1; k < costs.size(); ++k) {
        const SceneCost& first = costs.front();
        const SceneCost& before = costs[k - 1];
        const SceneCost& cost = costs[k];
        std::vector<double> row{static_cast<double>(cost.particles)};
        for (StageMedians SceneCost::* const when : {&SceneCost::free_us, &SceneCost::contact_us}) {
            for (std::size_t s = 0; s < kGrowthStages.size(); ++s) {
                row.push_back(growth_exponent((before.*when)[s], (cost.*when)[s], before.particles, cost.particles));
            }
        }
        for (StageMedians SceneCost::* const when : {&SceneCost::free_us, &SceneCost::contact_us}) {
            for (std::size_t s = 0; s < kGrowthStages.size(); ++s) {
                row.push_back(relative_to_n_log_n((cost.*when)[s], cost.particles, (first.*when)[s], first.particles));
            }
        }
        csv.row(row);
    }
    csv.close();
}

/// n log n through the point (n, y), as a function of x for gnuplot.
std::string n_log_n_through(std::size_t n, double y) {
    const auto size = static_cast<double>(n);
    return format_fixed(y / (size * std::log(size)), 12) + " * x * log(x)";
}

/// Times and their growth as data, and the times as a plot.
void show_times(const Study& study, Figure& figure, const GrowthSeries& series, std::span<const SceneCost> costs) {
    const std::string name = "scaling-" + series.name;
    write_costs(study, figure, name, costs);
    write_growth(study, figure, name + "-growth", costs);
    // 1,000 us are 1 ms.
    const auto curve = [](const std::string& column, const std::string& style, const std::string& title) {
        return "'' using 'particles':(1e-3 * column('" + column + "')) with linespoints " + style + " title '" + title +
               "'";
    };
    const SceneCost& first = costs.front();
    study.plot(figure, name,
               "Time of a step with " + series.title + ", in contact unless noted; both axes logarithmic.",
               "set xlabel 'particles'\nset ylabel 'ms'\nset key outside right center vertical\nset rmargin 28\nset "
               "logscale y\n"
               "set format y '%g'\n" +
                   std::string(kParticleAxis) + "plot '" + name +
                   ".csv' using 'particles':(1e-3 * column('total_contact_us')) with linespoints pt 7 "
                   "lw 2.5 lc 1 title 'whole step', " +
                   curve("total_free_us", "pt 6 dt 2 lc 1", "whole step, hand free") + ", " +
                   curve("collide_contact_us", "pt 5 lc 2", "collisions") + ", " +
                   curve("deform_contact_us", "pt 9 lc 3", "deformation") + ", " +
                   curve("skin_contact_us", "pt 11 lc 4", "skinning") + ", " +
                   curve("ccd_contact_us", "pt 13 lc 6", "refit and CCD") + ", " +
                   curve("proxy_contact_us", "pt 15 lc 7", "coupling") + ", " +
                   n_log_n_through(first.particles, 1e-3 * first.contact_us[0]) +
                   " with lines dt 3 lw 1.5 lc 5 title 'n log n'\n");
}

/// "500 / 60,000 us" and the like, of the smallest and the largest size.
std::string both(double smallest, double largest, int digits, const std::string& unit) {
    return format_fixed(smallest, digits) + " / " + format_fixed(largest, digits) + " " + unit;
}

void compare(Figure& figure, const GrowthSeries& series, std::span<const SceneCost> costs) {
    const SceneCost& smallest = costs.front();
    const SceneCost& largest = costs.back();
    figure.comparisons.push_back({series.title + ", " + with_separators(smallest.particles) + " / " +
                                      with_separators(largest.particles) + " particles: whole step, free",
                                  "-", both(1e-3 * smallest.free_us[0], 1e-3 * largest.free_us[0], 2, "ms")});
    figure.comparisons.push_back(
        {"the same, in contact", "-", both(1e-3 * smallest.contact_us[0], 1e-3 * largest.contact_us[0], 2, "ms")});
    figure.comparisons.push_back(
        {"building / memory of the largest", "-",
         format_fixed(largest.build_s, 2) + " s / " + format_fixed(largest.held_mb, 0) + " MB"});
    // The verdict, and each exponent that exceeds its limit.
    const std::vector<Growth> growths = growths_of(costs);
    std::string faster;
    for (const Growth& growth : growths) {
        if (growth.is_faster()) {
            faster += (faster.empty() ? "" : "; ") + growth.what + " (n^" + format_fixed(growth.exponent, 2) +
                      ", n log n with its tolerance: n^" + format_fixed(growth.limit, 2) + ")";
        }
    }
    figure.comparisons.push_back(
        {series.title + ": grows faster than n log n", "-", faster.empty() ? "nothing" : faster});
}

void plot_building(const Study& study, Figure& figure) {
    const auto plot = [&](const std::string& name, const std::string& caption, const std::string& unit,
                          const std::string& column) {
        study.plot(figure, name, caption,
                   "eval half_width\nset xlabel 'particles'\nset ylabel '" + unit +
                       "'\nset logscale y\nset format y '%g'\n" + std::string(kParticleAxis) +
                       "plot 'scaling-heaps.csv' using 'particles':'" + column +
                       "' with linespoints pt 7 lw 2 lc 1 title 'heaps', 'scaling-cloth.csv' using 'particles':'" +
                       column + "' with linespoints pt 5 lw 2 lc 2 title 'cloth'\n");
    };
    plot("scaling-memory", "Resident memory of a simulation; both axes logarithmic.", "MB", "held_mb");
    plot("scaling-building", "Time to build a simulation; both axes logarithmic.", "s", "build_s");
}

}  // namespace

void add_scene_growth(const Study& study, Figure& figure, const GrowthSizes& sizes) {
    const GrowthSeries heaps{"heaps", "heaps of four fish", sizes.heaps.size(),
                             [&sizes](std::size_t k) { return fish_heaps(sizes.heaps[k]); }};
    const GrowthSeries cloths{"cloth", "a falling cloth", sizes.cloths.size(),
                              [&sizes](std::size_t k) { return falling_cloth(sizes.cloths[k]); }};
    for (const GrowthSeries& series : {heaps, cloths}) {
        const std::vector<SceneCost> costs = measure(series, study.clock());
        show_times(study, figure, series, costs);
        compare(figure, series, costs);
    }
    plot_building(study, figure);
}

}  // namespace haptic::sim::reproduce
