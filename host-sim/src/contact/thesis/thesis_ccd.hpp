// The thesis' own continuous collision detection of a standing proxy against moving triangles (Algorithm 1), selected
// by CcdMethod::Thesis. It is here to be compared with, not to be relied upon.
//
// For each triangle, t_mu is the first moment in (0, 1) at which its plane passes through the sphere's centre (equation
// 4.5, a cubic). If the centre is inside the triangle then, the contact is on the face; if the triangle is within the
// radius then, on an edge or a vertex. The first face contact of all wins; without one, the first edge or vertex does.
//
// Mended, because it cannot have been meant as printed:
// - Equations 4.4 and 4.5 print a cross product for the scalar product.
// - t_mu < 0 "will not exist" (4.2.3): of up to three real roots any may be before or after the step. The smallest one
//   within it is taken, as the text to equation 4.8 asks.
// - Line 4 moves the centre along the face's normal, line 7 along the direction "from the proxy to the closest point",
//   into the triangle. Both are taken toward the side where the centre was, which serves double-faced and open meshes.
// - A centre that meets the border itself (distance 0) has no direction for line 7: that is a face contact here.
// - The published program drops cubics by absolute thresholds; ours are relative, so the scale of a scene is no matter.
//
// Kept, because it is the method: a triangle that clips the sphere while its plane does not pass through the centre
// within the step is not found, nor one whose plane does so only before or after the clipping, or within the step a
// second time; contact is found as late as the centre is met; any face beats any edge, however late; one contact a
// step is answered; and the jump to the secure position is not swept. What overlaps at the end is left to the pop-out.
#pragma once

#include <span>

#include <haptic/realtime.hpp>
#include <haptic/sim/contact.hpp>
#include "contact/proxy_path.hpp"
#include "contact/secure_position.hpp"
#include "contact/swept_tree.hpp"
#include "contact/triangle_ccd.hpp"

namespace haptic::sim {

/// What Algorithm 1 finds of one triangle.
struct ThesisContact {
    Feature feature = Feature::None;  // Face: the triangle is in the set S; Edge, Vertex: in W; None: in neither
    double time = 0.0;                // t_mu, in (0, 1)
    ClosestPoint at;                  // nearest point at t_mu; `point` relative to the sphere's centre
    Vec3 normal{0.0};  // unit; Face: of the triangle at t = 1, on the centre's side; else from the point to the centre
};

/// Equations 4.6 to 4.11 for one triangle. No libm but sqrt.
[[nodiscard]] ThesisContact thesis_triangle_ccd(const Vec3& center, double radius,
                                                const MovingTriangle& triangle) HAPTIC_RT;

/// Algorithm 1 over all triangles whose swept boxes meet the sphere's, so over all that can matter. Of equal times the
/// lower object and triangle wins, whatever the tree. Distances are held against radius * settings.shrink, the centre
/// is placed at the radius (thesis 4.1.4). `first_time` is t_mu. Appends to `path`, if given, the way beside the
/// touched face that a sphere might have gone; nobody has swept it.
[[nodiscard]] SecurePosition thesis_secure_position(std::span<const MovingSurface> surfaces, const Vec3& center,
                                                    double radius, const ContactSettings& settings,
                                                    ProxyPath* path = nullptr) noexcept;

}  // namespace haptic::sim
