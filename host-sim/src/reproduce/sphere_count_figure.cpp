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

/// Times of the steps without contact, or of those with contact, us.
struct ContactTimes {
    std::vector<double> whole;
    std::vector<double>
        tool;  // everything that grows with the spheres: detection, pop-out, equilibrium, planes, coupling

    void add(const StageTimes& t) {
        whole.push_back(static_cast<double>(t.total_ns) * 1e-3);
        tool.push_back(static_cast<double>(t.ccd_ns + t.popout_ns + t.proxy_ns + t.tool_ns) * 1e-3);
    }
};

struct Row {
    int spheres = 0;
    ContactTimes free;
    ContactTimes touching;
};

/// Least-squares line, and the share of the variance that it explains.
struct Line {
    double offset = 0.0;
    double slope = 0.0;
    double explained = 0.0;  // R^2
};

Line fit(const std::vector<double>& x, const std::vector<double>& y) {
    const auto count = static_cast<double>(x.size());
    // Means, then sums of squares about them.
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
    while (!run.finished()) {
        const StepResult& result = run.step();
        (result.in_contact ? row.touching : row.free).add(result.times);
    }
    return row;
}

std::string equation(const Line& line) {
    return format_fixed(line.offset, 0) + " us + " + format_fixed(line.slope, 2) + " us per sphere (R^2 " +
           format_fixed(line.explained, 3) + ")";
}

}  // namespace

Figure sphere_counts(const Study& study) {
    Figure figure;
    figure.number = "5.6";
    figure.title = "time of a step against the number of spheres";
    figure.conditions =
        "Scene curtain-hand with the thesis' solver and 1 to 50 spheres. Medians over the steps without contact and "
        "over those with "
        "contact (marked * in the thesis), of the whole step and of the tool's part: detection including the "
        "refit of the curtain's tree, pop-out, the tool's equilibrium with the moves of its proxies, the speculative "
        "planes for the hand, and the contact coupling. One core; the independent check is not included in the times.";
    // Medians for each number of spheres.
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
    study.plot(figure, "figure-5.6-times", "Median time of a step, microseconds.",
               "set xlabel 'spheres'\nset ylabel 'us'\nset yrange [0:*]\n"
               "plot 'figure-5.6.csv' using 1:3 skip 1 with linespoints pt 7 ps 0.6 lc 4 title 'step, in "
               "contact', '' using 1:2 skip 1 with linespoints pt 7 ps 0.6 lc 1 title 'step, free', '' using "
               "1:5 skip 1 with linespoints pt 7 ps 0.6 lc 2 title 'tool, in contact', '' using 1:4 skip 1 "
               "with linespoints pt 7 ps 0.6 lc 7 title 'tool, free'\n");
    // Linear fit of the tool's part over the number of spheres.
    const Line in_contact = fit(counts, touching);
    figure.comparisons = {
        {"the tool's part, in contact", "grows with the number (figure)", equation(in_contact)},
        {"the tool's part, free", "grows with the number (figure)", equation(fit(counts, free))},
        {"per sphere, in total", "some 400 us (15 ms for 37)", format_fixed(in_contact.slope, 2) + " us"},
    };
    figure.remarks =
        "The position of a sphere matters as much as its presence: with few spheres the hand touches the curtain "
        "in fewer places than it has fingers.";
    return figure;
}

}  // namespace haptic::sim::reproduce
