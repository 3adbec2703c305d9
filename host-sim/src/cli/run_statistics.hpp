// What is kept of a run: for its summary, its report and its record.
#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "haptic/histogram.hpp"
#include "haptic/sim/simulation.hpp"

namespace haptic::sim {

struct StageHistograms {
    Histogram total, ccd, popout, proxy, tool, deform, collide, skin;
};

class RunStatistics {
  public:
    /// `expected_steps` is room to reserve, so that a run does not allocate; more steps are no error.
    RunStatistics(const Scene& scene, bool recording, std::size_t expected_steps);

    void add(const StepInput& input, const StepResult& result);

    [[nodiscard]] std::uint64_t escapes() const noexcept { return escapes_; }
    [[nodiscard]] std::uint64_t steps() const noexcept { return steps_; }
    /// The surface was held without a break for kHeldForSeconds, or until the run ended, and never passed.
    [[nodiscard]] bool caught() const noexcept;

    /// The JSON report, keys as the design gives them. `wall_s` is what the run took.
    [[nodiscard]] nlohmann::json report(const Simulation& simulation, double wall_s, bool verified) const;
    /// The short table for a person.
    [[nodiscard]] std::string summary(const Simulation& simulation, double wall_s, bool verified) const;
    /// Throws CsvError.
    void write_record(const std::filesystem::path& file) const;

  private:
    static constexpr double kHeldForSeconds = 0.1;

    struct Row {
        std::int64_t time_ns;
        Pose device;
        Vec3 proxy, hip, hand_force;
        bool in_contact;
        double step_us;
        Vec3 hand_torque;
        double curl;
    };

    double step_s_;
    bool recording_;
    std::vector<Row> rows_;
    StageHistograms times_;
    std::uint64_t steps_ = 0;
    std::uint64_t in_contact_ = 0;
    std::uint64_t held_ = 0;  // steps in contact up to now without a break
    std::uint64_t longest_held_ = 0;
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
