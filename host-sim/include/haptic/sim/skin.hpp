// Skinning: where the vertices of a surface are, given the particles that carry it.
//
//     x_j = sum over i of w_ji (x_i + R_i (X_j - X_i))
//
// with X the rest positions of vertex j and particle i, x_i and R_i position and orientation of the particle now, and
// weights w_ji that sum to 1 (linear blend skinning; thesis, section 4.1.3).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "haptic/sim/particles.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

/// The particles that carry one vertex. A slot that is not used has weight 0 and names a particle that exists.
struct SkinVertex {
    static constexpr std::size_t kMost = 4;
    std::array<std::uint32_t, kMost> particle{};
    std::array<double, kMost> weight{};  // 0..1, sum 1
};

/// One element a vertex.
using Skin = std::vector<SkinVertex>;

/// A skin whose vertex j is particle j.
[[nodiscard]] Skin skin_of_particles(std::size_t count);

/// What Skinner works with in the course of a step.
struct ParticleFrame;

class Skinner {
  public:
    /// `rest` has one element a vertex. `wide` allows the registers that not every machine has; it makes no difference
    /// to the result. Throws std::invalid_argument for a skin of another length, a particle that does not exist, or
    /// weights that do not sum to 1 within 1e-9.
    Skinner(std::span<const Vec3> rest, const ParticleModel& model, const Skin& skin, bool wide = true);
    Skinner(Skinner&&) noexcept;
    Skinner& operator=(Skinner&&) noexcept;
    ~Skinner();

    /// Writes all vertices, at most as many as the skin has. No allocation; the same bits on every machine.
    void place(const ParticleModel& model, std::span<Vec3> vertices);

    /// Consecutive vertices and the particles that carry them: one body of several.
    struct Part {
        std::size_t first_vertex = 0;
        std::size_t vertices = 0;
        std::size_t first_particle = 0;
        std::size_t particles = 0;
    };
    /// Whether a particle of the part is elsewhere than at the last place() of the part or of all; the first time it
    /// is.
    [[nodiscard]] bool has_moved(const ParticleModel& model, const Part& part) const noexcept;
    /// The same for the vertices of one part, which no other particles carry. `vertices` has those of all parts.
    void place(const ParticleModel& model, const Part& part, std::span<Vec3> vertices);

  private:
    std::vector<std::uint32_t> particle_;  // [vertex][SkinVertex::kMost]
    std::vector<double> weight_;           // of the same shape
    std::vector<Vec3> rest_;               // m, per vertex
    std::vector<Vec3> rest_position_;      // m, per particle
    std::vector<ParticleFrame> frame_;     // per particle
    std::vector<Vec3> placed_position_;    // m, per particle: at the last place()
    std::vector<Quat> placed_orientation_;
    bool one_to_one_ = false;  // vertex j is particle j
    bool wide_ = false;
};

}  // namespace haptic::sim
