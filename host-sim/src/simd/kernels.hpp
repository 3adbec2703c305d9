// Kernel table: the vectorised inner loops, compiled once for each instruction set and chosen at run time.
//
// All entries give the same bits. baseline.cpp, avx2.cpp and avx512.cpp instantiate the same templates for registers of
// different width, each with its own compile flags (see CMakeLists.txt); lanes.hpp says what they have to observe.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "simd/collider_rows.hpp"
#include "simd/deformation.hpp"
#include "simd/elastic.hpp"
#include "simd/features.hpp"
#include "simd/inverse.hpp"
#include "simd/motion.hpp"
#include "simd/projection.hpp"
#include "simd/refit.hpp"
#include "simd/skinning.hpp"

namespace haptic::sim {

struct Kernels {
    ProjectionKernels projection;
    MotionKernels motion;
    ColliderKernels colliders;
    ElasticKernels elastic;
    FeatureKernels features;
    DeformationKernels deformation;
    SkinningFunction skin;
    RefitFunction refit;
    InverseFunction inverse;
};

extern const Kernels kOneLaneKernels;   // reference: constraints and colliders one by one
extern const Kernels kBaselineKernels;  // 128-bit registers: every x86-64 and aarch64
#if defined(__x86_64__)
extern const Kernels kAvx2Kernels;
extern const Kernels kAvx512Kernels;  // AVX-512F

// For kAvx512Kernels too: no 512-bit version exists, since both work on vectors of four doubles.
void skin_avx2(const SkinningTask& task) noexcept;
void refit_avx2(const RefitTask& task) noexcept;
#endif

/// The entries that this machine can execute, narrowest first; at least kOneLaneKernels and kBaselineKernels.
[[nodiscard]] std::span<const Kernels* const> usable_kernels() noexcept;

/// The last of usable_kernels().
[[nodiscard]] const Kernels& widest_kernels() noexcept;

constexpr std::size_t kWidestLanes = 0;

/// The part of an entry (`&Kernels::projection`) that has this number of lanes; the widest for kWidestLanes. Null if
/// this machine has none.
template <class Part>
[[nodiscard]] const Part* find_kernels(Part Kernels::* part, std::size_t lanes) noexcept {
    if (lanes == kWidestLanes) {
        return &(widest_kernels().*part);
    }
    for (const Kernels* kernels : usable_kernels()) {
        if ((kernels->*part).lanes == lanes) {
            return &(kernels->*part);
        }
    }
    return nullptr;
}

/// The numbers of lanes that find_kernels() finds, ascending.
template <class Part>
[[nodiscard]] std::vector<std::size_t> lanes_of(Part Kernels::* part) {
    std::vector<std::size_t> lanes;
    for (const Kernels* kernels : usable_kernels()) {
        lanes.push_back((kernels->*part).lanes);
    }
    return lanes;
}

}  // namespace haptic::sim
