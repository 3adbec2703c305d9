// Skinning: positions of a surface's vertices from the particles that move it (linear blend skinning).
//
//     x_j = sum over i of w_ji (x_i + R_i (X_j - X_i))
//
// X are the rest positions of vertex j and particle i, x_i and R_i the particle's present position and orientation, and
// the weights w_ji sum to 1.
// @source thesis, section 4.1.3
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "haptic/sim/particles.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

/// The particles that move one vertex. Unused slots have weight 0 and the index of an existing particle.
struct SkinVertex {
    static constexpr std::size_t kMax = 4;
    std::array<std::uint32_t, kMax> particle{};
    std::array<double, kMax> weight{};  // 0..1, sum 1
};

/// One element per vertex.
using Skin = std::vector<SkinVertex>;

/// Whether the particle alone moves the vertex.
[[nodiscard]] bool is_at_particle(const SkinVertex& vertex, std::size_t particle) noexcept;
/// A skin with vertex j at particle j.
[[nodiscard]] Skin skin_of_particles(std::size_t count);

// Of src/simd/skinning.hpp.
struct ParticleFrame;
struct SkinningTask;

class Skinner {
  public:
    /// `rest` has one element per vertex, m. `wide` allows registers that not every machine has; the result has the
    /// same bits. Throws std::invalid_argument for a skin of another length, a particle that does not exist, or weights
    /// that do not sum to 1 within 1e-9.
    Skinner(std::span<const Vec3> rest, const ParticleModel& model, const Skin& skin, bool wide = true);
    Skinner(Skinner&&) noexcept;
    Skinner& operator=(Skinner&&) noexcept;
    ~Skinner();

    /// Writes the positions of the first vertices.size() vertices, m. No allocation; the same bits on every machine.
    void skin_vertices(const ParticleModel& model, std::span<Vec3> vertices);

    /// Consecutive vertices and the particles that move them: one body of several.
    struct Part {
        std::size_t first_vertex = 0;
        std::size_t vertices = 0;
        std::size_t first_particle = 0;
        std::size_t particles = 0;
    };
    /// Whether a particle of the part has moved since the last skin_vertices() that included it; true before the first.
    [[nodiscard]] bool has_moved(const ParticleModel& model, const Part& part) const noexcept;
    /// skin_vertices() for one part, whose vertices no other particles move. `vertices` has those of all parts; so has
    /// `before`, which gets where those of this part were, unless it is empty.
    void skin_vertices(const ParticleModel& model, const Part& part, std::span<Vec3> vertices,
                       std::span<Vec3> before = {});

  private:
    std::vector<std::uint32_t> particle_;  // [vertex][SkinVertex::kMax]
    std::vector<double> weight_;           // [vertex][SkinVertex::kMax]
    std::vector<Vec3> rest_;               // m, per vertex
    std::vector<Vec3> rest_position_;      // m, per particle
    std::vector<ParticleFrame> frame_;     // per particle
    std::vector<Vec3> skinned_position_;   // m, per particle: at the last skin_vertices()
    std::vector<Quat> skinned_orientation_;
    bool one_to_one_ = false;                     // vertex j is particle j
    void (*skin_)(const SkinningTask&) noexcept;  // the loop for the widest registers allowed
};

}  // namespace haptic::sim
