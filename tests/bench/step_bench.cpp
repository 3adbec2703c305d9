// Benchmark of the simulation step: every built-in scene by timing stage, free and in contact; and the dynamics alone
// in the configurations of earlier figures.
//
//     step_bench --benchmark_filter=scene/four_fish
#include <benchmark/benchmark.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "haptic/clock.hpp"
#include "haptic/denormals.hpp"
#include "haptic/sim/cloth.hpp"
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
constexpr std::array<Stage, 7> kStages{{{"ccd_us", &StageTimes::ccd_ns},
                                        {"popout_us", &StageTimes::popout_ns},
                                        {"proxy_us", &StageTimes::proxy_ns},
                                        {"collide_us", &StageTimes::collide_ns},
                                        {"deform_us", &StageTimes::deform_ns},
                                        {"skin_us", &StageTimes::skin_ns},
                                        {"total_us", &StageTimes::total_ns}}};

/// Runs a built-in scene with its own script and counts the steps in contact, or those without. The time of an
/// iteration is that of all these steps; items are steps. Counters are the medians of the stages, and the 99.9 %
/// quantile of the proxy's stages together (ccd, popout, proxy).
void scene(benchmark::State& state, const std::string& name, bool in_contact) {
    const Scene scene = read_scene(open_scene(name), name);
    const std::int64_t step_ns = nanoseconds(scene.solver.step);
    const std::int64_t steps = nanoseconds(scene.duration_s) / step_ns;
    std::array<std::vector<std::int64_t>, kStages.size()> times_ns;
    std::vector<std::int64_t> contact_ns;
    for ([[maybe_unused]] const auto iteration : state) {
        Simulation simulation(scene, monotonic_now_ns);
        std::int64_t sum_ns = 0;
        for (std::int64_t k = 0; k < steps; ++k) {
            const StepResult result = simulation.step(simulation.scripted_input(k * step_ns));
            if (result.in_contact != in_contact) {
                continue;
            }
            const StageTimes& t = result.times;
            for (std::size_t s = 0; s < kStages.size(); ++s) {
                times_ns[s].push_back(t.*kStages[s].time_ns);
            }
            contact_ns.push_back(t.ccd_ns + t.popout_ns + t.proxy_ns);
            sum_ns += t.total_ns;
        }
        if (contact_ns.empty()) {
            state.SkipWithError("there are no such steps");
            return;
        }
        state.SetIterationTime(1e-9 * static_cast<double>(sum_ns));
    }
    state.SetItemsProcessed(static_cast<std::int64_t>(contact_ns.size()));
    for (std::size_t s = 0; s < kStages.size(); ++s) {
        state.counters[kStages[s].counter] = quantile_us(times_ns[s], 0.5);
    }
    state.counters["contact_p999_us"] = quantile_us(contact_ns, 0.999);
}

BENCHMARK_CAPTURE(scene, cloth_drop_free, "cloth-drop", false)->UseManualTime()->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(scene, cloth_drop_in_contact, "cloth-drop", true)->UseManualTime()->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(scene, popout_fan_free, "popout-fan", false)->UseManualTime()->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(scene, popout_fan_in_contact, "popout-fan", true)->UseManualTime()->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(scene, fish_hold_free, "fish-hold", false)->UseManualTime()->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(scene, fish_hold_in_contact, "fish-hold", true)->UseManualTime()->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(scene, fish_slide_free, "fish-slide", false)->UseManualTime()->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(scene, fish_slide_in_contact, "fish-slide", true)->UseManualTime()->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(scene, four_fish_free, "four-fish", false)->UseManualTime()->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(scene, four_fish_in_contact, "four-fish", true)->UseManualTime()->Unit(benchmark::kMillisecond);

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
