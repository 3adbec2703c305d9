// Scene growth: time of a step by stage, and memory, as a whole scene grows.
//
// Two scenes grow: heaps of four fish, many bodies of constant size, and a falling cloth, one body with more and more
// vertices. A cost t(n) is compared with n log n by its exponent between two sizes,
//
//     e = log(t2 / t1) / log(n2 / n1),   limit = log(n2 log n2 / (n1 log n1)) / log(n2 / n1) + kExponentTolerance.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "haptic/sim/progress.hpp"
#include "haptic/sim/scene.hpp"
#include "haptic/sim/simulation.hpp"

namespace haptic::sim::reproduce {

/// Exponent added to that of n log n, for the clock and what is left of the caches: between sizes of ratio 1.5 it
/// accepts 11 % of the time. A stage that grows as n^1.5 exceeds it.
inline constexpr double kExponentTolerance = 0.25;
/// The same for building, which is timed once.
inline constexpr double kBuildingTolerance = 0.5;
/// Stages below this share of the step of the largest scene are not compared: their times are those of the clock.
inline constexpr double kMinStageShare = 0.01;

struct GrowthStage {
    const char* name;  // also of its columns
    std::int64_t StageTimes::* time_ns;
};
inline constexpr std::array<GrowthStage, 8> kGrowthStages{{{"total", &StageTimes::total_ns},
                                                           {"collide", &StageTimes::collide_ns},
                                                           {"deform", &StageTimes::deform_ns},
                                                           {"skin", &StageTimes::skin_ns},
                                                           {"ccd", &StageTimes::ccd_ns},
                                                           {"popout", &StageTimes::popout_ns},
                                                           {"tool", &StageTimes::tool_ns},
                                                           {"proxy", &StageTimes::proxy_ns}}};
using StageMedians = std::array<double, kGrowthStages.size()>;  // us

/// A scene of one size and the steps that are measured.
struct GrowthCase {
    Scene scene;
    std::size_t first_step = 0;  // earlier ones are not measured
    std::size_t steps = 0;       // in all
};

/// `heaps` times the four fish of scene four-fish, on a square grid; measured from the time at which they fall on one
/// another. The hand of the scene pokes the first heap.
[[nodiscard]] GrowthCase fish_heaps(std::size_t heaps);

/// The cloth of scene cloth-drop, with vertices_per_side^2 vertices: the end of its fall, at the velocity it then has,
/// and the catch by the hand.
[[nodiscard]] GrowthCase falling_cloth(std::uint32_t vertices_per_side);

/// Cost of one size.
struct SceneCost {
    std::size_t bodies = 0;
    std::size_t particles = 0;
    std::size_t vertices = 0;
    std::size_t triangles = 0;
    double build_s = 0.0;        // making the simulation from the scene
    double held_mb = 0.0;        // resident memory that the simulation holds once it is built
    double peak_mb = 0.0;        // largest resident memory while it is built, above that before
    std::size_t free_steps = 0;  // without contact of the hand
    std::size_t contact_steps = 0;
    StageMedians free_us{};
    StageMedians contact_us{};
};

/// Builds these sizes, then runs them side by side, one step of each in turn: whatever else uses the machine's memory
/// and caches meanwhile slows all of them alike, and none finds in the caches what its last step left there. `clock`
/// returns monotonic nanoseconds; `progress` is that of building and running. Memory is that of the whole process:
/// nothing else may allocate meanwhile, and sizes should ascend, since freed memory may be used again.
[[nodiscard]] std::vector<SceneCost> measure_growth(std::span<const GrowthCase> sizes, Simulation::ClockFunction clock,
                                                    const Progress& progress);

/// Growth of one cost between the two largest sizes.
struct Growth {
    std::string what;  // "deform, in contact", "memory"
    double exponent = 0.0;
    double limit = 0.0;  // of n log n, with its tolerance

    [[nodiscard]] bool is_faster() const noexcept { return exponent > limit; }
};

/// log(t2 / t1) / log(n2 / n1); nan for times of 0.
[[nodiscard]] double growth_exponent(double first_time, double time, std::size_t first_n, std::size_t n);

/// t / (n log n) at a size, relative to the first.
[[nodiscard]] double relative_to_n_log_n(double time, std::size_t n, double first_time, std::size_t first_n);

/// Growth of all costs that count: stages of at least kMinStageShare, building, memory. `costs`: ascending sizes. The
/// two largest should exceed the caches and have been measured side by side; empty if there are no two.
[[nodiscard]] std::vector<Growth> growths_of(std::span<const SceneCost> costs);

}  // namespace haptic::sim::reproduce
