// The functions of projection.hpp for any number of lanes. To be used by the translation unit that is compiled for
// registers of that width, and by no other (see lanes.hpp).
#pragma once

#include "lane_rotation.hpp"
#include "projection.hpp"

namespace haptic::sim {

/// A row of each lane, by columns.
template <class Real>
struct LaneRow {
    Real a, b, c, d;
};

template <class Real>
HAPTIC_LANES LaneVec<Real> head(const LaneRow<Real>& row) noexcept {
    return {row.a, row.b, row.c};
}

/// Transposes the 4 x 4 matrix in each run of four lanes.
template <class Real>
HAPTIC_LANES LaneRow<Real> transposed(const LaneRow<Real>& m) noexcept {
    if constexpr (kLanes<Real> == 4) {
        const Real ab02 = __builtin_shufflevector(m.a, m.b, 0, 4, 2, 6);
        const Real ab13 = __builtin_shufflevector(m.a, m.b, 1, 5, 3, 7);
        const Real cd02 = __builtin_shufflevector(m.c, m.d, 0, 4, 2, 6);
        const Real cd13 = __builtin_shufflevector(m.c, m.d, 1, 5, 3, 7);
        return {__builtin_shufflevector(ab02, cd02, 0, 1, 4, 5), __builtin_shufflevector(ab13, cd13, 0, 1, 4, 5),
                __builtin_shufflevector(ab02, cd02, 2, 3, 6, 7), __builtin_shufflevector(ab13, cd13, 2, 3, 6, 7)};
    } else {
        static_assert(kLanes<Real> == 8);
        const Real ab02 = __builtin_shufflevector(m.a, m.b, 0, 8, 2, 10, 4, 12, 6, 14);
        const Real ab13 = __builtin_shufflevector(m.a, m.b, 1, 9, 3, 11, 5, 13, 7, 15);
        const Real cd02 = __builtin_shufflevector(m.c, m.d, 0, 8, 2, 10, 4, 12, 6, 14);
        const Real cd13 = __builtin_shufflevector(m.c, m.d, 1, 9, 3, 11, 5, 13, 7, 15);
        return {__builtin_shufflevector(ab02, cd02, 0, 1, 8, 9, 4, 5, 12, 13),
                __builtin_shufflevector(ab13, cd13, 0, 1, 8, 9, 4, 5, 12, 13),
                __builtin_shufflevector(ab02, cd02, 2, 3, 10, 11, 6, 7, 14, 15),
                __builtin_shufflevector(ab13, cd13, 2, 3, 10, 11, 6, 7, 14, 15)};
    }
}

/// The part of a row that one register holds: all of it, if there are four lanes or more.
template <class Real>
using Piece = typename LaneTypes<(kLanes<Real> < 4 ? kLanes<Real> : 4)>::Real;
template <class Real>
inline constexpr std::size_t kPieces = 4 / kLanes<Piece<Real>>;

/// A row for each lane, from piece(lane, part).
template <class Real, class PieceOf>
HAPTIC_LANES LaneRow<Real> assemble(const PieceOf& piece) noexcept {
    if constexpr (kLanes<Real> == 1) {
        return {piece(0, 0), piece(0, 1), piece(0, 2), piece(0, 3)};
    } else if constexpr (kLanes<Real> == 2) {
        const Real ab0 = piece(0, 0);
        const Real ab1 = piece(1, 0);
        const Real cd0 = piece(0, 1);
        const Real cd1 = piece(1, 1);
        return {__builtin_shufflevector(ab0, ab1, 0, 2), __builtin_shufflevector(ab0, ab1, 1, 3),
                __builtin_shufflevector(cd0, cd1, 0, 2), __builtin_shufflevector(cd0, cd1, 1, 3)};
    } else if constexpr (kLanes<Real> == 4) {
        return transposed<Real>({piece(0, 0), piece(1, 0), piece(2, 0), piece(3, 0)});
    } else {
        const auto both = [&](std::size_t lane) {
            return __builtin_shufflevector(piece(lane, 0), piece(lane + 4, 0), 0, 1, 2, 3, 4, 5, 6, 7);
        };
        return transposed<Real>({both(0), both(1), both(2), both(3)});
    }
}

/// rows[index * stride] of each lane.
template <class Real>
HAPTIC_LANES LaneRow<Real> gather(const Row* rows, const std::uint32_t* index, std::size_t stride = 1) noexcept {
    return assemble<Real>([&](std::size_t lane, std::size_t part) {
        return load<Piece<Real>>(rows[index[lane] * stride].number + part * kLanes<Piece<Real>>);
    });
}

/// The reverse of gather().
template <class Real>
HAPTIC_LANES void scatter(const LaneRow<Real>& value, Row* rows, const std::uint32_t* index,
                          std::size_t stride = 1) noexcept {
    const auto at = [&](std::size_t lane) { return rows[index[lane] * stride].number; };
    if constexpr (kLanes<Real> == 1) {
        store(value.a, at(0));
        store(value.b, at(0) + 1);
        store(value.c, at(0) + 2);
        store(value.d, at(0) + 3);
    } else if constexpr (kLanes<Real> == 2) {
        store<Real>(__builtin_shufflevector(value.a, value.b, 0, 2), at(0));
        store<Real>(__builtin_shufflevector(value.c, value.d, 0, 2), at(0) + 2);
        store<Real>(__builtin_shufflevector(value.a, value.b, 1, 3), at(1));
        store<Real>(__builtin_shufflevector(value.c, value.d, 1, 3), at(1) + 2);
    } else if constexpr (kLanes<Real> == 4) {
        const LaneRow<Real> row = transposed(value);
        store(row.a, at(0));
        store(row.b, at(1));
        store(row.c, at(2));
        store(row.d, at(3));
    } else {
        const auto store_pair = [&](Real row, std::size_t lane) {
            store(__builtin_shufflevector(row, row, 0, 1, 2, 3), at(lane));
            store(__builtin_shufflevector(row, row, 4, 5, 6, 7), at(lane + 4));
        };
        const LaneRow<Real> row = transposed(value);
        store_pair(row.a, 0);
        store_pair(row.b, 1);
        store_pair(row.c, 2);
        store_pair(row.d, 3);
    }
}

template <class Real>
HAPTIC_LANES void scatter_spin(const LaneMat<Real>& spin, Body* body, const std::uint32_t* index) noexcept {
    scatter<Real>({spin.x.x, spin.x.y, spin.x.z, Real{}}, body->spin, index, kRowsOfBody);
    scatter<Real>({spin.y.x, spin.y.y, spin.y.z, Real{}}, body->spin + 1, index, kRowsOfBody);
    scatter<Real>({spin.z.x, spin.z.y, spin.z.z, Real{}}, body->spin + 2, index, kRowsOfBody);
}

/// The indices of consecutive particles.
template <class Real>
HAPTIC_LANES void number_lanes(std::size_t first, std::uint32_t* index) noexcept {
    for (std::size_t lane = 0; lane < kLanes<Real>; ++lane) {
        index[lane] = static_cast<std::uint32_t>(first + lane);
    }
}

template <class Real>
void turn_bodies(std::size_t count, const Row* turning, Body* body) noexcept {
    for (std::size_t i = 0; i < count; i += kLanes<Real>) {
        std::uint32_t index[kLanes<Real>];
        number_lanes<Real>(i, index);
        const LaneRow<Real> by = gather<Real>(turning, index);
        const LaneRow<Real> before = gather<Real>(&body->turn, index, kRowsOfBody);
        const LaneQuat<Real> q = lane_turned(LaneQuat<Real>{before.a, before.b, before.c, before.d}, head(by));
        scatter<Real>({q.w, q.x, q.y, q.z}, &body->turn, index, kRowsOfBody);
        scatter_spin(by.d * lane_matrix(q), body, index);
    }
}

/// As a Cayley vector, a quarter of a turn. A fit that leaps to the other side of a turned over group is no rotation
/// that goes on; taken for one, it would leap again in each step.
inline constexpr double kMostTurn = 2.0;

template <class Real>
void find_rates(std::size_t count, const Row* before, const Body* body, double step, Row* rate) noexcept {
    for (std::size_t i = 0; i < count; i += kLanes<Real>) {
        std::uint32_t index[kLanes<Real>];
        number_lanes<Real>(i, index);
        const LaneRow<Real> from = gather<Real>(before, index);
        const LaneRow<Real> to = gather<Real>(&body->turn, index, kRowsOfBody);
        const LaneVec<Real> turn =
            lane_turn_between(LaneQuat<Real>{from.a, from.b, from.c, from.d}, LaneQuat<Real>{to.a, to.b, to.c, to.d});
        const Real square = dot(turn, turn);
        const auto too_far = square > kMostTurn * kMostTurn;
        const LaneVec<Real> kept = select(too_far, (kMostTurn / square_root(square)) * turn, turn);
        const LaneVec<Real> w = kept / broadcast<Real>(step);
        scatter<Real>({w.x, w.y, w.z, Real{}}, rate, index);
    }
}

template <class Real>
HAPTIC_LANES void project_link_batch(const LinkBatches& links, std::size_t batch, Row* place) noexcept {
    const std::size_t at = batch * kLanes<Real>;
    const LaneRow<Real> first = gather<Real>(place, links.first + at);
    const LaneRow<Real> second = gather<Real>(place, links.second + at);
    const LaneVec<Real> a = head(first);
    const LaneVec<Real> b = head(second);
    const LaneVec<Real> between = b - a;
    const Real length = square_root(dot(between, between));
    const LaneVec<Real> correction = (1.0 - load<Real>(links.rest_length + at) / length) * between;
    const auto apart = length > 0.0;  // two particles in one place have no direction in which to part
    const LaneVec<Real> a_new = select(apart, a + load<Real>(links.first_share + at) * correction, a);
    const LaneVec<Real> b_new = select(apart, b - load<Real>(links.second_share + at) * correction, b);
    scatter<Real>({a_new.x, a_new.y, a_new.z, first.d}, place, links.first + at);
    scatter<Real>({b_new.x, b_new.y, b_new.z, second.d}, place, links.second + at);
}

template <class Real>
void project_links(const LinkBatches& links, bool forward, const MovingParticles& particles) noexcept {
    for (std::size_t k = 0; k < links.count; ++k) {
        project_link_batch<Real>(links, forward ? k : links.count - 1 - k, particles.place);
    }
}

template <class Real>
HAPTIC_LANES void project_spring_batch(const SpringBatches& springs, std::size_t batch, Row* place) noexcept {
    const std::size_t at = batch * kLanes<Real>;
    const LaneRow<Real> first = gather<Real>(place, springs.first + at);
    const LaneRow<Real> second = gather<Real>(place, springs.second + at);
    const LaneVec<Real> a = head(first);
    const LaneVec<Real> b = head(second);
    const LaneVec<Real> between = b - a;
    const Real length = square_root(dot(between, between));
    const Real pull = load<Real>(springs.pull + at);
    const Real error = length - load<Real>(springs.rest_length + at) - load<Real>(springs.softness + at) * pull;
    const Real more = load<Real>(springs.gain + at) * error;
    const LaneVec<Real> along = (more / length) * between;
    const auto apart = length > 0.0;
    const LaneVec<Real> a_new = select(apart, a + load<Real>(springs.first_inverse_mass + at) * along, a);
    const LaneVec<Real> b_new = select(apart, b - load<Real>(springs.second_inverse_mass + at) * along, b);
    store(select(apart, pull + more, pull), springs.pull + at);
    scatter<Real>({a_new.x, a_new.y, a_new.z, first.d}, place, springs.first + at);
    scatter<Real>({b_new.x, b_new.y, b_new.z, second.d}, place, springs.second + at);
}

template <class Real>
void project_springs(const SpringBatches& springs, bool forward, const MovingParticles& particles) noexcept {
    for (std::size_t k = 0; k < springs.count; ++k) {
        project_spring_batch<Real>(springs, forward ? k : springs.count - 1 - k, particles.place);
    }
}

/// sum m p x (T q), given A = sum m p q^T: the axial vector of B = A T^T.
template <class Real>
HAPTIC_LANES LaneVec<Real> torque_of(const LaneMat<Real>& a, const LaneMat<Real>& t) noexcept {
    const LaneVec<Real> bx = t.x.x * a.x + t.y.x * a.y + t.z.x * a.z;
    const LaneVec<Real> by = t.x.y * a.x + t.y.y * a.y + t.z.y * a.z;
    const LaneVec<Real> bz = t.x.z * a.x + t.y.z * a.y + t.z.z * a.z;
    return {bz.y - by.z, bx.z - bz.x, by.x - bx.y};
}

/// One batch of groups, in three stages. `Uneven`, `Compliant`: see GroupRun; what a mask excludes keeps its bits.
template <class Real, bool Uneven, bool Compliant>
class BatchProjection {
  public:
    /// Sums over the members. Each has a loop of its own, because all together do not fit the registers. `scratch` has
    /// a row for each slot and lane.
    HAPTIC_LANES void gather_members(const GroupBatches& groups, std::size_t batch, const MovingParticles& particles,
                                     Row* scratch) noexcept {
        groups_ = &groups;
        scratch_ = scratch;
        at_ = batch * kLanes<Real>;
        first_ = groups.batch[batch].first_slot;
        slots_ = groups.batch[batch].slots;
        centroid_ = find_centroid(particles.place);
        moment_ = find_moment();
        matrix_ = moment_ + find_spin(particles.body);
        scatter_ = find_scatter();
    }

    /// Turns the centres, and finds how the members have to move.
    HAPTIC_LANES void fit(const MovingParticles& particles, int rotation_iterations) noexcept {
        const std::uint32_t* centre = groups_->centre + at_;
        const LaneRow<Real> row = gather<Real>(&particles.body->turn, centre, kRowsOfBody);
        const LaneQuat<Real> guess{row.a, row.b, row.c, row.d};
        const LaneQuat<Real> found = lane_extract_rotation(matrix_, guess, rotation_iterations);
        rotation_ = lane_matrix(found);
        turn_ = lane_solve_inertia(scatter_, torque_of(moment_, rotation_));
        turn_centres(particles, guess, found);
    }

    HAPTIC_LANES void move_members(Row* place) const noexcept {
        const Real stiffness = load<Real>(groups_->stiffness + at_);
        for (std::size_t k = 0; k < slots_; ++k) {
            const LaneRow<Real> u = placed(k);
            const LaneVec<Real> p = head(u) - centroid_;
            const LaneVec<Real> error = eased(k, rotation_ * rest_offset(k) - p - cross(turn_, p));
            if constexpr (Compliant) {
                add_shift(k, stiffness * error);
            }
            const LaneVec<Real> goal = head(u) + stiffness * error;
            const LaneVec<Real> next = where(groups_->member_is_free + member(k), goal, head(u));
            scatter<Real>({next.x, next.y, next.z, u.d}, place, groups_->member + member(k));
        }
    }

  private:
    [[nodiscard]] HAPTIC_LANES std::size_t member(std::size_t slot) const noexcept {
        return (first_ + slot) * kLanes<Real>;
    }
    [[nodiscard]] HAPTIC_LANES LaneVec<Real> rest_offset(std::size_t slot) const noexcept {
        const double* q = groups_->rest_offset + 3 * member(slot);
        return {load<Real>(q), load<Real>(q + kLanes<Real>), load<Real>(q + 2 * kLanes<Real>)};
    }
    [[nodiscard]] HAPTIC_LANES LaneVec<Real> shift(std::size_t slot) const noexcept {
        const double* s = groups_->shift + 3 * member(slot);
        return {load<Real>(s), load<Real>(s + kLanes<Real>), load<Real>(s + 2 * kLanes<Real>)};
    }
    /// What a compliant group leaves of a member's way to its goal, because of the pull that it exerts already.
    [[nodiscard]] HAPTIC_LANES LaneVec<Real> eased(std::size_t slot, const LaneVec<Real>& way) const noexcept {
        if constexpr (Compliant) {
            return way - load<Real>(groups_->softness + at_) * shift(slot);
        } else {
            return way;
        }
    }
    HAPTIC_LANES void add_shift(std::size_t slot, const LaneVec<Real>& more) const noexcept {
        double* s = groups_->shift + 3 * member(slot);
        const LaneVec<Real> sum = shift(slot) + more;
        store(sum.x, s);
        store(sum.y, s + kLanes<Real>);
        store(sum.z, s + 2 * kLanes<Real>);
    }
    [[nodiscard]] HAPTIC_LANES double* scratch(std::size_t slot) const noexcept {
        return scratch_[slot * kLanes<Real>].number;
    }
    /// A member's row of `place`, as find_centroid() left it.
    [[nodiscard]] HAPTIC_LANES LaneRow<Real> placed(std::size_t slot) const noexcept {
        const double* from = scratch(slot);
        constexpr std::size_t n = kLanes<Real>;
        return {load<Real>(from), load<Real>(from + n), load<Real>(from + 2 * n), load<Real>(from + 3 * n)};
    }
    [[nodiscard]] HAPTIC_LANES static LaneMat<Real> gather_spin(const Body* body, const std::uint32_t* index) noexcept {
        return {head(gather<Real>(body->spin, index, kRowsOfBody)),
                head(gather<Real>(body->spin + 1, index, kRowsOfBody)),
                head(gather<Real>(body->spin + 2, index, kRowsOfBody))};
    }
    /// `no` in lanes whose mask is 0. The masks of an even batch are not read.
    template <class Value>
    [[nodiscard]] HAPTIC_LANES static Value where(const std::int64_t* mask, const Value& yes,
                                                  const Value& no) noexcept {
        if constexpr (Uneven) {
            return select(load_mask<Real>(mask), yes, no);
        } else {
            return yes;
        }
    }
    /// With one more member, in lanes whose group has it.
    template <class Sum>
    [[nodiscard]] HAPTIC_LANES Sum add_member(std::size_t slot, const Sum& sum, const Sum& part) const noexcept {
        return where(groups_->member_exists + member(slot), sum + part, sum);
    }

    /// Also puts the members' places into the scratch, by columns.
    [[nodiscard]] HAPTIC_LANES LaneVec<Real> find_centroid(const Row* place) const noexcept {
        LaneVec<Real> sum{};
        for (std::size_t k = 0; k < slots_; ++k) {
            const LaneRow<Real> u = gather<Real>(place, groups_->member + member(k));
            double* to = scratch(k);
            store(u.a, to);
            store(u.b, to + kLanes<Real>);
            store(u.c, to + 2 * kLanes<Real>);
            store(u.d, to + 3 * kLanes<Real>);
            sum = add_member(k, sum, u.d * head(u));
        }
        return load<Real>(groups_->inverse_mass + at_) * sum;
    }

    /// Adds before it transposes, which is less work. The body of nobody holds -0, which changes no sum.
    [[nodiscard]] HAPTIC_LANES LaneMat<Real> find_spin(const Body* body) const noexcept {
        constexpr std::size_t n = kLanes<Piece<Real>>;
        Piece<Real> sum[kLanes<Real>][3][kPieces<Real>];
        for (std::size_t lane = 0; lane < kLanes<Real>; ++lane) {
            Piece<Real> of_lane[3][kPieces<Real>] = {};
            for (std::size_t k = 0; k < slots_; ++k) {
                const Row* spin = body[groups_->member[member(k) + lane]].spin;
                for (std::size_t column = 0; column < 3; ++column) {
                    for (std::size_t part = 0; part < kPieces<Real>; ++part) {
                        of_lane[column][part] += load<Piece<Real>>(spin[column].number + part * n);
                    }
                }
            }
            __builtin_memcpy(sum[lane], of_lane, sizeof(of_lane));
        }
        const auto column = [&](std::size_t which) {
            return head(assemble<Real>([&](std::size_t lane, std::size_t part) { return sum[lane][which][part]; }));
        };
        return {column(0), column(1), column(2)};
    }

    [[nodiscard]] HAPTIC_LANES LaneMat<Real> find_moment() const noexcept {
        LaneMat<Real> sum{};
        for (std::size_t k = 0; k < slots_; ++k) {
            const LaneRow<Real> u = placed(k);
            const LaneVec<Real> mp = u.d * (head(u) - centroid_);
            const LaneVec<Real> q = rest_offset(k);
            sum = add_member(k, sum, LaneMat<Real>{q.x * mp, q.y * mp, q.z * mp});
        }
        return sum;
    }

    [[nodiscard]] HAPTIC_LANES LaneSymmetric<Real> find_scatter() const noexcept {
        LaneSymmetric<Real> sum{};
        for (std::size_t k = 0; k < slots_; ++k) {
            const LaneRow<Real> u = placed(k);
            const LaneVec<Real> p = head(u) - centroid_;
            const LaneVec<Real> mp = u.d * p;
            const LaneSymmetric<Real> outer{mp.x * p.x, mp.y * p.y, mp.z * p.z, mp.x * p.y, mp.x * p.z, mp.y * p.z};
            sum = add_member(k, sum, outer);
        }
        return sum;
    }

    HAPTIC_LANES void turn_centres(const MovingParticles& particles, const LaneQuat<Real>& before,
                                   const LaneQuat<Real>& found) const noexcept {
        const std::uint32_t* centre = groups_->centre + at_;
        const std::int64_t* is_free = groups_->centre_is_free + at_;
        const LaneQuat<Real> q = where(is_free, found, before);
        const LaneMat<Real> spin_before = gather_spin(particles.body, centre);
        const LaneMat<Real> spin = where(is_free, load<Real>(groups_->centre_spin_mass + at_) * rotation_, spin_before);
        scatter<Real>({q.w, q.x, q.y, q.z}, &particles.body->turn, centre, kRowsOfBody);
        scatter_spin(spin, particles.body, centre);
    }

    const GroupBatches* groups_;
    Row* scratch_;
    std::size_t at_;     // into arrays of shape [batch][lane]
    std::size_t first_;  // slot
    std::size_t slots_;
    LaneVec<Real> centroid_;       // c
    LaneMat<Real> moment_;         // sum m p q^T
    LaneMat<Real> matrix_;         // A, that is with sum m r^2 / 5 R
    LaneSymmetric<Real> scatter_;  // sum m p p^T
    LaneMat<Real> rotation_;       // T
    LaneVec<Real> turn_;           // theta
};

template <class Real, bool Uneven, bool Compliant>
HAPTIC_LANES void project_run(const GroupBatches& groups, const GroupRun& run, int rotation_iterations,
                              const MovingParticles& particles) noexcept {
    BatchProjection<Real, Uneven, Compliant> batch[kMostBatchesInRun];
    for (std::size_t b = 0; b < run.batches; ++b) {
        Row* scratch = particles.scratch + b * groups.most_slots * kLanes<Real>;
        batch[b].gather_members(groups, run.first_batch + b, particles, scratch);
    }
    for (std::size_t b = 0; b < run.batches; ++b) {
        batch[b].fit(particles, rotation_iterations);
    }
    for (std::size_t b = 0; b < run.batches; ++b) {
        batch[b].move_members(particles.place);
    }
}

template <class Real>
void project_groups(const GroupBatches& groups, bool forward, int rotation_iterations,
                    const MovingParticles& particles) noexcept {
    for (std::size_t k = 0; k < groups.runs; ++k) {
        const GroupRun& run = groups.run[forward ? k : groups.runs - 1 - k];
        if (run.compliant) {
            project_run<Real, true, true>(groups, run, rotation_iterations, particles);
        } else if (run.uneven) {
            project_run<Real, true, false>(groups, run, rotation_iterations, particles);
        } else {
            project_run<Real, false, false>(groups, run, rotation_iterations, particles);
        }
    }
}

template <std::size_t Count>
inline constexpr Projection kProjection{Count,
                                        turn_bodies<typename LaneTypes<Count>::Real>,
                                        find_rates<typename LaneTypes<Count>::Real>,
                                        project_links<typename LaneTypes<Count>::Real>,
                                        project_springs<typename LaneTypes<Count>::Real>,
                                        project_groups<typename LaneTypes<Count>::Real>};

}  // namespace haptic::sim
