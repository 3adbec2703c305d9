// Figure 4.7: share of contacts that Algorithm 1 misses.

#include <sstream>
#include <string>

#include "haptic/text_file.hpp"
#include "program/progress_bar.hpp"
#include "reproduce/ccd_misses.hpp"
#include "reproduce/scene_run.hpp"
#include "reproduce/study.hpp"

namespace haptic::sim::reproduce {

namespace {

std::string share(std::uint64_t part, std::uint64_t whole) {
    return format_fixed(whole > 0 ? 100.0 * static_cast<double>(part) / static_cast<double>(whole) : 0.0, 1) + " %";
}

}  // namespace

Figure missed_contacts(const Study& study) {
    Figure figure;
    figure.number = "4.7";
    figure.title = "contacts that the detection misses";
    figure.conditions =
        "Random motions of single triangles and of whole cloths (0.25 m, waves of up to 20 mm) that travel 4.7 "
        "radii per step, as the thesis' falling cloth does, past a fixed sphere that they do not touch at first. "
        "An oracle that shares no code with either method decides which of them touch. The thesis' method is "
        "Algorithm 1 plus overlap at the end of the step, which is left to the pop-out. The thesis shows the "
        "situations and gives no number.";
    const auto table = with_progress_bar("looking for contacts that are missed",
                                         [](const Progress& progress) { return measure_ccd_misses({}, progress); });
    std::ostringstream csv;
    write_ccd_misses(csv, table);
    write_text(study.data(figure, "figure-4.7"), csv.str());
    for (const CcdMisses& row : table) {
        figure.comparisons.push_back({row.set + ", " + row.motion + ": missed of " + std::to_string(row.contacts),
                                      share(row.thesis.missed, row.contacts),
                                      share(row.complete.missed, row.contacts)});
    }
    study.plot(figure, "figure-4.7-missed", "Share of contacts that are missed.",
               "set ylabel '% of contacts'\nset style data histograms\nset style histogram clustered gap 1\n"
               "set boxwidth 0.9\nset yrange [0:100]\nset xtics rotate by -20\n"
               "plot 'figure-4.7.csv' using 15:xtic(2) skip 1 lc 4 title 'Algorithm 1 alone', "
               "'' using 10 skip 1 lc 2 title 'with overlap at the end', "
               "'' using ($6 / $4 * 100) skip 1 lc ours title 'here'\n");
    figure.remarks =
        "The thesis' column is its method as we run it on the same motions. Algorithm 1 finds a contact only when "
        "a triangle's plane passes through the sphere's centre. A triangle that touches the sphere beside its "
        "centre and has left by the end of the step is missed: edges, corners and strips pass through the sphere. "
        "The contacts that it finds are a quarter to half a step late.";
    return figure;
}

}  // namespace haptic::sim::reproduce
