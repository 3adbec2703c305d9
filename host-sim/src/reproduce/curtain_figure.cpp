// Figure 5.5: a deformable hand on a curtain.

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <string>
#include <utility>
#include <vector>

#include "haptic/csv.hpp"
#include "haptic/types.hpp"
#include "reproduce/haptic_render.hpp"
#include "reproduce/scene_run.hpp"
#include "reproduce/study.hpp"
#include "reproduce/tool_picture.hpp"

namespace haptic::sim::reproduce {
namespace {

constexpr std::array kCurtainColour{0.93, 0.76, 0.22};

// The curtain is built flat and unstretched; it is at rest once no vertex is faster than this.
constexpr double kResting = 0.02;       // m/s
constexpr double kSettleAtMost = 60.0;  // s

/// Cube around a point.
Aabb cube_around(const Vec3& centre, double half) {
    return {centre - half, centre + half};
}

void take_of_curtain(const Study& study, Figure& figure, const SceneRun& run, const Shot& shot) {
    ToolPicture picture = tool_picture(run, shot.caption, ToolStyle::Skin);
    picture.scene.objects.front().colour = kCurtainColour;
    picture.scene.camera = shot.camera;
    picture.scene.view = cube_around(run.result().proxy, 1.05);
    study.picture(figure, "figure-5.5-" + std::string(shot.name), shot.caption, picture.scene);
}

/// Times of the stages of a step, us, grouped as in the thesis.
struct CurtainTimes {
    std::vector<double> whole;
    std::vector<double> bodies_and_tool;
    std::vector<double> detection;
    std::vector<double> coupling;
    std::vector<double> contact;

    void add(const StageTimes& t) {
        const auto us = [](std::int64_t ns) { return static_cast<double>(ns) * 1e-3; };
        whole.push_back(us(t.total_ns));
        bodies_and_tool.push_back(us(t.deform_ns + t.tool_ns));
        detection.push_back(us(t.ccd_ns + t.popout_ns));
        coupling.push_back(us(t.proxy_ns));
        contact.push_back(us(t.ccd_ns + t.popout_ns + t.proxy_ns));
    }
};

std::string medians(const std::vector<double>& free, const std::vector<double>& touching) {
    return format_fixed(quantile(free, 0.5), 0) + " us free, " + format_fixed(quantile(touching, 0.5), 0) +
           " us in contact";
}

/// Statistics of the samples without contact.
struct FreeMotion {
    std::size_t samples = 0;
    double max_speed = 0.0;  // m/s
    double force = 0.0;      // N, maximum
    double torque = 0.0;     // N*m

    explicit FreeMotion(const std::vector<HapticSample>& all) {
        for (std::size_t k = 1; k < all.size(); ++k) {
            const HapticSample& s = all[k];
            if (s.collided > 0) {
                continue;
            }
            ++samples;
            force = std::max(force, glm::length(s.force));
            torque = std::max(torque, glm::length(s.torque));
            max_speed = std::max(max_speed, glm::length(s.hip - all[k - 1].hip) / (s.time_s - all[k - 1].time_s));
        }
    }
};

}  // namespace

Figure curtain_hand(const Study& study) {
    Figure figure;
    figure.number = "5.5";
    figure.title = "a deformable hand on a curtain";
    figure.conditions =
        "Scene curtain-hand with the thesis' solver: a double-faced curtain of 8 m and 200 g with 1,089 vertices, "
        "4,096 triangles, one "
        "particle per vertex and two iterations; a hand of 1 kg with 3,906 triangles, 37 particles and four "
        "iterations; both springs 20 N/m. The hand moves to and fro in the air, slaps the curtain with the palm, "
        "hits it with the fingertips, presses and turns, and leaves: 2.5 s, as in the thesis. Force and torque at "
        "1 kHz, in the scene, by rt-core's renderer from the frames of a simulation at 100 steps/s.";
    // Let the curtain settle, run the scene, render each frame at 1 kHz, and take the pictures of the thesis.
    SceneRun run("curtain-hand", {}, study.clock());
    const double settled_s = run.settle(kResting, kSettleAtMost);
    figure.conditions += " The curtain has hung for " + format_fixed(settled_s, 1) +
                         " s before, until no vertex was faster than " + format_fixed(1e3 * kResting, 0) + " mm/s.";
    const std::array<Shot, 5> shots{
        {{0.22, "1-air", "In the air: the tool is at the device's pose.", {0.8, 0.3, 1.0}},
         {0.6, "2-slap", "The flat hand slaps the curtain; grey: the pose of the device.", {0.9, 0.25, 0.6}},
         {1.05, "3-poke", "The fingertips hit the curtain and bend.", {1.0, 0.25, 0.35}},
         {1.8, "4-press", "The hand presses the curtain.", {0.9, 0.25, 0.6}},
         {2.1, "5-turn", "It turns while it presses.", {0.9, 0.25, 0.6}}}};
    HapticLoop loop;
    std::vector<HapticSample> samples;
    CurtainTimes free;
    CurtainTimes touching;
    std::size_t next = 0;
    std::size_t max_collided = 0;
    const std::int64_t step_ns = nanoseconds(run.simulation().scene().solver.step);
    while (!run.finished()) {
        const StepResult& result = run.step();
        const ContactFrame& frame = run.simulation().frame();
        loop.render(run.simulation(), frame, frame.plane_time_ns, frame.plane_time_ns + step_ns, samples);
        (result.in_contact ? touching : free).add(result.times);
        max_collided = std::max(max_collided, result.collided);
        if (next < shots.size() && run.time_s() + 1e-9 >= shots[next].time_s) {
            take_of_curtain(study, figure, run, shots[next]);
            if (next == 3) {
                ToolPicture spheres = tool_picture(run, "the spheres of the hand", ToolStyle::Spheres);
                spheres.scene.objects.erase(spheres.scene.objects.begin());  // the curtain
                spheres.scene.camera = {0.5, 0.3, 1.0};
                study.picture(figure, "figure-5.5-spheres", "The hand and its 37 spheres; those in contact are orange.",
                              spheres.scene);
            }
            ++next;
        }
    }
    // The samples as data, and their maxima.
    CsvWriter csv(study.data(figure, "figure-5.5"),
                  {"time_s", "x_m", "y_m", "z_m", "force_x_n", "force_y_n", "force_z_n", "torque_x_nm", "torque_y_nm",
                   "torque_z_nm", "particles_in_contact"});
    double force = 0.0;
    double torque = 0.0;
    for (const HapticSample& s : samples) {
        csv.row(std::array{s.time_s, s.hip.x, s.hip.y, s.hip.z, s.force.x, s.force.y, s.force.z, s.torque.x, s.torque.y,
                           s.torque.z, static_cast<double>(s.collided)});
        force = std::max(force, glm::length(s.force));
        torque = std::max(torque, glm::length(s.torque));
    }
    csv.close();
    // One plot each of position, force and torque.
    const auto plot = [&](const std::string& name, const std::string& caption, const std::string& axis, int column) {
        const auto line = [&](int k, const char* title) {
            return std::string(k == 0 ? "plot 'figure-5.5.csv'" : ", ''") + " using 1:" + std::to_string(column + k) +
                   " skip 1 with lines lw 2 lc along_" + title + " title '" + title + "'";
        };
        study.plot(
            figure, "figure-5.5-" + name, caption,
            "set xlabel 'time, s'\nset ylabel '" + axis + "'\n" + line(0, "x") + line(1, "y") + line(2, "z") + "\n");
    };
    plot("position", "Position of the device, in the scene.", "m", 2);
    plot("force", "Force on the hand, in the scene.", "N", 5);
    plot("torque", "Torque on the hand, in the scene.", "N m", 8);

    // Comparison with the thesis.
    const FreeMotion free_motion(samples);
    const double touching_us = quantile(touching.whole, 0.5);
    figure.comparisons = {
        {"force in the air", "none caused by inertia",
         free_motion.force == 0.0 && free_motion.torque == 0.0
             ? "exactly 0, and so is the torque, in all " + std::to_string(free_motion.samples) +
                   " ms without contact, at up to " + format_fixed(free_motion.max_speed, 1) + " m/s in the scene (" +
                   format_fixed(free_motion.max_speed * run.simulation().workspace().settings().scale, 2) +
                   " m/s at the device)"
             : "up to " + format_fixed(free_motion.force, 6) + " N and " + format_fixed(free_motion.torque, 6) +
                   " N m"},
        {"steps a second in contact", "45 to 59",
         touching_us > 0.0 ? format_fixed(1e6 / touching_us, 0) : "never in contact"},
        {"whole step", "17,000 to 22,000 us", medians(free.whole, touching.whole)},
        {"curtain's dynamics, and equilibrium of the hand with the moves of its proxies",
         "4,000 us (constraints of both)", medians(free.bodies_and_tool, touching.bodies_and_tool)},
        {"collision detection with pop-out", "3,000 us", medians(free.detection, touching.detection)},
        {"speculative planes and contact coupling", "8,000 to 12,000 us (with both runs of the virtual proxy)",
         medians(free.coupling, touching.coupling)},
        {"detection, pop-out, speculative planes and contact coupling, 99.9th percentile", "-",
         format_fixed(quantile(touching.contact, 0.999), 0) + " us"},
        {"largest number of particles in contact", "-", std::to_string(max_collided) + " of 37"},
        {"largest force and torque in the scene", "(figure only)",
         format_fixed(force, 1) + " N, " + format_fixed(torque, 1) + " N m"},
        {"particles through which something passed (independent check of each path)", "-",
         std::to_string(run.escapes())},
    };
    figure.remarks =
        "The path of the hand is our own script, and the thesis does not give the size of its hand, so the curves "
        "can be compared qualitatively only: no force in the air, a force that grows with depth, no oscillation "
        "after the impacts.";
    return figure;
}

}  // namespace haptic::sim::reproduce
