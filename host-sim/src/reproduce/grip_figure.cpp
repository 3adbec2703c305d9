// Figures 5.8, a deformable hand that grips, and 5.9, a thin rod between two spheres of a tool.

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <string>
#include <vector>

#include "haptic/csv.hpp"
#include "haptic/types.hpp"
#include "reproduce/scene_run.hpp"
#include "reproduce/study.hpp"
#include "reproduce/tool_picture.hpp"
#include "tool/tool_proxies.hpp"

namespace haptic::sim::reproduce {
namespace {

constexpr std::array kFishColour{0.36, 0.50, 0.62};

// The hand rolls until the palm is up, and back; times, positions and curl are fish-grab's own. The grip of a device on
// strings cannot roll that far, so the scene's script does not.
constexpr const char* kRollOver =
    "hand.orientations=[1, 0, 0, 0,  1, 0, 0, 0,  1, 0, 0, 0,  1, 0, 0, 0,  1, 0, 0, 0, "
    "0.7071067811865476, 0, 0, -0.7071067811865475,  0.7071067811865476, 0, 0, -0.7071067811865475, "
    "0, 0, 0, -1,  0, 0, 0, -1,  0.7071067811865476, 0, 0, -0.7071067811865475, "
    "1, 0, 0, 0,  1, 0, 0, 0,  1, 0, 0, 0,  1, 0, 0, 0,  1, 0, 0, 0,  1, 0, 0, 0]";

// Times of fish-grab's script.
constexpr double kLifted = 1.7;  // s
constexpr double kLowered = 5.0;
constexpr std::array<Shot, 6> kShots{
    {{0.5, "1-over", "The open hand comes down over the fish.", {-0.9, 0.35, 0.6}},
     {1.1, "2-closed", "It has closed around the fish.", {-0.9, 0.2, 0.5}},
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

void take_of_grip(const Study& study, Figure& figure, const SceneRun& run, const Shot& shot) {
    ToolPicture picture = tool_picture(run, shot.caption, ToolStyle::Skin);
    picture.scene.objects.resize(2);  // fish and hand, without the copy at the device's pose
    picture.scene.objects.front().colour = kFishColour;
    picture.scene.camera = shot.camera;
    picture.scene.tile = 0.05;
    const Vec3 middle = run.result().proxy - Vec3(0.0, 0.02, 0.0);
    picture.scene.view = Aabb{middle - 0.11, middle + 0.11};
    study.picture(figure, "figure-5.8-" + std::string(shot.name), shot.caption, picture.scene);
}

/// Statistics of the steps in which the hand holds the fish in the air.
struct GraspStatistics {
    std::size_t min_spheres = ToolSettings::kMaxSpheres;  // spheres in contact
    std::size_t max_spheres = 0;
    double steps = 0.0;
    double up = 0.0;  // N, on the fish, sum over the steps

    void add(const StepResult& result) {
        min_spheres = std::min(min_spheres, result.collided);
        max_spheres = std::max(max_spheres, result.collided);
        up -= result.force.y;
        steps += 1.0;
    }
};

/// The stick's spheres, sorted along it.
std::vector<ToolProxy> spheres_along(const ToolProxies& tool) {
    std::vector<ToolProxy> row(tool.particles().begin(), tool.particles().end());
    std::sort(row.begin(), row.end(),
              [](const ToolProxy& p, const ToolProxy& q) { return p.rest_offset.z < q.rest_offset.z; });
    return row;
}

/// Largest strain between neighbouring spheres, positive or negative: length / length at rest - 1.
double largest_strain(const std::vector<ToolProxy>& row) {
    double largest = 0.0;
    for (std::size_t k = 1; k < row.size(); ++k) {
        const double rest = glm::length(row[k].rest_offset - row[k - 1].rest_offset);
        const double strain = glm::length(row[k].position - row[k - 1].position) / rest - 1.0;
        largest = std::abs(strain) > std::abs(largest) ? strain : largest;
    }
    return largest;
}

/// Height of the line through the stick's spheres where it passes the rod, m; the rod is at 0, negative is below it.
double height_at_rod(const std::vector<ToolProxy>& row) {
    // Interpolate between the two spheres beside the rod, at z = 0.
    for (std::size_t k = 1; k < row.size(); ++k) {
        const Vec3& a = row[k - 1].position;
        const Vec3& b = row[k].position;
        if ((a.z <= 0.0) != (b.z <= 0.0)) {
            return a.y - (b.y - a.y) * a.z / (b.z - a.z);
        }
    }
    return 0.0;
}

/// The stick at the end of the press.
struct PressedStick {
    double height = 0.0;  // m, over the rod
    double force = 0.0;   // N, up
    double strain = 0.0;  // 1, the largest between neighbouring spheres
    std::uint64_t escapes = 0;
};

/// Runs rod-gap until the end of the press and takes pictures of stick and rod: the stick's mesh, and its spheres.
PressedStick press_on_rod(const Study& study, Figure& figure, bool closed) {
    SceneRun run("rod-gap", {std::string("tool.close_gaps=") + (closed ? "true" : "false")}, study.clock());
    while (run.time_s() < 1.2) {
        run.step();
    }
    const Vec3 middle(0.0, run.result().proxy.y, 0.0225);
    for (const ToolStyle style : {ToolStyle::Skin, ToolStyle::Spheres}) {
        ToolPicture picture = tool_picture(run, "the stick on the rod", style);
        picture.scene.camera = {0.9, 0.35, 0.5};
        picture.scene.view = Aabb{middle - 0.09, middle + 0.09};
        const std::string name = std::string("figure-5.9-") + (closed ? "closed" : "open");
        if (style == ToolStyle::Skin) {
            study.picture(figure, name,
                          closed ? "Gaps closed: the rod holds the stick; grey: the pose of the device."
                                 : "As in the thesis: the rod has gone through the stick.",
                          picture.scene);
        } else {
            study.picture(
                figure, name + "-spheres",
                closed ? "Its spheres; those in contact are orange." : "The rod has passed between two spheres.",
                picture.scene);
        }
    }
    const std::vector<ToolProxy> row = spheres_along(run.simulation().tool());
    return {height_at_rod(row), run.result().force.y, largest_strain(row), run.escapes()};
}

}  // namespace

Figure fish_grip(const Study& study) {
    Figure figure;
    figure.number = "5.8";
    figure.title = "a hand closes around a fish";
    figure.conditions =
        "Scene fish-grab: the hand of 37 spheres, 19 cm long, picks up a fish of 22 cm and 142 g (1,700 "
        "triangles, 137 particles) from the ground, carries it aside, puts it down and releases it. Meanwhile it rolls "
        "over and back, farther than in the scene's own script. The rest shape of the hand follows its curl; the fish "
        "is held by friction, coefficient 0.9.";
    SceneRun run("fish-grab", {kRollOver}, study.clock());
    CsvWriter csv(study.data(figure, "figure-5.8"), {"time_s", "curl", "hand_y_m", "fish_y_m", "force_x_n", "force_y_n",
                                                     "force_z_n", "particles_in_contact"});
    GraspStatistics grasp;
    std::size_t next = 0;
    while (!run.finished()) {
        const StepResult& result = run.step();
        csv.row(std::array{run.time_s(), result.curl, result.hip.y, mean_height(run.simulation()), result.force.x,
                           result.force.y, result.force.z, static_cast<double>(result.collided)});
        if (run.time_s() >= kLifted && run.time_s() < kLowered) {
            grasp.add(result);
        }
        if (next < kShots.size() && run.time_s() + 1e-9 >= kShots[next].time_s) {
            take_of_grip(study, figure, run, kShots[next++]);
        }
    }
    csv.close();
    study.plot(figure, "figure-5.8-heights", "Heights of the hand and of the middle of the fish.",
               "set xlabel 'time, s'\nset ylabel 'm'\nplot 'figure-5.8.csv' using 1:3 skip 1 with lines lw 2 lc hand "
               "title 'hand', '' using 1:4 skip 1 with lines lw 2 lc 1 title 'fish', '' using "
               "1:(0.1*$2) skip 1 with lines dt 2 lc 5 title 'curl, tenths'\n");
    // Weight of the fish, N.
    double weight = 0.0;
    for (const double mass : run.simulation().model().mass) {
        weight -= mass * run.simulation().scene().solver.gravity.y;
    }
    figure.comparisons = {
        {"actions of the hand", "\"tapping, catching, pressing, and probing\" (a curtain)",
         "also gripping and lifting"},
        {"pose of the hand", "one", "closes: 15 joints, driven by one number"},
        {"spheres in contact while the fish is in the air", "-",
         std::to_string(grasp.min_spheres) + " to " + std::to_string(grasp.max_spheres) + " of 37"},
        {"mean upward force on the fish meanwhile, and its weight", "-",
         format_fixed(grasp.up / grasp.steps, 2) + " N, " + format_fixed(weight, 2) + " N"},
        {"particles through which something passed (independent check of each path)", "-",
         std::to_string(run.escapes())},
    };
    return figure;
}

Figure rod_in_gap(const Study& study) {
    Figure figure;
    figure.number = "5.9";
    figure.title = "a thin rod between two spheres";
    figure.conditions =
        "Scene rod-gap: a stick of five spheres with gaps of 25 mm is pressed onto a rod of 4 mm, between two "
        "spheres, until the hand is 30 mm below the rod.";
    const PressedStick closed = press_on_rod(study, figure, true);
    const PressedStick open = press_on_rod(study, figure, false);
    figure.comparisons = {
        {"the tool as in the thesis", "penetration (figure)",
         "goes through: it is " + format_fixed(-1e3 * open.height, 1) + " mm below the rod, force " +
             format_fixed(open.force, 2) + " N"},
        {"with tool.close_gaps", "-",
         "held: it passes " + format_fixed(1e3 * closed.height, 1) + " mm over the rod's axis, force " +
             format_fixed(closed.force, 2) + " N"},
        {"largest strain of the held stick between neighbouring spheres", "-",
         format_fixed(100.0 * closed.strain, 1) + " %"},
        {"spheres through which something passed (independent check of each path)", "-",
         std::to_string(closed.escapes + open.escapes)},
    };
    return figure;
}

}  // namespace haptic::sim::reproduce
