// Projection with registers that every machine has.
#include "simd/projection_lanes.hpp"

namespace haptic::sim {

extern const Projection kOneLane = kProjection<1>;
extern const Projection kFourLanes = kProjection<4>;

}  // namespace haptic::sim
