// The catch of scene cloth-drop without most of its fall.
#pragma once

#include <string>
#include <vector>

#include "haptic/config.hpp"
#include "haptic/sim/simulation.hpp"

namespace haptic::sim::test {

/// cloth-drop from 0.5 m, at the speed that it has there after a fall from 10 m.
inline Scene late_drop(double shift = 0.0, const std::vector<std::string>& more = {}) {
    Config config = open_scene("cloth-drop");
    config.set("model.height=0.5");
    config.set("model.velocity=[0.0, -13.66, 0.0]");
    config.set("model.shift=" + std::to_string(shift));
    for (const std::string& assignment : more) {
        config.set(assignment);
    }
    return read_scene(config, "late-drop");
}

}  // namespace haptic::sim::test
