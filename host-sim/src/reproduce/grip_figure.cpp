// Figures 5.8, what can be done with a deformable hand, and 5.9, what is thin between two spheres of a tool.

#include <algorithm>
#include <array>
#include <glm/geometric.hpp>
#include <string>
#include <vector>

#include "haptic/csv.hpp"
#include "haptic/types.hpp"
#include "reproduce/scene_run.hpp"
#include "reproduce/study.hpp"
#include "reproduce/tool_render.hpp"

namespace haptic::sim::reproduce {
namespace {

constexpr std::array kFishColour{0.36, 0.50, 0.62};

struct Shot {
    double time_s;
    const char* name;
    const char* caption;
    Vec3 camera;
};

// The script of fish-grab.
constexpr double kLifted = 1.7;  // s
constexpr double kLowered = 5.0;
constexpr std::array<Shot, 6> kShots{
    {{0.5, "1-over", "The open hand comes down over the fish.", {-0.9, 0.35, 0.6}},
     {1.1, "2-closed", "It has closed round it.", {-0.9, 0.2, 0.5}},
     {2.0, "3-carried", "Lifted and carried: nothing is under the fish.", {-0.9, 0.0, 0.5}},
     {2.7, "4-head-down", "Turned by 90 degrees, the fish hangs with its head down.", {-0.4, 0.1, 0.9}},
     {3.6, "5-palm-up", "Turned over, the palm up.", {-0.9, 0.35, 0.6}},
     {6.0, "6-let-go", "Put down, and let go.", {-0.9, 0.35, 0.6}}}};

double mean_height(const Simulation& simulation) {
    double sum = 0.0;
    for (const Vec3& p : simulation.model().position) {
        sum += p.y;
    }
    return sum / static_cast<double>(simulation.model().size());
}

void take(const Study& study, Figure& figure, const SceneRun& run, const Shot& shot) {
    ToolPicture picture = tool_picture(run, shot.caption, ToolLook::Skin);
    picture.scene.objects.resize(2);  // fish and hand: not where the hand would be without the fish
    picture.scene.objects.front().colour = kFishColour;
    picture.scene.camera = shot.camera;
    picture.scene.tile = 0.05;
    const Vec3 middle = run.result().proxy - Vec3(0.0, 0.02, 0.0);
    picture.scene.view = PictureBox{middle - 0.11, middle + 0.11};
    study.picture(figure, "figure-5.8-" + std::string(shot.name), shot.caption, picture.scene);
}

/// What the grip is while the fish is in the air.
struct InTheAir {
    std::size_t fewest = ToolSettings::kMostSpheres;  // spheres in contact
    std::size_t most = 0;
    double steps = 0.0;
    double up = 0.0;  // N, sum over the steps, on the fish

    void add(const StepResult& result) {
        fewest = std::min(fewest, result.collided);
        most = std::max(most, result.collided);
        up -= result.force.y;
        steps += 1.0;
    }
};

/// m, height at which the line through the stick's spheres passes over the rod, which lies at 0; below it, it is
/// negative.
double height_at_rod(const ToolProxies& tool) {
    std::vector<ToolParticle> row(tool.particles().begin(), tool.particles().end());
    std::sort(row.begin(), row.end(),
              [](const ToolParticle& p, const ToolParticle& q) { return p.rest_offset.z < q.rest_offset.z; });
    for (std::size_t k = 1; k < row.size(); ++k) {
        const Vec3& a = row[k - 1].position;
        const Vec3& b = row[k].position;
        if ((a.z <= 0.0) != (b.z <= 0.0)) {
            return a.y - (b.y - a.y) * a.z / (b.z - a.z);
        }
    }
    return 0.0;
}

/// The height of rod-gap's stick over the rod in the end of the press, and a picture of it. `force` is N, up.
double press_on_rod(const Study& study, Figure& figure, bool closed, std::uint64_t& escapes, double& force) {
    SceneRun run("rod-gap", {std::string("tool.close_gaps=") + (closed ? "true" : "false")}, study.clock());
    while (run.time_s() < 1.2) {
        run.step();
    }
    ToolPicture picture = tool_picture(run, "the stick on the rod", ToolLook::Spheres);
    picture.scene.camera = {0.9, 0.35, 0.5};
    const Vec3 middle(0.0, run.result().proxy.y, 0.0225);
    picture.scene.view = PictureBox{middle - 0.09, middle + 0.09};
    study.picture(figure, closed ? "figure-5.9-closed" : "figure-5.9-open",
                  closed ? "Gaps closed: the rod is held, and the stick bends over it."
                         : "As in the thesis: the rod has gone through between two spheres.",
                  picture.scene);
    escapes += run.escapes();
    force = run.result().force.y;
    return height_at_rod(run.simulation().tool());
}

}  // namespace

Figure fish_grip(const Study& study) {
    Figure figure;
    figure.number = "5.8";
    figure.title = "a hand closes round a fish";
    figure.conditions =
        "Scene fish-grab: the hand of 37 spheres, 19 cm long, picks up a fish of 22 cm and 142 g (1,700 triangles, 137 "
        "particles) from the ground, carries it aside, turns over with it and back, puts it down and lets go. Its rest "
        "shape follows its curl; what holds the fish is friction, 0.9.";
    SceneRun run("fish-grab", {}, study.clock());
    CsvWriter csv(study.data(figure, "figure-5.8"), {"time_s", "curl", "hand_y_m", "fish_y_m", "force_x_n", "force_y_n",
                                                     "force_z_n", "particles_in_contact"});
    InTheAir held;
    std::size_t next = 0;
    while (!run.over()) {
        const StepResult& result = run.step();
        csv.row(std::array{run.time_s(), result.curl, result.hip.y, mean_height(run.simulation()), result.force.x,
                           result.force.y, result.force.z, static_cast<double>(result.collided)});
        if (run.time_s() >= kLifted && run.time_s() < kLowered) {
            held.add(result);
        }
        if (next < kShots.size() && run.time_s() + 1e-9 >= kShots[next].time_s) {
            take(study, figure, run, kShots[next++]);
        }
    }
    csv.close();
    study.plot(figure, "figure-5.8-heights", "Heights of the hand and of the middle of the fish.",
               "set xlabel 'time, s'\nset ylabel 'm'\nplot 'figure-5.8.csv' using 1:3 skip 1 with lines lw 2 lc rgb "
               "'#c8553d' title 'hand', '' using 1:4 skip 1 with lines lw 2 lc rgb '#2a6f97' title 'fish', '' using "
               "1:(0.1*$2) skip 1 with lines dt 2 lc rgb '#999999' title 'curl, tenths'\n");
    double weight = 0.0;
    for (const double mass : run.simulation().model().mass) {
        weight -= mass * run.simulation().scene().solver.gravity.y;
    }
    figure.comparisons = {
        {"what can be done with the hand", "\"tapping, catching, pressing, and probing\" (a curtain)",
         "gripping and lifting as well"},
        {"pose of the hand", "one", "closes, by 15 joints and one number"},
        {"spheres in contact while the fish is in the air", "-",
         std::to_string(held.fewest) + " to " + std::to_string(held.most) + " of 37"},
        {"force up on the fish then, mean, against its weight", "-",
         shown(held.up / held.steps, 2) + " N, " + shown(weight, 2) + " N"},
        {"particles through which something passed (independent check of each one's way)", "-",
         std::to_string(run.escapes())},
    };
    return figure;
}

Figure rod_in_gap(const Study& study) {
    Figure figure;
    figure.number = "5.9";
    figure.title = "a thin rod between two spheres";
    figure.conditions =
        "Scene rod-gap: a stick of five spheres with gaps of 25 mm is pressed onto a rod of 4 mm, between two of them, "
        "until the hand is 30 mm below it.";
    std::uint64_t escapes = 0;
    double held_by = 0.0;
    double open_force = 0.0;
    const double closed = press_on_rod(study, figure, true, escapes, held_by);
    const double open = press_on_rod(study, figure, false, escapes, open_force);
    figure.comparisons = {
        {"the tool as the thesis has it", "penetration (figure)",
         "goes through: it is " + shown(-1e3 * open, 1) + " mm below the rod, force " + shown(open_force, 2) + " N"},
        {"with tool.close_gaps", "-",
         "held: it passes " + shown(1e3 * closed, 1) + " mm over the rod's axis, force " + shown(held_by, 2) + " N"},
        {"spheres through which something passed (independent check of each one's way)", "-", std::to_string(escapes)},
    };
    return figure;
}

}  // namespace haptic::sim::reproduce
