// Elasticity of the tool: what new springs, a new curl of its fingers and the table of its shapes cost. The curl
// changes at each step in which fingers close.
//
//     tool_bench --benchmark_filter=new_curl
#include <benchmark/benchmark.h>

#include <cstddef>
#include <span>
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

void tabulate(benchmark::State& state) {
    ToolModel tool = hand(static_cast<std::size_t>(state.range(0)));
    ToolElasticity elasticity = elasticity_of(tool);
    std::vector<haptic::Quat> rotation(tool.radius.size());
    for (auto _ : state) {
        elasticity.tabulate([&](double curl, std::span<haptic::Vec3> rest_offset) {
            tool.joints.apply_curl(curl, rest_offset, rotation);
        });
    }
}
BENCHMARK(tabulate)->ArgName("spheres")->Arg(16)->Arg(37)->Arg(64)->Unit(benchmark::kMillisecond);

void new_curl(benchmark::State& state) {
    ToolModel tool = hand(static_cast<std::size_t>(state.range(0)));
    ToolElasticity elasticity = elasticity_of(tool);
    std::vector<haptic::Quat> rotation(tool.radius.size());
    const auto shape = [&](double curl, std::span<haptic::Vec3> rest_offset) {
        tool.joints.apply_curl(curl, rest_offset, rotation);
    };
    elasticity.tabulate(shape);
    double curl = 0.0;
    for (auto _ : state) {
        // The fingers close by 1 % of their range, and open when they are closed.
        curl = curl < 0.99 ? curl + 0.01 : 0.0;
        shape(curl, tool.body.particles.rest_position);
        elasticity.set_curl(curl, tool.body.particles.rest_position);
        benchmark::DoNotOptimize(elasticity.compliance(0, 0));
    }
}
BENCHMARK(new_curl)->ArgName("spheres")->Arg(16)->Arg(37)->Arg(64)->Unit(benchmark::kMicrosecond);

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
