#include "reproduce/scene_growth.hpp"

#include <malloc.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <string_view>
#include <utility>

#include "haptic/config.hpp"
#include "haptic/types.hpp"
#include "reproduce/scene_run.hpp"

namespace haptic::sim::reproduce {
namespace {

constexpr double kHeapSpacing = 0.6;  // m, of heaps of fish of 0.3 m
// Steps of 10 ms. From 0.3 s on the fish touch one another; the hand reaches the heap at 1.9 s.
constexpr std::size_t kFirstHeapStep = 30;
constexpr std::size_t kHeapSteps = 250;
constexpr std::size_t kFallSteps = 10;  // of the cloth, before it touches the hand
constexpr std::size_t kCatchSteps = 15;
// The first step of all touches the memory for the first time.
constexpr std::size_t kFirstClothStep = 1;

// Of the time of a size, roughly.
constexpr double kBuildingShare = 0.1;

/// A quantity of this process in /proc/self/status, MB; 0 if there is none.
double memory_mb(std::string_view key) {
    std::ifstream status("/proc/self/status");
    std::string name;
    double kib = 0.0;
    while (status >> name) {
        if (name == key && status >> kib) {
            return kib * 1.024e-3;
        }
        status.ignore(1000, '\n');
    }
    return 0.0;
}

/// Resets the largest resident memory (VmHWM) to the present one. Where the kernel refuses, it remains the largest so
/// far, which is the same for ascending sizes.
void reset_peak_memory() {
    std::ofstream("/proc/self/clear_refs") << "5\n";
}

double n_log_n(std::size_t n) {
    return static_cast<double>(n) * std::log(static_cast<double>(n));
}

StageMedians medians_of(const std::array<std::vector<double>, kGrowthStages.size()>& times_us) {
    StageMedians medians{};
    for (std::size_t s = 0; s < medians.size(); ++s) {
        medians[s] = quantile(times_us[s], 0.5);
    }
    return medians;
}

}  // namespace

GrowthCase fish_heaps(std::size_t heaps) {
    Scene scene = read_scene(open_scene("four-fish"), "four-fish");
    const std::vector<Placement> heap = scene.model.copies;
    const auto side = static_cast<std::size_t>(std::ceil(std::sqrt(static_cast<double>(heaps))));
    scene.model.copies.clear();
    for (std::size_t k = 0; k < heaps; ++k) {
        const std::size_t row = k / side;
        const Vec3 place(kHeapSpacing * static_cast<double>(k - row * side), 0.0,
                         kHeapSpacing * static_cast<double>(row));
        for (Placement fish : heap) {
            fish.position += place;
            scene.model.copies.push_back(fish);
        }
    }
    return {.scene = std::move(scene), .first_step = kFirstHeapStep, .steps = kHeapSteps};
}

GrowthCase falling_cloth(std::uint32_t vertices_per_side) {
    Scene scene = read_scene(open_scene("cloth-drop"), "cloth-drop");
    scene.model.cloth.vertices_per_side = vertices_per_side;
    // Without drag the cloth has the velocity of a free fall. Begin so low that it arrives after kFallSteps.
    double& height = scene.model.cloth.centre.y;
    const double g = -scene.solver.gravity.y;
    const double arrival_s = std::sqrt(2.0 * (height - scene.proxy.radius) / g);
    const double begin_s = arrival_s - (static_cast<double>(kFallSteps) + 0.5) * scene.solver.step;
    scene.model.velocity = begin_s * scene.solver.gravity;
    height -= 0.5 * g * begin_s * begin_s;
    return {.scene = std::move(scene), .first_step = kFirstClothStep, .steps = kFallSteps + kCatchSteps};
}

SceneCost measure_growth(const GrowthCase& size, Simulation::ClockFunction clock, const Progress& progress) {
    SceneCost cost;
    // Return freed memory to the system, so that it is not used again uncounted.
    (void)malloc_trim(0);
    reset_peak_memory();
    const double before_mb = memory_mb("VmRSS:");
    // Build.
    const std::int64_t begin_ns = clock();
    Simulation simulation(size.scene, clock, part_of(progress, 0.0, kBuildingShare));
    cost.build_s = seconds(clock() - begin_ns);
    cost.held_mb = memory_mb("VmRSS:") - before_mb;
    cost.bodies = simulation.bodies().size();
    cost.particles = simulation.model().size();
    cost.vertices = simulation.mesh().vertices.size();
    cost.triangles = simulation.mesh().triangles.size();
    // Run, and sort the measured steps by whether the hand touches.
    std::array<std::vector<double>, kGrowthStages.size()> free_us;
    std::array<std::vector<double>, kGrowthStages.size()> contact_us;
    const std::int64_t step_ns = nanoseconds(size.scene.solver.step);
    for (std::size_t k = 0; k < size.steps; ++k) {
        report(progress,
               kBuildingShare + (1.0 - kBuildingShare) * static_cast<double>(k) / static_cast<double>(size.steps));
        const StepResult result = simulation.step(simulation.scripted_input(static_cast<std::int64_t>(k) * step_ns));
        if (k < size.first_step) {
            continue;
        }
        ++(result.in_contact ? cost.contact_steps : cost.free_steps);
        for (std::size_t s = 0; s < kGrowthStages.size(); ++s) {
            (result.in_contact ? contact_us : free_us)[s].push_back(
                static_cast<double>(result.times.*kGrowthStages[s].time_ns) * 1e-3);
        }
    }
    cost.peak_mb = memory_mb("VmHWM:") - before_mb;
    cost.free_us = medians_of(free_us);
    cost.contact_us = medians_of(contact_us);
    return cost;
}

double growth_exponent(double first_time, double time, std::size_t first_n, std::size_t n) {
    return std::log(time / first_time) / std::log(static_cast<double>(n) / static_cast<double>(first_n));
}

double relative_to_n_log_n(double time, std::size_t n, double first_time, std::size_t first_n) {
    return time / first_time * n_log_n(first_n) / n_log_n(n);
}

std::vector<Growth> growths_of(std::span<const SceneCost> costs) {
    std::vector<Growth> growths;
    // The largest size, and the largest of those that are small enough beside it.
    const auto is_smaller = [&](const SceneCost& cost) {
        return kMinSizeRatio * static_cast<double>(cost.particles) <= static_cast<double>(costs.back().particles);
    };
    const auto smaller = std::find_if(costs.rbegin(), costs.rend(), is_smaller);
    if (smaller == costs.rend()) {
        return growths;
    }
    const SceneCost& first = *smaller;
    const SceneCost& last = costs.back();
    const auto exponent = [&](double small, double large) {
        return growth_exponent(small, large, first.particles, last.particles);
    };
    const double limit = exponent(n_log_n(first.particles), n_log_n(last.particles)) + kExponentTolerance;
    const auto add = [&](std::string what, double small, double large) {
        if (small > 0.0 && large > 0.0) {
            growths.push_back({std::move(what), exponent(small, large), limit});
        }
    };
    // Stages that matter, without and with contact of the hand.
    for (std::size_t s = 0; s < kGrowthStages.size(); ++s) {
        if (last.free_us[s] >= kMinStageShare * last.free_us[0]) {
            add(std::string(kGrowthStages[s].name) + ", free", first.free_us[s], last.free_us[s]);
        }
        if (last.contact_us[s] >= kMinStageShare * last.contact_us[0]) {
            add(std::string(kGrowthStages[s].name) + ", in contact", first.contact_us[s], last.contact_us[s]);
        }
    }
    add("building", first.build_s, last.build_s);
    add("memory", first.held_mb, last.held_mb);
    return growths;
}

}  // namespace haptic::sim::reproduce
