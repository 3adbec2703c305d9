#include "reproduce/scene_growth.hpp"

#include <malloc.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <memory>
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

/// A scene that is built and run, and what that takes.
class MeasuredScene {
  public:
    MeasuredScene(const GrowthCase& size, Simulation::ClockFunction clock, const Progress& progress)
        : first_step_(size.first_step), steps_(size.steps), step_ns_(nanoseconds(size.scene.solver.step)) {
        (void)malloc_trim(0);  // returns freed memory to the system, so that it is not used again uncounted
        reset_peak_memory();
        const double before_mb = memory_mb("VmRSS:");
        const std::int64_t begin_ns = clock();
        simulation_ = std::make_unique<Simulation>(size.scene, clock, progress);
        cost_.build_s = seconds(clock() - begin_ns);
        cost_.peak_mb = memory_mb("VmHWM:") - before_mb;
        (void)malloc_trim(0);
        cost_.held_mb = memory_mb("VmRSS:") - before_mb;
        cost_.bodies = simulation_->bodies().size();
        cost_.particles = simulation_->model().size();
        cost_.vertices = simulation_->mesh().vertices.size();
        cost_.triangles = simulation_->mesh().triangles.size();
    }

    /// Step k of the scene's script, if it has as many; sorts it by whether the hand touches.
    void step(std::size_t k) {
        if (k >= steps_) {
            return;
        }
        const std::int64_t time_ns = static_cast<std::int64_t>(k) * step_ns_;
        const StepResult result = simulation_->step(simulation_->scripted_input(time_ns));
        if (k < first_step_) {
            return;
        }
        ++(result.in_contact ? cost_.contact_steps : cost_.free_steps);
        for (std::size_t s = 0; s < kGrowthStages.size(); ++s) {
            (result.in_contact ? contact_us_ : free_us_)[s].push_back(
                static_cast<double>(result.times.*kGrowthStages[s].time_ns) * 1e-3);
        }
    }

    [[nodiscard]] SceneCost cost() const {
        SceneCost cost = cost_;
        cost.free_us = medians_of(free_us_);
        cost.contact_us = medians_of(contact_us_);
        return cost;
    }

  private:
    std::size_t first_step_;
    std::size_t steps_;
    std::int64_t step_ns_;
    SceneCost cost_;
    std::unique_ptr<Simulation> simulation_;
    std::array<std::vector<double>, kGrowthStages.size()> free_us_;
    std::array<std::vector<double>, kGrowthStages.size()> contact_us_;
};

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

std::vector<SceneCost> measure_growth(std::span<const GrowthCase> sizes, Simulation::ClockFunction clock,
                                      const Progress& progress) {
    const auto count = static_cast<double>(sizes.size());
    std::vector<MeasuredScene> scenes;
    scenes.reserve(sizes.size());
    std::size_t steps = 0;
    for (const GrowthCase& size : sizes) {
        const auto built = static_cast<double>(scenes.size());
        scenes.emplace_back(size, clock,
                            part_of(progress, kBuildingShare * built / count, kBuildingShare * (built + 1.0) / count));
        steps = std::max(steps, size.steps);
    }
    for (std::size_t k = 0; k < steps; ++k) {
        report(progress, kBuildingShare + (1.0 - kBuildingShare) * static_cast<double>(k) / static_cast<double>(steps));
        for (MeasuredScene& scene : scenes) {
            scene.step(k);
        }
    }
    std::vector<SceneCost> costs;
    costs.reserve(scenes.size());
    for (const MeasuredScene& scene : scenes) {
        costs.push_back(scene.cost());
    }
    return costs;
}

double growth_exponent(double first_time, double time, std::size_t first_n, std::size_t n) {
    return std::log(time / first_time) / std::log(static_cast<double>(n) / static_cast<double>(first_n));
}

double relative_to_n_log_n(double time, std::size_t n, double first_time, std::size_t first_n) {
    return time / first_time * n_log_n(first_n) / n_log_n(n);
}

std::vector<Growth> growths_of(std::span<const SceneCost> costs) {
    std::vector<Growth> growths;
    if (costs.size() < 2) {
        return growths;
    }
    const SceneCost& first = costs[costs.size() - 2];
    const SceneCost& last = costs.back();
    const auto exponent = [&](double small, double large) {
        return growth_exponent(small, large, first.particles, last.particles);
    };
    const double n_log_n_exponent = exponent(n_log_n(first.particles), n_log_n(last.particles));
    const auto add = [&](std::string what, double small, double large, double tolerance = kExponentTolerance) {
        if (small > 0.0 && large > 0.0) {
            growths.push_back({std::move(what), exponent(small, large), n_log_n_exponent + tolerance});
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
    add("building", first.build_s, last.build_s, kBuildingTolerance);
    add("memory", first.held_mb, last.held_mb);
    return growths;
}

}  // namespace haptic::sim::reproduce
