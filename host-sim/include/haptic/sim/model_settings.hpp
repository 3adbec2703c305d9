// The [model] table of a scene: which body is made, from a generator or a mesh file, and where its copies stand.
#pragma once

#include <string>
#include <vector>

#include "haptic/config.hpp"
#include "haptic/sim/cloth.hpp"
#include "haptic/sim/deformable.hpp"

namespace haptic::sim {

struct ModelSettings {
    ClothShape cloth;              // its centre at (0, height + shift, 0)
    Vec3 velocity{0.0};            // m/s, at the start
    double group_stiffness = 0.3;  // 0..1, alpha of the shape-matching groups
    double link_stiffness = 1.0;   // 0..1, of the distance constraints
    std::vector<Placement> copies{Placement{}};
};

/// Reads a table of the configuration, "model" or "objects.0", with all that is in it. Throws ConfigError.
[[nodiscard]] ModelSettings read_model(const Config& config, const std::string& table);

/// Makes the bodies, one for each copy. Throws std::invalid_argument.
[[nodiscard]] std::vector<DeformableBody> make_bodies(const ModelSettings& settings);

}  // namespace haptic::sim
