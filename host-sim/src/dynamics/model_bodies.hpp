// The separate bodies of a model of particles.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "haptic/sim/particles.hpp"

namespace haptic::sim {

/// A model without a list of bodies is one body; one without particles has none.
[[nodiscard]] std::vector<ParticleRange> bodies_of(const ParticleModel& model);
/// Those with a material: solids and sheets.
[[nodiscard]] std::vector<ParticleRange> elastic_bodies_of(const ParticleModel& model);
/// Those with solid elements: bodies with a material that are no sheets.
[[nodiscard]] std::vector<ParticleRange> solids_of(const ParticleModel& model);
/// Whether one of the bodies begins with this particle.
[[nodiscard]] bool has_body_at(std::span<const ParticleRange> bodies, std::uint32_t particle);
/// Whether the body is free to move as a whole.
[[nodiscard]] bool has_no_pinned(const ParticleModel& model, const ParticleRange& body);
/// Whether a part of the body is free to move.
[[nodiscard]] bool has_unpinned(const ParticleModel& model, const ParticleRange& body);
/// Whether the body sleeps.
[[nodiscard]] bool is_asleep(const ParticleModel& model, const ParticleRange& body);
/// m, at the present positions.
[[nodiscard]] Vec3 centre_of_mass(const ParticleModel& model, const ParticleRange& body);

}  // namespace haptic::sim
