// The inner loop of skinning (skin.hpp), for registers of different width.
//
// The frames of a vertex's particles are blended, and the blend is applied to where the vertex is at rest: rows of four
// numbers, so that a frame's column is one load and every operation is done on x, y, z and an unused number at once.
// Rounding is that of single numbers, whatever the width, so the bits are the same.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <haptic/sim/skin.hpp>

namespace haptic::sim {

/// Four numbers, of which the last is not used.
struct alignas(32) SkinRow {
    double number[4] = {};
};

/// A particle's motion: the point p at rest is at row[0] p.x + row[1] p.y + row[2] p.z + row[3]. The first three are
/// the columns of its rotation.
struct ParticleFrame {
    SkinRow row[4];
};

/// What one call skins; `particle` and `weight` are of shape [vertex][SkinVertex::kMost].
struct SkinningTask {
    std::size_t vertices;
    const std::uint32_t* particle;
    const double* weight;
    const double* rest;          // m, [vertex][x, y, z]
    const ParticleFrame* frame;  // per particle
    double* out;                 // [vertex][x, y, z]
};

using SkinningFunction = void (*)(const SkinningTask&) noexcept;

void skin_baseline(const SkinningTask& task) noexcept;
#if defined(__x86_64__)
void skin_avx2(const SkinningTask& task) noexcept;
#endif

}  // namespace haptic::sim
