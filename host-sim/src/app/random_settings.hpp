// Random settings: what a viewer can change while a scene runs, changed at random moments to random values. Contact
// must hold meanwhile. The methods of the thesis, which promise less, are left alone, and so is what a run was given.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "haptic/sim/live_settings.hpp"
#include "haptic/sim/simulation.hpp"
#include "scene/random_numbers.hpp"
#include "view/command.hpp"
#include "view/live_parameters.hpp"

namespace haptic::sim {

class RandomSettings {
  public:
    /// For one simulation, of a scene whose own settings are `own`. What the assignments in `given` set,
    /// "KEY=VALUE", does not change. The same seed, scene and keys give the same changes.
    RandomSettings(std::uint64_t seed, const Simulation& simulation, const LiveSettings& own,
                   std::span<const std::string> given = {});

    /// Advances by `dt`, s: the change that is due, of parameters().
    [[nodiscard]] std::optional<view::SetParameter> advance(double dt);
    [[nodiscard]] const view::LiveParameters& parameters() const noexcept { return parameters_; }

  private:
    RandomNumbers random_;
    view::LiveParameters parameters_;
    std::vector<std::size_t> numbers_;  // parameters that have no choices
    double left_s_ = 0.0;               // s, until the next change
};

}  // namespace haptic::sim
