// Vectors in rows of four numbers, the last one 0.
#pragma once

#include <cstddef>

#include "haptic/types.hpp"
#include "simd/projection.hpp"

namespace haptic::sim {

[[nodiscard]] inline Vec3 vector_of(const Row& row) noexcept {
    return {row.number[0], row.number[1], row.number[2]};
}

[[nodiscard]] inline Row row_of(const Vec3& v) noexcept {
    return {{v.x, v.y, v.z, 0.0}};
}

/// Keeps the fourth number.
inline void set_vector(Row& row, const Vec3& v) noexcept {
    row.number[0] = v.x;
    row.number[1] = v.y;
    row.number[2] = v.z;
}

inline void add_scaled(Row& to, double factor, const Row& row) noexcept {
    for (std::size_t k = 0; k < 4; ++k) {
        to.number[k] += factor * row.number[k];
    }
}

inline void add_vector(Row& row, const Vec3& v) noexcept {
    set_vector(row, vector_of(row) + v);
}

}  // namespace haptic::sim
