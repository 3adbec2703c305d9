// Not a figure of the thesis, which tests every triangle: how the time of a step grows with triangles that are far
// away.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "haptic/config.hpp"
#include "haptic/csv.hpp"
#include "haptic/sim/contact/planes_in_reach.hpp"
#include "contact/pop_out.hpp"
#include "contact/secure_position.hpp"
#include "contact/swept_tree.hpp"
#include "contact/virtual_proxy.hpp"
#include "haptic/sim/scene.hpp"
#include "haptic/sim/simulation.hpp"
#include "reproduce/scene_run.hpp"
#include "reproduce/study.hpp"

namespace haptic::sim::reproduce {
namespace {

struct Stage {
    const char* column;
    std::int64_t StageTimes::* time_ns;
};
constexpr std::array<Stage, 5> kStages{{{"total", &StageTimes::total_ns},
                                        {"ccd", &StageTimes::ccd_ns},
                                        {"popout", &StageTimes::popout_ns},
                                        {"proxy", &StageTimes::proxy_ns},
                                        {"skin", &StageTimes::skin_ns}}};
constexpr std::size_t kTotal = 0;
constexpr std::size_t kCcd = 1;
constexpr std::size_t kSkin = 4;
using Medians = std::array<double, kStages.size()>;  // us

struct StepCost {
    std::size_t triangles = 0;
    Medians standing{};  // of steps in contact, while what is far away stands
    Medians moving{};    // while it moves
};

constexpr double kHalfPeriod = 0.2;  // s, for which the far bodies stand, then move, by turns
constexpr double kFarAway = 20.0;    // m
constexpr double kJourney = 0.1;     // m, there and back
constexpr int kMostRefinements = 4;  // 870,400 triangles far away

/// The fish under the sliding hand, and two more far away that no force moves: they are led a little way, stand, are
/// led back, and stand. Each refinement makes four triangles of one; their particles are few and stay as many.
Scene scene_with_far_fish(int refinements) {
    Scene scene = read_scene(open_scene("fish-slide"), "fish-slide");
    ModelSettings far = scene.model;
    far.fish.refinements = static_cast<std::uint32_t>(refinements);
    far.builder.particles = 8;
    far.builder.neighbours = 4;
    Region whole;
    whole.low = Vec3(-1.0);
    whole.high = Vec3(1.0);
    whole.motion_times = {0.0, kHalfPeriod, 2.0 * kHalfPeriod, 3.0 * kHalfPeriod, 4.0 * kHalfPeriod};
    const Vec3 there(kJourney, 0.0, 0.0);
    whole.motion_offsets = {Vec3(0.0), Vec3(0.0), there, there, Vec3(0.0)};
    whole.motion_repeat = true;
    far.regions = {whole};
    far.copies = {Placement{.position = {kFarAway, 0.0, 0.0}}, Placement{.position = {-kFarAway, 0.0, 0.0}}};
    scene.objects.push_back(far);
    scene.duration_s = 3.0;  // in contact for two of them
    return scene;
}

/// The first vertex of the first body far away.
Vec3 far_vertex(const Simulation& simulation) {
    return simulation.vertices()[simulation.bodies().at(1).first_vertex];
}

StepCost measure_steps(const Scene& scene, std::int64_t (*clock)()) {
    Simulation simulation(scene, clock);
    const std::int64_t step_ns = nanoseconds(scene.solver.step);
    std::array<std::array<std::vector<double>, kStages.size()>, 2> times_us;  // standing, moving
    // What has come to rest is fitted once more in the step after, which is in neither count.
    int alike = 0;
    bool moved_before = false;
    for (std::int64_t t = 0; t < nanoseconds(scene.duration_s); t += step_ns) {
        const Vec3 before = far_vertex(simulation);
        const StepResult result = simulation.step(simulation.scripted_input(t));
        const bool moved = far_vertex(simulation) != before;
        alike = moved == moved_before ? alike + 1 : 0;
        moved_before = moved;
        if (alike < 2 || !result.in_contact) {
            continue;
        }
        for (std::size_t s = 0; s < kStages.size(); ++s) {
            times_us[moved ? 1 : 0][s].push_back(static_cast<double>(result.times.*kStages[s].time_ns) * 1e-3);
        }
    }
    StepCost cost;
    cost.triangles = simulation.mesh().triangles.size();
    for (std::size_t s = 0; s < kStages.size(); ++s) {
        cost.standing[s] = quantile(times_us[0][s], 0.5);
        cost.moving[s] = quantile(times_us[1][s], 0.5);
    }
    return cost;
}

constexpr double kRadius = 0.03;       // m, of the sphere on the floor
constexpr double kCell = 1.0 / 32.0;   // m: triangles as large as those of the thesis' cloth
constexpr double kUnevenness = 0.001;  // m

/// A floor, slightly domed, that rises by 0.1 mm in the step: of the thesis' triangles, all but some forty far away
/// from the sphere that rests on its middle.
class Floor {
  public:
    explicit Floor(double about) {
        const auto cells = static_cast<std::uint32_t>(std::ceil(std::sqrt(0.5 * about)));
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
    double query_us = 0.0;  // secure position, pop-out, virtual proxy and planes in reach of one sphere
    double refit_us = 0.0;  // of all triangles
};

// Medians of so many.
constexpr int kQueriesASide = 20;
constexpr int kQueries = kQueriesASide * kQueriesASide;
constexpr int kRefits = 20;
constexpr double kFewest = 1024.0;
constexpr int kDoublings = 10;  // to 1,048,576

QueryCost measure_query(double about, std::int64_t (*clock)()) {
    const Floor floor(about);
    SweptTree tree(floor.rest(), floor.motion().triangles);
    const auto us_of = [clock](auto&& act) {
        const std::int64_t before = clock();
        act();
        return 1e-3 * static_cast<double>(clock() - before);
    };
    std::vector<double> refits_us;
    refits_us.reserve(kRefits);
    for (int k = 0; k < kRefits; ++k) {
        refits_us.push_back(us_of([&] { tree.refit(floor.motion()); }));
    }
    const std::array<MovingSurface, 1> surfaces{MovingSurface{floor.motion(), &tree}};
    const ContactSettings settings;
    std::vector<double> queries_us;
    queries_us.reserve(kQueries);
    for (int k = 0; k < kQueries; ++k) {
        // Each time elsewhere, within a cell, so that it is not always the same triangles.
        const int along = k % kQueriesASide;
        const int across = k / kQueriesASide;
        const Vec3 resting(kCell * along / kQueriesASide, kRadius, kCell * across / kQueriesASide);
        queries_us.push_back(us_of([&] {
            const SecurePosition secure = secure_position(surfaces, resting, kRadius, settings);
            const PopOut popped = pop_out(surfaces, secure.position, kRadius, settings);
            const Vec3 goal = resting - Vec3(0.0, 0.01, 0.0);
            const ProxyMove move = move_proxy(surfaces, popped.position, goal, kRadius, 0.01, settings);
            (void)planes_in_reach(surfaces, move.contacts,
                                  {.position = move.position, .radius = kRadius, .reach = 0.8 * kRadius, .dt = 0.01});
        }));
    }
    return {floor.triangles(), quantile(queries_us, 0.5), quantile(refits_us, 0.5)};
}

std::string many(std::size_t triangles) {
    std::string digits = std::to_string(triangles);
    for (auto at = static_cast<std::ptrdiff_t>(digits.size()) - 3; at > 0; at -= 3) {
        digits.insert(static_cast<std::size_t>(at), ",");
    }
    return digits;
}

std::vector<StepCost> steps(const Study& study, Figure& figure) {
    std::vector<std::string> columns{"triangles"};
    for (const char* far : {"_standing_us", "_moving_us"}) {
        for (const Stage& stage : kStages) {
            columns.push_back(std::string(stage.column) + far);
        }
    }
    CsvWriter csv(study.data(figure, "scaling-step"), columns);
    std::vector<StepCost> costs;
    for (int refinements = 0; refinements <= kMostRefinements; ++refinements) {
        costs.push_back(measure_steps(scene_with_far_fish(refinements), study.clock()));
        std::vector<double> row{static_cast<double>(costs.back().triangles)};
        row.insert(row.end(), costs.back().standing.begin(), costs.back().standing.end());
        row.insert(row.end(), costs.back().moving.begin(), costs.back().moving.end());
        csv.row(row);
    }
    csv.close();
    return costs;
}

std::vector<QueryCost> queries(const Study& study, Figure& figure) {
    CsvWriter csv(study.data(figure, "scaling-query"), {"triangles", "query_us", "refit_us"});
    std::vector<QueryCost> costs;
    for (int k = 0; k <= kDoublings; ++k) {
        costs.push_back(measure_query(std::ldexp(kFewest, k), study.clock()));
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
    figure.title = "a step among many triangles";
    figure.conditions =
        "Not in the thesis. Above: the hand slides along the fish of scene fish-slide (1,700 triangles) while two more "
        "fish, 20 m away and of ever finer mesh, stand and move by turns; medians of the steps in contact, one core. "
        "Below: a sphere rests on a floor of triangles as large as the thesis' cloth has them, all but some forty of "
        "them far away; all that a step asks of the contact code, and the refit of the tree if the whole floor moves.";
    const std::vector<StepCost> step = steps(study, figure);
    const std::vector<QueryCost> query = queries(study, figure);
    study.plot(
        figure, "scaling-step", "Time of a step in contact by stage; both axes logarithmic.",
        "set xlabel 'triangles, all but 1,700 far away'\nset ylabel 'us'\nset logscale xy\nset xrange [1e3:2e6]\nset "
        "format x "
        "'10^{%L}'\n"
        "plot 'scaling-step.csv' using 'triangles':'total_moving_us' with linespoints pt 7 lw 2 lc rgb '#c8553d' "
        "title 'whole step, far bodies move', '' using 'triangles':'ccd_moving_us' with linespoints pt 5 dt 2 lc "
        "rgb '#b3710f' title 'refit and CCD', '' using 'triangles':'skin_moving_us' with linespoints pt 9 dt 2 "
        "lc rgb '#8a6fb0' title 'skinning', '' using 'triangles':'total_standing_us' with linespoints pt 7 lw 2 "
        "lc rgb '#2a6f97' title 'whole step, far bodies stand'\n");
    study.plot(
        figure, "scaling-query", "Cost of the contact itself, and of the refit of all; both axes logarithmic.",
        "set xlabel 'triangles, all but some forty far away'\nset ylabel 'us'\nset logscale xy\nset xrange "
        "[1e3:2e6]\nset format x "
        "'10^{%L}'\n"
        "plot 'scaling-query.csv' using 'triangles':'refit_us' with linespoints pt 5 dt 2 lc rgb '#b3710f' title "
        "'refit, if all move', '' using 'triangles':'query_us' with linespoints pt 7 lw 2 lc rgb '#2a6f97' title "
        "'CCD, pop-out, virtual proxy, planes'\n");
    const StepCost& few = step.front();
    const StepCost& most = step.back();
    const auto per_triangle_ns = [&](std::size_t stage) {
        return 1e3 * (most.moving[stage] - few.moving[stage]) / static_cast<double>(most.triangles - few.triangles);
    };
    figure.comparisons = {
        {"contact of one sphere among " + many(query.front().triangles) + " / " + many(query.back().triangles) +
             " triangles",
         "each triangle is tested: 73 to 244 ns apiece (section 4.4.1)",
         shown(query.front().query_us, 1) + " / " + shown(query.back().query_us, 1) + " us"},
        {"whole step, " + many(few.triangles) + " / " + many(most.triangles) + " triangles, those far away stand", "-",
         shown(few.standing[kTotal], 0) + " / " + shown(most.standing[kTotal], 0) + " us"},
        {"the same, those far away move", "-",
         shown(few.moving[kTotal], 0) + " / " + shown(most.moving[kTotal], 0) + " us"},
        {"of it for each moving triangle: refit / skinning", "-",
         shown(per_triangle_ns(kCcd), 1) + " / " + shown(per_triangle_ns(kSkin), 1) + " ns"},
    };
    figure.remarks =
        "What must grow with the triangles is what is done to those that move: their vertices are skinned, and the "
        "boxes "
        "over them fitted again, a few nanoseconds each. What asks for contacts descends a tree and grows with its "
        "depth; among the largest meshes the rest is the caches' doing.";
    if (most.standing[kTotal] > 0.5 * most.moving[kTotal]) {
        figure.remarks += " Here, bodies that stand are skinned and fitted as well, which they need not be.";
    }
    return figure;
}

}  // namespace haptic::sim::reproduce
