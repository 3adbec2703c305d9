// Pushes at single particles of elastic bodies, as contacts with other bodies and of solids with the ground make them.
//
// A force at a particle moves all particles of its body, by W = A^-1 (elastic_bodies.hpp), and turns a free solid
// (inertia_relief.hpp). One beside it, at the end of an arm a, turns a free solid as a whole by h^2 I^-1 (a x p) more.
// How far it moves the point where it acts is measured in the same way, as that of the particle and theta x a, where
// theta = h^2 I^-1 sum (r + a) x p is the rotation by all forces that has their angular momentum. So the answer stays
// symmetric, and forces that are opposite at one point keep the momenta of two bodies.
//
// Particles that are pushed, at the body's places, move with every push, which takes a few numbers each; the rest of
// the body moves once they agree. Columns of W are found when they are first needed, and kept as long as h stays the
// same. Their numbers between places are copied to rows, and what a force turns is kept as columns, for the kernels.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/geometric.hpp>
#include <memory>
#include <vector>

#include "dynamics/elastic_bodies.hpp"
#include "dynamics/rows.hpp"

namespace haptic::sim {

class ElasticPushes final : private ElasticBodies::Asker {
  public:
    struct Compliance {
        double along = 0.0;   // m/N
        double across = 0.0;  // m/N
    };
    /// A particle that takes part in this sub-step: one of its body's places.
    struct Place {
        std::uint32_t body = kNone;
        std::uint32_t index = 0;
        /// Whether the body moves with the particle.
        [[nodiscard]] bool has_body() const noexcept { return body != kNone; }
    };

    /// Allocates for all elastic bodies of the model.
    explicit ElasticPushes(const ParticleModel& model);

    /// Begins a sub-step of length h, s. The bodies are at `start`; `elastic` has been prepared for h.
    void begin(const ParticleModel& start, ElasticBodies& elastic, double h) noexcept;

    /// Whether the particle belongs to an elastic body and is not pinned.
    [[nodiscard]] bool answers(std::uint32_t particle) const noexcept { return body_of_particle_[particle] != kNone; }

    /// Expects pushes of the particle: the next step of its body answers what they need, and lets the particle take
    /// part, which would take most of the time of take_part().
    void expect(std::uint32_t particle) noexcept;
    /// The particle's place in this sub-step. It has no body if it does not answer, or if its body's columns have no
    /// room left (16 million numbers): it then moves alone. The following need a place with a body. Those of different
    /// bodies may be called at the same time.
    [[nodiscard]] Place take_part(std::uint32_t particle) noexcept;
    /// Whether no particle of its body is pinned.
    [[nodiscard]] bool is_free(const Place& place) const noexcept { return bodies_[place.body].is_free; }
    /// Whether it has a body, and that is a solid without pinned particles, which turns. Others have no arms.
    [[nodiscard]] bool turns(const Place& place) const noexcept {
        return place.has_body() && bodies_[place.body].turns;
    }
    /// rad: how far a body that turns had turned since the start when it was first pushed. Ask before that, too.
    [[nodiscard]] const Vec3& turned_before(const Place& place, const Row* position) noexcept;
    /// How far the end of an arm, m, at the particle moves in the sub-step along a force of 1 N on it: along the unit
    /// normal, and in the mean of the directions across it.
    [[nodiscard]] Compliance compliance(const Place& place, const Vec3& arm, const Vec3& normal) const noexcept;
    /// m/N: how far the end of one particle's arm moves by a force at that of another one; 0 of two bodies.
    [[nodiscard]] double response(const PushedContact::Side& moved, const Vec3& along,
                                  const PushedContact::Side& pushed, const Vec3& force) const noexcept;
    /// The same for the kernels. Stays where it is.
    [[nodiscard]] PushedPlace& kernel_place(const Place& place) noexcept { return row_[place.index]; }
    /// Pushes at the end of an arm, m, at the particle with a force, N, on top of the forces so far.
    void push(const Place& place, const Vec3& arm, const Vec3& force) noexcept;
    /// m: what the pushes since its body moved have moved the particle by, and all pushes the arm.
    [[nodiscard]] Vec3 displacement(const Place& place, const Vec3& arm) const noexcept;
    /// Moves the particle's whole body by these displacements.
    void move_body(std::uint32_t particle, Row* position) noexcept;

  private:
    static constexpr std::uint32_t kNone = 0xffff'ffff;

    struct Body {
        ParticleRange particles;
        bool is_free = true;  // has no pinned particles
        bool turns = true;    // and is a solid
        std::size_t room = 0;
        std::unique_ptr<double[]> columns{};  // m/N, [column][particle of the body], of which there is room
        std::vector<std::uint32_t> owner{};   // particle of each column in use
        double h = 0.0;                       // s, of the columns
        // In this sub-step.
        std::vector<std::uint32_t> expected{};            // particles
        const ElasticBodies::Turning* turning = nullptr;  // null: not known yet
        bool has_turned = false;                          // `turned_before` is known
        Vec3 turned_before{0.0};                          // rad
        std::size_t first_place = 0;                      // of the arrays below, with padding
        std::size_t places = 0;
        std::size_t row = 0;                // from one of `among` to the next: grows with `places`
        std::unique_ptr<double[]> among{};  // m/N, [place][place that moves]: W of the particles that take part
    };

    [[nodiscard]] static std::size_t padded(std::size_t places) noexcept {
        return (places + kPlacePadding - 1) / kPlacePadding * kPlacePadding;
    }
    void answered(std::size_t which) noexcept override;
    void widen_rows(Body& body) noexcept;
    void begin_place(Body& body, std::uint32_t particle) noexcept;
    [[nodiscard]] const double* column(const Body& body, std::uint32_t particle) const noexcept;
    [[nodiscard]] bool find_column(Body& body, std::uint32_t particle) noexcept;
    [[nodiscard]] double& lever(std::size_t k, std::size_t particle) noexcept;
    void find_turning(Body& body) noexcept;

    std::vector<Body> bodies_;
    LaneArray<PushedBody> pushed_;  // per body
    std::vector<std::uint32_t> body_of_particle_;
    std::vector<std::uint32_t> column_;  // per particle; kNone: not yet found
    std::vector<double> lever_;          // [Q, then r][particle]; see lever()
    LaneArray<Row> scratch_;             // per particle: those whose columns are found
    // Per place.
    std::vector<std::uint32_t> place_;     // per particle: its index; kNone: none in this sub-step
    std::vector<std::uint32_t> particle_;  // within its body
    LaneArray<PushedPlace> row_;
    std::vector<Mat3> answer_of_;  // m/N: of the particle to a force on it
    LaneArray<double> moved_[3];   // m, by columns of W
    std::vector<Row> force_;       // N, since the body moved
    std::vector<const double*> column_of_;
    const ParticleModel* start_ = nullptr;
    ElasticBodies* elastic_ = nullptr;
    double h_ = 0.0;
};

}  // namespace haptic::sim
