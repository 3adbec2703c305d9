// Every frame beside the others: how its pose is found, how quiet it is, what it can make, and what that costs.
//
// One benchmark a frame; its time is that of the tension solver, each call by itself, and its counters are the table:
//
//   step1_mm, step1_deg ... step3_...   left of a step of 27 mm and 25 degrees after 1, 2, 3 updates, the worst of many
//                                       directions
//   noise_um, noise_mdeg                one standard deviation of the pose at the centre from whole counts, worst axis
//   force_N, torque_mNm                 reach at the centre, the smallest of all six signed axes; 0: some axis has none
//   p50_ns, p999_ns                     one tension solution, smooth wrench and warm start, less the clock's own cost
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "clock_cost.hpp"
#include "device/kinematics.hpp"
#include "device/tension.hpp"
#include "device/velocity.hpp"
#include "haptic/device/device_geometry_file.hpp"
#include "haptic/device/wrench_closure.hpp"

namespace haptic::rt {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;
constexpr std::size_t kInputs = 4096;

using bench::Clock;
using bench::clock_cost;
using bench::nanoseconds_between;

class Random {
  public:
    Vec3 normal() {
        const double x = normal_(engine_);
        const double y = normal_(engine_);
        return {x, y, normal_(engine_)};
    }
    Vec3 direction() { return glm::normalize(normal()); }
    double uniform(double min, double max) { return std::uniform_real_distribution<double>(min, max)(engine_); }

  private:
    std::mt19937_64 engine_{41};
    std::normal_distribution<double> normal_;
};

void measure_steps(const device::DeviceGeometry& geometry, benchmark::State& state) {
    Random random;
    std::array<double, 3> furthest{};
    std::array<double, 3> widest{};
    for (int k = 0; k < 20000; ++k) {
        const Pose pose{random.direction() * 0.027, glm::angleAxis(25.0 * kDegree, random.direction())};
        const StringArray lengths = string_lengths(geometry, pose);
        PoseSolver solver(geometry);
        for (std::size_t update = 0; update < 3; ++update) {
            const Pose& found = solver.solve(lengths).pose;
            furthest[update] = std::max(furthest[update], glm::length(found.position - pose.position));
            widest[update] =
                std::max(widest[update], glm::length(rotation_between(pose.orientation, found.orientation)));
        }
    }
    for (std::size_t update = 0; update < 3; ++update) {
        const std::string name = "step" + std::to_string(update + 1);
        state.counters[name + "_mm"] = 1e3 * furthest[update];
        state.counters[name + "_deg"] = widest[update] / kDegree;
    }
}

void measure_noise(const device::DeviceGeometry& geometry, benchmark::State& state) {
    constexpr int kSamples = 20000;
    Random random;
    Vec3 position(0.0);
    Vec3 rotation(0.0);
    PoseSolver solver(geometry);
    for (int k = 0; k < kSamples; ++k) {
        // Far enough from one another that the eight roundings are independent.
        const Pose pose{random.direction() * random.uniform(0.0, 1e-3),
                        glm::angleAxis(random.uniform(0.0, 0.02), random.direction())};
        StringArray lengths = string_lengths(geometry, pose);
        for (std::size_t i = 0; i < kStrings; ++i) {
            const double count = std::fabs(geometry.strings[i].metres_per_count);
            lengths[i] = std::floor(lengths[i] / count + 0.5) * count;
        }
        const Pose& found = solver.solve(lengths).pose;
        const Vec3 moved = found.position - pose.position;
        const Vec3 turned = rotation_between(pose.orientation, found.orientation);
        position += moved * moved;
        rotation += turned * turned;
    }
    const auto worst = [](const Vec3& sum) { return std::sqrt(std::max({sum.x, sum.y, sum.z}) / kSamples); };
    state.counters["noise_um"] = 1e6 * worst(position);
    state.counters["noise_mdeg"] = 1e3 / kDegree * worst(rotation);
}

void measure_reach(const device::DeviceGeometry& geometry, benchmark::State& state) {
    double force = HUGE_VAL;
    double torque = HUGE_VAL;
    for (std::size_t axis = 0; axis < 6; ++axis) {
        for (const double sign : {1.0, -1.0}) {
            device::WrenchVector direction{};
            direction[axis] = sign;
            double& reach = axis < 3 ? force : torque;
            reach = std::min(reach, device::wrench_reach(geometry, {}, direction).value_or(0.0));
        }
    }
    state.counters["force_N"] = force;
    state.counters["torque_mNm"] = 1e3 * torque;
}

void geometry_table(benchmark::State& state, const std::string& name) {
    const device::DeviceGeometry geometry = device::built_in_geometry(name);
    double radius = 0.0;
    for (const device::StringFacts& string : geometry.strings) {
        radius = std::max(radius, glm::length(string.grip));
    }
    TensionSettings settings;
    settings.minimum = geometry.minimum_tension;
    settings.maximum = geometry.maximum_tension;
    settings.torque_scale = 1.0 / radius;
    std::vector<WireMatrix> wires(kInputs);
    std::vector<Wrench> wrenches(kInputs);
    for (std::size_t i = 0; i < kInputs; ++i) {
        // A hand that comes round to its start, in contact with something smooth.
        const double phase = 2.0 * std::numbers::pi * static_cast<double>(i) / kInputs;
        const Vec3 position(0.02 * std::sin(4.0 * phase), 0.015 * std::cos(3.0 * phase), 0.01 * std::sin(2.0 * phase));
        wires[i] = wire_matrix(
            geometry, {position, glm::angleAxis(0.4 * std::sin(4.0 * phase), glm::normalize(Vec3(1.0, 0.5, -0.3)))});
        wrenches[i] = {{1.0 + std::sin(5.0 * phase), 2.0 * std::cos(3.0 * phase), -1.0},
                       {0.02 * std::sin(3.0 * phase), 0.0, 0.01 * std::cos(4.0 * phase)}};
    }
    TensionSolver solver(settings);
    const double cost = clock_cost();
    std::vector<double> times;
    times.reserve(1U << 22U);
    std::size_t i = 0;
    for ([[maybe_unused]] auto unused : state) {  // NOLINT(clang-analyzer-deadcode.DeadStores)
        const auto start = Clock::now();
        benchmark::DoNotOptimize(solver.solve(wires[i], wrenches[i]));
        const auto end = Clock::now();
        i = (i + 1) % kInputs;
        const double time = nanoseconds_between(start, end);
        state.SetIterationTime(1e-9 * time);
        if (times.size() < times.capacity()) {
            times.push_back(std::max(0.0, time - cost));
        }
    }
    std::sort(times.begin(), times.end());
    const auto quantile = [&](double q) {
        return times[static_cast<std::size_t>(q * static_cast<double>(times.size() - 1))];
    };
    measure_steps(geometry, state);
    measure_noise(geometry, state);
    measure_reach(geometry, state);
    state.counters["p50_ns"] = quantile(0.5);
    state.counters["p999_ns"] = quantile(0.999);
}

[[maybe_unused]] const bool kRegistered = [] {
    for (const std::string& name : device::built_in_geometry_names()) {
        benchmark::RegisterBenchmark(("geometry/" + name).c_str(), geometry_table, name)->UseManualTime();
    }
    return true;
}();

}  // namespace
}  // namespace haptic::rt

BENCHMARK_MAIN();
