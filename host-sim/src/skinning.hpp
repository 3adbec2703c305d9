// The inner loop of skinning (skin.hpp), for registers of different width.
//
// A vertex is blended from the frames of its particles: rows of four numbers, so that a frame's column is one load and
// every operation is done on x, y, z and an unused number at once. Rounding is that of single numbers, whatever the
// width, so the bits are the same.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "haptic/sim/skin.hpp"

namespace haptic::sim {

/// Four numbers, of which the last is not used.
struct alignas(32) SkinRow {
    double number[4] = {};
};

/// A particle's place: the point p at rest is at x + axis[0] p.x + axis[1] p.y + axis[2] p.z, p from the particle.
struct ParticleFrame {
    SkinRow position;
    SkinRow axis[3];  // columns of the rotation
};

/// A vertex as one of its particles sees it.
struct SkinArm {
    double weight = 0.0;
    double arm[3] = {};  // m, weight (X_j - X_i)
};

/// What one call skins; `particle` and `arm` are of shape [vertex][SkinVertex::kMost].
struct SkinningTask {
    std::size_t vertices;
    const std::uint32_t* particle;
    const SkinArm* arm;
    const ParticleFrame* frame;  // per particle
    double* out;                 // [vertex][x, y, z]
};

using SkinningFunction = void (*)(const SkinningTask&) noexcept;

void skin_baseline(const SkinningTask& task) noexcept;
#if defined(__x86_64__)
void skin_avx2(const SkinningTask& task) noexcept;
#endif

}  // namespace haptic::sim
