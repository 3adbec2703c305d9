// Kernels for AVX-512F.
#include "simd/collider_lanes.hpp"
#include "simd/kernels.hpp"
#include "simd/projection_lanes.hpp"

namespace haptic::sim {

extern const Kernels kAvx512Kernels{kProjection<16>, kColliderKernels<8>, skin_avx2, refit_avx2};

}  // namespace haptic::sim
