// Benchmark of the simulation step: built-in scenes by timing stage, free and in contact; and the dynamics alone in the
// configurations of earlier figures. The contact stages must not delay a step by more than 1.5 of the scene's median
// step in contact (contact_p999_of_step), however the hand moves:
//
//     step_bench --benchmark_filter='scene/(four_fish|curtain_hand)_(in_contact|hostile)'
#include <benchmark/benchmark.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <optional>
#include <utility>
#include <vector>

#include "app/hand_sources.hpp"
#include "haptic/clock.hpp"
#include "haptic/denormals.hpp"
#include "haptic/sim/cloth.hpp"
#include "haptic/sim/elasticity.hpp"
#include "haptic/sim/scene.hpp"
#include "haptic/sim/simulation.hpp"
#include "haptic/sim/solver.hpp"
#include "strewn_body.hpp"

namespace haptic::sim {
namespace {

/// Quantile of the durations, us.
double quantile_us(std::vector<std::int64_t>& durations_ns, double part) {
    if (durations_ns.empty()) {
        return 0.0;
    }
    const auto at = durations_ns.begin() + static_cast<std::ptrdiff_t>(part * static_cast<double>(durations_ns.size()));
    std::nth_element(durations_ns.begin(), at, durations_ns.end());
    return static_cast<double>(*at) * 1e-3;
}

struct Stage {
    const char* counter;
    std::int64_t StageTimes::* time_ns;
};
constexpr std::array<Stage, 8> kStages{{{"ccd_us", &StageTimes::ccd_ns},
                                        {"popout_us", &StageTimes::popout_ns},
                                        {"tool_us", &StageTimes::tool_ns},
                                        {"proxy_us", &StageTimes::proxy_ns},
                                        {"collide_us", &StageTimes::collide_ns},
                                        {"deform_us", &StageTimes::deform_ns},
                                        {"skin_us", &StageTimes::skin_ns},
                                        {"total_us", &StageTimes::total_ns}}};

/// Time of the contact stages of a step, ns.
std::int64_t contact_ns(const StageTimes& t) {
    return t.ccd_ns + t.popout_ns + t.tool_ns + t.proxy_ns;
}

/// Step times of a scene, each the least of several runs. Runs are equal bit by bit, so the least time of a step is
/// that of its work, without interruptions by whatever else the machine does.
class LeastTimes {
  public:
    /// Runs `steps` steps of the scene; returns the time of the steps in contact, or of those without, ns.
    std::int64_t run(const Scene& scene, const HandSettings& hand, std::int64_t steps, bool in_contact) {
        Simulation simulation(scene, monotonic_now_ns);
        HandSources sources(hand, nullptr);
        sources.begin(simulation);
        const std::int64_t step_ns = nanoseconds(scene.solver.step);
        std::int64_t sum_ns = 0;
        std::size_t counted = 0;
        for (std::int64_t k = 0; k < steps; ++k) {
            const StepResult result =
                simulation.step(sources.at(simulation, {.scene_ns = k * step_ns, .step_ns = k * step_ns}));
            if (result.in_contact == in_contact) {
                record(counted++, result.times);
                sum_ns += result.times.total_ns;
            }
        }
        return sum_ns;
    }

    [[nodiscard]] std::size_t steps() const { return contact_ns_.size(); }
    [[nodiscard]] double stage_us(std::size_t stage, double part) { return quantile_us(stage_ns_[stage], part); }
    /// Of the contact stages together.
    [[nodiscard]] double contact_us(double part) { return quantile_us(contact_ns_, part); }

  private:
    /// Keeps the least time of step k and of each of its stages.
    void record(std::size_t k, const StageTimes& times) {
        const auto keep = [&](std::vector<std::int64_t>& least, std::int64_t taken_ns) {
            if (k == least.size()) {
                least.push_back(taken_ns);
            } else {
                least[k] = std::min(least[k], taken_ns);
            }
        };
        for (std::size_t s = 0; s < kStages.size(); ++s) {
            keep(stage_ns_[s], times.*kStages[s].time_ns);
        }
        keep(contact_ns_, contact_ns(times));
    }

    std::array<std::vector<std::int64_t>, kStages.size()> stage_ns_;  // by stage, then step
    std::vector<std::int64_t> contact_ns_;
};

constexpr double kRepeatedFor = 60.0;  // s, of a hand without end

/// A case of scene().
struct SceneRun {
    const char* scene;
    bool in_contact;
    bool hostile = false;  // a random hand replaces the scene's script
};

/// Runs a built-in scene and counts the steps in contact, or those without. The time of an iteration is that of all
/// these steps; items are steps. Counters are the medians of the stages, the 99.9 % quantile of the contact stages
/// together, and its ratio to the median whole step.
void scene(benchmark::State& state, const SceneRun& which) {
    const Scene scene = read_scene(open_scene(which.scene), which.scene);
    const HandSettings hand{
        .input = {}, .hostile_seed = which.hostile ? std::optional<std::uint64_t>(1) : std::nullopt, .scripted = true};
    const bool endless = which.hostile || scene.hand_repeats;
    const std::int64_t steps = nanoseconds(endless ? kRepeatedFor : scene.duration_s) / nanoseconds(scene.solver.step);
    LeastTimes least;
    for ([[maybe_unused]] const auto iteration : state) {
        state.SetIterationTime(1e-9 * static_cast<double>(least.run(scene, hand, steps, which.in_contact)));
    }
    if (least.steps() == 0) {
        state.SkipWithError("there are no such steps");
        return;
    }
    state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(least.steps()));
    for (std::size_t s = 0; s < kStages.size(); ++s) {
        state.counters[kStages[s].counter] = least.stage_us(s, 0.5);
    }
    const double contact_p999_us = least.contact_us(0.999);
    state.counters["contact_p999_us"] = contact_p999_us;
    state.counters["contact_p999_of_step"] = contact_p999_us / least.stage_us(kStages.size() - 1, 0.5);
}

/// Runs of a scene: 5, or as many as the environment asks for where no figure is read (toolchain/check bench).
int runs() {
    const char* const asked = std::getenv("HAPTIC_BENCH_RUNS");
    return asked == nullptr ? 5 : std::max(1, std::atoi(asked));
}

void each_run(benchmark::internal::Benchmark* bench) {
    bench->UseManualTime()->Iterations(runs())->Unit(benchmark::kMillisecond);
}
BENCHMARK_CAPTURE(scene, cloth_drop_free, {"cloth-drop", false})->Apply(each_run);
BENCHMARK_CAPTURE(scene, cloth_drop_in_contact, {"cloth-drop", true})->Apply(each_run);
BENCHMARK_CAPTURE(scene, popout_fan_free, {"popout-fan", false})->Apply(each_run);
BENCHMARK_CAPTURE(scene, popout_fan_in_contact, {"popout-fan", true})->Apply(each_run);
BENCHMARK_CAPTURE(scene, fish_hold_free, {"fish-hold", false})->Apply(each_run);
BENCHMARK_CAPTURE(scene, fish_hold_in_contact, {"fish-hold", true})->Apply(each_run);
BENCHMARK_CAPTURE(scene, fish_slide_free, {"fish-slide", false})->Apply(each_run);
BENCHMARK_CAPTURE(scene, fish_slide_in_contact, {"fish-slide", true})->Apply(each_run);
BENCHMARK_CAPTURE(scene, four_fish_free, {"four-fish", false})->Apply(each_run);
BENCHMARK_CAPTURE(scene, four_fish_in_contact, {"four-fish", true})->Apply(each_run);
BENCHMARK_CAPTURE(scene, four_fish_hostile, {"four-fish", true, true})->Apply(each_run);
BENCHMARK_CAPTURE(scene, gel_block_in_contact, {"gel-block", true})->Apply(each_run);
BENCHMARK_CAPTURE(scene, organ_lift_in_contact, {"organ-lift", true})->Apply(each_run);
BENCHMARK_CAPTURE(scene, curtain_hand_free, {"curtain-hand", false})->Apply(each_run);
BENCHMARK_CAPTURE(scene, curtain_hand_in_contact, {"curtain-hand", true})->Apply(each_run);
BENCHMARK_CAPTURE(scene, curtain_hand_hostile, {"curtain-hand", true, true})->Apply(each_run);

/// 1,089 groups and 4,160 links; the argument is the number of passes: 2 for a curtain. All numbers of lanes in one
/// run, so that their ratios can be compared.
void dynamics(benchmark::State& state) {
    const FlushDenormals flush;
    ParticleModel model = make_cloth_particles({}, 0.3, 1.0);
    for (std::size_t i = 0; i < model.size(); ++i) {
        model.position[i].y += 0.01 * static_cast<double>(i % 7);
    }
    ParticleSolver solver(
        model,
        {.iterations = static_cast<int>(state.range(0)), .rotation_iterations = static_cast<int>(state.range(1))},
        static_cast<std::size_t>(state.range(2)));
    for ([[maybe_unused]] const auto iteration : state) {
        solver.step(model, {});
    }
}

void each_number_of_lanes(benchmark::internal::Benchmark* bench) {
    bench->ArgNames({"iterations", "rotation_iterations", "lanes"});
    for (const auto& [iterations, rotation_iterations] : {std::pair{2, 1}, {2, 2}, {8, 2}}) {
        for (const std::size_t lanes : ParticleSolver::usable_lanes()) {
            bench->Args({iterations, rotation_iterations, static_cast<std::int64_t>(lanes)});
        }
    }
}
BENCHMARK(dynamics)->Apply(each_number_of_lanes)->Unit(benchmark::kMicrosecond);

/// A step of one sub-step of a cloth with a material, to be divided by that of dynamics/iterations:2 with as many
/// lanes.
void material_dynamics(benchmark::State& state) {
    const FlushDenormals flush;
    ParticleModel model = make_cloth_particles({}, 0.3, 1.0);
    model.elasticity = make_sheet(model, make_cloth_mesh({}), std::vector<SheetMaterial>(model.size()));
    model.groups.clear();
    model.links.clear();
    for (std::size_t i = 0; i < model.size(); ++i) {
        model.position[i].y += 0.01 * static_cast<double>(i % 7);
    }
    ParticleSolver solver(model, {.step = 0.002, .iterations = 1}, static_cast<std::size_t>(state.range(0)));
    for ([[maybe_unused]] const auto iteration : state) {
        solver.step(model, {});
    }
}
BENCHMARK(material_dynamics)
    ->ArgName("lanes")
    ->Apply([](benchmark::internal::Benchmark* bench) {
        for (const std::size_t lanes : ParticleSolver::usable_lanes()) {
            bench->Arg(static_cast<std::int64_t>(lanes));
        }
    })
    ->Unit(benchmark::kMicrosecond);

/// The dynamics of four-fish without contacts: 548 particles in four bent bodies, each particle with a group of nine; 5
/// iterations.
void four_bodies(benchmark::State& state) {
    const FlushDenormals flush;
    ParticleModel model;
    for (std::uint32_t body = 0; body < 4; ++body) {
        model.append(strewn_body(body, 0.6));
    }
    for (Vec3& x : model.position) {
        x.z += 2.0 * x.x * x.x;
    }
    ParticleSolver solver(model, {.gravity = Vec3(0.0)}, static_cast<std::size_t>(state.range(0)));
    for ([[maybe_unused]] const auto iteration : state) {
        solver.step(model, {});
    }
}
BENCHMARK(four_bodies)
    ->ArgName("lanes")
    ->Apply([](benchmark::internal::Benchmark* bench) {
        for (const std::size_t lanes : ParticleSolver::usable_lanes()) {
            bench->Arg(static_cast<std::int64_t>(lanes));
        }
    })
    ->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace haptic::sim

BENCHMARK_MAIN();
