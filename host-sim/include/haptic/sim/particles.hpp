// Oriented particles: the elements and the state of deformable models.
//
// A particle has a position and an orientation. A group is a particle with its neighbours; shape matching draws it
// toward the rigid placement of its rest shape that fits best. A link keeps the distance of two particles. Orientations
// enter the fit as if each particle were a small solid ball, so the fit is well defined for flat and collinear groups
// and for single particles. Bodies with a material have elements instead (elasticity.hpp).
// @source M. Müller, N. Chentanez, "Solid Simulation with Oriented Particles", 2011; thesis, section 4.1.2
#pragma once

#include <cstdint>
#include <vector>

#include "haptic/sim/elasticity.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

/// Distance constraint between two particles.
struct Link {
    std::uint32_t first = 0;
    std::uint32_t second = 0;
    double rest_length = 0.0;  // m
    double stiffness = 1.0;    // 0..1, fraction of the error that one projection removes
    double compliance = 0.0;   // m/N, of a spring: stretch per force, independent of step and iterations; 0: rigid
};

/// Shape-matching group: a particle and its neighbours.
struct Group {
    std::uint32_t centre = 0;            // the particle that takes the group's orientation
    std::vector<std::uint32_t> members;  // with the centre; no particle twice
    double stiffness = 1.0;              // 0..1, alpha (Müller et al. 2005, Meshless Deformations); 1 is rigid
    double compliance = 0.0;  // s^2, distance of a member from its goal, m, per force per mass, m/s^2; 0: none
};

/// The particles [begin, end) of a model.
struct ParticleRange {
    std::uint32_t begin = 0;
    std::uint32_t end = 0;
};

/// One or more deformable bodies. All "per particle" vectors have the same length.
struct ParticleModel {
    // The rest shape, per particle.
    std::vector<Vec3> rest_position;   // m
    std::vector<double> mass;          // kg, positive
    std::vector<double> radius;        // m, of the ball with the particle's own inertia
    std::vector<Vec3> semi_axes;       // m, of the ellipsoid with which other bodies collide; 0: no collisions
    std::vector<Quat> axes;            // unit, rest_from_ellipsoid
    std::vector<std::uint8_t> pinned;  // 1: moved by its own velocities only

    // The state, per particle.
    std::vector<Vec3> position;          // m
    std::vector<Vec3> velocity;          // m/s
    std::vector<Quat> orientation;       // unit, present_from_rest
    std::vector<Vec3> angular_velocity;  // rad/s
    std::vector<std::uint8_t> asleep;    // 1: stays where it is, at rest, with its whole body, which has a material

    std::vector<Group> groups;  // at most one for each centre
    std::vector<Link> links;
    Elasticity elasticity;  // of bodies with a material; these have neither groups nor links
    /// Separate bodies, in the order of their particles and without gaps; no constraint joins two. Empty: one body.
    std::vector<ParticleRange> bodies;

    [[nodiscard]] std::size_t size() const noexcept { return position.size(); }
    /// Appends a particle at rest in its rest position, without collisions.
    void add(const Vec3& at, double particle_mass, double particle_radius);
    /// Appends all bodies of another model, with their state.
    void append(const ParticleModel& other);
    /// Throws std::invalid_argument that names the wrong particle, group or link.
    void check() const;
};

/// 1/kg; 0 of pinned particles: they push but are not pushed.
[[nodiscard]] inline double inverse_mass(const ParticleModel& model, std::size_t particle) {
    return model.pinned[particle] != 0 ? 0.0 : 1.0 / model.mass[particle];
}
/// kg m/s
[[nodiscard]] Vec3 linear_momentum(const ParticleModel& model);
/// Of the particles as points, about the origin, kg m^2/s.
[[nodiscard]] Vec3 angular_momentum(const ParticleModel& model);
/// Of the particles as points, J.
[[nodiscard]] double kinetic_energy(const ParticleModel& model);
/// Whether all components of the state are finite.
[[nodiscard]] bool is_finite(const ParticleModel& model);
/// The same for `count` particles from `first` on.
[[nodiscard]] bool is_finite(const ParticleModel& model, std::size_t first, std::size_t count);

}  // namespace haptic::sim
