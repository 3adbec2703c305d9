// Live parameters: the settings that a viewer may change while a scene runs, with the range of each control.
//
// Key, label, unit, choices and allowed range come from the description of the setting (scene_reference()). Here each
// control gets a narrower range around the scene's own value.
#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "haptic/sim/live_settings.hpp"
#include "haptic/sim/simulation.hpp"
#include "view/snapshot.hpp"

namespace haptic::sim::view {

class LiveParameters {
  public:
    /// The parameters that have an effect in the scene: proxy.radius for a tool of one sphere, the tool's own for a
    /// tool of several. Controls range to both sides of `settings`, the scene's own, within what a scene file may say.
    LiveParameters(const Simulation& simulation, const LiveSettings& settings);
    explicit LiveParameters(const Simulation& simulation) : LiveParameters(simulation, simulation.settings()) {}

    [[nodiscard]] const std::vector<ParameterDescription>& descriptions() const noexcept { return descriptions_; }
    /// In the order of the descriptions; the rest is 0.
    [[nodiscard]] std::array<double, kMaxParameters> values(const LiveSettings& settings) const noexcept;
    /// Settings with another value of one parameter, clamped to its range. Dynamic friction never exceeds static
    /// friction: the other one of the two follows.
    [[nodiscard]] LiveSettings with(const LiveSettings& settings, std::size_t parameter, double value) const;

    /// One parameter as in a scene file and for --set, "solver.step=0.005". Reads back to the same bits.
    [[nodiscard]] std::string assignment(const LiveSettings& settings, std::size_t parameter) const;

    /// The assignments of `to` for all parameters in which the two differ.
    [[nodiscard]] std::vector<std::string> assignments(const LiveSettings& from, const LiveSettings& to) const;

  private:
    struct Control;
    void add(std::string_view key, const Control& control);

    std::vector<const LiveSetting*> parameters_;
    std::vector<ParameterDescription> descriptions_;
};

/// The settings changed by one assignment, "solver.step=0.005", as in a scene file. Throws std::invalid_argument: not a
/// live setting, not a value of it, or out of its range.
[[nodiscard]] LiveSettings assigned(const LiveSettings& settings, const std::string& assignment);

}  // namespace haptic::sim::view
