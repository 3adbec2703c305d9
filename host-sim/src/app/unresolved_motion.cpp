#include "app/unresolved_motion.hpp"

#include <spdlog/fmt/fmt.h>

#include <cmath>

#include "haptic/sim/elasticity.hpp"
#include "haptic/sim/solver.hpp"

namespace haptic::sim {
namespace {

// Sub-steps that are longer than resolved_step() by more than this ratio are worth a warning.
constexpr double kUnresolved = 1.01;

}  // namespace

std::string unresolved_motion(const Simulation& simulation) {
    const double resolved_s = resolved_step(simulation.model());
    const double step_s = simulation.scene().solver.step;
    if (!(step_s / simulation.substeps() > kUnresolved * resolved_s)) {
        return "";
    }
    const double needed = std::ceil(step_s / resolved_s);
    const std::string remedy =
        needed <= kMaxSubsteps
            ? fmt::format("{:.0f} sub-steps would resolve its vibrations (solver.substeps), or a shorter solver.step",
                          needed)
            : fmt::format("its vibrations need {:.4g} sub-steps, or a solver.step of {:.2g} ms with {} of them", needed,
                          1e3 * kMaxSubsteps * resolved_s, kMaxSubsteps);
    return fmt::format(
        "a body is as stiff as its material says, but vibrates less than it: sound crosses it in {:.2g} ms, and a "
        "sub-step takes {:.2g} ms; {}",
        4e3 * resolved_s, 1e3 * step_s / simulation.substeps(), remedy);
}

}  // namespace haptic::sim
