// Marks that spread from body to body.
#pragma once

#include <cstddef>

namespace haptic::sim {

/// Calls mark(b) for each of the first `count` bodies that meets(a, b) a marked one, until none is left: also for those
/// that meet what was marked on the way.
template <class IsMarked, class Meets, class Mark>
void spread(std::size_t count, const IsMarked& is_marked, const Meets& meets, const Mark& mark) {
    for (bool grows = true; grows;) {
        grows = false;
        for (std::size_t a = 0; a < count; ++a) {
            for (std::size_t b = 0; b < count; ++b) {
                if (is_marked(a) && !is_marked(b) && meets(a, b)) {
                    mark(b);
                    grows = true;
                }
            }
        }
    }
}

}  // namespace haptic::sim
