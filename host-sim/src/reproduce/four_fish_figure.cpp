// Figure 4.18: time of each stage of a step with four fish.

#include <array>
#include <string>
#include <vector>

#include "haptic/csv.hpp"
#include "reproduce/scene_run.hpp"
#include "reproduce/study.hpp"

namespace haptic::sim::reproduce {
namespace {

struct Stage {
    const char* name;
    const char* thesis;
    std::int64_t StageTimes::* time_ns;
};
constexpr std::array<Stage, 8> kStages{{
    {"whole step", "12,500 us free, 18,200 us in contact", &StageTimes::total_ns},
    {"particle collisions", "2,500 us", &StageTimes::collide_ns},
    {"deformation (shape matching)", "4,000 us", &StageTimes::deform_ns},
    {"skinning", "1,000 us", &StageTimes::skin_ns},
    {"collision detection of the proxy", "500 us", &StageTimes::ccd_ns},
    {"pop-out", "less than 300 us", &StageTimes::popout_ns},
    {"virtual proxy: equilibrium of the tool", "the largest part", &StageTimes::tool_ns},
    {"speculative planes and contact coupling", "-", &StageTimes::proxy_ns},
}};

using Samples = std::array<std::vector<double>, kStages.size()>;

}  // namespace

Figure four_fish(const Study& study) {
    Figure figure;
    figure.number = "4.18";
    figure.title = "four fish: time of each stage";
    figure.conditions =
        "Scene four-fish: 6,800 triangles, 548 particles, five iterations per step, ellipsoids that collide with "
        "one another and with the table. Medians over the steps without and with contact of the hand, on one "
        "core. The independent check of each step is not included in the times.";
    // Collect the time of each stage, with and without contact, and take one picture.
    SceneRun run("four-fish", {}, study.clock());
    Samples free;
    Samples touching;
    bool shot = false;
    while (!run.finished()) {
        const StepResult& result = run.step();
        for (std::size_t s = 0; s < kStages.size(); ++s) {
            (result.in_contact ? touching : free)[s].push_back(static_cast<double>(result.times.*kStages[s].time_ns) *
                                                               1e-3);
        }
        if (!shot && result.in_contact && run.time_s() > 2.5) {
            shot = true;
            PictureScene picture = run.picture("the hand among the fish");
            picture.camera = {0.35, 0.6, 1.0};
            study.picture(figure, "figure-4.18-heap", "The hand among the four fish.", picture);
        }
    }
    // Medians as data and as comparison.
    CsvWriter csv(study.data(figure, "figure-4.18"), {"stage", "free_us", "in_contact_us"});
    for (std::size_t s = 0; s < kStages.size(); ++s) {
        const double free_us = quantile(free[s], 0.5);
        const double touching_us = quantile(touching[s], 0.5);
        csv.row(std::array{static_cast<double>(s), free_us, touching_us});
        figure.comparisons.push_back(
            {kStages[s].name, kStages[s].thesis,
             format_fixed(free_us, 1) + " us free, " + format_fixed(touching_us, 1) + " us in contact"});
    }
    csv.close();
    const double touching_us = quantile(touching[0], 0.5);
    figure.comparisons.push_back(
        {"steps in contact, of all steps", "-",
         std::to_string(touching[0].size()) + " of " + std::to_string(touching[0].size() + free[0].size())});
    figure.comparisons.push_back(
        {"steps a second in contact", "55",
         touching_us > 0.0 ? format_fixed(1e6 / touching_us, 0) : std::string("never in contact")});
    figure.comparisons.push_back(
        {"steps at which something passed through (independent check)", "-", std::to_string(run.escapes())});
    study.plot(figure, "figure-4.18-stages", "Time of each stage, microseconds, medians.",
               "set ylabel 'us'\nset style data histograms\nset style histogram clustered gap 1\n"
               "set xtics ('all' 0, 'collisions' 1, 'deformation' 2, 'skinning' 3, 'CCD' 4, 'pop-out' 5, 'proxy' 6, "
               "'coupling' 7) rotate by -20\n"
               "plot 'figure-4.18.csv' using 2 skip 1 title 'free' lc 1, '' using 3 skip 1 title 'in contact' lc 4\n");
    figure.remarks =
        "The deformation is fast because eight constraints are processed at a time in vector registers, in the "
        "order of a graph colouring. The proxy tests only the triangles that a tree of moving boxes selects, so "
        "it is no longer the largest part.";
    return figure;
}

}  // namespace haptic::sim::reproduce
