// Benchmark of the contact solver: forces of limp, elastic and almost rigid tools in contact. The hand moves by 0.3 mm
// (1 ms at 0.3 m/s) before each solution, which starts cold, or warm from the last one.
#include <benchmark/benchmark.h>

#include <cstdint>
#include <memory>
#include <vector>

#include "contact_tools.hpp"
#include "haptic/clock.hpp"
#include "haptic/contact_problem.hpp"
#include "haptic/histogram.hpp"

namespace haptic {
namespace {

using contact_tools::Contacts;
using contact_tools::Random;

constexpr int kProblems = 12;
constexpr int kMotions = 40;      // of the hand, back and forth
constexpr double kMotion = 3e-4;  // m

struct Problem {
    Contacts contacts;
    ComplianceMatrix matrix;
    Eigen::Vector3d direction;
};

std::vector<Problem> random_problems(int spheres, double friction) {
    Random random(1);
    std::vector<Problem> problems;
    for (int i = 0; i < kProblems; ++i) {
        // Limp, elastic and almost rigid tools in turn.
        const double kappa = std::vector{0.0, 1e3, 1e6}[static_cast<std::size_t>(i % 3)];
        const contact_tools::Tool tool = contact_tools::random_tool(spheres, kappa, random);
        Contacts contacts = contact_tools::random_contacts(tool, {.friction = friction}, random);
        ComplianceMatrix matrix = contacts.matrix();
        problems.push_back({std::move(contacts), std::move(matrix), random.direction()});
    }
    return problems;
}

/// Arguments: number of spheres in contact, friction in percent, warm (0 or 1).
void contact_problem(benchmark::State& state) {
    std::vector<Problem> problems =
        random_problems(static_cast<int>(state.range(0)), 0.01 * static_cast<double>(state.range(1)));
    const bool warm = state.range(2) != 0;
    const auto solver = std::make_unique<ContactSolver>();
    const auto histogram = std::make_unique<Histogram>();
    std::size_t index = 0;
    int motion = 0;
    std::int64_t steps = 0;
    std::int64_t sweeps = 0;
    for ([[maybe_unused]] auto unused : state) {  // NOLINT(clang-analyzer-deadcode.DeadStores)
        Problem& problem = problems[index];
        if (!warm || motion == 0) {
            solver->restart();
        }
        if (warm && motion == 0) {
            solver->solve(problem.matrix, problem.contacts.depth, problem.contacts.friction);
        }
        problem.contacts.move((motion < kMotions / 2 ? kMotion : -kMotion) * problem.direction);
        const std::int64_t begin_ns = monotonic_now_ns();
        const ContactSolver::Result result =
            solver->solve(problem.matrix, problem.contacts.depth, problem.contacts.friction);
        const std::int64_t taken_ns = monotonic_now_ns() - begin_ns;
        steps += result.steps;
        sweeps += result.sweeps;
        histogram->record(taken_ns);
        state.SetIterationTime(1e-9 * static_cast<double>(taken_ns));
        motion = (motion + 1) % kMotions;
        index = motion == 0 ? (index + 1) % problems.size() : index;
    }
    const auto iterations = static_cast<double>(state.iterations());
    state.counters["p50_us"] = 1e-3 * static_cast<double>(histogram->percentile_ns(0.5));
    state.counters["p99.9_us"] = 1e-3 * static_cast<double>(histogram->percentile_ns(0.999));
    state.counters["steps"] = static_cast<double>(steps) / iterations;
    state.counters["sweeps"] = static_cast<double>(sweeps) / iterations;
}

BENCHMARK(contact_problem)
    ->ArgNames({"contacts", "friction", "warm"})
    ->ArgsProduct({{1, 8, 27, 64}, {0}, {0, 1}})
    ->ArgsProduct({{12, 64}, {60}, {0, 1}})
    ->UseManualTime()
    ->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace haptic

BENCHMARK_MAIN();
