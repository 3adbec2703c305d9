// Benchmark of the contact solver: forces of limp, elastic and almost rigid tools in contact. The hand moves by 0.3 mm
// (1 ms at 0.3 m/s) before each solution, which starts cold, or warm from the last one. worst_problem has the largest
// problems that a contact frame can hold, from the two families that take the solver the most steps.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
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

/// 64 spheres with three planes and friction each: 320 rows. 0: surfaces that face each other 1 mm too close for limp,
/// elastic and almost rigid tools, so that rows enter and leave; 1: a definite matrix under which all 192 planes press,
/// so that the factor is the largest.
std::vector<Problem> worst_problems(bool all_press) {
    Random random(1);
    std::vector<Problem> problems;
    for (int i = 0; i < kProblems; ++i) {
        const double kappa = std::vector{0.0, 1e3, 1e6}[static_cast<std::size_t>(i % 3)];
        const contact_tools::Tool tool = contact_tools::random_tool(kMaxProxies, kappa, random);
        const double no_room = all_press ? 0.0 : 1e-3;
        Contacts contacts =
            contact_tools::random_contacts(tool, {.planes = kMaxPlanes, .friction = 0.6, .no_room = no_room}, random);
        ComplianceMatrix matrix = contacts.matrix();
        if (all_press) {
            // I - 0.9 / n 1 1^T: what presses on one plane presses the tool against all others.
            const std::size_t rows = matrix.rows();
            const double between = -0.9 / static_cast<double>(rows);
            for (std::size_t r = 0; r < rows; ++r) {
                for (std::size_t s = 0; s <= r; ++s) {
                    matrix.set(r, s, (r == s ? 1.0 + between : between) / tool.stiffness);
                }
            }
            for (double& depth : contacts.depth) {
                depth = std::abs(depth);
            }
        }
        problems.push_back({std::move(contacts), std::move(matrix), random.direction()});
    }
    return problems;
}

void worst_problem(benchmark::State& state) {
    std::vector<Problem> problems = worst_problems(state.range(0) != 0);
    const auto solver = std::make_unique<ContactSolver>();
    const auto histogram = std::make_unique<Histogram>();
    std::size_t index = 0;
    int most_steps = 0;
    int most_sweeps = 0;
    for ([[maybe_unused]] auto unused : state) {  // NOLINT(clang-analyzer-deadcode.DeadStores)
        Problem& problem = problems[index];
        index = (index + 1) % problems.size();
        solver->restart();
        const std::int64_t begin_ns = monotonic_now_ns();
        const ContactSolver::Result result =
            solver->solve(problem.matrix, problem.contacts.depth, problem.contacts.friction);
        const std::int64_t taken_ns = monotonic_now_ns() - begin_ns;
        most_steps = std::max(most_steps, result.steps);
        most_sweeps = std::max(most_sweeps, result.sweeps);
        histogram->record(taken_ns);
        state.SetIterationTime(1e-9 * static_cast<double>(taken_ns));
    }
    state.counters["p50_us"] = 1e-3 * static_cast<double>(histogram->percentile_ns(0.5));
    state.counters["p99.9_us"] = 1e-3 * static_cast<double>(histogram->percentile_ns(0.999));
    state.counters["steps_most"] = most_steps;
    state.counters["sweeps_most"] = most_sweeps;
}

BENCHMARK(worst_problem)->ArgName("all_press")->Arg(0)->Arg(1)->UseManualTime()->Unit(benchmark::kMicrosecond);

BENCHMARK(contact_problem)
    ->ArgNames({"contacts", "friction", "warm"})
    ->ArgsProduct({{1, 8, 27, 64}, {0}, {0, 1}})
    ->ArgsProduct({{12, 64}, {60}, {0, 1}})
    ->UseManualTime()
    ->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace haptic

BENCHMARK_MAIN();
