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
#include "reproduce/reacting_hand.hpp"
#include "reproduce/scene_run.hpp"
#include "reproduce/study.hpp"
#include "reproduce/tool_picture.hpp"

namespace haptic::sim::reproduce {
namespace {

constexpr double kSpeed = 0.3;          // m/s, of the scene's slides
constexpr double kReactingScale = 0.2;  // workspace.scale of the scene, and force_scale for a hand that reacts

/// A multi-rate scheme and its parameters.
struct Scheme {
    std::string name;
    bool positions = false;  // the thesis' multi-rate scheme
    double step_s = 0.02;
    double stiffness = 20.0;   // N/m
    bool holds_force = false;  // a single rate: the force of each step is held until that of the next is known
};

std::vector<std::string> assignments_of(const Scheme& scheme) {
    return {"solver.step=" + std::to_string(scheme.step_s), "coupling.stiffness=" + std::to_string(scheme.stiffness),
            "coupling.torque_stiffness=" + std::to_string(scheme.stiffness),
            std::string("coupling.multi_rate=") + (scheme.positions ? "positions" : "planes")};
}

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
    SceneRun run("plane-slide", assignments_of(scheme), clock);
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

/// A reacting hand on its intended path, once a millisecond, at the device.
struct HandSample {
    double time_s = 0.0;
    double deviation = 0.0;  // m, height over the intended one
};

/// Runs the scene with a hand that follows the script and reacts to the force, which is that of rt-core's renderer, or
/// held during a step. As with slide(), computing a frame or a force takes the whole step.
std::vector<HandSample> react(const Scheme& scheme, std::int64_t (*clock)(), std::uint64_t& escapes) {
    // With force_scale = scale the coupling is as stiff at the hand as in the scene.
    std::vector<std::string> assignments = assignments_of(scheme);
    assignments.push_back("workspace.scale=" + std::to_string(kReactingScale));
    assignments.push_back("workspace.force_scale=" + std::to_string(kReactingScale));
    SceneRun run("plane-slide", assignments, clock);
    const Simulation& simulation = run.simulation();
    const std::int64_t step_ns = nanoseconds(scheme.step_s);
    const bool one_rate = scheme.step_s <= 1e-3;
    ReactingHand hand({}, simulation.scripted_input(0).device);
    HapticLoop loop;
    ContactFrame last{};
    last.step_ns = step_ns;
    Vec3 held(0.0);  // N, at the device: of the step before
    std::vector<HandSample> samples;
    while (!run.finished()) {
        const StepResult& result = run.step(hand.pose());
        const ContactFrame& frame = simulation.frame();
        const std::int64_t now_ns = frame.plane_time_ns;
        loop.accept(one_rate ? frame : last, now_ns);
        for (std::int64_t time_ns = now_ns; time_ns < now_ns + step_ns; time_ns += HapticLoop::kTickNs) {
            const HapticSample sample = loop.tick(simulation.workspace(), hand.pose(), time_ns);
            const Vec3 force = scheme.holds_force ? held : simulation.workspace().force_to_device(sample.force);
            const Pose intended = simulation.scripted_input(time_ns).device;
            samples.push_back({seconds(time_ns), hand.pose().position.y - intended.position.y});
            hand.advance(simulation.scripted_input(time_ns + HapticLoop::kTickNs).device, force,
                         seconds(HapticLoop::kTickNs));
        }
        last = frame;
        held = result.hand_force;
    }
    escapes += run.escapes();
    return samples;
}

/// m: motion across the plane that nobody intends, root mean square about the mean of each slide.
double extra_motion(const std::vector<HandSample>& samples) {
    double squares = 0.0;
    double count = 0.0;
    for (const auto& [from_s, until_s] : kSlides) {
        double sum = 0.0;
        double sum_of_squares = 0.0;
        double n = 0.0;
        for (const HandSample& s : samples) {
            if (s.time_s >= from_s && s.time_s <= until_s) {
                sum += s.deviation;
                sum_of_squares += s.deviation * s.deviation;
                n += 1.0;
            }
        }
        squares += sum_of_squares - sum * sum / n;
        count += n;
    }
    return std::sqrt(std::max(0.0, squares) / count);
}

/// (c): extra motion of a reacting hand against the stiffness, and its path at one at which the schemes differ.
void add_reacting_hand(const Study& study, Figure& figure, std::uint64_t& escapes) {
    constexpr double shown_stiffness = 500.0;  // N/m
    const std::vector<double> stiffnesses{20.0, 50.0, 100.0, 200.0, 500.0, 1000.0};
    const std::array<Scheme, 4> schemes{{{"positions", true, 0.02, 0.0, false},
                                         {"planes", false, 0.02, 0.0, false},
                                         {"held", false, 0.02, 0.0, true},
                                         {"1-khz", false, 0.001, 0.0, false}}};
    CsvWriter csv(study.data(figure, "figure-5.7-extra-motion"),
                  {"stiffness_n_m", "positions_mm", "planes_mm", "single_rate_50_hz_mm", "single_rate_1_khz_mm"});
    std::array<double, 4> least{};
    std::array<double, 4> shown{};
    std::array<std::vector<HandSample>, 4> paths;
    for (const double stiffness : stiffnesses) {
        std::array<double, 5> row{stiffness};
        for (std::size_t w = 0; w < schemes.size(); ++w) {
            Scheme scheme = schemes[w];
            scheme.stiffness = stiffness;
            const std::vector<HandSample> samples = react(scheme, study.clock(), escapes);
            row[w + 1] = 1e3 * extra_motion(samples);
            least[w] = stiffness == stiffnesses.front() ? row[w + 1] : least[w];
            if (stiffness == shown_stiffness) {
                shown[w] = row[w + 1];
                paths[w] = samples;
            }
        }
        csv.row(row);
    }
    csv.close();
    study.plot(
        figure, "figure-5.7-extra-motion",
        "(c) Motion of a reacting hand across the plane that nobody intends, while it slides.",
        "set xlabel 'stiffness of the coupling, N/m'\nset ylabel 'mm, rms'\nset logscale xy\nset key left top "
        "inside\nplot 'figure-5.7-extra-motion.csv' using 1:4 skip 1 with linespoints pt 7 lc 4 title 'single "
        "rate, 50 steps/s', '' using 1:2 skip 1 with linespoints pt 7 lc thesis title 'positions (the thesis), 50 "
        "steps/s', '' using 1:3 skip 1 with linespoints pt 7 lc ours title 'planes, 50 steps/s', '' using 1:5 skip "
        "1 with linespoints pt 7 lc 5 title 'single rate, 1 kHz'\n");
    // The path of each hand at one stiffness.
    CsvWriter path(study.data(figure, "figure-5.7-hand"),
                   {"time_s", "positions_mm", "planes_mm", "single_rate_50_hz_mm", "single_rate_1_khz_mm"});
    for (std::size_t k = 0; k < paths[0].size(); ++k) {
        path.row(std::array{paths[0][k].time_s, 1e3 * paths[0][k].deviation, 1e3 * paths[1][k].deviation,
                            1e3 * paths[2][k].deviation, 1e3 * paths[3][k].deviation});
    }
    path.close();
    study.plot(
        figure, "figure-5.7-hand",
        "(c) Height of the reacting hand over its intended path, " + format_fixed(shown_stiffness, 0) + " N/m.",
        "set xlabel 'time, s'\nset ylabel 'mm'\nset xrange [0.5:3.2]\nplot 'figure-5.7-hand.csv' using 1:4 skip "
        "1 with lines lc 4 title 'single rate, 50 steps/s', '' using 1:2 skip 1 with lines lw 2 lc thesis title "
        "'positions (the thesis)', '' using 1:3 skip 1 with lines lw 2 lc ours title 'planes', '' using 1:5 skip 1 "
        "with lines dt 2 lc 5 title 'single rate, 1 kHz'\n");
    const auto motions = [](const std::array<double, 4>& mm) {
        return "positions " + format_fixed(mm[0], 4) + ", planes " + format_fixed(mm[1], 4) + ", single rate " +
               format_fixed(mm[2], 4) + " (50 steps/s) and " + format_fixed(mm[3], 4) + " mm (1 kHz)";
    };
    figure.comparisons.push_back(
        {"(c) extra motion of the hand, 20 N/m", "a single rate has more (figure)", motions(least)});
    figure.comparisons.push_back({"(c) the same, " + format_fixed(shown_stiffness, 0) + " N/m", "-", motions(shown)});
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
        "which the particles are held at 1 kHz. (c) A single rate: the simulation at 1 kHz, or the force of a step of "
        "20 ms held until the next is known. For (c) the hand reacts: 0.1 kg on a spring of 255 N/m and a damper of "
        "4 N s/m to the intended path (a loosely pressing fingertip, Hajian and Howe 1997), and feels the coupling as "
        "stiff as it is in the scene.";
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
                       ".csv' using 1:5 skip 1 with lines lw 2 lc along_x title 'force along x', '' using 1:6 skip "
                       "1 with lines lw 2 lc along_y title 'up', '' using 1:7 skip 1 with lines lw 2 lc along_z title "
                       "'along z', "
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
               "plot 'figure-5.7-steps.csv' using 1:2 skip 1 with linespoints pt 7 lc thesis title 'positions (the "
               "thesis)', '' using 1:3 skip 1 with linespoints pt 7 lc ours title 'planes', '' using 1:4 skip 1 "
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
    };
    add_reacting_hand(study, figure, escapes);
    figure.comparisons.push_back(
        {"particles through which something passed (independent check)", "-", std::to_string(escapes)});
    figure.remarks =
        "With a single rate at 1 kHz, the force of each millisecond follows from the hand's position in that "
        "millisecond: nothing drags, and the hand is as steady as with planes. What the thesis observed is seen where "
        "the single rate is that of the simulation. A force that is held for a step of 20 ms, and known one step late, "
        "takes damping from the hand: at 20 N/m the extra motion is three times that of planes, but half a micrometre; "
        "from 200 N/m on it can be felt, and at 500 N/m the hand leaves the plane and comes back in a cycle that does "
        "not end. Forces up: the thesis' positions have independent springs, so that only those of the spheres in "
        "contact press; with planes the scene's elastic tool presses with the whole spring.";
    return figure;
}

}  // namespace haptic::sim::reproduce
