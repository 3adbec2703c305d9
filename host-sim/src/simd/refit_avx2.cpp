// Refitting with AVX2 (see CMakeLists.txt).
#include "simd/refit_rows.hpp"

namespace haptic::sim {

void refit_avx2(const RefitTask& task) noexcept {
    RefitRows<4>::run(task);
}

}  // namespace haptic::sim
