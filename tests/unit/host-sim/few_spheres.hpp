// Small tools for tests, built by hand.
#pragma once

#include <cstdint>
#include <vector>

#include "haptic/sim/tool_model.hpp"

namespace haptic::sim::test {

/// side x side spheres in the plane y = 0 of the tool frame, centred on the origin. Each forms a group with its
/// neighbours, diagonals included.
inline ToolModel square_of_spheres(int side, double spacing, double radius, const ToolMaterial& material = {}) {
    ToolModel tool;
    ParticleModel& model = tool.body.particles;
    const double middle = 0.5 * (side - 1);
    for (int j = 0; j < side; ++j) {
        for (int i = 0; i < side; ++i) {
            model.add(Vec3((i - middle) * spacing, 0.0, (j - middle) * spacing), 0.1, radius);
        }
    }
    for (int j = 0; j < side; ++j) {
        for (int i = 0; i < side; ++i) {
            Group group;
            group.centre = static_cast<std::uint32_t>(j * side + i);
            for (int b = j > 0 ? j - 1 : 0; b < side && b <= j + 1; ++b) {
                for (int a = i > 0 ? i - 1 : 0; a < side && a <= i + 1; ++a) {
                    group.members.push_back(static_cast<std::uint32_t>(b * side + a));
                }
            }
            model.groups.push_back(group);
        }
    }
    tool.radius.assign(model.size(), radius);
    tool.volume.assign(model.size(), 4.0 * radius * radius * radius);
    tool.material = material;
    return tool;
}

/// Spheres at given positions without constraints.
inline ToolModel loose_spheres(const std::vector<Vec3>& where, double radius) {
    ToolModel tool;
    for (const Vec3& o : where) {
        tool.body.particles.add(o, 0.1, radius);
    }
    tool.radius.assign(where.size(), radius);
    tool.volume.assign(where.size(), 4.0 * radius * radius * radius);
    return tool;
}

}  // namespace haptic::sim::test
