#include "dynamics/model_bodies.hpp"

#include <algorithm>

namespace haptic::sim {
namespace {

/// Those whose first particle belongs to such an element.
template <class IsSuch>
std::vector<ParticleRange> bodies_with(const ParticleModel& model, const IsSuch& is_such) {
    std::vector<std::uint8_t> has(model.size(), 0);
    for (const ElasticElement& element : model.elasticity.elements) {
        for (const std::uint32_t p : element.members) {
            has[p] = has[p] != 0 || is_such(element) ? 1 : 0;
        }
    }
    std::vector<ParticleRange> bodies = bodies_of(model);
    std::erase_if(bodies, [&](const ParticleRange& body) { return has[body.begin] == 0; });
    return bodies;
}

}  // namespace

std::vector<ParticleRange> bodies_of(const ParticleModel& model) {
    if (!model.bodies.empty() || model.size() == 0) {
        return model.bodies;
    }
    return {{0, static_cast<std::uint32_t>(model.size())}};
}

std::vector<ParticleRange> elastic_bodies_of(const ParticleModel& model) {
    return bodies_with(model, [](const ElasticElement& /*any*/) { return true; });
}

std::vector<ParticleRange> solids_of(const ParticleModel& model) {
    return bodies_with(model, [](const ElasticElement& element) { return element.members.size() != 3; });
}

bool has_body_at(std::span<const ParticleRange> bodies, std::uint32_t particle) {
    return std::ranges::find(bodies, particle, &ParticleRange::begin) != bodies.end();
}

bool has_no_pinned(const ParticleModel& model, const ParticleRange& body) {
    const auto first = model.pinned.begin();
    return std::all_of(first + body.begin, first + body.end, [](std::uint8_t pin) { return pin == 0; });
}

bool has_unpinned(const ParticleModel& model, const ParticleRange& body) {
    const auto first = model.pinned.begin();
    return std::any_of(first + body.begin, first + body.end, [](std::uint8_t pin) { return pin == 0; });
}

bool is_asleep(const ParticleModel& model, const ParticleRange& body) {
    return model.asleep[body.begin] != 0;
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
