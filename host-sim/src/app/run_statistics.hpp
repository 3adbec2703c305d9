// Run statistics: figures of a run for its summary and its report.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "haptic/histogram.hpp"
#include "haptic/sim/simulation.hpp"
#include "simd/aabb.hpp"

namespace haptic::sim {

struct StageHistograms {
    Histogram total, ccd, popout, proxy, tool, deform, collide, skin;
};

/// Steps in which something crossed, and the most that did in one step.
struct CrossingTally {
    std::uint64_t steps = 0;
    std::size_t most = 0;

    void add(std::size_t crossings) noexcept {
        steps += crossings > 0 ? 1 : 0;
        most = crossings > most ? crossings : most;
    }
};

class RunStatistics {
  public:
    void add(const StepResult& result);

    /// The verdict of the verification: one sentence for each thing that must not happen and did.
    [[nodiscard]] std::vector<std::string> violations() const;
    [[nodiscard]] std::uint64_t steps() const noexcept { return steps_; }
    /// Contact lasted kHeldForSeconds without a break, or until the end, and no surface was passed.
    [[nodiscard]] bool caught() const noexcept;

    /// JSON report. `wall_s`: duration of the run, s.
    [[nodiscard]] nlohmann::json report(const Simulation& simulation, double wall_s, bool verified) const;
    /// Short table for the terminal.
    [[nodiscard]] std::string summary(const Simulation& simulation, double wall_s, bool verified) const;

  private:
    [[nodiscard]] nlohmann::json surface_report(bool verified) const;

    static constexpr double kHeldForSeconds = 0.1;
    // s, in which a device's force fades after a contact
    static constexpr double kAfterContact = 0.1;
    // s, over which impulses are added as vectors
    static constexpr double kImpulseWindow = 0.1;

    StageHistograms times_;
    std::uint64_t steps_ = 0;
    std::uint64_t in_contact_ = 0;
    double held_s_ = 0.0;  // duration of the current contact
    double max_held_s_ = 0.0;
    double held_since_s_ = 0.0;
    std::uint64_t overconstrained_ = 0;
    std::uint64_t stood_still_ = 0;
    std::uint64_t sleeping_ = 0;  // steps in which a body slept
    std::size_t asleep_ = 0;      // bodies, in the last one
    std::uint64_t escapes_ = 0;
    CrossingTally sheets_;        // edges of sheets through sheets
    CrossingTally solids_;        // edges of solids through what they are kept apart from, themselves too
    CrossingTally others_;        // of surfaces that nothing keeps apart
    CrossingTally below_ground_;  // vertices
    double max_ground_depth_ = 0.0;
    double first_contact_s_ = -1.0;
    Aabb reached_;  // m, scene: where the tool was
    double max_depth_ = 0.0;
    double max_hand_force_ = 0.0;   // N, hand
    double max_scene_force_ = 0.0;  // N
    double max_hand_torque_ = 0.0;  // N*m, hand
    std::size_t max_collided_ = 0;  // maximum number of proxies in contact
    double force_sum_ = 0.0;        // N, hand, sum over steps in contact
    // N*s, impulses in contact and until kAfterContact later, hand: sums of the windows' magnitudes
    double hand_impulse_ = 0.0;
    double body_impulse_ = 0.0;
    Vec3 window_hand_{0.0};  // N*s, of the present window
    Vec3 window_bodies_{0.0};
    double window_s_ = 0.0;
    double impulses_until_s_ = -1.0;
};

}  // namespace haptic::sim
