// Link guard: keeps thin objects from getting between two spheres of a tool.
//
// Each sphere moves on its own, and spheres of one tool pass through one another. So they can roll around a thin rod
// one after the other, however close they are, until the tool is on its other side although no centre crossed a surface
// (thesis, figure 5.9). The segment between the centres of two neighbours detects this. When both move from a0, b0 to
// a1, b1, the segment sweeps a patch, here the triangles (a0, b0, b1) and (a0, b1, a1). If the patch meets no surface,
// everything beside the segment is still on the same side.
#pragma once

#include <optional>
#include <span>

#include "contact/swept_tree.hpp"
#include "haptic/sim/contact.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

/// Centres of two neighbours before and after a move, m. Neither crosses a surface on its own path.
struct LinkMove {
    Vec3 a0{0.0};
    Vec3 b0{0.0};
    Vec3 a1{0.0};
    Vec3 b1{0.0};
};

/// Surface that the segment hit.
struct LinkHit {
    /// Normal to the segment before the move, away from the surface, with the touched point. The caller sets offset and
    /// velocity for the sphere to be kept back.
    SurfacePlane plane;
};

/// Finds the hit nearest to the segment before the move, with the surfaces at the end of the step. None if the patch
/// meets no surface, or if a surface already crosses the segment, so that there is nothing to keep. No allocation.
[[nodiscard]] std::optional<LinkHit> find_link_hit(std::span<const MovingSurface> surfaces, const LinkMove& move);

}  // namespace haptic::sim
