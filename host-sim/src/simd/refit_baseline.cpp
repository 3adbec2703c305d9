// Refitting with registers that every machine has.
#include "simd/refit_rows.hpp"

namespace haptic::sim {

void refit_baseline(const RefitTask& task) noexcept {
    RefitRows<2>::run(task);
}

}  // namespace haptic::sim
