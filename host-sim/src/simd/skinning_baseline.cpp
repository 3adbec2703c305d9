// Skinning with registers that every machine has.
#include "simd/skinning_rows.hpp"

namespace haptic::sim {

void skin_baseline(const SkinningTask& task) noexcept {
    skin_rows<2>(task);
}

}  // namespace haptic::sim
