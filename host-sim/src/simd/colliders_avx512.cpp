// Rows of colliders with AVX-512 (see CMakeLists.txt).
#include "simd/collider_lanes.hpp"

namespace haptic::sim {

extern const ColliderKernels kColliderEightLanes = kColliderKernels<8>;

}  // namespace haptic::sim
