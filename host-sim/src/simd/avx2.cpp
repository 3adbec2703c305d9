// Kernels for AVX2.
#include "simd/collider_lanes.hpp"
#include "simd/deformation_lanes.hpp"
#include "simd/elastic_lanes.hpp"
#include "simd/feature_lanes.hpp"
#include "simd/inverse_rows.hpp"
#include "simd/kernels.hpp"
#include "simd/motion_lanes.hpp"
#include "simd/projection_lanes.hpp"
#include "simd/refit_rows.hpp"
#include "simd/skinning_rows.hpp"

namespace haptic::sim {

void skin_avx2(const SkinningTask& task) noexcept {
    skin_rows<4>(task);
}

void refit_avx2(const RefitTask& task) noexcept {
    RefitRows<4>::run(task);
}

namespace {

void inverse_avx2(const InverseTask& task) noexcept {
    InverseRows<4>::run(task);
}

}  // namespace

extern const Kernels kAvx2Kernels{kProjection<8>,     kMotion<8>,         kColliderKernels<4>,
                                  kElasticKernels<4>, kFeatureKernels<4>, kDeformationKernels<4>,
                                  skin_avx2,          refit_avx2,         inverse_avx2};

}  // namespace haptic::sim
