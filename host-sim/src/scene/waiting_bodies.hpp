// Solids that wait for their surfaces.
//
// A surface follows its body, but not through itself or another one (collision/solid_surfaces.hpp). Of that its
// particles know nothing: a hand that crushes a body may fold them through themselves, and a surface that is left far
// behind may never find its way back.
//
// Invariant: at the end of a step no vertex is farther from where its skin would be than a limit, or than the farthest
// vertex of its body was at the start; but for what a script leads away, what the ground flattens of a skin that turns,
// and what has been alone for a while (lone_surfaces.hpp). Where a step would break it, the body waits, and so does the
// group of all that it may have met: they make the mean of their motions, as one rigid body, which closes no gap
// (rigid_motion.hpp), and get the velocities of one that has their momenta. So waiting keeps linear and angular
// momentum, and takes energy out, as an inelastic impact does. Of a group that would turn by more than a little in a
// step some rotation is lost. The floor holds a group up where its surfaces touch it, which lag behind the particles
// that know of the floor. Where there is no room for that either, the group stands still (body_surfaces.hpp).
//
// Waiting alone would not end: the next step would want the same. So a body that had to wait makes only a share of what
// its motion has beyond the mean, until it has not had to for a while.
// @source X. Provot 1997 and R. Bridson et al. 2002 (zones of impact that move as rigid bodies); bodies as zones and
// their shares are our own
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "dynamics/rigid_motion.hpp"
#include "haptic/sim/particles.hpp"
#include "haptic/types.hpp"
#include "simd/collider_rows.hpp"

namespace haptic::sim {

struct Assembly;

/// Where particles are.
struct ParticlePlaces {
    explicit ParticlePlaces(const ParticleModel& model) : position(model.position), orientation(model.orientation) {}
    void take(const ParticleModel& model) noexcept;

    std::vector<Vec3> position;  // m
    std::vector<Quat> orientation;
};

class WaitingBodies {
  public:
    static constexpr std::uint32_t kNone = 0xffff'ffff;
    /// The step in which bodies move as one, and the floor below them.
    struct Surroundings {
        double step = 0.0;                 // s
        std::span<const Vec3> vertices{};  // m, of all surfaces at its start, which the floor holds; none: no floor
        double friction = 0.0;             // coefficient, of the floor
    };

    /// `farthest`: of the mean edge of a body's surface, that this may be from its skin.
    WaitingBodies(const Assembly& assembly, double farthest);

    /// Begins a step, in which no body waits yet: how far vertices are from their skins, m, per body.
    void begin_step(std::span<const double> lag) noexcept;
    /// The part of its motion beyond the mean that a body makes; 1: all of it.
    [[nodiscard]] double share(std::size_t body) const noexcept { return share_[body]; }
    /// Moves a body by the mean of its step, s, and its share of the rest. Different bodies on any thread.
    void slow(std::size_t body, const ParticlePlaces& before, double step, Assembly& assembly) const noexcept;

    /// Whether a body is to wait whose surface is so far behind, m.
    [[nodiscard]] bool is_to_wait(std::size_t body, double lag) const noexcept;
    /// At the end of a step: finds the groups that are to wait, bodies over their limits with all whose boxes overlap,
    /// of those that may wait, marked by 1. Their shares shrink, and those of others grow. Without boxes each body is
    /// alone. Whether any are to wait.
    [[nodiscard]] bool find(std::span<const double> lag, std::span<const std::uint8_t> may_wait,
                            std::span<const Bounds> box);
    /// Per body: a body that stands for its group; kNone: it does not wait.
    [[nodiscard]] std::span<const std::uint32_t> group_of() const noexcept { return group_of_; }
    /// A body that has waited has no part in the motion of its group any more.
    void let_go(std::size_t body) noexcept { group_of_[body] = kNone; }
    /// Moves a group as a whole. Returns its motion.
    [[nodiscard]] RigidMotion let_wait(std::uint32_t group, const ParticlePlaces& before, const Surroundings& around,
                                       Assembly& assembly) const noexcept;

  private:
    std::vector<double> farthest_;         // m, per body
    std::vector<double> share_;            // per body
    std::vector<double> lag_before_;       // m, per body
    std::vector<std::uint32_t> group_of_;  // per body
};

}  // namespace haptic::sim
