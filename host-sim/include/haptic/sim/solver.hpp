// Position-based dynamics of one model of oriented particles.
//
// One step of length h, with f the force on each particle (thesis, Algorithm 3, lines 9 to 24):
//
//     v <- v + h (f / m + gravity);   u <- x + h v;   orientations turn by h w
//     repeat `iterations` times: project every link, then every group, each at once onto u (Gauss-Seidel)
//     v <- (u - x) / h;   w <- turn / h;   x <- u
//
// A link of rest length d moves its ends along their line, in inverse proportion to their masses, by stiffness times
// its error (M. Müller et al., "Position Based Dynamics", 2007, equations 10 and 11).
//
// A group with masses m, rest offsets q from its rest centroid and present offsets p from its centroid c has the moment
// matrix A = sum m p q^T + sum m r^2 / 5 R, with R the particles' orientations as matrices (Müller & Chentanez 2011,
// equations 10 to 12). Its rotational part T gives each member the goal c + T q, of which it goes `stiffness` of the
// way; the centre particle takes T as its orientation. A fit that also counts orientations may turn the group as a
// whole, which no inner force can do; that turn, theta = I^-1 sum m p x d, is taken out again, so that every
// projection keeps linear and angular momentum to rounding.
//
// Both loops run in the order of a graph colouring: constraints of one colour share no particle, so that they can be
// done side by side without a change in the result.
//
// Projection at u while the momentum is counted at x is the implicit Euler method, which turns angular momentum into
// nothing at the rate of the motion within a step. For a model that nothing pins, the step puts it back as one rigid
// turn of the velocities. Damping (`settling`) draws the velocities toward those of a rigid body with the model's
// momenta and so keeps both (Müller et al. 2007, section 3.5).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "haptic/sim/particles.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

struct SolverSettings {
    double step = 0.01;                 // s
    int substeps = 1;                   // equal parts into which a step is divided
    int iterations = 5;                 // passes over the constraints in each sub-step
    int rotation_iterations = 2;        // steps of the extraction, from the predicted orientation
    Vec3 gravity{0.0, -9.81, 0.0};      // m/s^2
    double drag = 0.0;                  // 1/s, rate at which velocities decay; 0 keeps momentum
    double settling = 0.0;              // 1/s, rate at which motion other than that of a rigid body decays
    bool keep_angular_momentum = true;  // see above; has no effect on a model with pinned particles
};

class ParticleSolver {
  public:
    /// Orders the model's constraints. Throws std::invalid_argument for a model that check() refuses, or settings out
    /// of their range.
    ParticleSolver(const ParticleModel& model, const SolverSettings& settings);

    /// Advances the model, which has to be the one given to the constructor as far as its rest shape and constraints
    /// go. `force` is in N, per particle, constant over the step; an empty span is no force.
    void step(ParticleModel& model, std::span<const Vec3> force);

    [[nodiscard]] const SolverSettings& settings() const noexcept { return settings_; }
    [[nodiscard]] std::size_t group_colours() const noexcept { return group_colours_; }
    [[nodiscard]] std::size_t link_colours() const noexcept { return link_colours_; }

  private:
    struct OrderedGroup {
        std::uint32_t centre;
        std::uint32_t first;  // into members_
        std::uint32_t count;
        double stiffness;
        double inverse_mass;  // 1 / kg, of the whole group
    };
    struct Member {
        std::uint32_t particle;
        double mass;       // kg
        double spin_mass;  // kg m^2, m r^2 / 5
        Vec3 rest_offset;  // m, from the group's rest centroid
    };
    struct OrderedLink {
        std::uint32_t first;
        std::uint32_t second;
        double rest_length;
        double first_share;  // stiffness * w1 / (w1 + w2), w inverse mass
        double second_share;
    };

    void order_groups(const ParticleModel& model);
    void order_links(const ParticleModel& model);
    void predict(ParticleModel& model, std::span<const Vec3> force, double h);
    void project_link(const OrderedLink& link);
    void sweep(ParticleModel& model, bool forward);
    void project_group(ParticleModel& model, const OrderedGroup& group);
    void update(ParticleModel& model, double h);
    void settle(ParticleModel& model, double h) const;
    void restore_angular_momentum(ParticleModel& model, double h);

    SolverSettings settings_;
    bool free_ = true;  // nothing is pinned
    std::vector<OrderedGroup> groups_;
    std::vector<Member> members_;
    std::vector<OrderedLink> links_;
    std::size_t group_colours_ = 0;
    std::size_t link_colours_ = 0;

    // Scratch, per particle.
    std::vector<Vec3> next_;       // u
    std::vector<Vec3> predicted_;  // velocity after forces, before constraints
    std::vector<Quat> previous_;   // orientation at the start of the sub-step
    std::vector<Mat3> rotation_;   // orientation as a matrix
};

}  // namespace haptic::sim
