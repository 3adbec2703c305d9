// Contacts that move whole bodies.
//
// A contact keeps a particle from another one or from the ground, n.(x1 - x2) >= min_separation, with a force on both
// bodies (dynamics/elastic_pushes.hpp). It acts where the ellipsoids touch, at one point of the start of the sub-step
// for both, so that linear and angular momentum are kept, and friction undoes the slip of that point: what rolls does
// not slip. Which of the candidates push is not known before: those that are violated join, in rounds. In each,
// projected Gauss-Seidel with over-relaxation (D. M. Young, 1954) finds the forces of those that have joined, with
// Coulomb friction, while only their particles move; then the bodies move, which may violate further ones. Two contacts
// that press the same particle from both sides are solved together: where a fin lies between a body and the ground,
// each turn alone would hand on little of the body's weight, and what passes leave over keeps heaps from coming to
// rest. The first to join are those that pushed in the last sub-step, with the forces that they had: at rest little is
// left to find. Whether others join is decided with ellipsoids as they were predicted to be rotated. Bodies that touch
// no common body form islands; each is solved by itself.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "collision/colliders.hpp"
#include "dynamics/elastic_pushes.hpp"

namespace haptic::sim {

/// Two particles that may touch in a sub-step. At least one moves its body.
struct ContactCandidate {
    static constexpr std::uint32_t kGround = 0xffff'ffff;

    std::uint32_t first = 0;
    std::uint32_t second = 0;  // or the ground
    SeparatingPlane plane{};   // with the ground: from height 0, and final; else fitted when it is first violated
    Vec3 from{0.0};            // m, x1 - x2 at the start of the sub-step
};

class BodyContacts {
  public:
    /// Has room for this many candidates. `colliders` must outlive this object. Errors count relative to `min_size`, m.
    BodyContacts(const ParticleModel& model, const Colliders& colliders, std::size_t capacity,
                 FrictionCoefficients friction, double min_size);

    /// Whether the particle moves its body along.
    [[nodiscard]] bool answers(std::uint32_t particle) const noexcept { return pushes_.answers(particle); }

    /// Begins a sub-step of length h, s, without candidates. `push_out`: see Colliders::fit_plane().
    void begin(const ParticleModel& start, ElasticBodies& elastic, double h, const PushOut& push_out) noexcept;
    /// Not after the first solve() of a sub-step. False: no room. Inline, and one number after the other: a copy of the
    /// whole would wait until each of them had been stored.
    bool add(std::uint32_t first, std::uint32_t second, const SeparatingPlane& plane, const Vec3& from) noexcept {
        if (candidate_.size() == candidate_.capacity()) {
            return false;
        }
        ContactCandidate& added = candidate_.emplace_back();
        added.first = first;
        added.second = second;
        added.plane = plane;
        added.from = from;
        unite(first, second);
        return true;
    }
    /// Moves the bodies until no contact is violated and none pushes too much, or to `max_passes` over the contacts.
    void solve(Row* position, int max_passes) noexcept {
        know_islands();
        workers_->for_each(island_.size(), [&](std::size_t k) { solve_island(island_[k], position, max_passes); });
    }
    /// Adds each particle's displacement by the forces of this sub-step as if it had moved alone, which has the linear
    /// momentum of the motion of its body. Returns the number of contacts that push.
    std::size_t add_pushes(Row* pushed) const noexcept;

  private:
    struct NearPair {  // NOLINT(cppcoreguidelines-pro-type-member-init): memory is not touched before it is needed
        std::uint32_t first;
        std::uint32_t second;
    };
    struct alignas(PushedContact) ContactMemory {  // NOLINT(cppcoreguidelines-pro-type-member-init): the same
        std::byte of[sizeof(PushedContact)];
    };
    /// A contact that pushed in the last sub-step.
    struct Remembered {
        std::uint32_t first;
        std::uint32_t second;
        double along;    // N
        Vec3 across;     // N
        double permits;  // of the way out of an overlap: what it may take in a sub-step
    };
    /// Ranges of order_ and of body_order_.
    struct Island {
        std::uint32_t begin = 0;
        std::uint32_t end = 0;
        std::uint32_t active = 0;  // at the beginning of the same range of active_
        std::uint32_t first_body = 0;
        std::uint32_t end_body = 0;
        bool begun = false;
        bool forward = true;
    };

    void remember(const ParticleModel& start) noexcept;
    void expect_pushes() noexcept;
    void know_islands() noexcept;
    void form_islands() noexcept;
    void unite(std::uint32_t first, std::uint32_t second) noexcept;
    void solve_island(Island& island, Row* position, int max_passes) noexcept;
    bool join_remembered(Island& island, Row* position) noexcept;
    bool join_violated(Island& island, Row* position) noexcept;
    [[nodiscard]] SeparatingPlane fitted_plane(const ContactCandidate& candidate, const Vec3& apart) const noexcept;
    PushedContact& join(Island& island, std::uint32_t at, const SeparatingPlane& plane, double permits,
                        Row* position) noexcept;
    [[nodiscard]] std::array<Vec3, 2> touching_points(const ContactCandidate& candidate, const Vec3& normal,
                                                      const std::array<ElasticPushes::Place, 2>& place) const noexcept;
    [[nodiscard]] std::array<Vec3, 2> arms(const ContactCandidate& candidate, const std::array<Vec3, 2>& surface,
                                           const std::array<ElasticPushes::Place, 2>& place) const noexcept;
    [[nodiscard]] const Remembered* remembered(const ContactCandidate& candidate) const noexcept;
    [[nodiscard]] PushedContact* active(std::uint32_t k) const noexcept {
        return reinterpret_cast<PushedContact*>(active_[k].of);
    }
    template <class Visit>
    void each_side(std::uint32_t contact, const Visit& visit) noexcept;
    void match(Island& island) noexcept;
    void match_one(std::uint32_t contact) noexcept;
    [[nodiscard]] double coupling(const PushedContact& one, const PushedContact& other) const noexcept;
    [[nodiscard]] double project_all(Island& island) noexcept;
    [[nodiscard]] static Vec3 force_of(const PushedContact& contact) noexcept;
    void push_apart(const PushedContact& contact) noexcept;
    void push_alone(std::uint32_t particle, const Vec3& force, Row* displaced) const noexcept;
    [[nodiscard]] double compliance_alone(std::uint32_t particle) const noexcept;

    const Colliders& colliders_;
    FrictionCoefficients friction_;
    double tolerance_;  // m
    ElasticPushes pushes_;
    Workers* workers_ = nullptr;
    const ElasticKernels* kernels_ = nullptr;
    // Of the sub-step.
    double h_ = 0.0;  // s
    PushOut push_out_;
    std::vector<ContactCandidate> candidate_;
    std::vector<std::uint32_t> candidate_body_;  // a body that each may move
    bool islands_known_ = false;
    std::vector<Island> island_;
    std::vector<std::uint32_t> parent_;         // per body: the root is its own
    std::vector<std::uint32_t> island_of_;      // per body; kNone: it has no contacts
    std::vector<std::uint32_t> order_;          // candidates by island
    std::vector<std::uint8_t> has_joined_;      // in the same order
    std::vector<std::uint32_t> body_order_;     // some_particle_ of each body, by island
    std::vector<std::uint32_t> some_particle_;  // per body: one that answers, if there is one
    // Contacts that push, or have, and their particles. Memory of contacts is not touched before it is needed.
    std::unique_ptr<ContactMemory[]> active_;
    std::unique_ptr<NearPair[]> active_particles_;
    std::unique_ptr<double[]> permits_;
    std::unique_ptr<NearPair[]> previous_at_;  // of them: the one before that has the first particle, and the second
    std::vector<std::uint32_t> last_at_;       // per particle: the last of them; kNone but in match()
    std::vector<Remembered> remembered_;       // by the first, then the second
    std::vector<std::uint32_t> first_remembered_;  // per particle: its first; kNone: none
};

}  // namespace haptic::sim
