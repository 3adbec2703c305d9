// One step of cloth-drop, by stage, and the dynamics alone in the set-up that earlier figures are for.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "haptic/clock.hpp"
#include "haptic/config.hpp"
#include "haptic/denormals.hpp"
#include "haptic/sim/cloth.hpp"
#include "haptic/sim/simulation.hpp"
#include "haptic/sim/solver.hpp"
#include "strewn_body.hpp"

namespace haptic::sim {
namespace {

double median_us(std::vector<std::int64_t>& durations_ns) {
    const auto middle = durations_ns.begin() + static_cast<std::ptrdiff_t>(durations_ns.size() / 2);
    std::nth_element(durations_ns.begin(), middle, durations_ns.end());
    return static_cast<double>(*middle) * 1e-3;
}

/// From half a metre above the proxy, through contact, for as many steps as it is held.
Scene late_drop() {
    Config config = open_scene("cloth-drop");
    config.set("model.height=0.5");
    config.set("model.velocity=[0.0, -13.66, 0.0]");
    return read_scene(config, "late-drop");
}

constexpr int kSteps = 40;  // in contact, that one iteration measures

/// Whole steps in contact; the counters are medians of the stages in microseconds.
void cloth_step_in_contact(benchmark::State& state) {
    const Scene scene = late_drop();
    std::vector<std::int64_t> ccd, popout, proxy, collide, deform, total;
    for ([[maybe_unused]] const auto iteration : state) {
        state.PauseTiming();
        Simulation simulation(scene, monotonic_now_ns);
        int step = 0;
        while (!simulation.step(simulation.scripted_input(10'000'000 * std::int64_t{step})).in_contact) {
            ++step;
        }
        state.ResumeTiming();
        for (int i = 0; i < kSteps; ++i) {
            const StepResult result = simulation.step(simulation.scripted_input(10'000'000 * std::int64_t{++step}));
            ccd.push_back(result.times.ccd_ns);
            popout.push_back(result.times.popout_ns);
            proxy.push_back(result.times.proxy_ns);
            collide.push_back(result.times.collide_ns);
            deform.push_back(result.times.deform_ns);
            total.push_back(result.times.total_ns);
        }
    }
    state.SetItemsProcessed(state.iterations() * kSteps);
    state.counters["ccd_us"] = median_us(ccd);
    state.counters["popout_us"] = median_us(popout);
    state.counters["proxy_us"] = median_us(proxy);
    state.counters["collide_us"] = median_us(collide);
    state.counters["deform_us"] = median_us(deform);
    state.counters["total_us"] = median_us(total);
}
BENCHMARK(cloth_step_in_contact)->Unit(benchmark::kMillisecond);

/// 1,089 groups and 4,160 links, as many passes as the arguments say: 2 is what a curtain needs. All numbers of lanes
/// in one run, so that their ratios can be compared.
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

/// The dynamics of four-fish without contacts: 548 particles in four bodies, each in a group of nine, bent; 5
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
