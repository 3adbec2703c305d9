// Figure 4.14: how many iterations the pop-out takes in a narrow funnel.

#include <algorithm>
#include <array>
#include <string>
#include <vector>

#include "haptic/csv.hpp"
#include "reproduce/scene_run.hpp"
#include "reproduce/study.hpp"

namespace haptic::sim::reproduce {
namespace {

// The parts of the scene's script: the hand is so deep while it crosses.
struct Crossing {
    double from_s;
    double to_s;
    const char* depth;
};
constexpr std::array<Crossing, 3> kCrossings{{{0.6, 1.93, "-1 m"}, {3.1, 4.43, "-2 m"}, {5.9, 7.23, "-3 m"}}};

struct Outcome {
    std::array<int, kCrossings.size()> most{};  // iterations of the pop-out
    std::array<int, kCrossings.size()> most_rides{};
    std::uint64_t escapes = 0;
    std::uint64_t in_contact = 0;
};

/// Runs the scene once and writes a row a step.
Outcome run_with(const Study& study, Figure& figure, const std::string& method,
                 const std::vector<std::string>& settings, bool pictures) {
    Outcome outcome;
    const std::string name = "figure-4.14-" + method;
    SceneRun run("popout-fan", settings, study.clock());
    CsvWriter csv(study.data(figure, name), {"time_s", "hip_x_m", "hip_y_m", "proxy_x_m", "proxy_y_m", "iterations",
                                             "rides", "in_contact", "squeezed"});
    std::array<bool, kCrossings.size()> shot{};
    while (!run.over()) {
        const StepResult& r = run.step();
        csv.row(std::array{run.time_s(), r.hip.x, r.hip.y, r.proxy.x, r.proxy.y,
                           static_cast<double>(r.pop_out_iterations), static_cast<double>(r.rides),
                           r.in_contact ? 1.0 : 0.0, r.squeezed ? 1.0 : 0.0});
        outcome.in_contact += r.in_contact ? 1 : 0;
        for (std::size_t k = 0; k < kCrossings.size(); ++k) {
            const Crossing& crossing = kCrossings[k];
            if (run.time_s() < crossing.from_s || run.time_s() > crossing.to_s) {
                continue;
            }
            outcome.most[k] = std::max(outcome.most[k], r.pop_out_iterations);
            outcome.most_rides[k] = std::max(outcome.most_rides[k], r.rides);
            if (pictures && !shot[k] && run.time_s() > crossing.from_s + 0.3 && r.hip.x > 0.3) {
                shot[k] = true;
                PictureScene picture = run.picture(std::string("the hand at ") + crossing.depth);
                picture.camera = {0.3, 0.28, 1.0};
                picture.objects[0].faceted = true;
                study.picture(figure, "figure-4.14-depth" + std::to_string(k + 1),
                              std::string("The hand crosses at ") + crossing.depth + ".", picture);
            }
        }
    }
    csv.close();
    outcome.escapes = run.escapes();
    return outcome;
}

std::string counts(const std::array<int, kCrossings.size()>& most) {
    return std::to_string(most[0]) + " / " + std::to_string(most[1]) + " / " + std::to_string(most[2]);
}

}  // namespace

Figure pop_out_iterations(const Study& study) {
    Figure figure;
    figure.number = "4.14";
    figure.title = "iterations of the pop-out";
    figure.conditions =
        "Scene popout-fan: 33 vertices, 32 faces, the rim fixed, the centre free; the hand crosses at 3 m/s, 1, 2 and "
        "3 m "
        "deep; proxy 0.03 m, smallest pop 0.002 radii. The thesis does not give the radius of the rim: here 1 m.";
    const Outcome ours = run_with(study, figure, "ours", {}, true);
    const Outcome thesis =
        run_with(study, figure, "thesis", {"contact.method=thesis", "contact.pop_out=thesis"}, false);
    study.plot(
        figure, "figure-4.14-iterations",
        "Moves of the proxy a step: iterations of the thesis' Algorithm 2 after its Algorithm 1, and ours, rides "
        "with the surface and pop-outs together.",
        "set xlabel 'time, s'\nset ylabel 'iterations'\n"
        "plot 'figure-4.14-thesis.csv' using 'time_s':'iterations' with steps lc rgb '#c8553d' title 'thesis', "
        "'figure-4.14-ours.csv' using 'time_s':(column('iterations') + column('rides')) with steps lw 2 lc rgb "
        "'#2a6f97' title 'ours'\n");
    figure.comparisons = {
        {"most iterations of Algorithm 2 in a step, 1 / 2 / 3 m deep", "(figure only; more with depth)",
         counts(thesis.most)},
        {"ours: most rides with the surface, 1 / 2 / 3 m deep", "-", counts(ours.most_rides)},
        {"ours: most pop-outs after them", "-", counts(ours.most)},
        {"steps at which the proxy fell through (independent check), Algorithm 2", "0 with pop-out",
         std::to_string(thesis.escapes)},
        {"the same, ours", "-", std::to_string(ours.escapes)},
        {"steps in contact, Algorithm 2 / ours", "-",
         std::to_string(thesis.in_contact) + " / " + std::to_string(ours.in_contact)},
    };
    figure.remarks =
        "Ours leaves nothing to pop out of as a rule: the ride with the touched surface is swept against all others, "
        "and a "
        "place clear of everything that touches is found at once, for all triangles together. Where the thesis' method "
        "lets "
        "the proxy through, it is Algorithm 1 that does: with our detection before it (contact.method = \"complete\", "
        "contact.pop_out = \"thesis\") Algorithm 2 holds the proxy in this scene, too.";
    return figure;
}

}  // namespace haptic::sim::reproduce
