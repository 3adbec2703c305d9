// Skinning loop of skinning.hpp with registers of `Width` numbers. Only one source file may instantiate each width (see
// lanes.hpp).
#pragma once

#include "simd/lanes.hpp"
#include "simd/skinning.hpp"

namespace haptic::sim {

template <std::size_t Width>
void skin_rows(const SkinningTask& task) noexcept {
    using Real = typename LaneTypes<Width>::Real;
    constexpr std::size_t parts = 4 / Width;  // registers per column
    constexpr std::size_t rows = 4;           // columns of a transform: three axes and the translation
    const std::uint32_t* particle = task.particle;
    const double* weight = task.weight;
    const double* rest = task.rest;
    for (std::size_t j = 0; j < task.vertices; ++j, rest += 3) {
        // Blend the transforms: sum over the particles of weight * transform.
        Real blend[rows][parts];
        for (std::size_t k = 0; k < kParticlesPerVertex; ++k, ++particle, ++weight) {
            const double* frame = task.frame[*particle].row[0].number;
            for (std::size_t r = 0; r < rows; ++r) {
                for (std::size_t p = 0; p < parts; ++p) {
                    const Real weighted = *weight * load<Real>(frame + 4 * r + p * Width);
                    blend[r][p] = k == 0 ? weighted : blend[r][p] + weighted;
                }
            }
        }
        // Apply the blend to the rest position.
        Real sum[parts];
        for (std::size_t p = 0; p < parts; ++p) {
            sum[p] = (blend[3][p] + rest[0] * blend[0][p]) + (rest[1] * blend[1][p] + rest[2] * blend[2][p]);
        }
        if (task.before != nullptr) {
            __builtin_memcpy(task.before + 3 * j, task.out + 3 * j, 3 * sizeof(double));
        }
        __builtin_memcpy(task.out + 3 * j, sum, 3 * sizeof(double));
    }
}

}  // namespace haptic::sim
