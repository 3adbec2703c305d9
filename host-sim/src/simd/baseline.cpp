// Kernels for the registers that every machine has.
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
namespace {

void skin_baseline(const SkinningTask& task) noexcept {
    skin_rows<2>(task);
}

void refit_baseline(const RefitTask& task) noexcept {
    RefitRows<2>::run(task);
}

void inverse_one_lane(const InverseTask& task) noexcept {
    InverseRows<1>::run(task);
}

void inverse_baseline(const InverseTask& task) noexcept {
    InverseRows<2>::run(task);
}

}  // namespace

extern const Kernels kOneLaneKernels{kProjection<1>,     kMotion<1>,         kColliderKernels<1>,
                                     kElasticKernels<1>, kFeatureKernels<1>, kDeformationKernels<1>,
                                     skin_baseline,      refit_baseline,     inverse_one_lane};
extern const Kernels kBaselineKernels{kProjection<4>,     kMotion<4>,         kColliderKernels<2>,
                                      kElasticKernels<2>, kFeatureKernels<2>, kDeformationKernels<2>,
                                      skin_baseline,      refit_baseline,     inverse_baseline};

}  // namespace haptic::sim
