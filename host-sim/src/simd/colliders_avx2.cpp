// Rows of colliders with AVX2 (see CMakeLists.txt).
#include "simd/collider_lanes.hpp"

namespace haptic::sim {

extern const ColliderKernels kColliderFourLanes = kColliderKernels<4>;

}  // namespace haptic::sim
