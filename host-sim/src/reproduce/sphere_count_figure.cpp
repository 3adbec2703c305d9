// Figure 5.6: the time of a step against the number of spheres of the tool.

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "haptic/csv.hpp"
#include "reproduce/scene_run.hpp"
#include "reproduce/study.hpp"

namespace haptic::sim::reproduce {
namespace {

constexpr std::array kCounts{1, 2, 3, 5, 8, 12, 16, 20, 25, 30, 35, 40, 45, 50};

/// Of the steps in which the tool touches nothing, or of those in which it does, us.
struct Times {
    std::vector<double> whole;
    std::vector<double> tool;  // all that grows with the spheres: detection, pop-out, virtual proxies, constraints

    void add(const StageTimes& t) {
        whole.push_back(static_cast<double>(t.total_ns) * 1e-3);
        tool.push_back(static_cast<double>(t.ccd_ns + t.popout_ns + t.proxy_ns + t.tool_ns) * 1e-3);
    }
};

struct Row {
    int spheres = 0;
    Times free;
    Times touching;
};

/// Straight line through points by least squares, and how much of their variance it explains.
struct Line {
    double offset = 0.0;
    double slope = 0.0;
    double explained = 0.0;  // R^2
};

Line fit(const std::vector<double>& x, const std::vector<double>& y) {
    const auto count = static_cast<double>(x.size());
    double mean_x = 0.0;
    double mean_y = 0.0;
    for (std::size_t k = 0; k < x.size(); ++k) {
        mean_x += x[k] / count;
        mean_y += y[k] / count;
    }
    double xx = 0.0;
    double xy = 0.0;
    double yy = 0.0;
    for (std::size_t k = 0; k < x.size(); ++k) {
        xx += (x[k] - mean_x) * (x[k] - mean_x);
        xy += (x[k] - mean_x) * (y[k] - mean_y);
        yy += (y[k] - mean_y) * (y[k] - mean_y);
    }
    return {mean_y - xy / xx * mean_x, xy / xx, yy > 0.0 ? xy * xy / (xx * yy) : 1.0};
}

Row run_with(int spheres, std::int64_t (*clock)()) {
    Row row;
    row.spheres = spheres;
    SceneRun run("curtain-hand", {"tool.spheres=" + std::to_string(spheres)}, clock);
    while (!run.over()) {
        const StepResult& result = run.step();
        (result.in_contact ? row.touching : row.free).add(result.times);
    }
    return row;
}

std::string equation(const Line& line) {
    return shown(line.offset, 0) + " us + " + shown(line.slope, 2) + " us a sphere (R^2 " + shown(line.explained, 3) +
           ")";
}

}  // namespace

Figure sphere_counts(const Study& study) {
    Figure figure;
    figure.number = "5.6";
    figure.title = "time of a step against the number of spheres";
    figure.conditions =
        "Scene curtain-hand with 1 to 50 spheres. Medians over the steps in which the tool touches nothing, and over "
        "those "
        "in which it does (marked with * in the thesis), of the whole step and of all that the tool takes in it: "
        "detection with the refit of the curtain's tree, pop-out, both runs of the virtual proxy, the planes for the "
        "hand, the contact force, the tool's constraints. One core; the independent check is not in the times.";
    std::vector<double> counts;
    std::vector<double> free;
    std::vector<double> touching;
    CsvWriter csv(study.data(figure, "figure-5.6"),
                  {"spheres", "step_free_us", "step_in_contact_us", "tool_free_us", "tool_in_contact_us"});
    for (const int spheres : kCounts) {
        const Row row = run_with(spheres, study.clock());
        csv.row(std::array{static_cast<double>(spheres), quantile(row.free.whole, 0.5),
                           quantile(row.touching.whole, 0.5), quantile(row.free.tool, 0.5),
                           quantile(row.touching.tool, 0.5)});
        counts.push_back(spheres);
        free.push_back(quantile(row.free.tool, 0.5));
        touching.push_back(quantile(row.touching.tool, 0.5));
    }
    csv.close();
    study.plot(
        figure, "figure-5.6-times", "Median time of a step, microseconds.",
        "set xlabel 'spheres'\nset ylabel 'us'\nset yrange [0:*]\n"
        "plot 'figure-5.6.csv' using 1:3 skip 1 with linespoints pt 7 ps 0.6 lc rgb '#c8553d' title 'step, in "
        "contact', '' using 1:2 skip 1 with linespoints pt 7 ps 0.6 lc rgb '#b3710f' title 'step, free', '' using "
        "1:5 skip 1 with linespoints pt 7 ps 0.6 lc rgb '#2a6f97' title 'tool, in contact', '' using 1:4 skip 1 "
        "with linespoints pt 7 ps 0.6 lc rgb '#8ab6cf' title 'tool, free'\n");
    const Line in_contact = fit(counts, touching);
    figure.comparisons = {
        {"the tool's part, in contact", "grows with the number (figure)", equation(in_contact)},
        {"the tool's part, free", "grows with the number (figure)", equation(fit(counts, free))},
        {"a sphere, all in all", "some 400 us (15 ms for 37)", shown(in_contact.slope, 2) + " us"},
    };
    figure.remarks =
        "Where a sphere is counts as much as that it is there: with few spheres the hand touches the curtain in fewer "
        "places than it has fingers.";
    return figure;
}

}  // namespace haptic::sim::reproduce
