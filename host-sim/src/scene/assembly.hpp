// Assembly: all bodies of a scene in common arrays. Particles for the solver, the mesh that they carry, the skin
// between the two, and per body what the contact code needs.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "contact/swept_tree.hpp"
#include "haptic/sim/contact_force.hpp"
#include "haptic/sim/deformable.hpp"
#include "haptic/sim/mesh.hpp"
#include "haptic/sim/particles.hpp"
#include "haptic/sim/scene.hpp"
#include "haptic/sim/scene_body.hpp"
#include "haptic/sim/skin.hpp"

namespace haptic::sim {

struct Assembly {
    explicit Assembly(const Scene& scene, const Progress& progress = {});

    /// Sets the velocities of all driven particles so that they reach their prescribed positions at now_s + step_s.
    void drive(double now_s, double step_s);

    /// Ranges of a body's vertices and particles in the common arrays.
    [[nodiscard]] Skinner::Part part(std::size_t body) const {
        const std::size_t first = bodies[body].first_particle;
        const std::size_t next = body + 1 < bodies.size() ? bodies[body + 1].first_particle : model.size();
        return {bodies[body].first_vertex, bodies[body].mesh.vertices.size(), first, next - first};
    }
    [[nodiscard]] ParticleRange particles_of(std::size_t body) const;
    /// Where the scene gives the body of a particle.
    [[nodiscard]] const Config::Place& place_of(std::uint32_t particle) const;

    /// The vertices of a body of those of all.
    template <class T>
    [[nodiscard]] std::span<T> surface_of(std::size_t body, std::span<T> all) const {
        return all.subspan(bodies[body].first_vertex, bodies[body].mesh.vertices.size());
    }

    /// Whether a particle of a body is not pinned.
    [[nodiscard]] bool is_movable(std::size_t body) const;
    /// Whether a body is a sheet: its vertices are its particles, and a triangle can move as a whole.
    [[nodiscard]] bool is_sheet(std::size_t body) const;

    // Of all bodies together.
    ParticleModel model;  // current state
    TriangleMesh mesh;    // at rest
    Skin skin;
    // Per body.
    std::vector<SceneBody> bodies;
    std::vector<Config::Place> places;
    std::vector<SweptTree> trees;
    std::vector<PressureMask> masks;
    std::vector<std::vector<Motion>> motions;
    std::vector<std::vector<Load>> loads;
    std::vector<double> floor;  // m, of the surface: the ground, or none

  private:
    void add(DeformableBody&& body, const Config::Place& place, const Scene& scene);
};

}  // namespace haptic::sim
