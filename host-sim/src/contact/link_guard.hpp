// What is thin does not get between two spheres of a tool.
//
// Each sphere goes to its own place, and spheres of one tool pass through one another. So they roll round a thin rod
// one after the other, however densely they sit, and in the end the tool is on its other side without any centre having
// crossed anything (thesis, figure 5.9). What tells is the segment between the centres of two neighbours: where both
// go from a0, b0 to a1, b1, it sweeps over a patch, here the triangles (a0, b0, b1) and (a0, b1, a1). If the patch
// meets no surface, what was beside the segment is beside it still.
#pragma once

#include <optional>
#include <span>

#include <haptic/sim/contact.hpp>
#include "contact/swept_tree.hpp"
#include <haptic/types.hpp>

namespace haptic::sim {

/// The centres of two neighbours before and after a move, m. Neither crosses a surface on its own way.
struct LinkMove {
    Vec3 a0{0.0};
    Vec3 b0{0.0};
    Vec3 a1{0.0};
    Vec3 b1{0.0};
};

/// Where a segment has run into a surface.
struct LinkHit {
    /// Normal to the segment as it was before, away from the surface, with the touched point; offset and velocity are
    /// for whom the plane is to hold.
    SurfacePlane plane;
};

/// The hit that is nearest to the segment before the move, of surfaces as they are at the end of the step. None: the
/// patch meets nothing; or a surface goes through the segment already, so that there is nothing to keep. No allocation.
[[nodiscard]] std::optional<LinkHit> find_link_hit(std::span<const MovingSurface> surfaces, const LinkMove& move);

}  // namespace haptic::sim
