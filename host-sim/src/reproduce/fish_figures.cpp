// Figures 4.16 and 4.17: a fish felt at 1 kHz, held by its tail and slid along.

#include <algorithm>
#include <array>
#include <glm/geometric.hpp>
#include <string>
#include <vector>

#include "haptic/csv.hpp"
#include "reproduce/scene_run.hpp"
#include "reproduce/study.hpp"

namespace haptic::sim::reproduce {
namespace {

struct Shot {
    double time_s;
    const char* name;
    const char* caption;
};

/// Runs a scene to its end, renders it at 1 kHz and takes pictures at the given times.
std::vector<HapticSample> feel(const Study& study, Figure& figure, SceneRun& run, std::span<const Shot> shots) {
    std::vector<HapticSample> samples;
    std::size_t next = 0;
    while (!run.over()) {
        run.step();
        run.render(samples);
        if (next < shots.size() && run.time_s() >= shots[next].time_s) {
            PictureScene picture = run.picture(shots[next].caption);
            picture.camera = {0.25, 0.45, 1.0};
            study.picture(figure, "figure-" + figure.number + "-" + shots[next].name, shots[next].caption, picture);
            ++next;
        }
    }
    return samples;
}

void write(const Study& study, Figure& figure, std::span<const HapticSample> samples) {
    CsvWriter csv(study.data(figure, "figure-" + figure.number),
                  {"time_s", "hip_x_m", "hip_y_m", "proxy_x_m", "proxy_y_m", "force_x_n", "force_y_n", "force_z_n"});
    for (const HapticSample& s : samples) {
        csv.row(std::array{s.time_s, s.hip.x, s.hip.y, s.proxy.x, s.proxy.y, s.force.x, s.force.y, s.force.z});
    }
    csv.close();
}

/// Of the samples between two times.
std::span<const HapticSample> between(std::span<const HapticSample> samples, double from_s, double to_s) {
    const auto before = [](const HapticSample& s, double time_s) { return s.time_s < time_s; };
    const auto first = std::lower_bound(samples.begin(), samples.end(), from_s, before);
    const auto last = std::lower_bound(first, samples.end(), to_s, before);
    return {first, last};
}

double largest_slew(std::span<const HapticSample> samples) {
    double largest = 0.0;
    for (std::size_t k = 1; k < samples.size(); ++k) {
        largest = std::max(largest, glm::length(samples[k].force - samples[k - 1].force));
    }
    return largest;  // N in a millisecond
}

/// Longest time without any force, ms.
int longest_gap(std::span<const HapticSample> samples) {
    int longest = 0;
    int gap = 0;
    for (const HapticSample& s : samples) {
        gap = s.force.y > 0.0 ? 0 : gap + 1;
        longest = std::max(longest, gap);
    }
    return longest;
}

/// Maxima of the force that stand out from the minima beside them by at least `prominence`, N.
int peaks(std::span<const HapticSample> samples, double prominence) {
    int count = 0;
    double low = samples.empty() ? 0.0 : samples.front().force.y;
    double high = low;
    bool rising = true;
    for (const HapticSample& s : samples) {
        const double f = s.force.y;
        if (rising) {
            high = std::max(high, f);
            if (high - f >= prominence && high - low >= prominence) {
                ++count;
                rising = false;
                low = f;
            } else if (f < low) {
                low = high = f;
            }
        } else {
            low = std::min(low, f);
            if (f - low >= prominence) {
                rising = true;
                high = f;
            }
        }
    }
    return count;
}

double most(std::span<const HapticSample> samples) {
    double most_n = 0.0;
    for (const HapticSample& s : samples) {
        most_n = std::max(most_n, s.force.y);
    }
    return most_n;
}

}  // namespace

Figure fish_hold(const Study& study) {
    Figure figure;
    figure.number = "4.16";
    figure.title = "holding the tail of a living fish";
    figure.conditions =
        "Scene fish-hold: 137 particles with eight neighbours, stiffness 0.9 for the head, 0.6 for belly and tail, the "
        "belly "
        "stuck to the table, neck and upper tail moved up and down twice and again; coupling 10 N/m without damping. "
        "The "
        "fish is ours (852 vertices, 1,700 triangles; the thesis' 1,047 vertices are split at seams). Force and "
        "positions at "
        "1 kHz, from the planes of a simulation at 100 steps/s.";
    SceneRun run("fish-hold", {}, study.clock());
    const std::array<Shot, 4> shots{{{1.3, "1", "The hand comes down on the tail."},
                                     {2.9, "2", "The tail is pressed onto the table, at rest."},
                                     {3.7, "3", "The fish lifts its tail against the hand."},
                                     {3.8, "4", "Between two shakes."}}};
    const std::vector<HapticSample> samples = feel(study, figure, run, shots);
    write(study, figure, samples);
    study.plot(figure, "figure-4.16-force", "Vertical force on the hand, in the scene, at 1 kHz.",
               "set xlabel 'time, s'\nset ylabel 'force, N'\n"
               "plot 'figure-4.16.csv' using 'time_s':'force_y_n' with lines lc rgb '#c8553d' notitle\n");
    study.plot(
        figure, "figure-4.16-positions", "Heights of proxy and hand.",
        "set xlabel 'time, s'\nset ylabel 'height, m'\n"
        "plot 'figure-4.16.csv' using 'time_s':'proxy_y_m' with lines lw 2 lc rgb '#2a6f97' title 'proxy', '' using "
        "'time_s':'hip_y_m' with lines lc rgb '#555555' title 'hand (HIP)'\n");
    const auto held = between(samples, 2.2, 8.0);
    figure.comparisons = {
        {"the tail is held without a break", "stably", longest_gap(held) == 0 ? "yes, from 2.2 s to the end" : "no"},
        {"peaks of the force from 2.2 s on", "one for each shake (figure)", std::to_string(peaks(held, 0.02))},
        {"largest force", "(figure only)", shown(most(samples), 3) + " N"},
        {"largest change of the force in a millisecond", "-", shown(1e3 * largest_slew(samples), 2) + " mN"},
        {"steps at which something passed through (independent check)", "-", std::to_string(run.escapes())},
    };
    figure.remarks =
        "The height of the peaks follows from size, mass and way of shaking, which the thesis does not give; that "
        "there is "
        "one for each shake and that the hand keeps hold is what can be compared. The largest change in a millisecond "
        "is "
        "that of the bare planes where a frame arrives; rt-core spreads it over the step.";
    return figure;
}

Figure fish_slide(const Study& study) {
    Figure figure;
    figure.number = "4.17";
    figure.title = "sliding along a fish from head to tail";
    figure.conditions =
        "Scene fish-slide: the fish of figure 4.16 without its motion; the hand slides along it at one height from "
        "head to "
        "tail in 4 s. Force at 1 kHz.";
    SceneRun run("fish-slide", {}, study.clock());
    const std::array<Shot, 2> shots{
        {{2.0, "1", "The hand slides over the head."}, {4.0, "2", "The hand slides over the tail."}}};
    const std::vector<HapticSample> samples = feel(study, figure, run, shots);
    write(study, figure, samples);
    study.plot(
        figure, "figure-4.17-force",
        "Vertical force on the hand against its place along the fish; the head is on the left.",
        "set xlabel 'place along the fish, m (head on the left)'\nset ylabel 'force, N'\nset xrange [0.15:-0.16]\n"
        "plot 'figure-4.17.csv' using ($1 >= 1 && $1 <= 5 ? $2 : NaN):7 skip 1 with lines lc rgb '#c8553d' "
        "notitle\n");
    const auto on_fish = between(samples, 1.1, 4.6);
    figure.comparisons = {
        {"longest time without force while on the fish", "none (figure)", std::to_string(longest_gap(on_fish)) + " ms"},
        {"largest force", "(figure only)", shown(most(samples), 3) + " N"},
        {"largest change of the force in a millisecond", "-", shown(1e3 * largest_slew(on_fish), 2) + " mN"},
        {"steps at which something passed through (independent check)", "-", std::to_string(run.escapes())},
    };
    figure.remarks = "As in the thesis the force follows the outline of the fish and falls where it is soft.";
    return figure;
}

}  // namespace haptic::sim::reproduce
