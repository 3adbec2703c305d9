// Regions of a body: what a scene says of the particles and triangles in a box.
#pragma once

#include "haptic/sim/deformable.hpp"
#include "haptic/sim/model_settings.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

/// The box of a region of a body at a placement.
class RegionBox {
  public:
    RegionBox(const Region& region, const Placement& placement);
    /// A position at rest, m, scene, in the frame of the box.
    [[nodiscard]] Vec3 in_body(const Vec3& rest) const noexcept;
    /// The same for whether it is in the box. The border is inside.
    [[nodiscard]] bool contains(const Vec3& rest) const noexcept;

  private:
    Vec3 low_;
    Vec3 high_;
    Vec3 origin_;
    Mat3 body_from_scene_;
};

/// Gives a body at `placement`, which has its material, the stiffnesses, motions and loads of its regions. Throws
/// ConfigError for a region without particles, unless the mesh is from a file, and for a load that nothing can take.
void apply_regions(const ModelSettings& settings, const Placement& placement, DeformableBody& body);

}  // namespace haptic::sim
