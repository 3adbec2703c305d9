// The settings of a scene that a viewer may change while it runs: how they are called and what they may be, and how
// a value becomes one of LiveSettings and back.
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
    /// Those of a scene: the radius where the tool is one sphere, what is for many where it has many. A slider goes
    /// some way to either side of `s`, the scene's own settings, within what a scene file may say.
    LiveParameters(const Simulation& simulation, const LiveSettings& s);
    explicit LiveParameters(const Simulation& simulation) : LiveParameters(simulation, simulation.settings()) {}

    [[nodiscard]] const std::vector<ParameterDescription>& descriptions() const noexcept { return descriptions_; }
    /// In the order of the descriptions; the rest is 0.
    [[nodiscard]] std::array<double, kMostParameters> values(const LiveSettings& settings) const noexcept;
    /// With another value of one parameter, which is brought within its range; friction in motion never exceeds that
    /// at rest, the other one yields.
    [[nodiscard]] LiveSettings with(const LiveSettings& settings, std::size_t parameter, double value) const noexcept;

    /// The value of one parameter as a scene file and --set have it, "solver.step=0.005": reads back to the same bits.
    [[nodiscard]] std::string assignment(const LiveSettings& settings, std::size_t parameter) const;

    /// Of all parameters in which two differ, those of the second.
    [[nodiscard]] std::vector<std::string> assignments(const LiveSettings& from, const LiveSettings& to) const;

  private:
    struct Parameter;
    struct Slider;

    std::vector<const Parameter*> parameters_;
    std::vector<ParameterDescription> descriptions_;

    static const std::array<Parameter, 11>& all();
    void add(std::string_view key, const Slider& slider);
    friend LiveSettings assigned(const LiveSettings& settings, const std::string& assignment);
};

/// The settings with what one assignment, "solver.step=0.005", says, as the scene file would have it. Throws
/// std::invalid_argument: not a live parameter, not a value of it, or out of its range.
[[nodiscard]] LiveSettings assigned(const LiveSettings& settings, const std::string& assignment);

}  // namespace haptic::sim::view
