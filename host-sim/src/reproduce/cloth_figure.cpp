// Figure 4.13: a cloth dropped from 10 m is caught by a proxy of 3 cm.

#include <algorithm>
#include <array>
#include <glm/geometric.hpp>
#include <utility>
#include <vector>

#include "haptic/csv.hpp"
#include "reproduce/haptic_render.hpp"
#include "reproduce/scene_run.hpp"
#include "reproduce/study.hpp"

namespace haptic::sim::reproduce {
namespace {

/// Takes pictures at the moments that the thesis shows: one step before the contact, the step of the contact with the
/// previous cloth, and some steps later.
struct Pictures {
    static constexpr std::uint64_t kLater = 12;  // steps

    void observe(const Study& study, Figure& figure, const SceneRun& run) {
        // First contact: the previous step, and this one with the previous cloth in grey.
        if (first_ == 0 && run.result().in_contact) {
            first_ = run.simulation().steps();
            PictureScene before = run.picture("one step before the contact");
            before.objects[0].vertices = previous_;
            before.proxy = before.hip;
            before.camera.y = -0.12;
            study.picture(figure, "figure-4.13-before", "One step before the contact.", before);
            PictureScene contact = run.picture("the step of the contact");
            PictureObject ghost = contact.objects[0];
            ghost.vertices = previous_;
            ghost.ghost = true;
            contact.objects.push_back(std::move(ghost));
            contact.camera.y = -0.12;
            study.picture(
                figure, "figure-4.13-contact",
                "The step of the contact: grey, the cloth one step before; it has passed the hand (white) and "
                "has taken the proxy (blue) along.",
                contact);
        } else if (first_ != 0 && run.simulation().steps() == first_ + kLater) {
            study.picture(figure, "figure-4.13-later", "0.12 s later: the cloth is held.",
                          run.picture("some steps later"));
        }
        previous_ = run.vertices();
    }

  private:
    std::uint64_t first_ = 0;  // step of the contact; 0: none yet
    std::vector<Vec3> previous_;
};

}  // namespace

Figure cloth_drop(const Study& study) {
    Figure figure;
    figure.number = "4.13";
    figure.title = "a cloth dropped from 10 m is caught";
    figure.conditions =
        "Scene cloth-drop with the thesis' solver: 1,089 vertices, 4,096 triangles (double-faced), step 0.01 s, proxy "
        "0.03 m, the hand "
        "fixed at the origin. The cloth arrives at 14 m/s and moves 4.7 proxy radii per step. The thesis gives "
        "neither mass nor stiffness: here 100 g and 10 N/m, with damping that grows with depth so that the cloth "
        "does not bounce. Force at 1 kHz, in the scene, by rt-core's renderer from the frames of a simulation at 100 "
        "steps/s.";
    // Run the scene, render each frame at 1 kHz, and time the detection of each step.
    SceneRun run("cloth-drop", {}, study.clock());
    HapticLoop loop;
    std::vector<HapticSample> samples;
    Pictures pictures;
    std::vector<double> ccd_us;
    std::uint64_t in_contact = 0;
    while (!run.finished()) {
        const StepResult& result = run.step();
        const ContactFrame& frame = run.simulation().frame();
        loop.render(run.simulation(), frame, frame.plane_time_ns, frame.plane_time_ns + frame.step_ns, samples);
        pictures.observe(study, figure, run);
        ccd_us.push_back(static_cast<double>(result.times.ccd_ns) * 1e-3);
        in_contact += result.in_contact ? 1 : 0;
    }
    // The samples as data, and the largest force.
    double peak = 0.0;
    CsvWriter csv(study.data(figure, "figure-4.13"),
                  {"time_s", "force_x_n", "force_y_n", "force_z_n", "proxy_y_m", "hip_y_m"});
    for (const HapticSample& s : samples) {
        csv.row(std::array{s.time_s, s.force.x, s.force.y, s.force.z, s.proxy.y, s.hip.y});
        peak = std::max(peak, glm::length(s.force));
    }
    csv.close();
    // Plot, then compare with the thesis.
    study.plot(figure, "figure-4.13-force", "Force on the hand, in the scene, at 1 kHz; the hand is fixed.",
               "set xlabel 'time, s'\nset ylabel 'force, N'\nset xrange [1.3:*]\n"
               "plot 'figure-4.13.csv' using 'time_s':'force_y_n' with lines lw 2 lc along_y title 'up', '' using "
               "'time_s':'force_x_n' with lines lc along_x title 'x', '' using 'time_s':'force_z_n' with lines lc "
               "along_z title 'z'\n");
    figure.comparisons = {
        {"cloth caught", "yes; not without the method", in_contact > 0 && run.escapes() == 0 ? "yes" : "no"},
        {"steps at which something passed through the proxy (independent check)", "-", std::to_string(run.escapes())},
        {"collision detection per step, including the refit of the tree", "300 to 1,000 us",
         format_fixed(quantile(ccd_us, 0.5), 1) + " us (median), " + format_fixed(quantile(ccd_us, 0.99), 1) +
             " us (99 %)"},
        {"largest force in the scene", "(figure only)", format_fixed(peak, 1) + " N"},
        {"steps in contact", "(figure only)", std::to_string(in_contact)},
    };
    figure.remarks =
        "The thesis tests all triangles against the proxy's centre; here a tree over the moving triangles selects "
        "the few that may touch. The shape of the force depends on mass and stiffness, which the thesis does not "
        "give.";
    return figure;
}

}  // namespace haptic::sim::reproduce
