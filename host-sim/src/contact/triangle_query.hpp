// Triangle queries: the whole answer of the contact code to one sphere at rest and one moving triangle, to check the
// method against independent data (`host-sim query ccd`, Python's haptic.ccd).
#pragma once

#include <optional>

#include "contact/triangle_ccd.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

struct TriangleQuery {
    Vec3 center{0.0};     // m, of the sphere, which is at rest
    double radius = 0.0;  // m, positive
    MovingTriangle triangle;
};

struct TriangleAnswer {
    Feature touched = Feature::None;     // what the sphere touches first
    double touch_time = 0.0;             // in [0, 1]; of a sphere that is touched
    std::optional<double> passage_time;  // in [touch_time, 1]: the triangle passes through the centre
    Vec3 normal{0.0};                    // unit, from the touched point to the centre; of a sphere that is touched
    Vec3 secure_position{0.0};           // m, centre at t = 1: secure position, then pop-out
};

/// Precondition: finite coordinates.
[[nodiscard]] TriangleAnswer answer(const TriangleQuery& query);

}  // namespace haptic::sim
