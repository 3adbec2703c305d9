// Kernels for AVX-512F.
#include "simd/collider_lanes.hpp"
#include "simd/deformation_lanes.hpp"
#include "simd/elastic_lanes.hpp"
#include "simd/feature_lanes.hpp"
#include "simd/inverse_rows.hpp"
#include "simd/kernels.hpp"
#include "simd/motion_lanes.hpp"
#include "simd/projection_lanes.hpp"

namespace haptic::sim {
namespace {

void inverse_avx512(const InverseTask& task) noexcept {
    InverseRows<8>::run(task);
}

}  // namespace

extern const Kernels kAvx512Kernels{kProjection<16>,    kMotion<16>,        kColliderKernels<8>,
                                    kElasticKernels<8>, kFeatureKernels<8>, kDeformationKernels<8>,
                                    skin_avx2,          refit_avx2,         inverse_avx512};

}  // namespace haptic::sim
