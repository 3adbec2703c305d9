// The functions of projection.hpp for any number of lanes. To be used by the translation unit that is compiled for
// registers of that width, and by no other (see lanes.hpp).
#pragma once

#include "simd/lane_rotation.hpp"
#include "simd/lane_rows.hpp"
#include "simd/projection.hpp"

namespace haptic::sim {

template <class Real>
HAPTIC_LANES LaneQuat<Real> conjugated(const LaneQuat<Real>& q) noexcept {
    return {q.w, -q.x, -q.y, -q.z};
}

template <class Real>
void turn_bodies(std::size_t count, const Row* turning, Row* turn, Body* body) noexcept {
    using Double = Wide<Real>;
    constexpr std::size_t n = kLanes<Real>;
    for (std::size_t i = 0; i < count; i += kLanes<Double>) {
        const auto turn_at = [&](std::size_t lane) __attribute__((always_inline)) { return turn[i + lane].number; };
        const auto turning_at = [&](std::size_t lane)
                                    __attribute__((always_inline)) { return turning[i + lane].number; };
        scatter(row_of(lane_turned(quat_of(gather<Double>(turn_at)), head(gather<Double>(turning_at)))), turn_at);
    }
    for (std::size_t i = 0; i < count; ++i) {
        store_quad<n>(rounded<n>(load_row<n>(turn[i])), body[i].turn);
    }
}

/// As a Cayley vector, a quarter of a turn. A fit that leaps to the other side of a turned over group is no rotation
/// that goes on; taken for one, it would leap again in each step.
inline constexpr double kMostTurn = 2.0;

template <class Real>
void find_rates(std::size_t count, const Row* before, const Body* body, double step, Row* turn, Row* rate) noexcept {
    using Double = Wide<Real>;
    constexpr std::size_t n = kLanes<Real>;
    const double inverse_step = 1.0 / step;
    for (std::size_t i = 0; i < count; i += kLanes<Double>) {
        const auto turn_at = [&](std::size_t lane) __attribute__((always_inline)) { return turn[i + lane].number; };
        const LaneQuat<Double> now = quat_of(columns<Real>([&](std::size_t lane) __attribute__((always_inline)) {
            return widened<n>(load_quad<n>(body[i + lane].turn));
        }));
        const LaneQuat<Double> then = quat_of(columns<Real>([&](std::size_t lane) __attribute__((always_inline)) {
            return widened<n>(rounded<n>(load_row<n>(turn[i + lane])));
        }));
        // Of what has not been turned since, the product with the conjugate is a number, exactly.
        const LaneQuat<Double> to = normalised(now * conjugated(then) * quat_of(gather<Double>(turn_at)));
        const LaneVec<Double> by =
            lane_turn_between(quat_of(gather<Double>([&](std::size_t lane) __attribute__((always_inline)) {
                                  return before[i + lane].number;
                              })),
                              to);
        const Double square = dot(by, by);
        const auto too_far = square > kMostTurn * kMostTurn;
        const LaneVec<Double> kept = select(too_far, (kMostTurn / square_root(square)) * by, by);
        const LaneVec<Double> w = broadcast<Double>(inverse_step) * kept;
        scatter(row_of(to), turn_at);
        scatter<Double>({w.x, w.y, w.z, Double{}},
                        [&](std::size_t lane) __attribute__((always_inline)) { return rate[i + lane].number; });
    }
}

template <class Real>
void find_moved(std::size_t count, const Row* place, const Row* start, Body* body) noexcept {
    constexpr std::size_t n = kLanes<Real>;
    for (std::size_t i = 0; i < count; ++i) {
        store_quad<n>(rounded<n>(load_row<n>(place[i]) - load_row<n>(start[i])), body[i].moved);
    }
}

template <class Real>
void add_moved(std::size_t count, const Body* body, const Row* start, Row* place) noexcept {
    constexpr std::size_t n = kLanes<Real>;
    for (std::size_t i = 0; i < count; ++i) {
        const DoubleRow<n> then = load_row<n>(place[i]);
        const DoubleRow<n> counted = widened<n>(rounded<n>(then - load_row<n>(start[i])));
        store_row<n>(then - (counted - widened<n>(load_quad<n>(body[i].moved))), place[i]);
    }
}

/// The numbers of the particles that constraints name.
HAPTIC_LANES auto bodies_at(Body* body, const std::uint32_t* index) noexcept {
    float* numbers = body->moved.number;
    return [numbers, index](std::size_t lane) __attribute__((always_inline)) {
        return numbers + std::size_t{index[lane]} * (kNumbersOfBody / kNumbersOfRow);
    };
}
HAPTIC_LANES auto turns_at(Body* body, const std::uint32_t* index) noexcept {
    float* numbers = body->turn.number;
    return [numbers, index](std::size_t lane) __attribute__((always_inline)) {
        return numbers + std::size_t{index[lane]} * (kNumbersOfBody / kNumbersOfRow);
    };
}
HAPTIC_LANES auto places_at(Row* place, const std::uint32_t* index) noexcept {
    double* numbers = place->number;
    return [numbers, index](std::size_t lane)
               __attribute__((always_inline)) { return numbers + std::size_t{index[lane]}; };
}

template <class Real>
HAPTIC_LANES LaneVec<Real> load_vector(const float* from) noexcept {
    return {load<Real>(from), load<Real>(from + kLanes<Real>), load<Real>(from + 2 * kLanes<Real>)};
}
template <class Real>
HAPTIC_LANES void store_vector(const LaneVec<Real>& v, float* to) noexcept {
    store(v.x, to);
    store(v.y, to + kLanes<Real>);
    store(v.z, to + 2 * kLanes<Real>);
}

/// The ways from one particle to another of each lane.
template <class Real>
HAPTIC_LANES LaneVec<Real> offset_between(const Row* place, const std::uint32_t* from,
                                          const std::uint32_t* to) noexcept {
    constexpr std::size_t n = kLanes<Real>;
    const auto quad = [&](std::size_t lane) __attribute__((always_inline)) {
        return rounded<n>(load_row<n>(place[to[lane] / kNumbersOfRow]) -
                          load_row<n>(place[from[lane] / kNumbersOfRow]));
    };
    if constexpr (n == 1) {
        const FloatRow only = quad(0);
        return {only.number[0], only.number[1], only.number[2]};
    } else {
        return head(join<Real>(quad));
    }
}

template <class Real>
void begin(const LinkBatches& links, const GroupBatches& groups, const Row* place) noexcept {
    constexpr std::size_t n = kLanes<Real>;
    for (std::size_t at = 0; at < links.count * n; at += n) {
        store_vector(offset_between<Real>(place, links.first + at, links.second + at), links.start + 3 * at);
    }
    for (std::size_t b = 0; b < groups.batches; ++b) {
        const std::size_t first = groups.batch[b].first_slot * n;
        for (std::size_t at = first; at < first + groups.batch[b].slots * n; at += n) {
            store_vector(offset_between<Real>(place, groups.centre + b * n, groups.member + at), groups.start + 3 * at);
        }
    }
}

template <class Real>
HAPTIC_LANES void project_link_batch(const LinkBatches& links, std::size_t batch, Body* body) noexcept {
    const std::size_t at = batch * kLanes<Real>;
    const auto first_at = bodies_at(body, links.first + at);
    const auto second_at = bodies_at(body, links.second + at);
    const LaneRow<Real> first = gather<Real>(first_at);
    const LaneRow<Real> second = gather<Real>(second_at);
    const LaneVec<Real> between = load_vector<Real>(links.start + 3 * at) + (head(second) - head(first));
    const Real length = square_root(dot(between, between));
    const Real part = NumberOf<Real>(1) - load<Real>(links.rest_length + at) / length;
    // Two particles in one place have no direction in which to part.
    const LaneVec<Real> correction = select(length > NumberOf<Real>(0), part * between, LaneVec<Real>{});
    const LaneVec<Real> a = head(first) + load<Real>(links.first_share + at) * correction;
    const LaneVec<Real> b = head(second) - load<Real>(links.second_share + at) * correction;
    scatter<Real>({a.x, a.y, a.z, first.d}, first_at);
    scatter<Real>({b.x, b.y, b.z, second.d}, second_at);
}

template <class Real>
void project_links(const LinkBatches& links, bool forward, const MovingParticles& particles) noexcept {
    for (std::size_t k = 0; k < links.count; ++k) {
        project_link_batch<Real>(links, forward ? k : links.count - 1 - k, particles.body);
    }
}

template <class Real>
HAPTIC_LANES void project_spring_batch(const SpringBatches& springs, std::size_t batch, Row* place) noexcept {
    const std::size_t at = batch * kLanes<Real>;
    const auto first_at = places_at(place, springs.first + at);
    const auto second_at = places_at(place, springs.second + at);
    const LaneRow<Real> first = gather<Real>(first_at);
    const LaneRow<Real> second = gather<Real>(second_at);
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
    scatter<Real>({a_new.x, a_new.y, a_new.z, first.d}, first_at);
    scatter<Real>({b_new.x, b_new.y, b_new.z, second.d}, second_at);
}

/// In double, since a spring's pull is added up from one iteration to the next.
template <class Real>
void project_springs(const SpringBatches& springs, bool forward, const MovingParticles& particles) noexcept {
    const std::size_t parts = springs.count * (kLanes<Real> / kLanes<Wide<Real>>);
    for (std::size_t k = 0; k < parts; ++k) {
        project_spring_batch<Wide<Real>>(springs, forward ? k : parts - 1 - k, particles.place);
    }
}

/// One batch of groups, in three stages. `Uneven`, `Compliant`: see GroupRun; what a mask excludes keeps its bits.
///
/// Offsets p are from the centre particle.
template <class Real, bool Uneven, bool Compliant>
class BatchProjection {
  public:
    /// Sums over the members. Each has a loop of its own, because all together do not fit the registers. `scratch` has
    /// x, y, z for each slot and lane.
    HAPTIC_LANES void gather_members(const GroupBatches& groups, std::size_t batch, const MovingParticles& particles,
                                     float* scratch) noexcept {
        groups_ = &groups;
        scratch_ = scratch;
        at_ = batch * kLanes<Real>;
        first_ = groups.batch[batch].first_slot;
        slots_ = groups.batch[batch].slots;
        const LaneBody<Real> centre = gather_bodies<Real>(bodies_at(particles.body, groups.centre + at_));
        guess_ = quat_of(centre.turn);
        add_turns(particles.body, head(centre.moved));
        add_offsets();
    }

    /// Turns the centres, and finds how the members have to move.
    HAPTIC_LANES void fit(const MovingParticles& particles, int rotation_iterations) noexcept {
        const LaneQuat<Real> found = lane_greatest_overlap(overlap_of(moment_) + spin_, guess_, rotation_iterations);
        const LaneMat<Real> rotation = lane_matrix(found);
        // sum w p x (T q), given the moment matrix sum w p q^T
        const LaneVec<Real> torque =
            cross(moment_.x, rotation.x) + cross(moment_.y, rotation.y) + cross(moment_.z, rotation.z);
        const LaneVec<Real> turn = torque / inertia_;
        const LaneQuat<Real> kept = where_free(groups_->centre_is_free + at_, found, guess_);
        scatter(row_of(kept), turns_at(particles.body, groups_->centre + at_));
        stiffness_ = load<Real>(groups_->stiffness + at_);
        rotation_ = stiffness_ * rotation;
        turn_ = stiffness_ * turn;
        shift_ = stiffness_ * centroid_ + cross(turn_, centroid_);
    }

    HAPTIC_LANES void move_members(Body* body) const noexcept {
        for (std::size_t k = 0; k < slots_; ++k) {
            const LaneVec<Real> p = offset(k);
            const LaneVec<Real> goal = rotation_ * vector_at(groups_->rest_offset, k) + shift_;
            const LaneVec<Real> before = load_vector<Real>(scratch(k) + 3 * kLanes<Real>);
            const LaneVec<Real> next = before + eased(k, goal - (stiffness_ * p + cross(turn_, p)));
            const LaneVec<Real> moved = where_free(groups_->member_is_free + member(k), next, before);
            const Real spin_mass = load<Real>(scratch(k) + 6 * kLanes<Real>);
            scatter<Real>({moved.x, moved.y, moved.z, spin_mass}, bodies_at(body, groups_->member + member(k)));
        }
    }

  private:
    [[nodiscard]] HAPTIC_LANES std::size_t member(std::size_t slot) const noexcept {
        return (first_ + slot) * kLanes<Real>;
    }
    /// Of an array of shape [slot][x, y, z][lane].
    [[nodiscard]] HAPTIC_LANES LaneVec<Real> vector_at(const float* numbers, std::size_t slot) const noexcept {
        return load_vector<Real>(numbers + 3 * member(slot));
    }
    /// Of a member: p, by what it has moved, m r^2 / 5.
    [[nodiscard]] HAPTIC_LANES float* scratch(std::size_t slot) const noexcept {
        return scratch_ + kNumbersOfSlot * slot * kLanes<Real>;
    }
    [[nodiscard]] HAPTIC_LANES LaneVec<Real> offset(std::size_t slot) const noexcept {
        return load_vector<Real>(scratch(slot));
    }
    /// What a compliant group leaves of a member's way to its goal, because of the pull that it exerts already.
    [[nodiscard]] HAPTIC_LANES LaneVec<Real> eased(std::size_t slot, const LaneVec<Real>& way) const noexcept {
        if constexpr (Compliant) {
            const LaneVec<Real> gone = vector_at(groups_->shift, slot);
            const LaneVec<Real> more = way - (stiffness_ * load<Real>(groups_->softness + at_)) * gone;
            store_vector(gone + more, groups_->shift + 3 * member(slot));
            return more;
        } else {
            return way;
        }
    }
    /// `no` in lanes whose mask is 0. The masks of an even batch are not read.
    template <class Value>
    [[nodiscard]] HAPTIC_LANES static Value where_free(const std::int32_t* mask, const Value& yes,
                                                       const Value& no) noexcept {
        if constexpr (Uneven) {
            return select(load_mask<Real>(mask), yes, no);
        } else {
            return yes;
        }
    }

    /// Fills the scratch, and adds up what the members' orientations say. Since tr(R(a)^T R(b)) =
    /// 4 (a . b)^2 - 1, the overlap matrix of R(b) is 4 b b^T - 1.
    HAPTIC_LANES void add_turns(Body* body, const LaneVec<Real>& centre_moved) noexcept {
        constexpr std::size_t n = kLanes<Real>;
        LaneOverlap<Real> sum{};
        Real all{};
        for (std::size_t k = 0; k < slots_; ++k) {
            const LaneBody<Real> row = gather_bodies<Real>(bodies_at(body, groups_->member + member(k)));
            const LaneVec<Real> moved = head(row.moved);
            store_vector(vector_at(groups_->start, k) + (moved - centre_moved), scratch(k));
            store_vector(moved, scratch(k) + 3 * n);
            store(row.moved.d, scratch(k) + 6 * n);
            const LaneQuat<Real> q = quat_of(row.turn);
            const Real w = row.moved.d * q.w;
            const Real x = row.moved.d * q.x;
            const Real y = row.moved.d * q.y;
            const Real z = row.moved.d * q.z;
            sum = sum + LaneOverlap<Real>{w * q.w, x * q.x, y * q.y, z * q.z, w * q.x,
                                          w * q.y, w * q.z, x * q.y, x * q.z, y * q.z};
            all = all + row.moved.d;
        }
        const Real part = load<Real>(groups_->inverse_mass + at_);
        const Real less = part * all;
        spin_ = (NumberOf<Real>(4) * part) * sum;
        spin_.ww = spin_.ww - less;
        spin_.xx = spin_.xx - less;
        spin_.yy = spin_.yy - less;
        spin_.zz = spin_.zz - less;
    }

    /// Finds centroid, moment and inertia. A member that a group does not have weighs 0, and a sum that began with 0
    /// keeps its bits. The moment is the same about any point, since the rest offsets add up to 0.
    HAPTIC_LANES void add_offsets() noexcept {
        constexpr bool at_once = kLanes<Real> == 16;  // there are registers enough
        LaneVec<Real> sum{};
        LaneSymmetric<Real> outer{};
        LaneMat<Real> moment{};
        const auto add_moment = [&](std::size_t k, const LaneVec<Real>& wp) __attribute__((always_inline)) {
            const LaneVec<Real> q = vector_at(groups_->rest_offset, k);
            moment = moment + LaneMat<Real>{q.x * wp, q.y * wp, q.z * wp};
        };
        for (std::size_t k = 0; k < slots_; ++k) {
            const LaneVec<Real> p = offset(k);
            const LaneVec<Real> wp = load<Real>(groups_->weight + member(k)) * p;
            sum = sum + wp;
            outer = outer + LaneSymmetric<Real>{wp.x * p.x, wp.y * p.y, wp.z * p.z, wp.x * p.y, wp.x * p.z, wp.y * p.z};
            if constexpr (at_once) {
                add_moment(k, wp);
            }
        }
        if constexpr (!at_once) {
            for (std::size_t k = 0; k < slots_; ++k) {
                add_moment(k, load<Real>(groups_->weight + member(k)) * offset(k));
            }
        }
        moment_ = moment;
        centroid_ = sum;
        const LaneVec<Real>& c = centroid_;
        inertia_ = lane_inertia(LaneSymmetric<Real>{.xx = outer.xx - c.x * c.x,
                                                    .yy = outer.yy - c.y * c.y,
                                                    .zz = outer.zz - c.z * c.z,
                                                    .yx = outer.yx - c.x * c.y,
                                                    .zx = outer.zx - c.x * c.z,
                                                    .zy = outer.zy - c.y * c.z});
    }

    const GroupBatches* groups_;
    float* scratch_;
    std::size_t at_;     // into arrays of shape [batch][lane]
    std::size_t first_;  // slot
    std::size_t slots_;
    LaneQuat<Real> guess_;       // the centre's turn
    LaneVec<Real> centroid_;     // c, from the centre particle
    LaneMat<Real> moment_;       // sum w p q^T, w parts of the mass
    LaneOverlap<Real> spin_;     // of orientations, per mass
    LaneInertia<Real> inertia_;  // per mass
    Real stiffness_;             // and, times it:
    LaneMat<Real> rotation_;     // T
    LaneVec<Real> turn_;         // theta
    LaneVec<Real> shift_;        // c + theta x c
};

template <class Real, bool Uneven, bool Compliant>
HAPTIC_LANES void project_run(const GroupBatches& groups, const GroupRun& run, int rotation_iterations,
                              const MovingParticles& particles) noexcept {
    BatchProjection<Real, Uneven, Compliant> batch[kMostBatchesInRun];
    for (std::size_t b = 0; b < run.batches; ++b) {
        float* scratch = particles.scratch + kNumbersOfSlot * b * groups.most_slots * kLanes<Real>;
        batch[b].gather_members(groups, run.first_batch + b, particles, scratch);
    }
    for (std::size_t b = 0; b < run.batches; ++b) {
        batch[b].fit(particles, rotation_iterations);
    }
    for (std::size_t b = 0; b < run.batches; ++b) {
        batch[b].move_members(particles.body);
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
                                        turn_bodies<typename LaneTypes<Count, float>::Real>,
                                        find_rates<typename LaneTypes<Count, float>::Real>,
                                        begin<typename LaneTypes<Count, float>::Real>,
                                        find_moved<typename LaneTypes<Count, float>::Real>,
                                        add_moved<typename LaneTypes<Count, float>::Real>,
                                        project_links<typename LaneTypes<Count, float>::Real>,
                                        project_springs<typename LaneTypes<Count, float>::Real>,
                                        project_groups<typename LaneTypes<Count, float>::Real>};

}  // namespace haptic::sim
