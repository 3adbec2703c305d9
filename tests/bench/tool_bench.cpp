// Elasticity of the tool: what new springs and a new rest shape cost. The rest shape changes at each step in which
// fingers close.
//
//     tool_bench --benchmark_filter=new_rest_shape
#include <benchmark/benchmark.h>

#include <cstddef>
#include <vector>

#include "haptic/sim/tool_model.hpp"
#include "haptic/types.hpp"
#include "tool/tool_elasticity.hpp"

namespace {

using namespace haptic::sim;

/// The generated hand with this number of spheres.
ToolModel hand(std::size_t spheres) {
    ToolSettings settings;
    settings.shape = ToolShape::Hand;
    settings.spheres = spheres;
    return make_tool(settings);
}

ToolElasticity elasticity_of(const ToolModel& tool) {
    return {{.rest_offset = tool.body.particles.rest_position,
             .volume = tool.volume,
             .radius = tool.radius,
             .groups = tool.body.particles.groups},
            tool.material,
            {}};
}

void new_rest_shape(benchmark::State& state) {
    ToolModel tool = hand(static_cast<std::size_t>(state.range(0)));
    ToolElasticity elasticity = elasticity_of(tool);
    std::vector<haptic::Quat> rotation(tool.radius.size());
    double curl = 0.0;
    for (auto _ : state) {
        // The fingers close by 1 % of their range, and open when they are closed.
        curl = curl < 1.0 ? curl + 0.01 : 0.0;
        state.PauseTiming();
        tool.joints.apply_curl(curl, tool.body.particles.rest_position, rotation);
        state.ResumeTiming();
        elasticity.set_rest_shape(tool.body.particles.rest_position);
        benchmark::DoNotOptimize(elasticity.compliance(0, 0));
    }
}
BENCHMARK(new_rest_shape)->ArgName("spheres")->Arg(16)->Arg(37)->Arg(64)->Unit(benchmark::kMicrosecond);

void new_springs(benchmark::State& state) {
    const ToolModel tool = hand(static_cast<std::size_t>(state.range(0)));
    ToolElasticity elasticity = elasticity_of(tool);
    double stiffness = 20.0;
    for (auto _ : state) {
        stiffness = 60.0 - stiffness;
        elasticity.set_springs({.stiffness = stiffness});
        benchmark::DoNotOptimize(elasticity.compliance(0, 0));
    }
}
BENCHMARK(new_springs)->ArgName("spheres")->Arg(16)->Arg(37)->Arg(64)->Unit(benchmark::kMicrosecond);

}  // namespace

BENCHMARK_MAIN();
