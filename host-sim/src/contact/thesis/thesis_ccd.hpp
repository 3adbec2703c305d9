// Algorithm 1 of the thesis: triangle-proxy CCD as printed, selected by CcdMethod::Thesis. For comparison, not for use.
//
// For each triangle, t_mu is the first time in (0, 1) at which its plane passes through the sphere's centre (equation
// 4.5, a cubic). If the centre is inside the triangle at t_mu, the contact is on the face. If the triangle is within
// the radius, it is on an edge or a vertex. The first face contact of all triangles wins; without one, the first edge
// or vertex contact.
//
// Corrected, because the print cannot be meant literally:
// - Equations 4.4 and 4.5 print a cross product instead of a scalar product.
// - t_mu < 0 "will not exist" (4.2.3): of up to three real roots any may lie before or after the step. We take the
//   smallest one within it, as the text of equation 4.8 requires.
// - Line 4 moves the centre along the face's normal, line 7 along the direction "from the proxy to the closest point",
//   into the triangle. We move toward the side where the centre was, which also suits double-faced and open meshes.
// - A centre on the border itself (distance 0) has no direction for line 7: we treat it as a face contact.
// - The published program discards cubics by absolute thresholds; ours are relative, so the scale of a scene is free.
//
// Kept, because it is the method: a triangle is missed if it clips the sphere while its plane does not pass through the
// centre within the step, or passes only before or after the clipping, or passes a second time. A contact is found only
// when the plane reaches the centre. Any face beats any edge, however late. One contact a step is resolved. The jump to
// the secure position is not swept. Overlaps at the end are left to the pop-out.
#pragma once

#include <span>

#include "contact/proxy_path.hpp"
#include "contact/secure_position.hpp"
#include "contact/swept_tree.hpp"
#include "contact/triangle_ccd.hpp"
#include "haptic/realtime.hpp"
#include "haptic/sim/contact.hpp"

namespace haptic::sim {

/// Result of Algorithm 1 for one triangle.
struct ThesisContact {
    Feature feature = Feature::None;  // Face: the triangle is in the set S; Edge, Vertex: in W; None: in neither
    double time = 0.0;                // t_mu, in (0, 1)
    ClosestPoint at;                  // closest point at t_mu; `point` relative to the sphere's centre
    Vec3 normal{
        0.0};  // unit; Face: of the triangle at t = 1, on the centre's side; otherwise from the point to the centre
};

/// Equations 4.6 to 4.11 for one triangle. No libm except sqrt.
[[nodiscard]] ThesisContact thesis_triangle_ccd(const Vec3& center, double radius,
                                                const MovingTriangle& triangle) HAPTIC_RT;

/// Algorithm 1 over all triangles whose swept boxes overlap the sphere's box, which are all that can matter. Of equal
/// times the lower object and triangle wins, independent of the tree. Distances are compared with radius *
/// settings.shrink; the centre is placed at the full radius (thesis 4.1.4). `first_time` is t_mu. Appends to `path`, if
/// given, a path beside the touched face that the sphere might have taken; it is not swept.
[[nodiscard]] SecurePosition thesis_secure_position(std::span<const MovingSurface> surfaces, const Vec3& center,
                                                    double radius, const ContactSettings& settings,
                                                    ProxyPath* path = nullptr) noexcept;

}  // namespace haptic::sim
