// Pushes at single particles of solid elastic bodies, as contacts with other bodies and the ground make them.
//
// A force p at particle i within a sub-step of length h moves all particles of the body. Without its turning that is
// A^-1 p (elastic_bodies.hpp), which A resists as if turning were a strain. A free body is therefore relieved of the
// torque: the rigid rotation alpha = I^-1 (r_i x p), h^2 alpha in the sub-step, is added to the answer A^-1 to what is
// left of the force, p - m (alpha x r), and the turning of that answer, beta, is taken out again (r about the centre of
// mass). The answer then has the momenta of the force, and is symmetric: what j moves by a force at i is what i moves
// by the same force at j. With Q = A^-1 M r of the three coordinates and W = A^-1:
//
//     u_j = W_ji p - alpha x Q_j + (h^2 alpha - beta) x r_j,   beta = I^-1 (Q_i x p - J alpha),   J = -sum m [Q] [r]
//
// Columns of W are found when they are first needed, and kept as long as h stays the same.
// @source Inertia relief: the D'Alembert forces of a free body's rigid acceleration, as in structural analysis.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "dynamics/elastic_bodies.hpp"

namespace haptic::sim {

class ElasticPushes {
  public:
    struct Compliance {
        double along = 0.0;   // m/N
        double across = 0.0;  // m/N
    };

    /// Allocates for all solid elastic bodies of the model.
    explicit ElasticPushes(const ParticleModel& model);

    [[nodiscard]] bool empty() const noexcept { return bodies_.empty(); }
    /// Begins a sub-step of length h, s. The bodies are at `start`; `elastic` has been prepared for h.
    void begin(const ParticleModel& start, ElasticBodies& elastic, double h) noexcept;

    /// Whether the particle belongs to a solid elastic body and is not pinned. The following need that.
    [[nodiscard]] bool answers(std::uint32_t particle) const noexcept { return body_of_particle_[particle] != kNone; }
    /// How far the particle moves in the sub-step along a force of 1 N on it: along the unit normal, and in the mean of
    /// the directions across it.
    [[nodiscard]] Compliance compliance(std::uint32_t particle, const Vec3& normal) noexcept;
    /// Moves the particle's body by a force, N, on the particle.
    void push(std::uint32_t particle, const Vec3& force, Row* position) noexcept;

  private:
    static constexpr std::uint32_t kNone = 0xffff'ffff;

    struct Body {
        ParticleRange particles;
        bool is_free = true;                 // no particle is pinned
        std::vector<double> columns{};       // m/N, [column][particle of the body]
        std::vector<std::uint32_t> owner{};  // particle of each column in use
        double h = 0.0;                      // s, of the columns
        bool placed = false;                 // in this sub-step: the following
        Mat3 inverse_inertia{0.0};           // 1/(kg m^2)
        Mat3 turning{0.0};                   // J
    };

    [[nodiscard]] std::uint32_t column(Body& body, std::uint32_t particle) noexcept;
    void place(Body& body) noexcept;
    [[nodiscard]] Vec3 lever(std::uint32_t particle, std::size_t first) const noexcept;

    std::vector<Body> bodies_;
    std::vector<std::uint32_t> body_of_particle_;
    std::vector<std::uint32_t> column_;  // per particle; kNone: not yet found
    std::vector<double> lever_;          // [particle][Q, s^2 m, then r, m]
    LaneArray<Row> scratch_;
    const ParticleModel* start_ = nullptr;
    ElasticBodies* elastic_ = nullptr;
    double h_ = 0.0;
};

}  // namespace haptic::sim
