// Projection with AVX2 (see CMakeLists.txt).
#include "simd/projection_lanes.hpp"

namespace haptic::sim {

extern const Projection kEightLanes = kProjection<8>;

}  // namespace haptic::sim
