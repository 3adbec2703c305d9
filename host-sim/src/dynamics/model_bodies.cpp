#include "dynamics/model_bodies.hpp"

#include <algorithm>

namespace haptic::sim {

std::vector<ParticleRange> bodies_of(const ParticleModel& model) {
    if (!model.bodies.empty() || model.size() == 0) {
        return model.bodies;
    }
    return {{0, static_cast<std::uint32_t>(model.size())}};
}

std::vector<ParticleRange> solids_of(const ParticleModel& model) {
    std::vector<std::uint8_t> solid(model.size(), 0);
    for (const ElasticElement& element : model.elasticity.elements) {
        solid[element.centre] = solid[element.centre] != 0 || element.members.size() != 3;
    }
    std::vector<ParticleRange> solids = bodies_of(model);
    std::erase_if(solids, [&](const ParticleRange& body) { return solid[body.begin] == 0; });
    return solids;
}

bool has_no_pinned(const ParticleModel& model, const ParticleRange& body) {
    const auto first = model.pinned.begin();
    return std::all_of(first + body.begin, first + body.end, [](std::uint8_t pin) { return pin == 0; });
}

bool has_unpinned(const ParticleModel& model, const ParticleRange& body) {
    const auto first = model.pinned.begin();
    return std::any_of(first + body.begin, first + body.end, [](std::uint8_t pin) { return pin == 0; });
}

Vec3 centre_of_mass(const ParticleModel& model, const ParticleRange& body) {
    double mass = 0.0;
    Vec3 sum(0.0);
    for (std::size_t i = body.begin; i < body.end; ++i) {
        mass += model.mass[i];
        sum += model.mass[i] * model.position[i];
    }
    return sum / mass;
}

}  // namespace haptic::sim
