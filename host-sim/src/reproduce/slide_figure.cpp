// Figure 5.7: sliding over a plane, with the thesis' multi-rate scheme, with ours, and with one rate.

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <string>
#include <vector>

#include "haptic/csv.hpp"
#include "haptic/types.hpp"
#include "reproduce/haptic_render.hpp"
#include "reproduce/scene_run.hpp"
#include "reproduce/study.hpp"
#include "reproduce/tool_picture.hpp"

namespace haptic::sim::reproduce {
namespace {

constexpr double kSpeed = 0.3;  // m/s, of the scene's slides

/// A multi-rate scheme and its parameters.
struct Scheme {
    std::string name;
    bool positions = false;  // the thesis' multi-rate scheme
    double step_s = 0.02;
    double stiffness = 20.0;  // N/m
};

/// Straight slides of plane-slide without rotation, s, without the first steps of each.
constexpr std::array<std::array<double, 2>, 3> kSlides{{{1.1, 1.5}, {1.8, 2.2}, {2.5, 2.9}}};

struct SlideForces {
    double along = 0.0;   // N, largest force along the plane while sliding
    double normal = 0.0;  // N, mean normal force
    double ripple = 0.0;  // N, largest deviation from the mean
};

SlideForces slide_forces(const std::vector<HapticSample>& samples) {
    SlideForces result;
    for (const auto& [from_s, until_s] : kSlides) {
        // Mean, extremes and tangential maximum of one slide.
        double sum = 0.0;
        double count = 0.0;
        double min = 1e9;
        double max = -1e9;
        for (const HapticSample& s : samples) {
            if (s.time_s < from_s || s.time_s > until_s) {
                continue;
            }
            result.along = std::max(result.along, std::hypot(s.force.x, s.force.z));
            sum += s.force.y;
            count += 1.0;
            min = std::min(min, s.force.y);
            max = std::max(max, s.force.y);
        }
        result.normal = sum / count;
        result.ripple = std::max({result.ripple, max - result.normal, result.normal - min});
    }
    return result;
}

/// Runs the scene with one scheme. A frame is rendered from the end of its step, as if computing it took the whole
/// step; with a single rate it is rendered at once.
std::vector<HapticSample> slide(const Scheme& scheme, std::int64_t (*clock)(), std::uint64_t& escapes,
                                const Study* study, Figure* figure) {
    SceneRun run(
        "plane-slide",
        {"solver.step=" + std::to_string(scheme.step_s), "coupling.stiffness=" + std::to_string(scheme.stiffness),
         "coupling.torque_stiffness=" + std::to_string(scheme.stiffness),
         std::string("coupling.multi_rate=") + (scheme.positions ? "positions" : "planes")},
        clock);
    // Render the previous frame during this step, or this frame if there is only one rate.
    const std::int64_t step_ns = nanoseconds(scheme.step_s);
    const bool one_rate = scheme.step_s <= 1e-3;
    HapticLoop loop;
    std::vector<HapticSample> samples;
    ContactFrame last{};  // of no proxy, until the first step has ended
    last.step_ns = step_ns;
    bool shot = study == nullptr;
    while (!run.finished()) {
        run.step();
        const ContactFrame& frame = run.simulation().frame();
        const std::int64_t now_ns = frame.plane_time_ns;
        loop.render(run.simulation(), one_rate ? frame : last, now_ns, now_ns + step_ns, samples);
        last = frame;
        if (!shot && run.time_s() > 1.3) {
            shot = true;
            ToolPicture picture = tool_picture(run, "the hand slides over the plane", ToolStyle::Skin);
            picture.scene.camera = {0.6, 0.55, 0.9};
            picture.scene.view = Aabb{run.result().proxy - 0.14, run.result().proxy + 0.14};
            study->picture(*figure, "figure-5.7-slide", "The hand slides over the plane; grey: the pose of the device.",
                           picture.scene);
        }
    }
    escapes += run.escapes();
    return samples;
}

void write(const Study& study, Figure& figure, const std::string& name, const std::vector<HapticSample>& samples) {
    CsvWriter csv(study.data(figure, name), {"time_s", "x_m", "y_m", "z_m", "force_x_n", "force_y_n", "force_z_n",
                                             "torque_x_nm", "torque_y_nm", "torque_z_nm"});
    for (const HapticSample& s : samples) {
        csv.row(std::array{s.time_s, s.hip.x, s.hip.y, s.hip.z, s.force.x, s.force.y, s.force.z, s.torque.x, s.torque.y,
                           s.torque.z});
    }
    csv.close();
}

std::string per_cent(double part) {
    return format_fixed(100.0 * part, part < 0.01 ? 3 : 0) + " %";
}

}  // namespace

Figure plane_slide(const Study& study) {
    Figure figure;
    figure.number = "5.7";
    figure.title = "sliding over a plane: dragging forces";
    figure.conditions =
        "Scene plane-slide: a hand of 37 spheres is pressed onto a rigid horizontal plane and slides over it at "
        "0.3 m/s, along x, diagonally and along z. The simulation makes 50 steps/s, and each takes a whole step "
        "to compute, so a frame is rendered from the end of its step to the end of the next. (a) The thesis' "
        "multi-rate scheme: particles in contact stay at their positions in the frame. (b) Ours: planes, against "
        "which the particles are held at 1 kHz. (c) A single rate: the simulation at 1 kHz.";
    // The three schemes at the thesis' settings.
    const std::array<Scheme, 3> schemes{
        {{"a-positions", true, 0.02, 20.0}, {"b-planes", false, 0.02, 20.0}, {"c-one-rate", true, 0.001, 20.0}}};
    std::uint64_t escapes = 0;
    std::array<SlideForces, 3> results;
    for (std::size_t w = 0; w < schemes.size(); ++w) {
        const std::vector<HapticSample> samples =
            slide(schemes[w], study.clock(), escapes, w == 1 ? &study : nullptr, w == 1 ? &figure : nullptr);
        results[w] = slide_forces(samples);
        const std::string name = "figure-5.7-" + schemes[w].name;
        write(study, figure, name, samples);
        const std::array<const char*, 3> captions{
            "(a) The thesis' multi-rate scheme, 50 steps/s: forces along x and z.",
            "(b) Planes, 50 steps/s: nothing along x and z.", "(c) Single rate, 1 kHz."};
        study.plot(figure, name, captions[w],
                   "set xlabel 'time, s'\nset ylabel 'N'\nset xrange [0:5]\nplot '" + name +
                       ".csv' using 1:5 skip 1 with lines lw 2 lc 2 title 'force along x', '' using 1:6 skip "
                       "1 with lines lw 2 lc 3 title 'up', '' using 1:7 skip 1 with lines lw 2 lc 1 title 'along z', "
                       "'' using 1:(10*$2) skip 1 with lines dt 2 lc 5 title 'x of "
                       "the hand, 10 cm'\n");
    }
    // Dragging force against the duration of a step.
    const std::vector<double> steps{0.005, 0.01, 0.02, 0.04};
    CsvWriter csv(study.data(figure, "figure-5.7-steps"), {"step_ms", "positions_n", "planes_n", "k_v_step_n"});
    for (const double step_s : steps) {
        const SlideForces drag =
            slide_forces(slide({"", true, step_s, 20.0}, study.clock(), escapes, nullptr, nullptr));
        const SlideForces none =
            slide_forces(slide({"", false, step_s, 20.0}, study.clock(), escapes, nullptr, nullptr));
        csv.row(std::array{1e3 * step_s, drag.along, none.along, 20.0 * kSpeed * step_s});
    }
    csv.close();
    study.plot(figure, "figure-5.7-steps", "Largest force along the plane against the duration of a step.",
               "set xlabel 'duration of a step, ms'\nset ylabel 'N'\nset yrange [0:*]\nset key left top inside\n"
               "plot 'figure-5.7-steps.csv' using 1:2 skip 1 with linespoints pt 7 lc 2 title 'positions (the "
               "thesis)', '' using 1:3 skip 1 with linespoints pt 7 lc 1 title 'planes', '' using 1:4 skip 1 "
               "with lines dt 2 lc 5 title 'k v T'\n");
    // Planes with a stiff coupling, and the expected dragging force k v T.
    const SlideForces stiff = slide_forces(slide({"", false, 0.02, 500.0}, study.clock(), escapes, nullptr, nullptr));
    const double kvt = 20.0 * kSpeed * 0.02;
    const double stiff_kvt = 500.0 * kSpeed * 0.02;
    figure.comparisons = {
        {"(a) force along the plane, the largest", "\"dragging\" while the hand moves (figure)",
         format_fixed(results[0].along, 3) + " N = " + format_fixed(results[0].along / kvt, 2) + " k v T"},
        {"(b) the same with planes, 20 N/m", "-",
         format_fixed(results[1].along, 6) + " N = " + per_cent(results[1].along / kvt) + " of k v T"},
        {"(b) ripple of the force up", "-", per_cent(results[1].ripple / results[1].normal) + " of it"},
        {"(b) with 500 N/m", "-",
         format_fixed(stiff.along, 6) + " N = " + per_cent(stiff.along / stiff_kvt) + " of k v T, ripple " +
             per_cent(stiff.ripple / stiff.normal)},
        {"(c) single rate", "none, but less stable (figure)", format_fixed(results[2].along, 4) + " N"},
        {"particles through which something passed (independent check)", "-", std::to_string(escapes)},
    };
    figure.remarks =
        "With a single rate, the force of each millisecond follows from the hand's position in that millisecond. "
        "The instability that the thesis observed there involves the user's hand in the loop, which a script does "
        "not model (see rt-core's stability map).";
    return figure;
}

}  // namespace haptic::sim::reproduce
