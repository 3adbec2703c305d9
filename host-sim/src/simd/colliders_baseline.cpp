// Rows of colliders with registers that every machine has.
#include "simd/collider_lanes.hpp"

namespace haptic::sim {

extern const ColliderKernels kColliderOneLane = kColliderKernels<1>;
extern const ColliderKernels kColliderTwoLanes = kColliderKernels<2>;

}  // namespace haptic::sim
