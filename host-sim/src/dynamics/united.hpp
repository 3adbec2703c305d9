// Things that are united step by step, each told by the one that stands for all of its group.
#pragma once

#include <cstdint>
#include <span>

namespace haptic::sim {

/// The one that stands for all that are united with `of`. `parent`: per thing, one of its group that is nearer to that
/// one, which has itself. Shortens the way for later calls (path halving; Tarjan, van Leeuwen 1984).
inline std::uint32_t root_of(std::span<std::uint32_t> parent, std::uint32_t of) noexcept {
    while (parent[of] != of) {
        of = parent[of] = parent[parent[of]];
    }
    return of;
}

}  // namespace haptic::sim
