#include "scene/scene_loads.hpp"

#include <algorithm>

#include "scene/assembly.hpp"

namespace haptic::sim {

SceneLoads::SceneLoads(const Assembly& assembly) {
    for (std::size_t b = 0; b < assembly.loads.size(); ++b) {
        const Skinner::Part part = assembly.part(b);
        for (const Load& load : assembly.loads[b]) {
            loads_.push_back({load, part.first_particle, part.particles});
        }
    }
    if (!loads_.empty()) {
        middle_.resize(assembly.model.size());
        force_.resize(assembly.model.size());
    }
}

std::span<const Vec3> SceneLoads::at(const ParticleModel& start, double elapsed, double h) noexcept {
    // A pressure that lagged behind a turning body would turn it faster: the body and the load's factor are those of
    // the middle of the sub-step, so that the lag is zero on average.
    for (std::size_t i = 0; i < middle_.size(); ++i) {
        middle_[i] = start.position[i] + 0.5 * h * start.velocity[i];
    }
    std::fill(force_.begin(), force_.end(), Vec3(0.0));
    for (BodyLoad& of : loads_) {
        add_forces(of.load, now_s_ + elapsed + 0.5 * h, std::span(middle_).subspan(of.first_particle, of.particles),
                   std::span(force_).subspan(of.first_particle, of.particles));
    }
    return force_;
}

}  // namespace haptic::sim
