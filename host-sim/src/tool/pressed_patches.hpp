// Patches of particles under masks, and how the bodies to which they belong answer forces on them.
//
// A force on a body at a touched point presses on the particles under the pressure mask there (Eq. 4.1), each with its
// weight. A row is a direction along which a patch is pressed. In a sub-step of length h the bodies answer forces l (N)
// of the rows with the displacements Y P l, where P spreads the forces over the particles and Y is h^2 M^-1 or, with a
// material, A^-1 (dynamics/elastic_bodies.hpp) and the turning of free solids (dynamics/inertia_relief.hpp). The rows
// move by P^T Y P l, so the compliance is P^T Y P. Pinned particles have M^-1 = 0.
//
// The particles of a solid lie below its skin, but the force has its moment where the skin is touched, at an arm a from
// their mean. So it presses on the elements of the particles under the mask (haptic/sim/elasticity.hpp) with the
// weights
//
//     W_j + a . g_j,   g_j = sum W_i R_i b_ij,
//
// where b_ij are the gradients of the element about particle i and R_i is its rotation. The g_j sum to 0, and sum x_j
// g_j^T is 1 but for the strain of the elements, so that the mean of the x_j moves by a; a is corrected for that
// strain. Rows along a normal leave away the part of a that is along it: it has no moment, and the depth is that of the
// particles.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "dynamics/elastic_bodies.hpp"
#include "dynamics/inertia_relief.hpp"
#include "haptic/contact_problem.hpp"
#include "haptic/sim/contact.hpp"
#include "haptic/sim/contact_force.hpp"
#include "haptic/sim/particles.hpp"
#include "haptic/sim/scene_body.hpp"
#include "haptic/types.hpp"
#include "simd/projection.hpp"

namespace haptic::sim {

class PressedPatches {
  public:
    /// The bodies of the model.
    struct Bodies {
        std::span<const SceneBody> bodies;
        std::span<PressureMask> masks;  // one per body
    };
    /// A PressedParticle in the numbering of the model, with its mass.
    struct Pressed {
        std::uint32_t particle = 0;  // of the model
        double weight = 0.0;         // W_i
        double inverse_mass = 0.0;   // 1/kg; 0: pinned
        Vec3 gradient{0.0};          // 1/m, g_i; 0 on a body without elements, and of a mean patch
    };
    /// Of a force.
    struct Line {
        Vec3 point;      // m, where the tool touches
        Vec3 direction;  // unit
    };
    /// Of a patch: sum W_i x_i.
    struct Places {
        Vec3 reference{0.0};  // m, at the beginning of the step
        Vec3 start{0.0};      // m, of the sub-step
        Vec3 now{0.0};        // m, by the last update_now(); after advance_places() the previous start
    };

    /// Allocates for the bodies of this model.
    explicit PressedPatches(const ParticleModel& model);

    /// Removes all patches and rows, at the beginning of a step. No allocation here, nor in add(), add_mean() and
    /// add_row().
    void clear() noexcept;
    /// Adds the particles that take a force at the touched point (Eq. 4.1), along a line. Returns the patch.
    std::uint32_t add(const SurfacePoint& touched, const Line& line, const Bodies& bodies, const ParticleModel& model);
    /// Adds the mean of consecutive patches, weighted by these shares, or evenly if all are 0, for forces across their
    /// lines. For a single patch, returns that patch if it serves for both.
    std::uint32_t add_mean(std::uint32_t first, std::span<const double> shares, const ParticleModel& model);
    /// Adds a row, along a unit direction.
    void add_row(std::uint32_t patch, const Vec3& direction) { rows_.push_back({patch, direction}); }

    [[nodiscard]] const Places& places(std::uint32_t patch) const noexcept { return patches_[patch].places; }
    [[nodiscard]] std::span<const Pressed> particles(std::uint32_t patch) const noexcept {
        return particles_of(patches_[patch]);
    }
    /// Most particles that all patches can have together, without mean ones.
    [[nodiscard]] std::size_t max_particles() const noexcept { return pressed_.capacity() / 2; }

    /// Begins a sub-step of length h, s, in which the bodies answer. Allocates only for more than four million answers
    /// of particles.
    void begin(ElasticBodies& elastic, double h);
    /// Finds how they turn from where the sub-step begins, once they have moved.
    void find_turning(const ParticleModel& start, double h);
    /// Moves Places::start to Places::now, and finds Places::start at these positions. To be called at the beginning of
    /// each sub-step and at the end of the step.
    void advance_places(const ParticleModel& model) noexcept;
    void update_now(const Row* position) noexcept;
    /// m: sum W_i x_i of particles. position_of(i): m, of particle i of the model.
    template <class PositionOf>
    [[nodiscard]] static Vec3 mean_of(std::span<const Pressed> particles, const PositionOf& position_of) noexcept {
        Vec3 mean(0.0);
        for (const Pressed& p : particles) {
            mean += p.weight * position_of(p.particle);
        }
        return mean;
    }
    /// m: the same of a patch at these positions. Stores nothing.
    [[nodiscard]] Vec3 place_of(std::uint32_t patch, const Row* position) const noexcept;
    /// P^T Y P / h^2 of the rows, 1/kg, after find_turning().
    [[nodiscard]] const ComplianceMatrix& compliance() const noexcept { return body_compliance_; }
    /// Adds Y P / h^2 times `by`, h^2 times a force on a patch, kg m; on a body with a material once
    /// move_elastic_bodies() is called.
    void press(std::uint32_t on, const Vec3& by, Row* position) noexcept;
    /// Applies what press() has gathered on bodies with a material.
    void move_elastic_bodies(const ParticleModel& start, double h, Row* position) noexcept;
    /// Adds `by` W_i / m_i to the particles of a patch, as if each moved alone.
    void displace(std::uint32_t on, const Vec3& by, Row* position) const noexcept;
    static void displace(std::span<const Pressed> particles, const Vec3& by, Row* position) noexcept;

  private:
    static constexpr std::uint32_t kNone = 0xffff'ffff;

    /// The particles that take the force of one or more rows: a range of pressed_.
    struct Patch {
        std::uint32_t begin = 0;
        std::uint32_t end = 0;
        Vec3 depth{0.0};  // m, from where the force acts to where the tool touches, along the line
        Places places{};
        ParticleRange body{};    // from the first to the last body, if one has a material; empty: none has
        std::size_t answer = 0;  // of these bodies: index into answers_, one element per particle
        Vec3 change{0.0};        // kg m, h^2 times the change of force that has not moved the body yet
    };
    struct PatchRow {
        std::uint32_t patch = 0;
        Vec3 direction{0.0};  // unit
    };
    /// A body with a material, under a patch.
    struct Answering {
        std::size_t patch = 0;
        ParticleRange body{};
    };
    /// A free solid under a patch, which turns.
    struct TurningBody {
        ParticleRange particles;
        const ElasticBodies::Turning* by_forces = nullptr;
        InertiaRelief::Turn change;  // by changes of force that have not moved it yet
    };
    /// What a patch has on such a body: sums over its particles there, with their weights.
    struct PatchLever {
        std::size_t patch = 0;
        std::size_t body = 0;  // of turning_
        Vec3 arm{0.0};         // m, r
        Vec3 answer{0.0};      // s^2 m, Q
    };
    /// The same for a force of 1 N along a row.
    struct RowLever {
        std::size_t row = 0;
        std::size_t body = 0;
        Vec3 torque{0.0};    // m, r x d
        Vec3 answered{0.0};  // s^2 m, Q x d
        InertiaRelief::Turn turn;
    };

    [[nodiscard]] std::span<const Pressed> particles_of(const Patch& patch) const noexcept {
        return std::span(pressed_).subspan(patch.begin, patch.end - patch.begin);
    }
    [[nodiscard]] Vec3 place_in(const ParticleModel& model, const Patch& patch) const noexcept {
        return mean_of(particles_of(patch), [&](std::size_t i) { return model.position[i]; });
    }
    [[nodiscard]] bool add_elements(const ParticleModel& model, std::size_t room, Patch& patch);
    void lead_to(const Line& line, const ParticleModel& model, Patch& patch) noexcept;
    void centre_on(const Line& line, const ParticleModel& model, Patch& patch) noexcept;
    void find_answers(ElasticBodies& elastic, double h);
    [[nodiscard]] double overlap(const Patch& a, const Patch& b) const noexcept;
    [[nodiscard]] bool is_of_last_patch(std::size_t row) const noexcept {
        return row > 0 && rows_[row].patch == rows_[row - 1].patch;
    }
    void find_overlaps(std::size_t row) noexcept;
    void find_body_compliance();
    void list_turning();
    [[nodiscard]] std::size_t body_that_turns(const ParticleRange& body) const noexcept;
    void find_levers(const ParticleModel& start);
    void add_turning(double h);

    std::vector<Pressed> pressed_;
    std::size_t added_patches_ = 0;    // so far, but mean ones
    std::size_t added_particles_ = 0;  // of these
    std::vector<Patch> patches_;
    std::vector<PatchRow> rows_;
    std::vector<double> scattered_;  // per particle of the model: W_i / m_i of one patch
    std::vector<double> overlaps_;   // 1/kg, per row up to one
    // Per particle: the element about it, of solids; kNone: none.
    std::vector<std::uint32_t> element_of_;
    std::vector<Vec3> gradient_of_;        // 1/m, per particle: g of one patch
    std::vector<std::uint32_t> members_;   // of its elements, once each
    std::vector<std::uint8_t> is_member_;  // per particle
    std::vector<double> answers_;          // 1/kg: Y P / h^2 of the patches on bodies with a material
    std::vector<Answering> answering_;
    std::vector<Row> columns_;          // per particle of a body: four of them
    double answered_step_ = 0.0;        // s, sub-step for which they and shape_compliance_ are; 0: none
    bool is_new_ = false;               // they are of this sub-step
    ElasticBodies* elastic_ = nullptr;  // in this sub-step
    std::vector<std::uint8_t> turns_;   // per particle: it belongs to a free solid with a material
    std::vector<TurningBody> turning_;  // in this sub-step
    std::vector<PatchLever> patch_levers_;
    std::vector<RowLever> row_levers_;   // in the order of the rows
    ComplianceMatrix shape_compliance_;  // P^T Y P / h^2, 1/kg, without turning
    ComplianceMatrix body_compliance_;   // with it
};

}  // namespace haptic::sim
