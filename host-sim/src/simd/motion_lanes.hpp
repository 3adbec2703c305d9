// Motion kernels of motion.hpp for any number of lanes of float. Only the source file compiled for registers of that
// width may instantiate them (see lanes.hpp).
#pragma once

#include "simd/lane_rotation.hpp"
#include "simd/lane_rows.hpp"
#include "simd/motion.hpp"

namespace haptic::sim {

/// Three numbers, and 0.
template <std::size_t Lanes>
HAPTIC_LANES DoubleRow<Lanes> load_three(const double* from) noexcept {
    constexpr std::size_t lanes = kLanes<DoublePiece<Lanes>>;
    if constexpr (lanes == 4) {
        using Two = LaneTypes<2>::Real;
        return {{__builtin_shufflevector(load<Two>(from), Two{from[2], 0.0}, 0, 1, 2, 3)}};
    } else if constexpr (lanes == 2) {
        return {{load<DoublePiece<Lanes>>(from), DoublePiece<Lanes>{from[2], 0.0}}};
    } else {
        return {{from[0], from[1], from[2], 0.0}};
    }
}
template <std::size_t Lanes>
HAPTIC_LANES void store_three(const DoubleRow<Lanes>& row, double* to) noexcept {
    constexpr std::size_t lanes = kLanes<DoublePiece<Lanes>>;
    if constexpr (lanes == 4) {
        store(__builtin_shufflevector(row.piece[0], row.piece[0], 0, 1), to);
        to[2] = row.piece[0][2];
    } else if constexpr (lanes == 2) {
        store(row.piece[0], to);
        to[2] = row.piece[1][0];
    } else {
        for (std::size_t k = 0; k < 3; ++k) {
            to[k] = row.piece[k];
        }
    }
}

template <std::size_t Lanes>
HAPTIC_LANES DoubleRow<Lanes> operator/(DoubleRow<Lanes> a, double s) noexcept {
    for (std::size_t p = 0; p < kDoublePieces<Lanes>; ++p) {
        a.piece[p] /= s;
    }
    return a;
}

/// y, z, x and the fourth number.
template <std::size_t Lanes>
HAPTIC_LANES DoubleRow<Lanes> rolled(const DoubleRow<Lanes>& a) noexcept {
    constexpr std::size_t lanes = kLanes<DoublePiece<Lanes>>;
    if constexpr (lanes == 4) {
        return {{__builtin_shufflevector(a.piece[0], a.piece[0], 1, 2, 0, 3)}};
    } else if constexpr (lanes == 2) {
        return {{__builtin_shufflevector(a.piece[0], a.piece[1], 1, 2),
                 __builtin_shufflevector(a.piece[0], a.piece[1], 0, 3)}};
    } else {
        return {{a.piece[1], a.piece[2], a.piece[0], a.piece[3]}};
    }
}

/// a x b. Each of its numbers is a difference of two products, in the order of cross().
template <std::size_t Lanes>
HAPTIC_LANES DoubleRow<Lanes> cross(const DoubleRow<Lanes>& a, const DoubleRow<Lanes>& b) noexcept {
    const DoubleRow<Lanes> a_yzx = rolled(a);
    const DoubleRow<Lanes> b_yzx = rolled(b);
    return a_yzx * rolled(b_yzx) - b_yzx * rolled(a_yzx);
}

/// w, x, y, z of a quaternion in the order x, y, z, w, and back.
template <std::size_t Lanes>
HAPTIC_LANES DoubleRow<Lanes> load_quaternion(const double* from) noexcept {
    constexpr std::size_t lanes = kLanes<DoublePiece<Lanes>>;
    if constexpr (lanes == 4) {
        const auto xyzw = load<DoublePiece<Lanes>>(from);
        return {{__builtin_shufflevector(xyzw, xyzw, 3, 0, 1, 2)}};
    } else if constexpr (lanes == 2) {
        return {{DoublePiece<Lanes>{from[3], from[0]}, load<DoublePiece<Lanes>>(from + 1)}};
    } else {
        return {{from[3], from[0], from[1], from[2]}};
    }
}
template <std::size_t Lanes>
HAPTIC_LANES void store_quaternion(const DoubleRow<Lanes>& wxyz, double* to) noexcept {
    constexpr std::size_t lanes = kLanes<DoublePiece<Lanes>>;
    if constexpr (lanes == 4) {
        store(__builtin_shufflevector(wxyz.piece[0], wxyz.piece[0], 1, 2, 3, 0), to);
    } else {
        for (std::size_t k = 0; k < 4; ++k) {
            to[k] = number_of(wxyz, (k + 1) % 4);
        }
    }
}

/// Whether some of the first three numbers is not 0.
HAPTIC_LANES bool any_of_three(const double* number) noexcept {
    return (number[0] != 0.0) | (number[1] != 0.0) | (number[2] != 0.0);
}

template <std::size_t Lanes>
void predict(const StartingParticles& p) noexcept {
    using Vector = DoubleRow<Lanes>;
    const Vector gravity = load_three<Lanes>(p.gravity);
    for (std::size_t i = 0; i < p.count; ++i) {
        const Vector orientation = load_quaternion<Lanes>(p.orientation + 4 * i);
        store_row(orientation, p.before[i]);
        store_row(orientation, p.turning[i]);
        const Vector start = load_three<Lanes>(p.start + 3 * i);
        const Vector velocity = load_three<Lanes>(p.velocity + 3 * i);
        const Vector spin = load_three<Lanes>(p.angular_velocity + 3 * i);
        // Pinned particles follow their own velocities. Those at rest keep their positions bit for bit.
        if (p.pinned[i] != 0) {
            const bool still = !any_of_three(p.velocity + 3 * i);
            store_three(velocity, p.predicted + 3 * i);
            store_three(still ? start : start + p.step * velocity, p.position[i].number);
            store_row(p.step * spin, p.rotation[i]);
            continue;
        }
        // Free particles: drag, gravity and external force.
        Vector predicted = p.drag_factor * velocity + p.step * gravity;
        if (p.force != nullptr) {
            predicted = predicted + (p.step / p.mass[i]) * load_three<Lanes>(p.force + 3 * i);
        }
        store_three(predicted, p.predicted + 3 * i);
        // u = x + h v, and the rotation vector h w.
        store_three(start + p.step * predicted, p.position[i].number);
        store_row((p.step * p.drag_factor) * spin, p.rotation[i]);
    }
}

template <std::size_t Lanes>
void find_velocities(const MovedParticles& p) noexcept {
    for (std::size_t i = 0; i < p.count; ++i) {
        if (any_of_three(p.pushed[i].number)) {  // few are pushed
            double* const predicted = p.predicted + 3 * i;
            store_three(load_three<Lanes>(predicted) + load_row<Lanes>(p.pushed[i]) / p.step, predicted);
            p.pushed[i] = {};
        }
        double* const spin = p.new_angular_velocity + 3 * i;
        const bool is_free = p.pinned[i] == 0;
        if (is_free || any_of_three(spin)) {
            store_quaternion(load_row<Lanes>(p.orientation[i]), p.new_orientation + 4 * i);
        }
        if (is_free) {
            store_three((load_row<Lanes>(p.position[i]) - load_three<Lanes>(p.start + 3 * i)) / p.step,
                        p.velocity + 3 * i);
            store_three(load_row<Lanes>(p.angular_velocity[i]), spin);
        }
    }
}

template <std::size_t Lanes>
void restore_momenta(const FreeBody& body) noexcept {
    using Vector = DoubleRow<Lanes>;
    // Centre of mass.
    double mass = 0.0;
    Vector moment{};
    for (std::size_t i = 0; i < body.count; ++i) {
        mass += body.mass[i];
        moment = moment + body.mass[i] * load_three<Lanes>(body.start + 3 * i);
    }
    const Vector centre = moment / mass;
    // Momenta lost by the projections, about the centre of mass: sums of m (v_predicted - v) and of p x that vector.
    // The columns of sum m p p^T.
    Vector linear{};
    Vector angular{};
    Vector scatter[3]{};
    for (std::size_t i = 0; i < body.count; ++i) {
        const Vector start = load_three<Lanes>(body.start + 3 * i);
        const Vector p = start - centre;
        const Vector velocity = (load_three<Lanes>(body.position[i].number) - start) / body.step;
        const Vector lost = body.mass[i] * (load_three<Lanes>(body.predicted + 3 * i) - velocity);
        linear = linear + lost;
        angular = angular + cross(p, lost);
        const Vector heavy = body.mass[i] * p;
        for (std::size_t k = 0; k < 3; ++k) {
            scatter[k] = scatter[k] + number_of(p, k) * heavy;
        }
    }
    // Velocity of the lost linear momentum. It is rounding error alone, since every projection conserves momentum.
    linear = linear / mass;
    Vector omega{};
    if (body.keep_angular_momentum) {
        const auto element = [&](std::size_t column, std::size_t row)
                                 __attribute__((always_inline)) { return number_of(scatter[column], row); };
        const LaneVec<double> turned =
            LaneVec<double>{number_of(angular, 0), number_of(angular, 1), number_of(angular, 2)} /
            lane_inertia(LaneSymmetric<double>{.xx = element(0, 0),
                                               .yy = element(1, 1),
                                               .zz = element(2, 2),
                                               .yx = element(1, 0),
                                               .zx = element(2, 0),
                                               .zy = element(2, 1)});
        omega = row_of_three<Lanes>(turned.x, turned.y, turned.z);
    }
    // Add them back as a rigid motion, dv + w x p.
    for (std::size_t i = 0; i < body.count; ++i) {
        const Vector change = linear + cross(omega, load_three<Lanes>(body.start + 3 * i) - centre);
        if (body.velocity != nullptr) {
            double* const velocity = body.velocity + 3 * i;
            store_three(load_three<Lanes>(velocity) + change, velocity);
        }
        store_row(load_row<Lanes>(body.position[i]) + body.step * change, body.position[i]);
    }
}

template <std::size_t Count>
inline constexpr MotionKernels kMotion{Count, predict<Count>, find_velocities<Count>, restore_momenta<Count>};

}  // namespace haptic::sim
