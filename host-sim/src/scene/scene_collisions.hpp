// What of a scene collides: its particles, its sheets and the surfaces of its solids, with what crosses at the start.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "collision/solid_surfaces.hpp"
#include "collision/surface_contacts.hpp"
#include "haptic/sim/collisions.hpp"
#include "haptic/sim/particles.hpp"
#include "haptic/types.hpp"
#include "verification/surface_crossings.hpp"

namespace haptic::sim {

struct Assembly;

/// Null if nothing can collide. `sheet`: per body, whether it is a sheet that collides with its surface.
[[nodiscard]] std::unique_ptr<ParticleCollisions> make_collisions(const ParticleModel& model,
                                                                  const CollisionSettings& settings,
                                                                  std::span<const std::uint8_t> sheet,
                                                                  ParticleCollisions::ClockFunction clock);

/// Surfaces of all bodies, for verification.
[[nodiscard]] SurfaceCrossings make_surface_crossings(const Assembly& assembly);

/// Per body: it is a sheet that collides.
[[nodiscard]] std::vector<std::uint8_t> colliding_sheets(const Assembly& assembly, const CollisionSettings& settings);

/// Null without sheets that collide. What crosses at rest is left alone.
[[nodiscard]] std::unique_ptr<SurfaceContacts> make_surface_contacts(const Assembly& assembly,
                                                                     const CollisionSettings& settings,
                                                                     std::span<const std::uint8_t> sheet,
                                                                     ParticleCollisions::ClockFunction clock);

/// The surfaces of all bodies. Those of solids meet themselves, and one another if bodies collide, and then sheets,
/// which they follow.
[[nodiscard]] std::unique_ptr<SolidSurfaces> make_solid_surfaces(Assembly& assembly, const CollisionSettings& settings,
                                                                 std::span<const Vec3> start);

}  // namespace haptic::sim
