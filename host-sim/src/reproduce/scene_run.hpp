// Scene run: one of the built-in scenes, with the thesis' solver, run by its own script to its end.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "haptic/sim/simulation.hpp"
#include "haptic/types.hpp"
#include "program/progress_bar.hpp"
#include "reproduce/povray.hpp"

namespace haptic::sim::reproduce {

/// The thesis moves its bodies by position-based constraints; built-in scenes may give them a material instead. These
/// assignments, as for --set, turn such a scene back: solver, stiffnesses, masses, and what was tuned to them.
[[nodiscard]] std::vector<std::string> thesis_assignments(std::string_view scene);

class SceneRun {
  public:
    /// Loads a built-in scene, with thesis_assignments() and then `assignments`, "key=value" as for --set. The clock
    /// measures the stages; null: no times.
    SceneRun(const std::string& scene, const std::vector<std::string>& assignments, std::int64_t (*clock)());

    /// The simulation has reached the duration of the scene.
    [[nodiscard]] bool finished() const noexcept;

    /// Lets the bodies come to rest, with the hand where its script begins: steps until no vertex is faster than
    /// `speed` (m/s), or for `at_most_s`. The script then starts at 0. Returns the time that passed, s.
    double settle(double speed, double at_most_s);

    /// Makes one step of the script, with the independent check, and stores the vertices as the step found them.
    const StepResult& step();
    /// The same with the device at a pose of a hand that reacts to forces; curl and buttons are those of the script.
    const StepResult& step(const Pose& device);

    /// The scene as the last step found it, with the proxy that this step produced. The picture refers to this object.
    [[nodiscard]] PictureScene picture(const std::string& title) const;

    [[nodiscard]] const Simulation& simulation() const noexcept { return simulation_; }
    [[nodiscard]] const StepResult& result() const noexcept { return result_; }
    /// Vertices at the beginning of the last step, m.
    [[nodiscard]] const std::vector<Vec3>& vertices() const noexcept { return vertices_; }
    /// Time of the script at the beginning of the last step, s.
    [[nodiscard]] double time_s() const noexcept { return time_s_; }
    /// Steps in which the independent check found that a surface passed through the proxy.
    [[nodiscard]] std::uint64_t escapes() const noexcept { return escapes_; }

  private:
    const StepResult& step(const StepInput& input);
    /// Time of the script at the beginning of the next step.
    [[nodiscard]] std::int64_t script_time_ns() const;

    Simulation simulation_;
    StepResult result_;
    std::vector<Vec3> vertices_;
    double time_s_ = 0.0;
    std::uint64_t settled_steps_ = 0;
    std::uint64_t escapes_ = 0;
    ProgressBar progress_;
};

/// Quantile: the value below which this fraction (0 .. less than 1) of the values lies; 0 if there are none.
[[nodiscard]] double quantile(std::vector<double> values, double fraction);

/// A number with a fixed number of digits behind the decimal point, e.g. "1.23".
[[nodiscard]] std::string format_fixed(double value, int digits);

/// A count with separators of thousands, e.g. "54,800".
[[nodiscard]] std::string with_separators(std::size_t count);

}  // namespace haptic::sim::reproduce
