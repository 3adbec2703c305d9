// Projection with AVX2 (see CMakeLists.txt).
#include "projection_lanes.hpp"

namespace haptic::sim {

extern const Projection kFourLanes = kProjection<4>;

}  // namespace haptic::sim
