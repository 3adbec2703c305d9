#include "scene/scene_loads.hpp"

#include <algorithm>

#include "scene/assembly.hpp"

namespace haptic::sim {

SceneLoads::SceneLoads(const Assembly& assembly) {
    for (std::size_t b = 0; b < assembly.loads.size(); ++b) {
        for (const Load& load : assembly.loads[b]) {
            loads_.push_back({load, assembly.part(b).first_particle});
        }
    }
    if (!loads_.empty()) {
        middle_.resize(assembly.model.size());
        force_.resize(assembly.model.size());
    }
}

std::span<const Vec3> SceneLoads::at(const ParticleModel& start, const ParticleRange& body, double elapsed,
                                     double h) noexcept {
    if (loads_.empty()) {
        return {};
    }
    const std::size_t particles = body.end - body.begin;
    const auto middle = std::span(middle_).subspan(body.begin, particles);
    const auto force = std::span(force_).subspan(body.begin, particles);
    // A pressure that lagged behind a turning body would turn it faster: the body and the load's factor are those of
    // the middle of the sub-step, so that the lag is zero on average.
    for (std::size_t i = 0; i < particles; ++i) {
        middle[i] = start.position[body.begin + i] + 0.5 * h * start.velocity[body.begin + i];
    }
    std::fill(force.begin(), force.end(), Vec3(0.0));
    for (BodyLoad& of : loads_) {
        if (of.first_particle == body.begin) {
            add_forces(of.load, now_s_ + elapsed + 0.5 * h, middle, force);
        }
    }
    return force;
}

}  // namespace haptic::sim
