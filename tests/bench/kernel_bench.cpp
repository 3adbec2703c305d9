// Benchmark of the kernels of a tick: pose from lengths, local proxies against their planes, tensions from the wrench.
//
// Google Benchmark reports the mean over many calls. A real-time loop depends on the tail, so each benchmark also times
// every single call and reports p50, p99.9 and the maximum, less the clock's own cost, in nanoseconds.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include "clock_cost.hpp"
#include "device/kinematics.hpp"
#include "device/tension.hpp"
#include "haptic/device/device_geometry.hpp"
#include "rendering/local_proxy.hpp"

namespace haptic::rt {
namespace {

constexpr std::size_t kInputs = 4096;  // power of two; all inputs fit into the second-level cache

using bench::Clock;
using bench::clock_cost;
using bench::nanoseconds_between;

/// Times each call of work(i) individually.
template <typename Work>
void measure(benchmark::State& state, Work work) {
    const double cost = clock_cost();
    std::vector<double> times;
    times.reserve(1U << 22U);
    std::size_t i = 0;
    for (auto _ : state) {
        const auto start = Clock::now();
        work(i);
        const auto end = Clock::now();
        i = (i + 1) % kInputs;
        const double time = nanoseconds_between(start, end);
        state.SetIterationTime(time * 1e-9);
        if (times.size() < times.capacity()) {
            times.push_back(std::max(0.0, time - cost));
        }
    }
    std::sort(times.begin(), times.end());
    const auto quantile = [&](double q) { return times[static_cast<std::size_t>(q * double(times.size() - 1))]; };
    state.counters["p50_ns"] = quantile(0.5);
    state.counters["p999_ns"] = quantile(0.999);
    state.counters["max_ns"] = times.back();
}

class Inputs {
  public:
    Inputs() {
        std::mt19937_64 engine(41);
        std::normal_distribution<double> normal;
        const auto vector = [&](double size) {
            const double x = normal(engine);
            const double y = normal(engine);
            return Vec3(x, y, normal(engine)) * size;
        };
        for (std::size_t i = 0; i < kInputs; ++i) {
            // A periodic hand motion at 1 Hz, and random wrenches of a few newtons.
            const double phase = 2.0 * 3.14159265358979 * static_cast<double>(i) / kInputs;
            const Pose pose{{0.02 * std::sin(4.0 * phase), 0.015 * std::cos(3.0 * phase), 0.01 * std::sin(2.0 * phase)},
                            glm::angleAxis(0.4 * std::sin(4.0 * phase), glm::normalize(Vec3(1.0, 0.5, -0.3)))};
            lengths[i] = string_lengths(geometry, pose);
            wires[i] = wire_matrix(geometry, pose);
            wrenches[i] = {vector(2.0), vector(0.02)};
            // Wrench of a smooth contact, for a warm start.
            smooth[i] = {{1.0 + std::sin(5.0 * phase), 2.0 * std::cos(3.0 * phase), -1.0},
                         {0.02 * std::sin(3.0 * phase), 0.0, 0.01 * std::cos(4.0 * phase)}};
            targets[i] = vector(0.01);
            for (HalfSpace& plane : planes[i]) {
                plane = {glm::normalize(vector(1.0)), 0.005 * normal(engine)};
            }
        }
    }

    device::DeviceGeometry geometry = device::spidar_g6_x3r();
    TensionSettings settings{0.3, 20.0, 1.0 / 0.0225};
    std::vector<StringArray> lengths = std::vector<StringArray>(kInputs);
    std::vector<WireMatrix> wires = std::vector<WireMatrix>(kInputs);
    std::vector<Wrench> wrenches = std::vector<Wrench>(kInputs);
    std::vector<Wrench> smooth = std::vector<Wrench>(kInputs);
    std::vector<Vec3> targets = std::vector<Vec3>(kInputs);
    std::vector<std::array<HalfSpace, kMaxPlanes>> planes = std::vector<std::array<HalfSpace, kMaxPlanes>>(kInputs);
};

const Inputs& inputs() {
    static const Inputs made;
    return made;
}

void pose_solve(benchmark::State& state) {
    const Inputs& in = inputs();
    PoseSolver solver(in.geometry);
    measure(state, [&](std::size_t i) { benchmark::DoNotOptimize(solver.solve(in.lengths[i])); });
}
BENCHMARK(pose_solve)->UseManualTime();

void tension_smooth_warm(benchmark::State& state) {
    const Inputs& in = inputs();
    TensionSolver solver(in.settings);
    measure(state, [&](std::size_t i) { benchmark::DoNotOptimize(solver.solve(in.wires[i], in.smooth[i])); });
}
BENCHMARK(tension_smooth_warm)->UseManualTime();

void tension_random_warm(benchmark::State& state) {
    const Inputs& in = inputs();
    TensionSolver solver(in.settings);
    measure(state, [&](std::size_t i) { benchmark::DoNotOptimize(solver.solve(in.wires[i], in.wrenches[i])); });
}
BENCHMARK(tension_random_warm)->UseManualTime();

void tension_random_cold(benchmark::State& state) {
    const Inputs& in = inputs();
    TensionSolver solver(in.settings);
    measure(state, [&](std::size_t i) {
        solver.reset();
        benchmark::DoNotOptimize(solver.solve(in.wires[i], in.wrenches[i]));
    });
}
BENCHMARK(tension_random_cold)->UseManualTime();

/// Argument: number of planes of the proxy.
void local_projection(benchmark::State& state) {
    const Inputs& in = inputs();
    const auto count = static_cast<std::size_t>(state.range(0));
    measure(state, [&](std::size_t i) {
        benchmark::DoNotOptimize(project(in.targets[i], std::span<const HalfSpace>(in.planes[i]).first(count)));
    });
}
BENCHMARK(local_projection)->UseManualTime()->DenseRange(1, 3);

/// Computation of one tick: pose, local proxies with three planes each (argument: their number), sum of their springs,
/// wire matrix and tensions. One proxy in four is in contact, because most planes of a frame are only nearby.
void tick_computation(benchmark::State& state) {
    const Inputs& in = inputs();
    const auto proxies = static_cast<std::size_t>(state.range(0));
    PoseSolver pose_solver(in.geometry);
    TensionSolver tension_solver(in.settings);
    std::vector<std::array<HalfSpace, kMaxPlanes>> planes(proxies);
    std::vector<Vec3> offsets(proxies);
    for (std::size_t k = 0; k < proxies; ++k) {
        planes[k] = in.planes[k];
        offsets[k] = in.targets[k];
        for (HalfSpace& plane : planes[k]) {
            plane.offset = glm::dot(plane.normal, offsets[k]) - (k % 4 == 0 ? -0.0005 : 0.04);
        }
    }
    measure(state, [&](std::size_t i) {
        const Pose& pose = pose_solver.solve(in.lengths[i]).pose;
        Wrench wrench;
        for (std::size_t k = 0; k < proxies; ++k) {
            const Vec3 arm = pose.orientation * offsets[k];
            const Vec3 hip = pose.position + arm;
            const Vec3 force = 20.0 * (project(hip, planes[k]).position - hip);
            wrench.force += force;
            wrench.torque += glm::cross(arm, force);
        }
        benchmark::DoNotOptimize(tension_solver.solve(wire_matrix(in.geometry, pose), wrench));
    });
}
BENCHMARK(tick_computation)->UseManualTime()->Arg(1)->Arg(37)->Arg(64);

}  // namespace
}  // namespace haptic::rt

BENCHMARK_MAIN();
