// Projection with AVX-512F (see CMakeLists.txt).
#include "simd/projection_lanes.hpp"

namespace haptic::sim {

extern const Projection kSixteenLanes = kProjection<16>;

}  // namespace haptic::sim
