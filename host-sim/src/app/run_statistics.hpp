// What is kept of a run for its summary and its report.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include <haptic/histogram.hpp>
#include <haptic/sim/simulation.hpp>

namespace haptic::sim {

struct StageHistograms {
    Histogram total, ccd, popout, proxy, tool, deform, collide, skin;
};

class RunStatistics {
  public:
    void add(const StepResult& result);

    [[nodiscard]] std::uint64_t escapes() const noexcept { return escapes_; }
    [[nodiscard]] std::uint64_t steps() const noexcept { return steps_; }
    /// The surface was held without a break for kHeldForSeconds, or until the run ended, and never passed.
    [[nodiscard]] bool caught() const noexcept;

    /// The JSON report, keys as the design gives them. `wall_s` is what the run took.
    [[nodiscard]] nlohmann::json report(const Simulation& simulation, double wall_s, bool verified) const;
    /// The short table for a person.
    [[nodiscard]] std::string summary(const Simulation& simulation, double wall_s, bool verified) const;

  private:
    static constexpr double kHeldForSeconds = 0.1;

    StageHistograms times_;
    std::uint64_t steps_ = 0;
    std::uint64_t in_contact_ = 0;
    double held_s_ = 0.0;  // in contact up to now without a break
    double longest_held_s_ = 0.0;
    double held_since_s_ = 0.0;
    std::uint64_t squeezed_ = 0;
    std::uint64_t let_through_ = 0;
    std::uint64_t escapes_ = 0;
    double first_contact_s_ = -1.0;
    double deepest_ = 0.0;
    double highest_force_ = 0.0;        // N, hand
    double highest_scene_force_ = 0.0;  // N
    double highest_torque_ = 0.0;       // N*m, hand
    std::size_t most_collided_ = 0;     // proxies in contact at once
    double force_sum_ = 0.0;            // N, hand, over steps in contact
};

}  // namespace haptic::sim
