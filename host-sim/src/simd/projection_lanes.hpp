// Projection kernels of projection.hpp for any number of lanes. Only the source file compiled for registers of that
// width may instantiate them (see lanes.hpp).
#pragma once

#include <cstdint>
#include <type_traits>

#include "simd/lane_rotation.hpp"
#include "simd/lane_rows.hpp"
#include "simd/projection.hpp"

namespace haptic::sim {

template <class Real>
HAPTIC_LANES LaneQuat<Real> conjugated(const LaneQuat<Real>& q) noexcept {
    return {q.w, -q.x, -q.y, -q.z};
}

/// q <- rotation * q, in double, of the particles from i on that fit into a Double side by side.
template <class Double>
HAPTIC_LANES void rotate_from(std::size_t i, const Row* rotation, Row* orientation) noexcept {
    const auto orientation_at = [&](std::size_t lane)
                                    __attribute__((always_inline)) { return orientation[i + lane].number; };
    const auto rotation_at = [&](std::size_t lane) __attribute__((always_inline)) { return rotation[i + lane].number; };
    scatter(row_of(lane_rotated(quat_of(gather<Double>(orientation_at)), head(gather<Double>(rotation_at)))),
            orientation_at);
}

template <class Real>
void rotate_particles(std::size_t count, const Row* rotation, Row* orientation, ParticleF32* f32) noexcept {
    using Double = Wide<Real>;
    constexpr std::size_t n = kLanes<Real>;
    std::size_t i = 0;
    for (; i + kLanes<Double> <= count; i += kLanes<Double>) {
        rotate_from<Double>(i, rotation, orientation);
    }
    for (; i < count; ++i) {
        rotate_from<double>(i, rotation, orientation);
    }
    // The projections work on the rounded copy.
    for (i = 0; i < count; ++i) {
        store_quad<n>(rounded<n>(load_row<n>(orientation[i])), f32[i].orientation);
    }
}

/// Longest Cayley vector of a step that counts as a rotation: a quarter turn. A fit may jump to the opposite side of an
/// inverted group; taken as an angular velocity, it would jump again in every step.
inline constexpr double kMaxRotation = 2.0;

/// Whether the condition holds in some lane.
template <class Mask>
HAPTIC_LANES bool any_of(const Mask& condition) noexcept {
    if constexpr (std::is_same_v<Mask, bool>) {
        return condition;
    } else {
        std::int64_t lane[sizeof(Mask) / sizeof(std::int64_t)];
        __builtin_memcpy(lane, &condition, sizeof(Mask));
        std::int64_t any = 0;
        for (const std::int64_t bits : lane) {
            any |= bits;
        }
        return any != 0;
    }
}

/// Of the particles from i on that fit into half a Real, in double, side by side. Free: no constraint has rotated them.
template <class Real, bool Free>
HAPTIC_LANES void find_angular_velocities_from(std::size_t i, const Row* before, const ParticleF32* f32, double step,
                                               Row* orientation, Row* angular_velocity) noexcept {
    using Double = Wide<Real>;
    constexpr std::size_t n = kLanes<Real>;
    const auto orientation_at = [&](std::size_t lane)
                                    __attribute__((always_inline)) { return orientation[i + lane].number; };
    // NOLINTNEXTLINE(misc-const-correctness): constraints change it
    LaneQuat<Double> to = quat_of(gather<Double>(orientation_at));
    if constexpr (!Free) {
        // Orientation after and before the constraints, as both were rounded to float.
        const LaneQuat<Double> now = quat_of(columns<Real>([&](std::size_t lane) __attribute__((always_inline)) {
            return widened<n>(load_quad<n>(f32[i + lane].orientation));
        }));
        const LaneQuat<Double> then = quat_of(columns<Real>([&](std::size_t lane) __attribute__((always_inline)) {
            return widened<n>(rounded<n>(load_row<n>(orientation[i + lane])));
        }));
        // Apply the rotation by the constraints, now * conj(then), to the orientation in double. Where there was none,
        // the product is exactly real and the double keeps its direction.
        to = normalised(now * conjugated(then) * to);
        scatter(row_of(to), orientation_at);
    }
    // Rotation of the whole sub-step, prediction and constraints, as a Cayley vector.
    const LaneVec<Double> rotation = lane_rotation_between(
        quat_of(
            gather<Double>([&](std::size_t lane) __attribute__((always_inline)) { return before[i + lane].number; })),
        to);
    // w = rotation / h, its length limited to a quarter turn in the step.
    const Double square = dot(rotation, rotation);
    const auto too_far = square > kMaxRotation * kMaxRotation;
    LaneVec<Double> limited = rotation;
    if (any_of(too_far)) {
        limited = select(too_far, (kMaxRotation / square_root(square)) * rotation, rotation);
    }
    const LaneVec<Double> w = broadcast<Double>(1.0 / step) * limited;
    scatter<Double>({w.x, w.y, w.z, Double{}},
                    [&](std::size_t lane) __attribute__((always_inline)) { return angular_velocity[i + lane].number; });
}

template <class Real>
void find_angular_velocities(std::size_t count, const Row* before, const ParticleF32* f32, double step,
                             Row* orientation, Row* angular_velocity) noexcept {
    const auto all = [&](auto is_free) __attribute__((always_inline)) {
        std::size_t i = 0;
        for (; i + kLanes<Wide<Real>> <= count; i += kLanes<Wide<Real>>) {
            find_angular_velocities_from<Real, is_free()>(i, before, f32, step, orientation, angular_velocity);
        }
        for (; i < count; ++i) {
            find_angular_velocities_from<float, is_free()>(i, before, f32, step, orientation, angular_velocity);
        }
    };
    if (f32 == nullptr) {
        all(std::bool_constant<true>{});
    } else {
        all(std::bool_constant<false>{});
    }
}

template <class Real>
void round_displacements(std::size_t count, const Row* position, const Row* start, ParticleF32* f32) noexcept {
    constexpr std::size_t n = kLanes<Real>;
    // start has 0 in its fourth number, so that m r^2 / 5 passes through.
    for (std::size_t i = 0; i < count; ++i) {
        store_quad<n>(rounded<n>(load_row<n>(position[i]) - load_row<n>(start[i])), f32[i].displacement);
    }
}

template <class Real>
void apply_displacements(std::size_t count, const ParticleF32* f32, const Row* start, Row* position) noexcept {
    constexpr std::size_t n = kLanes<Real>;
    for (std::size_t i = 0; i < count; ++i) {
        // x <- x + (displacement now - displacement at the last rounding).
        const DoubleRow<n> then = load_row<n>(position[i]);
        // The displacement as round_displacements() rounded it: the difference is exactly 0 for what has not moved.
        const DoubleRow<n> counted = widened<n>(rounded<n>(then - load_row<n>(start[i])));
        store_row<n>(then - (counted - widened<n>(load_quad<n>(f32[i].displacement))), position[i]);
    }
}

/// Addresses of the particles that a batch of constraints names, for gather() and scatter().
HAPTIC_LANES auto particles_at(ParticleF32* f32, const std::uint32_t* index) noexcept {
    float* numbers = f32->displacement.number;
    return [numbers, index](std::size_t lane) __attribute__((always_inline)) {
        return numbers + std::size_t{index[lane]} * (kFloatsPerParticle / kDoublesPerRow);
    };
}
HAPTIC_LANES auto orientations_at(ParticleF32* f32, const std::uint32_t* index) noexcept {
    float* numbers = f32->orientation.number;
    return [numbers, index](std::size_t lane) __attribute__((always_inline)) {
        return numbers + std::size_t{index[lane]} * (kFloatsPerParticle / kDoublesPerRow);
    };
}
HAPTIC_LANES auto positions_at(Row* position, const std::uint32_t* index) noexcept {
    double* numbers = position->number;
    return [numbers, index](std::size_t lane)
               __attribute__((always_inline)) { return numbers + std::size_t{index[lane]}; };
}

/// From and to an array of shape [x, y, z][lane].
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

/// The vector from one particle to another in each lane: subtracted in double, then rounded.
template <class Real>
HAPTIC_LANES LaneVec<Real> offset_between(const Row* position, const std::uint32_t* from,
                                          const std::uint32_t* to) noexcept {
    constexpr std::size_t n = kLanes<Real>;
    const auto quad = [&](std::size_t lane) __attribute__((always_inline)) {
        return rounded<n>(load_row<n>(position[to[lane] / kDoublesPerRow]) -
                          load_row<n>(position[from[lane] / kDoublesPerRow]));
    };
    if constexpr (n == 1) {
        const FloatRow only = quad(0);
        return {only.number[0], only.number[1], only.number[2]};
    } else {
        return head(join<Real>(quad));
    }
}

template <class Real>
void begin_substep(const LinkBatches& links, const GroupBatches& groups, const Row* position) noexcept {
    constexpr std::size_t n = kLanes<Real>;
    // Links: from the first particle to the second.
    for (std::size_t at = 0; at < links.count * n; at += n) {
        store_vector(offset_between<Real>(position, links.first + at, links.second + at), links.start + 3 * at);
    }
    // Groups: from the centre particle to each member.
    for (std::size_t b = 0; b < groups.batches; ++b) {
        const std::size_t first = groups.batch[b].first_slot * n;
        for (std::size_t at = first; at < first + groups.batch[b].slots * n; at += n) {
            store_vector(offset_between<Real>(position, groups.centre + b * n, groups.member + at),
                         groups.start + 3 * at);
        }
    }
}

/// Distance constraint C = |b - a| - d (Müller et al. 2007, equations 10 and 11).
template <class Real>
HAPTIC_LANES void project_link_batch(const LinkBatches& links, std::size_t batch, ParticleF32* f32) noexcept {
    const std::size_t at = batch * kLanes<Real>;
    const auto first_at = particles_at(f32, links.first + at);
    const auto second_at = particles_at(f32, links.second + at);
    const LaneRow<Real> first = gather<Real>(first_at);
    const LaneRow<Real> second = gather<Real>(second_at);
    // b - a: the offset at the start plus the difference of the displacements.
    const LaneVec<Real> between = load_vector<Real>(links.start + 3 * at) + (head(second) - head(first));
    const Real length = square_root(dot(between, between));
    // C times the direction, (1 - d / length) (b - a). Coincident particles have no direction: no correction.
    const Real stretch = NumberOf<Real>(1) - load<Real>(links.rest_length + at) / length;
    const LaneVec<Real> correction = select(length > NumberOf<Real>(0), stretch * between, LaneVec<Real>{});
    // Each end moves by its share of the inverse masses, times the stiffness.
    const LaneVec<Real> a = head(first) + load<Real>(links.first_share + at) * correction;
    const LaneVec<Real> b = head(second) - load<Real>(links.second_share + at) * correction;
    scatter<Real>({a.x, a.y, a.z, first.d}, first_at);
    scatter<Real>({b.x, b.y, b.z, second.d}, second_at);
}

template <class Real>
void project_links(const LinkBatches& links, bool forward, const MovingParticles& particles) noexcept {
    for (std::size_t k = 0; k < links.count; ++k) {
        project_link_batch<Real>(links, forward ? k : links.count - 1 - k, particles.f32);
    }
}

/// Distance constraint with a compliance (Macklin et al. 2016, equations 17 and 18).
template <class Real>
HAPTIC_LANES void project_spring_batch(const SpringBatches& springs, std::size_t batch, Row* position) noexcept {
    const std::size_t at = batch * kLanes<Real>;
    const auto first_at = positions_at(position, springs.first + at);
    const auto second_at = positions_at(position, springs.second + at);
    const LaneRow<Real> first = gather<Real>(first_at);
    const LaneRow<Real> second = gather<Real>(second_at);
    // Offset and length of the spring, for C = |b - a| - d.
    const LaneVec<Real> a = head(first);
    const LaneVec<Real> b = head(second);
    const LaneVec<Real> between = b - a;
    const Real length = square_root(dot(between, between));
    // Equation 18: change of the multiplier, (C - s lambda) / (w_a + w_b + s), with the scaled compliance s.
    const Real lambda = load<Real>(springs.lambda + at);
    const Real error =
        length - load<Real>(springs.rest_length + at) - load<Real>(springs.scaled_compliance + at) * lambda;
    const Real delta_lambda = load<Real>(springs.gain + at) * error;
    // Equation 17: both ends move along the spring in proportion to their inverse masses. Coincident ends stay.
    const LaneVec<Real> along = (delta_lambda / length) * between;
    const auto has_direction = length > 0.0;
    const LaneVec<Real> a_new = select(has_direction, a + load<Real>(springs.first_inverse_mass + at) * along, a);
    const LaneVec<Real> b_new = select(has_direction, b - load<Real>(springs.second_inverse_mass + at) * along, b);
    // lambda <- lambda + delta lambda; it accumulates over the iterations of the sub-step.
    store(select(has_direction, lambda + delta_lambda, lambda), springs.lambda + at);
    scatter<Real>({a_new.x, a_new.y, a_new.z, first.d}, first_at);
    scatter<Real>({b_new.x, b_new.y, b_new.z, second.d}, second_at);
}

/// In double, since a spring's multiplier accumulates over the iterations.
template <class Real>
void project_springs(const SpringBatches& springs, bool forward, const MovingParticles& particles) noexcept {
    const std::size_t parts = springs.count * (kLanes<Real> / kLanes<Wide<Real>>);
    for (std::size_t k = 0; k < parts; ++k) {
        project_spring_batch<Wide<Real>>(springs, forward ? k : parts - 1 - k, particles.position);
    }
}

/// Shape matching of one batch of groups, in three phases: gather_members, fit, move_members. `Uneven` and `Compliant`
/// are as in GroupRun; particles that a mask excludes keep their bits.
///
/// Members' offsets p are from the centre particle; w is a member's fraction of the group's mass.
/// @source Müller & Chentanez 2011, equations 10 to 12; thesis, section 4.1.2
template <class Real, bool Uneven, bool Compliant>
class BatchProjection {
  public:
    /// Sums over the members. Each sum has its own loop, because together they do not fit the registers. `scratch` has
    /// kFloatsPerSlot numbers for each slot and lane.
    HAPTIC_LANES void gather_members(const GroupBatches& groups, std::size_t batch, const MovingParticles& particles,
                                     float* scratch) noexcept {
        groups_ = &groups;
        scratch_ = scratch;
        at_ = batch * kLanes<Real>;
        first_ = groups.batch[batch].first_slot;
        slots_ = groups.batch[batch].slots;
        // Initial guess of the fit: the orientation of the centre particle.
        const LaneParticle<Real> centre = gather_particles<Real>(particles_at(particles.f32, groups.centre + at_));
        guess_ = quat_of(centre.orientation);
        add_orientations(particles.f32, head(centre.displacement));
        add_offsets();
    }

    /// Fits the rotation, gives it to the centre particles, and derives the rigid motion of the members' goals.
    HAPTIC_LANES void fit(const MovingParticles& particles, int rotation_iterations) noexcept {
        // T: rotational part of A = sum w p q^T + sum of the orientations, from Horn's matrices.
        const LaneQuat<Real> found =
            lane_greatest_overlap(overlap_of(moment_) + orientation_overlap_, guess_, rotation_iterations);
        const LaneMat<Real> rotation = lane_matrix(found);
        // theta = I^-1 sum w p x (T q): the net rotation that the goals would cause. No inner force can do that, so
        // move_members() takes it out. The cross products of A's columns with T's columns give the sum.
        const LaneVec<Real> torque =
            cross(moment_.x, rotation.x) + cross(moment_.y, rotation.y) + cross(moment_.z, rotation.z);
        const LaneVec<Real> theta = torque / inertia_;
        // The centre particle takes T as its orientation, unless it is pinned.
        const LaneQuat<Real> kept = where_free(groups_->centre_is_free + at_, found, guess_);
        scatter(row_of(kept), orientations_at(particles.f32, groups_->centre + at_));
        // With the stiffness s: s T, s theta, and the part of the displacement that all members share.
        stiffness_ = load<Real>(groups_->stiffness + at_);
        rotation_ = stiffness_ * rotation;
        theta_ = stiffness_ * theta;
        translation_ = stiffness_ * centroid_ + cross(theta_, centroid_);
    }

    /// Moves each member by s ((c + T q - p) - theta x (p - c)).
    HAPTIC_LANES void move_members(ParticleF32* f32) const noexcept {
        for (std::size_t k = 0; k < slots_; ++k) {
            // s (T q + c + theta x c), less s (p + theta x p); s is already a factor of the sums from fit().
            const LaneVec<Real> p = offset(k);
            const LaneVec<Real> goal = rotation_ * vector_at(groups_->rest_offset, k) + translation_;
            const LaneVec<Real> before = load_vector<Real>(scratch(k) + 3 * kLanes<Real>);
            const LaneVec<Real> next = before + compliant_part(k, goal - (stiffness_ * p + cross(theta_, p)));
            // Pinned and missing members keep their displacement.
            const LaneVec<Real> moved = where_free(groups_->member_is_free + member(k), next, before);
            // The fourth number, m r^2 / 5, is stored unchanged.
            const Real spin_mass = load<Real>(scratch(k) + 6 * kLanes<Real>);
            scatter<Real>({moved.x, moved.y, moved.z, spin_mass}, particles_at(f32, groups_->member + member(k)));
        }
    }

  private:
    [[nodiscard]] HAPTIC_LANES std::size_t member(std::size_t slot) const noexcept {
        return (first_ + slot) * kLanes<Real>;
    }
    /// From an array of shape [slot][x, y, z][lane].
    [[nodiscard]] HAPTIC_LANES LaneVec<Real> vector_at(const float* numbers, std::size_t slot) const noexcept {
        return load_vector<Real>(numbers + 3 * member(slot));
    }
    /// Of a member: offset p, displacement, m r^2 / 5.
    [[nodiscard]] HAPTIC_LANES float* scratch(std::size_t slot) const noexcept {
        return scratch_ + kFloatsPerSlot * slot * kLanes<Real>;
    }
    [[nodiscard]] HAPTIC_LANES LaneVec<Real> offset(std::size_t slot) const noexcept {
        return load_vector<Real>(scratch(slot));
    }
    /// XPBD step of a compliant group, (d - s e) / (1 + s) with e the member's displacement so far (see solver.hpp);
    /// `displacement` already contains the factor stiffness / (1 + s). Identity for other groups.
    [[nodiscard]] HAPTIC_LANES LaneVec<Real> compliant_part(std::size_t slot,
                                                            const LaneVec<Real>& displacement) const noexcept {
        if constexpr (Compliant) {
            const LaneVec<Real> so_far = vector_at(groups_->shift, slot);
            const LaneVec<Real> added =
                displacement - (stiffness_ * load<Real>(groups_->scaled_compliance + at_)) * so_far;
            store_vector(so_far + added, groups_->shift + 3 * member(slot));
            return added;
        } else {
            return displacement;
        }
    }

    /// `no` in lanes whose mask is 0. Even batches do not read their masks.
    template <class Value>
    [[nodiscard]] HAPTIC_LANES static Value where_free(const std::int32_t* mask, const Value& yes,
                                                       const Value& no) noexcept {
        if constexpr (Uneven) {
            return select(load_mask<Real>(mask), yes, no);
        } else {
            return yes;
        }
    }

    /// Fills the scratch and sums the orientation terms m r^2 / 5 R of the moment matrix, as Horn's matrix. Since
    /// tr(R(a)^T R(b)) = 4 (a . b)^2 - 1, Horn's matrix of R(b) is 4 b b^T - 1.
    HAPTIC_LANES void add_orientations(ParticleF32* f32, const LaneVec<Real>& centre_displacement) noexcept {
        constexpr std::size_t n = kLanes<Real>;
        LaneOverlap<Real> sum{};
        Real total{};
        for (std::size_t k = 0; k < slots_; ++k) {
            // Scratch of the member: p, its displacement, m r^2 / 5.
            const LaneParticle<Real> row = gather_particles<Real>(particles_at(f32, groups_->member + member(k)));
            const LaneVec<Real> displacement = head(row.displacement);
            store_vector(vector_at(groups_->start, k) + (displacement - centre_displacement), scratch(k));
            store_vector(displacement, scratch(k) + 3 * n);
            store(row.displacement.d, scratch(k) + 6 * n);
            // Sum of m r^2 / 5 b b^T.
            const LaneQuat<Real> q = quat_of(row.orientation);
            const Real w = row.displacement.d * q.w;
            const Real x = row.displacement.d * q.x;
            const Real y = row.displacement.d * q.y;
            const Real z = row.displacement.d * q.z;
            sum = sum + LaneOverlap<Real>{w * q.w, x * q.x, y * q.y, z * q.z, w * q.x,
                                          w * q.y, w * q.z, x * q.y, x * q.z, y * q.z};
            total = total + row.displacement.d;
        }
        // Per mass of the group: 4 b b^T - 1.
        const Real inverse_mass = load<Real>(groups_->inverse_mass + at_);
        const Real diagonal = inverse_mass * total;
        orientation_overlap_ = (NumberOf<Real>(4) * inverse_mass) * sum;
        orientation_overlap_.ww = orientation_overlap_.ww - diagonal;
        orientation_overlap_.xx = orientation_overlap_.xx - diagonal;
        orientation_overlap_.yy = orientation_overlap_.yy - diagonal;
        orientation_overlap_.zz = orientation_overlap_.zz - diagonal;
    }

    /// Sums centroid c = sum w p, moment sum w p q^T and inertia. A member that a group does not have weighs 0 and
    /// changes no bit of a sum that starts at 0. The moment is the same about any point, since the rest offsets sum to
    /// 0.
    HAPTIC_LANES void add_offsets() noexcept {
        constexpr bool at_once = kLanes<Real> == 16;  // AVX-512 has enough registers for all sums in one loop
        LaneVec<Real> sum{};
        LaneSymmetric<Real> outer{};
        LaneMat<Real> moment{};
        const auto add_moment = [&](std::size_t k, const LaneVec<Real>& wp) __attribute__((always_inline)) {
            const LaneVec<Real> q = vector_at(groups_->rest_offset, k);
            moment = moment + LaneMat<Real>{q.x * wp, q.y * wp, q.z * wp};
        };
        // Centroid, and second moments about the centre particle.
        for (std::size_t k = 0; k < slots_; ++k) {
            const LaneVec<Real> p = offset(k);
            const LaneVec<Real> wp = load<Real>(groups_->weight + member(k)) * p;
            sum = sum + wp;
            outer = outer + LaneSymmetric<Real>{wp.x * p.x, wp.y * p.y, wp.z * p.z, wp.x * p.y, wp.x * p.z, wp.y * p.z};
            if constexpr (at_once) {
                add_moment(k, wp);
            }
        }
        // Moment A = sum w p q^T.
        if constexpr (!at_once) {
            for (std::size_t k = 0; k < slots_; ++k) {
                add_moment(k, load<Real>(groups_->weight + member(k)) * offset(k));
            }
        }
        moment_ = moment;
        centroid_ = sum;
        // Parallel axis theorem: second moments about the centroid.
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
    LaneQuat<Real> guess_;                   // orientation of the centre particle
    LaneVec<Real> centroid_;                 // c, from the centre particle
    LaneMat<Real> moment_;                   // sum w p q^T
    LaneOverlap<Real> orientation_overlap_;  // Horn's matrix of the orientation terms, per mass
    LaneInertia<Real> inertia_;              // I, per mass
    Real stiffness_;                         // s; the following contain it as a factor
    LaneMat<Real> rotation_;                 // T
    LaneVec<Real> theta_;
    LaneVec<Real> translation_;  // c + theta x c
};

template <class Real, bool Uneven, bool Compliant>
HAPTIC_LANES void project_run(const GroupBatches& groups, const GroupRun& run, int rotation_iterations,
                              const MovingParticles& particles) noexcept {
    // One phase over all batches of the run before the next phase (see GroupRun).
    BatchProjection<Real, Uneven, Compliant> batch[kMaxBatchesInRun];
    for (std::size_t b = 0; b < run.batches; ++b) {
        float* scratch = particles.scratch + kFloatsPerSlot * b * groups.max_slots * kLanes<Real>;
        batch[b].gather_members(groups, run.first_batch + b, particles, scratch);
    }
    for (std::size_t b = 0; b < run.batches; ++b) {
        batch[b].fit(particles, rotation_iterations);
    }
    for (std::size_t b = 0; b < run.batches; ++b) {
        batch[b].move_members(particles.f32);
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
inline constexpr ProjectionKernels kProjection{Count,
                                               rotate_particles<typename LaneTypes<Count, float>::Real>,
                                               find_angular_velocities<typename LaneTypes<Count, float>::Real>,
                                               begin_substep<typename LaneTypes<Count, float>::Real>,
                                               round_displacements<typename LaneTypes<Count, float>::Real>,
                                               apply_displacements<typename LaneTypes<Count, float>::Real>,
                                               project_links<typename LaneTypes<Count, float>::Real>,
                                               project_springs<typename LaneTypes<Count, float>::Real>,
                                               project_groups<typename LaneTypes<Count, float>::Real>};

}  // namespace haptic::sim
