// Kernel table: the vectorised inner loops, compiled once for each instruction set and chosen at run time.
//
// All entries give the same bits. baseline.cpp, avx2.cpp and avx512.cpp instantiate the same templates for registers of
// different width, each with its own compile flags (see CMakeLists.txt); lanes.hpp says what they have to observe.
#pragma once

#include <span>

#include "simd/collider_rows.hpp"
#include "simd/projection.hpp"
#include "simd/refit.hpp"
#include "simd/skinning.hpp"

namespace haptic::sim {

struct Kernels {
    ProjectionKernels projection;
    ColliderKernels colliders;
    SkinningFunction skin;
    RefitFunction refit;
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

}  // namespace haptic::sim
