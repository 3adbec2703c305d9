// Figures 4.16 and 4.17: a fish felt at 1 kHz, held by its tail and slid along.

#include <algorithm>
#include <array>
#include <glm/geometric.hpp>
#include <string>
#include <vector>

#include "haptic/csv.hpp"
#include "reproduce/haptic_render.hpp"
#include "reproduce/scene_run.hpp"
#include "reproduce/study.hpp"

namespace haptic::sim::reproduce {
namespace {

struct FishShot {
    double time_s;
    const char* name;
    const char* caption;
};

/// Runs a scene to its end, renders it at 1 kHz and takes pictures at the given times.
std::vector<HapticSample> run_and_render(const Study& study, Figure& figure, SceneRun& run,
                                         std::span<const FishShot> shots) {
    HapticLoop loop;
    std::vector<HapticSample> samples;
    std::size_t next = 0;
    while (!run.finished()) {
        run.step();
        const ContactFrame& frame = run.simulation().frame();
        loop.render(run.simulation(), frame, frame.plane_time_ns, frame.plane_time_ns + frame.step_ns, samples);
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

/// The samples between two times.
std::span<const HapticSample> between(std::span<const HapticSample> samples, double from_s, double to_s) {
    const auto before = [](const HapticSample& s, double time_s) { return s.time_s < time_s; };
    const auto first = std::lower_bound(samples.begin(), samples.end(), from_s, before);
    const auto last = std::lower_bound(first, samples.end(), to_s, before);
    return {first, last};
}

double max_force_step(std::span<const HapticSample> samples) {
    // Largest change of the force between two samples (1 ms).
    double largest = 0.0;
    for (std::size_t k = 1; k < samples.size(); ++k) {
        largest = std::max(largest, glm::length(samples[k].force - samples[k - 1].force));
    }
    return largest;  // N per ms
}

/// Longest time without force, ms (samples).
int longest_gap_ms(std::span<const HapticSample> samples) {
    int longest = 0;
    int gap = 0;
    for (const HapticSample& s : samples) {
        gap = s.force.y > 0.0 ? 0 : gap + 1;
        longest = std::max(longest, gap);
    }
    return longest;
}

/// Counts the maxima of the vertical force that exceed the adjacent minima by at least `prominence`, N.
int count_peaks(std::span<const HapticSample> samples, double prominence) {
    int count = 0;
    // State machine with hysteresis: follow a rise until the force falls by `prominence`, then a fall until it rises by
    // it.
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

double max_force(std::span<const HapticSample> samples) {
    double max_n = 0.0;
    for (const HapticSample& s : samples) {
        max_n = std::max(max_n, s.force.y);
    }
    return max_n;
}

}  // namespace

Figure fish_hold(const Study& study) {
    Figure figure;
    figure.number = "4.16";
    figure.title = "holding the tail of a living fish";
    figure.conditions =
        "Scene fish-hold: 137 particles with eight neighbours each, stiffness 0.9 for the head, 0.6 for belly and "
        "tail; the belly is fixed to the table, neck and upper tail move up and down twice, repeatedly; coupling "
        "10 N/m without damping. The fish is our own (852 vertices, 1,700 triangles; the thesis' 1,047 vertices "
        "are split at seams). Force and positions at 1 kHz, by rt-core's renderer from the frames of a simulation "
        "at 100 steps/s.";
    SceneRun run("fish-hold", {}, study.clock());
    const std::array<FishShot, 4> shots{{{1.3, "1", "The hand comes down on the tail."},
                                         {2.9, "2", "The tail is pressed onto the table, at rest."},
                                         {3.7, "3", "The fish lifts its tail against the hand."},
                                         {3.8, "4", "Between two shakes."}}};
    // Run, record and plot.
    const std::vector<HapticSample> samples = run_and_render(study, figure, run, shots);
    write(study, figure, samples);
    study.plot(figure, "figure-4.16-force", "Vertical force on the hand, in the scene, at 1 kHz.",
               "set xlabel 'time, s'\nset ylabel 'force, N'\n"
               "plot 'figure-4.16.csv' using 'time_s':'force_y_n' with lines lc along_y notitle\n");
    study.plot(figure, "figure-4.16-positions", "Heights of proxy and hand.",
               "set xlabel 'time, s'\nset ylabel 'height, m'\n"
               "plot 'figure-4.16.csv' using 'time_s':'proxy_y_m' with lines lw 2 lc proxy title 'proxy', '' using "
               "'time_s':'hip_y_m' with lines lc hand title 'hand (HIP)'\n");
    // From 2.2 s on the tail is held.
    const auto held = between(samples, 2.2, 8.0);
    figure.comparisons = {
        {"the tail is held without interruption", "stably",
         longest_gap_ms(held) == 0 ? "yes, from 2.2 s to the end" : "no"},
        {"peaks of the force from 2.2 s on", "one for each shake (figure)", std::to_string(count_peaks(held, 0.02))},
        {"largest force", "(figure only)", format_fixed(max_force(samples), 3) + " N"},
        {"largest change of the force in a millisecond", "-", format_fixed(1e3 * max_force_step(samples), 2) + " mN"},
        {"steps at which something passed through (independent check)", "-", std::to_string(run.escapes())},
    };
    figure.remarks =
        "The height of the peaks follows from size, mass and motion of the fish, which the thesis does not give. "
        "Comparable are that each shake causes one peak and that the hand does not lose the tail.";
    return figure;
}

Figure fish_slide(const Study& study) {
    Figure figure;
    figure.number = "4.17";
    figure.title = "sliding along a fish from head to tail";
    figure.conditions =
        "Scene fish-slide: the fish of figure 4.16 without its motion; the hand slides along it from head to tail "
        "at constant height in 4 s. Force at 1 kHz.";
    SceneRun run("fish-slide", {}, study.clock());
    const std::array<FishShot, 2> shots{
        {{2.0, "1", "The hand slides over the head."}, {4.0, "2", "The hand slides over the tail."}}};
    const std::vector<HapticSample> samples = run_and_render(study, figure, run, shots);
    write(study, figure, samples);
    study.plot(
        figure, "figure-4.17-force",
        "Vertical force on the hand against its position along the fish; the head is on the left.",
        "set xlabel 'position along the fish, m (head on the left)'\nset ylabel 'force, N'\nset xrange [0.15:-0.16]\n"
        "plot 'figure-4.17.csv' using ($1 >= 1 && $1 <= 5 ? $2 : NaN):7 skip 1 with lines lc along_y "
        "notitle\n");
    // From 1.1 s to 4.6 s the hand is on the fish.
    const auto on_fish = between(samples, 1.1, 4.6);
    figure.comparisons = {
        {"longest time without force while on the fish", "none (figure)",
         std::to_string(longest_gap_ms(on_fish)) + " ms"},
        {"largest force", "(figure only)", format_fixed(max_force(samples), 3) + " N"},
        {"largest change of the force in a millisecond", "-", format_fixed(1e3 * max_force_step(on_fish), 2) + " mN"},
        {"steps at which something passed through (independent check)", "-", std::to_string(run.escapes())},
    };
    figure.remarks = "As in the thesis, the force follows the outline of the fish and drops where the fish is soft.";
    return figure;
}

}  // namespace haptic::sim::reproduce
