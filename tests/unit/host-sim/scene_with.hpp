// Built-in scenes with some of their settings changed.
#pragma once

#include <string>
#include <vector>

#include "haptic/config.hpp"
#include "haptic/sim/scene.hpp"

namespace haptic::sim::test {

/// Each assignment is a key=value, as on the command line.
inline Scene scene_with(const std::string& name, const std::vector<std::string>& assignments = {}) {
    Config config = open_scene(name);
    for (const std::string& assignment : assignments) {
        config.set(assignment);
    }
    return read_scene(config, name);
}

}  // namespace haptic::sim::test
