// Oriented particles: what a deformable model is made of, and its state.
//
// A particle has a position and an orientation. A group is a particle with those it is linked to; it is drawn toward
// the rigid placement of its rest shape that fits it best (shape matching). A link keeps the distance of two particles.
// Orientations enter the fit as if each particle were a small solid ball, so that it is well defined for groups of any
// shape: flat, collinear, even a single particle.
// @source M. Müller, N. Chentanez, "Solid Simulation with Oriented Particles", 2011
#pragma once

#include <cstdint>
#include <vector>

#include "haptic/types.hpp"

namespace haptic::sim {

/// Two particles that keep their distance.
struct Link {
    std::uint32_t first = 0;
    std::uint32_t second = 0;
    double rest_length = 0.0;  // m
    double stiffness = 1.0;    // 0..1, part of the error that one projection removes
    double compliance = 0.0;   // m/N, of a spring; the stretch under a force, whatever step and iterations are
};

/// A particle and those linked to it, matched to their rest shape.
struct Group {
    std::uint32_t centre = 0;            // the particle whose orientation is that of the group
    std::vector<std::uint32_t> members;  // the centre among them; no particle twice
    double stiffness = 1.0;              // 0..1 (alpha in Müller et al. 2005, Meshless Deformations); 1 is rigid
    double compliance = 0.0;             // s^2, how far from its goal a force per mass, m/s^2, takes a member, m
};

/// The particles [begin, end) of a model.
struct ParticleRange {
    std::uint32_t begin = 0;
    std::uint32_t end = 0;
};

/// Deformable bodies, one or many. All vectors that are "per particle" have the same length.
struct ParticleModel {
    // The rest shape, per particle.
    std::vector<Vec3> rest_position;   // m
    std::vector<double> mass;          // kg, positive
    std::vector<double> radius;        // m, of the ball that stands for the particle's own inertia
    std::vector<Vec3> semi_axes;       // m, of the ellipsoid that other bodies collide with; 0: nothing does
    std::vector<Quat> axes;            // unit, rest_from_ellipsoid
    std::vector<std::uint8_t> pinned;  // 1: nothing but its own velocities moves the particle

    // The state, per particle.
    std::vector<Vec3> position;          // m
    std::vector<Vec3> velocity;          // m/s
    std::vector<Quat> orientation;       // unit, present_from_rest
    std::vector<Vec3> angular_velocity;  // rad/s

    std::vector<Group> groups;  // at most one for each centre
    std::vector<Link> links;
    /// Bodies that nothing holds together, in the order of their particles, which they share out without a gap; groups
    /// and links stay within one. Empty: all particles are one body.
    std::vector<ParticleRange> bodies;

    [[nodiscard]] std::size_t size() const noexcept { return position.size(); }
    /// Appends a particle at rest where its rest position is. Nothing collides with it.
    void add(const Vec3& where, double particle_mass, double particle_radius);
    /// Appends all bodies of another model, with their state.
    void append(const ParticleModel& other);
    /// Throws std::invalid_argument, naming the particle, group or link that is wrong.
    void check() const;
};

[[nodiscard]] Vec3 linear_momentum(const ParticleModel& model);
/// Of the particles as points, about the scene's origin.
[[nodiscard]] Vec3 angular_momentum(const ParticleModel& model);
[[nodiscard]] double kinetic_energy(const ParticleModel& model);
/// False if any component of the state is infinite or not a number.
[[nodiscard]] bool is_finite(const ParticleModel& model);

}  // namespace haptic::sim
