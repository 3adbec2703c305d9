#include "simd/kernels.hpp"

#include <array>
#include <cstddef>

namespace haptic::sim {
namespace {

/// Detects the instruction sets of the processor once, at the first use.
struct UsableKernels {
    std::array<const Kernels*, 4> entry{&kOneLaneKernels, &kBaselineKernels};
    std::size_t count = 2;

    UsableKernels() noexcept {
#if defined(__x86_64__)
        if (__builtin_cpu_supports("avx2") != 0) {
            entry[count++] = &kAvx2Kernels;
        }
        if (__builtin_cpu_supports("avx512f") != 0) {
            entry[count++] = &kAvx512Kernels;
        }
#endif
    }
};

}  // namespace

std::span<const Kernels* const> usable_kernels() noexcept {
    static const UsableKernels usable;
    return {usable.entry.data(), usable.count};
}

const Kernels& widest_kernels() noexcept {
    return *usable_kernels().back();
}

}  // namespace haptic::sim
