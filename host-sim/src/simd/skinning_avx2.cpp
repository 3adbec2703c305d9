// Skinning with AVX2 (see CMakeLists.txt).
#include "simd/skinning_rows.hpp"

namespace haptic::sim {

void skin_avx2(const SkinningTask& task) noexcept {
    skin_rows<4>(task);
}

}  // namespace haptic::sim
