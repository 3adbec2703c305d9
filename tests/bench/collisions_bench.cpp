// Collisions between bodies: 548 ellipsoids in 4 bodies, like four fish, in a heap on the ground and far apart.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cstdint>
#include <ctime>
#include <vector>

#include "clouds.hpp"
#include "haptic/denormals.hpp"
#include "haptic/sim/collisions.hpp"
#include "haptic/sim/solver.hpp"

namespace haptic::sim {
namespace {

/// CPU time of this thread in ns, so that other load of the machine is not counted.
std::int64_t work_ns() {
    timespec now{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return std::int64_t{1'000'000'000} * now.tv_sec + now.tv_nsec;
}

double median_us(std::vector<std::int64_t>& durations_ns) {
    const auto middle = durations_ns.begin() + static_cast<std::ptrdiff_t>(durations_ns.size() / 2);
    std::nth_element(durations_ns.begin(), middle, durations_ns.end());
    return static_cast<double>(*middle) * 1e-3;
}

ParticleModel four_clouds(double apart) {
    ParticleModel model;
    for (std::uint32_t b = 0; b < 4; ++b) {
        model.append(moved(make_cloud({}, b + 1), {0.0, 0.06 + apart * b, 0.0}, Vec3(0.0)));
    }
    return model;
}

/// Whole steps; the counters are medians of the stages in microseconds, and the numbers of contacts.
void measure(benchmark::State& state, ParticleModel model, bool ground) {
    const FlushDenormals flush;
    ParticleSolver solver(model, {.gravity = {0.0, ground ? -9.81 : 0.0, 0.0}});
    ParticleCollisions collisions(model, {.ground = ground, .static_friction = 0.4, .dynamic_friction = 0.3}, work_ns);
    for (int i = 0; i < 200; ++i) {
        solver.step(model, {}, {&collisions});
    }
    (void)collisions.take_time();
    std::vector<std::int64_t> collide;
    std::vector<std::int64_t> deform;
    for ([[maybe_unused]] const auto iteration : state) {
        const std::int64_t start = work_ns();
        solver.step(model, {}, {&collisions});
        const std::int64_t whole = work_ns() - start;
        collide.push_back(collisions.take_time());
        deform.push_back(whole - collide.back());
    }
    state.counters["collide_us"] = median_us(collide);
    state.counters["deform_us"] = median_us(deform);
    state.counters["near"] = static_cast<double>(collisions.counts().near);
    state.counters["planes"] = static_cast<double>(collisions.counts().planes);
    state.counters["pressed"] = static_cast<double>(collisions.counts().active);
}

void four_clouds_in_a_heap(benchmark::State& state) {
    measure(state, four_clouds(0.09), true);
}
BENCHMARK(four_clouds_in_a_heap)->Unit(benchmark::kMicrosecond);

void four_clouds_apart(benchmark::State& state) {
    measure(state, four_clouds(1.0), false);
}
BENCHMARK(four_clouds_apart)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace haptic::sim

BENCHMARK_MAIN();
