// The loop of skinning.hpp, with registers of `Width` numbers. To be used by one translation unit for each width (see
// lanes.hpp).
#pragma once

#include "lanes.hpp"
#include "skinning.hpp"

namespace haptic::sim {

template <std::size_t Width>
void skin_rows(const SkinningTask& task) noexcept {
    using Real = typename LaneTypes<Width>::Real;
    constexpr std::size_t parts = 4 / Width;  // of a row
    const std::uint32_t* particle = task.particle;
    const SkinArm* arm = task.arm;
    for (std::size_t j = 0; j < task.vertices; ++j) {
        Real sum[parts] = {};
        for (std::size_t k = 0; k < SkinVertex::kMost; ++k, ++particle, ++arm) {
            const ParticleFrame& frame = task.frame[*particle];
            for (std::size_t p = 0; p < parts; ++p) {
                const std::size_t at = p * Width;
                sum[p] += arm->weight * load<Real>(frame.position.number + at) +
                          arm->arm[0] * load<Real>(frame.axis[0].number + at) +
                          arm->arm[1] * load<Real>(frame.axis[1].number + at) +
                          arm->arm[2] * load<Real>(frame.axis[2].number + at);
            }
        }
        __builtin_memcpy(task.out + 3 * j, sum, 3 * sizeof(double));
    }
}

}  // namespace haptic::sim
