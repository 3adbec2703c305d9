// Scaling (not in the thesis, which tests every triangle): time of a step against the number of triangles far away, and
// of whole scenes that grow.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "contact/pop_out.hpp"
#include "contact/secure_position.hpp"
#include "contact/speculative_planes.hpp"
#include "contact/swept_tree.hpp"
#include "contact/virtual_proxy.hpp"
#include "haptic/config.hpp"
#include "haptic/csv.hpp"
#include "haptic/sim/scene.hpp"
#include "haptic/sim/simulation.hpp"
#include "program/progress_bar.hpp"
#include "reproduce/growth_figure.hpp"
#include "reproduce/scene_run.hpp"
#include "reproduce/study.hpp"

namespace haptic::sim::reproduce {
namespace {

struct TimedStage {
    const char* column;
    std::int64_t StageTimes::* time_ns;
};
constexpr std::array<TimedStage, 5> kTimedStages{{{"total", &StageTimes::total_ns},
                                                  {"ccd", &StageTimes::ccd_ns},
                                                  {"popout", &StageTimes::popout_ns},
                                                  {"proxy", &StageTimes::proxy_ns},
                                                  {"skin", &StageTimes::skin_ns}}};
constexpr std::size_t kTotal = 0;
constexpr std::size_t kCcd = 1;
constexpr std::size_t kSkin = 4;
using Medians = std::array<double, kTimedStages.size()>;  // us

struct StepCost {
    std::size_t triangles = 0;
    Medians at_rest{};  // of steps in contact while the far bodies rest
    Medians moving{};   // while they move
};

constexpr double kBuildingPart = 0.1;  // of the time of a refinement, roughly
constexpr double kHalfPeriod = 0.2;    // s, for which the far bodies rest, then move, in turn
constexpr double kFarDistance = 20.0;  // m
constexpr double kFarTravel = 0.1;     // m, there and back
constexpr int kMaxRefinements = 4;     // 870,400 triangles far away

/// The fish under the sliding hand, and two more far away that no force moves: they are moved a little, rest, are moved
/// back, and rest. Each refinement splits a triangle into four; the number of their particles stays small and constant.
Scene scene_with_far_fish(int refinements) {
    Scene scene = read_scene(open_scene("fish-slide"), "fish-slide");
    // The far fish: a copy of the model with a finer mesh and few particles.
    ModelSettings far = scene.model;
    far.fish.refinements = static_cast<std::uint32_t>(refinements);
    far.builder.particles = 8;
    far.builder.neighbours = 4;
    // The whole body follows a scripted motion: rest, move, rest, move back.
    Region whole;
    whole.low = Vec3(-1.0);
    whole.high = Vec3(1.0);
    whole.motion_times = {0.0, kHalfPeriod, 2.0 * kHalfPeriod, 3.0 * kHalfPeriod, 4.0 * kHalfPeriod};
    const Vec3 there(kFarTravel, 0.0, 0.0);
    whole.motion_offsets = {Vec3(0.0), Vec3(0.0), there, there, Vec3(0.0)};
    whole.motion_repeat = true;
    far.regions = {whole};
    // One copy on either side.
    far.copies = {Placement{.position = {kFarDistance, 0.0, 0.0}}, Placement{.position = {-kFarDistance, 0.0, 0.0}}};
    scene.objects.push_back(far);
    scene.duration_s = 3.0;  // in contact for two of them
    return scene;
}

/// The first vertex of the first body far away.
Vec3 far_vertex(const Simulation& simulation) {
    return simulation.vertices()[simulation.bodies().at(1).first_vertex];
}

StepCost measure_steps(const Scene& scene, std::int64_t (*clock)(), const Progress& progress) {
    Simulation simulation(scene, clock, part_of(progress, 0.0, kBuildingPart));
    const std::int64_t step_ns = nanoseconds(scene.solver.step);
    std::array<std::array<std::vector<double>, kTimedStages.size()>, 2> times_us;  // standing, moving
    // A body that has come to rest is refitted once more in the next step, which is counted in neither state.
    int alike = 0;
    bool moved_before = false;
    for (std::int64_t t = 0; t < nanoseconds(scene.duration_s); t += step_ns) {
        report(progress, kBuildingPart + (1.0 - kBuildingPart) * seconds(t) / scene.duration_s);
        // Whether the far bodies moved in this step shows in one of their vertices.
        const Vec3 before = far_vertex(simulation);
        const StepResult result = simulation.step(simulation.scripted_input(t));
        const bool moved = far_vertex(simulation) != before;
        alike = moved == moved_before ? alike + 1 : 0;
        moved_before = moved;
        if (alike < 2 || !result.in_contact) {
            continue;
        }
        for (std::size_t s = 0; s < kTimedStages.size(); ++s) {
            times_us[moved ? 1 : 0][s].push_back(static_cast<double>(result.times.*kTimedStages[s].time_ns) * 1e-3);
        }
    }
    StepCost cost;
    cost.triangles = simulation.mesh().triangles.size();
    for (std::size_t s = 0; s < kTimedStages.size(); ++s) {
        cost.at_rest[s] = quantile(times_us[0][s], 0.5);
        cost.moving[s] = quantile(times_us[1][s], 0.5);
    }
    return cost;
}

constexpr double kFloorRadius = 0.03;  // m, of the sphere on the floor
constexpr double kCell = 1.0 / 32.0;   // m: triangles as large as those of the thesis' cloth
constexpr double kUnevenness = 0.001;  // m

/// A slightly domed floor that rises by 0.1 mm in the step, of triangles as large as the thesis'; all but some forty
/// are far away from the sphere that rests on its middle.
class Floor {
  public:
    explicit Floor(double min_triangles) {
        // A square grid of cells with two triangles each; the sphere rests on its middle.
        const auto cells = static_cast<std::uint32_t>(std::ceil(std::sqrt(0.5 * min_triangles)));
        for (std::uint32_t i = 0; i <= cells; ++i) {
            for (std::uint32_t j = 0; j <= cells; ++j) {
                const double x = (i - 0.5 * cells) * kCell;
                const double z = (j - 0.5 * cells) * kCell;
                const double square = x * x + z * z;
                start_.emplace_back(x, -kUnevenness * square / (1.0 + square), z);
                end_.push_back(start_.back() + Vec3(0.0, 1e-4, 0.0));
            }
        }
        for (std::uint32_t i = 0; i < cells; ++i) {
            for (std::uint32_t j = 0; j < cells; ++j) {
                const std::uint32_t a = i * (cells + 1) + j;
                const std::uint32_t b = a + cells + 1;
                triangles_.push_back({a, a + 1, b + 1});
                triangles_.push_back({a, b + 1, b});
            }
        }
    }
    [[nodiscard]] SurfaceMotion motion() const { return {start_, end_, triangles_}; }
    [[nodiscard]] std::size_t triangles() const { return triangles_.size(); }
    [[nodiscard]] const std::vector<Vec3>& rest() const { return start_; }

  private:
    std::vector<Vec3> start_;
    std::vector<Vec3> end_;
    std::vector<Triangle> triangles_;
};

struct QueryCost {
    std::size_t triangles = 0;
    double query_us = 0.0;  // secure position, pop-out, virtual proxy and speculative planes of one sphere
    double refit_us = 0.0;  // of all triangles
};

// Numbers of repetitions, whose median is reported.
constexpr int kQueriesASide = 20;
constexpr int kQueries = kQueriesASide * kQueriesASide;
constexpr int kRefits = 20;
constexpr double kMinTriangles = 1024.0;
constexpr int kDoublings = 10;  // to 1,048,576

QueryCost measure_query(double min_triangles, std::int64_t (*clock)()) {
    const Floor floor(min_triangles);
    // Refit of the whole tree.
    SweptTree tree(floor.rest(), floor.motion().triangles);
    const auto us_of = [clock](auto&& action) {
        const std::int64_t before = clock();
        action();
        return 1e-3 * static_cast<double>(clock() - before);
    };
    std::vector<double> refits_us;
    refits_us.reserve(kRefits);
    for (int k = 0; k < kRefits; ++k) {
        refits_us.push_back(us_of([&] { tree.refit(floor.motion()); }));
    }
    // All contact queries of one sphere that rests on the floor and is pressed 10 mm into it.
    const std::array<MovingSurface, 1> surfaces{MovingSurface{floor.motion(), &tree}};
    const ContactSettings settings;
    std::vector<double> queries_us;
    queries_us.reserve(kQueries);
    for (int k = 0; k < kQueries; ++k) {
        // A different position within a cell each time, so that the queries do not always meet the same triangles.
        const int along = k % kQueriesASide;
        const int across = k / kQueriesASide;
        const Vec3 resting(kCell * along / kQueriesASide, kFloorRadius, kCell * across / kQueriesASide);
        queries_us.push_back(us_of([&] {
            const SecurePosition secure = secure_position(surfaces, resting, kFloorRadius, settings);
            const PopOut popped = pop_out(surfaces, secure.position, kFloorRadius, settings);
            const Vec3 goal = resting - Vec3(0.0, 0.01, 0.0);
            const ProxyMove move = move_proxy(surfaces, popped.position, goal, kFloorRadius, 0.01, settings);
            (void)speculative_planes(
                surfaces, move.contacts,
                {.position = move.position, .radius = kFloorRadius, .reach = 0.8 * kFloorRadius, .dt = 0.01});
        }));
    }
    return {floor.triangles(), quantile(queries_us, 0.5), quantile(refits_us, 0.5)};
}

std::vector<StepCost> steps(const Study& study, Figure& figure) {
    std::vector<std::string> columns{"triangles"};
    for (const char* far : {"_standing_us", "_moving_us"}) {
        for (const TimedStage& stage : kTimedStages) {
            columns.push_back(std::string(stage.column) + far);
        }
    }
    CsvWriter csv(study.data(figure, "scaling-step"), columns);
    std::vector<StepCost> costs;
    ProgressBar bar("measuring steps among triangles far away");
    for (int refinements = 0; refinements <= kMaxRefinements; ++refinements) {
        // Each refinement has four times as many triangles as the one before, so this one takes 4 to the number of
        // those that follow.
        const double share = std::ldexp(1.0, 2 * (refinements - kMaxRefinements));
        costs.push_back(measure_steps(scene_with_far_fish(refinements), study.clock(),
                                      [&](double done) { bar.show(share * (0.25 + 0.75 * done)); }));
        std::vector<double> row{static_cast<double>(costs.back().triangles)};
        row.insert(row.end(), costs.back().at_rest.begin(), costs.back().at_rest.end());
        row.insert(row.end(), costs.back().moving.begin(), costs.back().moving.end());
        csv.row(row);
    }
    csv.close();
    return costs;
}

std::vector<QueryCost> queries(const Study& study, Figure& figure) {
    CsvWriter csv(study.data(figure, "scaling-query"), {"triangles", "query_us", "refit_us"});
    std::vector<QueryCost> costs;
    ProgressBar bar("measuring queries among triangles far away");
    for (int k = 0; k <= kDoublings; ++k) {
        // Each floor is twice as large as the one before.
        bar.show(std::ldexp(1.0, k - kDoublings - 1));
        costs.push_back(measure_query(std::ldexp(kMinTriangles, k), study.clock()));
        const QueryCost& cost = costs.back();
        csv.row(std::array{static_cast<double>(cost.triangles), cost.query_us, cost.refit_us});
    }
    csv.close();
    return costs;
}

}  // namespace

Figure scaling(const Study& study) {
    Figure figure;
    figure.number = "scaling";
    figure.title = "a step among many triangles, and of scenes that grow";
    figure.conditions =
        "Not in the thesis. Medians of steps, with a thread for each processor, up to 8. First plot: the hand slides "
        "along the fish of scene fish-slide "
        "(1,700 triangles) while two "
        "more fish, 20 m away and with increasingly fine meshes, rest and move in turn. Second: a sphere rests on a "
        "floor of triangles as large as those of the thesis' cloth, "
        "all but some forty of them far away; all contact queries of a step, and the refit of the tree if the "
        "whole floor moves. Then whole scenes with their materials, as built in: copies of the heap of scene "
        "four-fish, 0.6 m apart, from when the fish fall on one another until the hand has poked one heap; and the "
        "cloth of scene cloth-drop with up to 100,489 vertices, at the end of its fall and in the catch. Memory is "
        "what the process grows by while it builds the simulation.";
    // Measure, plot, and compare the smallest with the largest mesh.
    const std::vector<StepCost> step = steps(study, figure);
    const std::vector<QueryCost> query = queries(study, figure);
    study.plot(
        figure, "scaling-step", "Time of a step in contact by stage; both axes logarithmic.",
        "set xlabel 'triangles, all but 1,700 far away'\nset ylabel 'us'\nset logscale y\neval log_axis('x', "
        "1e3, 2e6)\n"
        "plot 'scaling-step.csv' using 'triangles':'total_moving_us' with linespoints pt 7 lw 2 lc 2 "
        "title 'whole step, far bodies move', '' using 'triangles':'ccd_moving_us' with linespoints pt 5 dt 2 lc 4 "
        "title 'refit and CCD', '' using 'triangles':'skin_moving_us' with linespoints pt 9 dt 2 "
        "lc 6 title 'skinning', '' using 'triangles':'total_standing_us' with linespoints pt 7 lw 2 "
        "lc 1 title 'whole step, far bodies rest'\n");
    study.plot(figure, "scaling-query",
               "Time of the contact queries, and of the refit of all triangles; both axes logarithmic.",
               "set xlabel 'triangles, all but some forty far away'\nset ylabel 'us'\nset logscale y\neval "
               "log_axis('x', 1e3, 2e6)\n"
               "plot 'scaling-query.csv' using 'triangles':'refit_us' with linespoints pt 5 dt 2 lc 4 title "
               "'refit, if all move', '' using 'triangles':'query_us' with linespoints pt 7 lw 2 lc 1 title "
               "'CCD, pop-out, virtual proxy, planes'\n");
    const StepCost& smallest = step.front();
    const StepCost& largest = step.back();
    const auto per_triangle_ns = [&](std::size_t stage) {
        return 1e3 * (largest.moving[stage] - smallest.moving[stage]) /
               static_cast<double>(largest.triangles - smallest.triangles);
    };
    figure.comparisons = {
        {"contact of one sphere among " + with_separators(query.front().triangles) + " / " +
             with_separators(query.back().triangles) + " triangles",
         "each triangle is tested: 73 to 244 ns each (section 4.4.1)",
         format_fixed(query.front().query_us, 1) + " / " + format_fixed(query.back().query_us, 1) + " us"},
        {"whole step, " + with_separators(smallest.triangles) + " / " + with_separators(largest.triangles) +
             " triangles, those far away at rest",
         "-", format_fixed(smallest.at_rest[kTotal], 0) + " / " + format_fixed(largest.at_rest[kTotal], 0) + " us"},
        {"the same, those far away moving", "-",
         format_fixed(smallest.moving[kTotal], 0) + " / " + format_fixed(largest.moving[kTotal], 0) + " us"},
        {"of this, per moving triangle: refit / skinning", "-",
         format_fixed(per_triangle_ns(kCcd), 1) + " / " + format_fixed(per_triangle_ns(kSkin), 1) + " ns"},
    };
    figure.remarks =
        "Only the work on moving triangles must grow with their number: their vertices are skinned and the boxes "
        "over them refitted, a few nanoseconds each. A contact query descends a tree and grows with its depth; "
        "for the largest meshes the additional time is due to cache misses. Whole scenes take longer per particle as "
        "soon as they no longer fit into a cache, which bends the curves between 2,000 and 20,000 particles. Growth is "
        "therefore judged between the two largest sizes.";
    add_scene_growth(study, figure, {});
    if (largest.at_rest[kTotal] > 0.5 * largest.moving[kTotal]) {
        figure.remarks += " Here, bodies at rest are also skinned and refitted, which is unnecessary.";
    }
    return figure;
}

}  // namespace haptic::sim::reproduce
