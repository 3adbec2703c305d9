// Skinning kernel: the inner loop of linear blend skinning (haptic/sim/skin.hpp), for registers of different width.
//
// The transforms of a vertex's particles are blended, then the blend is applied to the rest position. Transforms are
// columns of four numbers, so that a column is one load and x, y, z and an unused number are computed together. Each
// number is rounded as alone, so the bits do not depend on the width.
#pragma once

#include <cstddef>
#include <cstdint>

namespace haptic::sim {

/// Four numbers; the last is unused.
struct alignas(32) SkinRow {
    double number[4] = {};
};

/// Transform of a particle: the rest point p moves to row[0] p.x + row[1] p.y + row[2] p.z + row[3]. The first three
/// are the columns of its rotation matrix.
struct ParticleFrame {
    SkinRow row[4];
};

/// Particles that move one vertex: SkinVertex::kMax.
inline constexpr std::size_t kParticlesPerVertex = 4;

/// Input and output of one call; `particle` and `weight` have shape [vertex][kParticlesPerVertex].
struct SkinningTask {
    std::size_t vertices;
    const std::uint32_t* particle;
    const double* weight;
    const double* rest;          // m, [vertex][x, y, z]
    const ParticleFrame* frame;  // per particle
    double* out;                 // [vertex][x, y, z]
    double* before;              // gets what `out` had; null: nobody needs it
};

using SkinningFunction = void (*)(const SkinningTask&) noexcept;

}  // namespace haptic::sim
