// Elastic kernels of elastic.hpp for any number of lanes. Only the source file compiled for registers of that width may
// instantiate them (see lanes.hpp).
#pragma once

#include <type_traits>

#include "simd/elastic.hpp"
#include "simd/lane_rotation.hpp"
#include "simd/lane_rows.hpp"

namespace haptic::sim {

// Ratio of areas: keeps the frame of a triangle without area finite.
inline constexpr double kSmallestArea = 1e-9;

/// Addresses of the rows that a batch names, for gather() and scatter().
HAPTIC_LANES auto rows_at(const Row* rows, const std::uint32_t* index) noexcept {
    return [rows, index](std::size_t lane) __attribute__((always_inline)) { return rows[index[lane]].number; };
}
HAPTIC_LANES auto rows_at(Row* rows, const std::uint32_t* index) noexcept {
    return [rows, index](std::size_t lane) __attribute__((always_inline)) { return rows[index[lane]].number; };
}

template <class Real>
HAPTIC_LANES LaneVec<Real> vector_from(const double* from) noexcept {
    return {load<Real>(from), load<Real>(from + kLanes<Real>), load<Real>(from + 2 * kLanes<Real>)};
}

/// Stores what each lane's element pulls at the member in this slot.
template <class Real>
HAPTIC_LANES void store_pull(const LaneVec<Real>& pull, const ElasticBatches& b, std::size_t slot) noexcept {
    store_rows<Real>({pull.x, pull.y, pull.z, Real{}}, b.pull[slot * kLanes<Real>].number);
}

/// The part of the damping that the step itself does not have.
template <class Real>
HAPTIC_LANES Real further_damping(const ElasticBatches& b, std::size_t batch) noexcept {
    return load<Real>(b.damping + batch * kLanes<Real>) - broadcast<Real>(b.own_damping);
}

/// sum of the members' rows, from the centre's, times the gradient: F, or its rate.
template <class Real>
HAPTIC_LANES LaneMat<Real> solid_gradient(const ElasticBatches& b, std::size_t batch, const Row* rows) noexcept {
    constexpr std::size_t n = kLanes<Real>;
    const std::size_t first = b.batch[batch].first_slot;
    const LaneVec<Real> centre = head(gather<Real>(rows_at(rows, b.member + first * n)));
    LaneMat<Real> sum{};
    // The first member is the centre.
    for (std::size_t slot = first + 1; slot < first + b.batch[batch].slots; ++slot) {
        const LaneVec<Real> p = head(gather<Real>(rows_at(rows, b.member + slot * n))) - centre;
        const LaneVec<Real> g = vector_from<Real>(b.gradient + 3 * slot * n);
        sum = sum + LaneMat<Real>{g.x * p, g.y * p, g.z * p};
    }
    return sum;
}

/// A step of lane_greatest_overlap() that is not normalised, from a q of any length. `square`: dot(q, q).
template <class Real>
HAPTIC_LANES LaneQuat<Real> nearer(const LaneOverlap<Real>& k, const LaneQuat<Real>& q, Real square) noexcept {
    const LaneQuat<Real> g = k * q;
    const Real overlap = dot(q, g);
    const Real magnitude = absolute(overlap);
    const Real shift = (magnitude - overlap) + magnitude;
    return {square * g.w + shift * q.w, square * g.x + shift * q.x, square * g.y + shift * q.y,
            square * g.z + shift * q.z};
}

/// Two steps toward the rotation nearest to F, from the one that the element's angular velocity predicts. The steps are
/// those of lane_extract_rotation(), but only the last one is normalised: a batch waits for each square root and
/// quotient.
template <class Real>
HAPTIC_LANES LaneQuat<Real> nearest_rotation(const LaneMat<Real>& f, const LaneQuat<Real>& guess) noexcept {
    const LaneOverlap<Real> k = overlap_of(f);
    const LaneQuat<Real> first = nearer(k, guess, broadcast<Real>(1.0));
    const LaneQuat<Real> second = nearer(k, first, dot(first, first));
    // 0 where F determines nothing: keep the guess instead of 0 / 0.
    return select(dot(second, second) > 0.0, normalised(second), guess);
}

/// The symmetric part of R^T F.
template <class Real>
HAPTIC_LANES LaneSymmetric<Real> turned_back(const LaneMat<Real>& r, const LaneMat<Real>& f) noexcept {
    const NumberOf<Real> half(0.5);
    return {dot(r.x, f.x),
            dot(r.y, f.y),
            dot(r.z, f.z),
            half * (dot(r.y, f.x) + dot(r.x, f.y)),
            half * (dot(r.z, f.x) + dot(r.x, f.z)),
            half * (dot(r.z, f.y) + dot(r.y, f.z))};
}

template <class Real>
HAPTIC_LANES LaneSymmetric<Real> operator*(Real s, const LaneSymmetric<Real>& a) noexcept {
    return {s * a.xx, s * a.yy, s * a.zz, s * a.yx, s * a.zx, s * a.zy};
}

template <class Real>
void elastic_solids(const ElasticBatches& b, const ElasticParticles& particles) noexcept {
    constexpr std::size_t n = kLanes<Real>;
    for (std::size_t batch = 0; batch < b.batches; ++batch) {
        // F, and the rotation nearest to it, which the centre takes.
        const LaneMat<Real> f = solid_gradient<Real>(b, batch, particles.position);
        const auto turn_at = rows_at(particles.orientation, b.centre + batch * n);
        const LaneQuat<Real> turn = nearest_rotation(f, quat_of(gather<Real>(turn_at)));
        scatter(row_of(turn), turn_at);
        const LaneMat<Real> r = lane_matrix(turn);
        // Strain e = sym(R^T F) - N, and damping times its rate.
        const double* const spread_at = b.spread + 6 * batch * n;
        const auto spread_row = [&](std::size_t k)
                                    __attribute__((always_inline)) { return load<Real>(spread_at + k * n); };
        const LaneSymmetric<Real> spread{spread_row(0), spread_row(1), spread_row(2),
                                         spread_row(3), spread_row(4), spread_row(5)};
        LaneSymmetric<Real> e = turned_back(r, f) + broadcast<Real>(-1.0) * spread;
        if (b.damped) {
            const LaneMat<Real> rate = solid_gradient<Real>(b, batch, particles.velocity);
            e = e + further_damping<Real>(b, batch) * turned_back(r, rate);
        }
        // Minus the stress times the volume, R (2 mu e + lambda tr(e) N).
        const Real shear = -load<Real>(b.shear + batch * n);
        const Real sum = -load<Real>(b.lame + batch * n) * (e.xx + e.yy + e.zz);
        const LaneSymmetric<Real> s = shear * e + sum * spread;
        LaneMat<Real> stress{s.xx * r.x + s.yx * r.y + s.zx * r.z, s.yx * r.x + s.yy * r.y + s.zy * r.z,
                             s.zx * r.x + s.zy * r.y + s.zz * r.z};
        // Solved for positions, the right-hand side contains what the matrix makes of F.
        if (b.bound != nullptr) {
            stress = stress + load<Real>(b.bound + batch * n) * f;
        }
        // Each member is pulled by that times its gradient.
        const std::size_t first = b.batch[batch].first_slot;
        for (std::size_t slot = first; slot < first + b.batch[batch].slots; ++slot) {
            store_pull(stress * vector_from<Real>(b.gradient + 3 * slot * n), b, slot);
        }
    }
}

/// Both columns of a triangle's F, or of its rate, along its own axes.
template <class Real>
struct TriangleGradient {
    LaneVec<Real> x, y;
};

template <class Real>
HAPTIC_LANES TriangleGradient<Real> triangle_gradient(const ElasticBatches& b, std::size_t batch,
                                                      const Row* rows) noexcept {
    constexpr std::size_t n = kLanes<Real>;
    const std::size_t first = b.batch[batch].first_slot;
    const LaneVec<Real> centre = head(gather<Real>(rows_at(rows, b.member + first * n)));
    TriangleGradient<Real> sum{};
    // The first corner is the centre.
    for (std::size_t slot = first + 1; slot < first + 3; ++slot) {
        const LaneVec<Real> p = head(gather<Real>(rows_at(rows, b.member + slot * n))) - centre;
        const double* const at = b.gradient + 2 * slot * n;
        sum = {sum.x + load<Real>(at) * p, sum.y + load<Real>(at + n) * p};
    }
    return sum;
}

template <class Real>
void elastic_triangles(const ElasticBatches& b, const ElasticParticles& particles) noexcept {
    constexpr std::size_t n = kLanes<Real>;
    const Real one = broadcast<Real>(1.0);
    const Real two = broadcast<Real>(2.0);
    for (std::size_t batch = 0; batch < b.batches; ++batch) {
        const TriangleGradient<Real> f = triangle_gradient<Real>(b, batch, particles.position);
        // F = R U: U = (C + det(U) 1) / tr(U), the root of the symmetric 2 x 2 matrix C = F^T F.
        const Real cxx = dot(f.x, f.x);
        const Real cxy = dot(f.x, f.y);
        const Real cyy = dot(f.y, f.y);
        const Real square = cxx * cyy - cxy * cxy;
        const Real area = square_root(select(square > 0.0, square, Real{})) + broadcast<Real>(kSmallestArea);
        const Real inverse_sum = one / square_root(cxx + cyy + two * area);
        const Real uxx = (cxx + area) * inverse_sum;
        const Real uxy = cxy * inverse_sum;
        const Real uyy = (cyy + area) * inverse_sum;
        const Real inverse = one / (uxx * uyy - uxy * uxy);
        const LaneVec<Real> rx = inverse * (uyy * f.x - uxy * f.y);
        const LaneVec<Real> ry = inverse * (uxx * f.y - uxy * f.x);
        // Strain U - 1 and damping times its rate.
        Real exx = uxx - one;
        Real eyy = uyy - one;
        Real exy = uxy;
        if (b.damped) {
            const TriangleGradient<Real> rate = triangle_gradient<Real>(b, batch, particles.velocity);
            const Real damping = further_damping<Real>(b, batch);
            exx = exx + damping * dot(rx, rate.x);
            eyy = eyy + damping * dot(ry, rate.y);
            exy = exy + broadcast<Real>(0.5) * damping * (dot(rx, rate.y) + dot(ry, rate.x));
        }
        // Minus the stress times the area.
        const Real shear = -load<Real>(b.shear + batch * n);
        const Real sum = -load<Real>(b.lame + batch * n) * (exx + eyy);
        const Real sxy = shear * exy;
        const LaneVec<Real> along = (shear * exx + sum) * rx + sxy * ry;
        const LaneVec<Real> across = sxy * rx + (shear * eyy + sum) * ry;
        // Each corner is pulled by that times its gradient.
        const std::size_t first = b.batch[batch].first_slot;
        for (std::size_t slot = first; slot < first + 3; ++slot) {
            const double* const at = b.gradient + 2 * slot * n;
            store_pull(load<Real>(at) * along + load<Real>(at + n) * across, b, slot);
        }
    }
}

template <std::size_t Lanes>
void sum_forces(const ForceSums& s) noexcept {
    using Sum = DoubleRow<2 * Lanes>;
    for (std::size_t r = 0; r < s.count; ++r) {
        const std::uint32_t i = s.particle[r];
        // Two sums, so that additions need not wait for one another.
        Sum even = load_row<2 * Lanes>(s.given[i]);
        Sum odd{};
        const std::uint32_t end_share = s.first_share[i + 1];
        std::uint32_t share = s.first_share[i];
        for (; share + 1 < end_share; share += 2) {
            even = even + load_row<2 * Lanes>(s.pull[s.share[share]]);
            odd = odd + load_row<2 * Lanes>(s.pull[s.share[share + 1]]);
        }
        if (share < end_share) {
            even = even + load_row<2 * Lanes>(s.pull[s.share[share]]);
        }
        const std::uint32_t first = s.first_pair != nullptr ? s.first_pair[i] : 0;
        const std::uint32_t end = s.first_pair != nullptr ? s.first_pair[i + 1] : 0;
        const Sum at = load_row<2 * Lanes>(s.position[i]);
        const auto pull = [&](std::uint32_t k) __attribute__((always_inline)) {
            return s.stiffness[k] * (load_row<2 * Lanes>(s.position[s.other[k]]) - at);
        };
        std::uint32_t k = first;
        for (; k + 1 < end; k += 2) {
            even = even + pull(k);
            odd = odd + pull(k + 1);
        }
        if (k < end) {
            even = even + pull(k);
        }
        if (s.damped) {
            const Sum velocity = load_row<2 * Lanes>(s.velocity[i]);
            for (k = first; k < end; ++k) {
                const double viscosity = s.stiffness[k] * (s.damping[k] - s.own_damping);
                even = even + viscosity * (load_row<2 * Lanes>(s.velocity[s.other[k]]) - velocity);
            }
        }
        store_row(even + odd, s.sum[r]);
    }
}

/// What the factors are applied to: a whole row of one right-hand side, or x, y and z of two.
template <std::size_t Lanes, std::size_t Sides>
class SideNumbers {
  public:
    SideNumbers() = default;
    HAPTIC_LANES explicit SideNumbers(const Row& from) noexcept {
        for (std::size_t p = 0; p < kParts; ++p) {
            part_[p] = load<Part>(from.number + p * kLanes<Part>);
        }
        if constexpr (kHasRest) {
            rest_ = load<Rest>(from.number + kParts * kLanes<Part>);
        }
    }
    HAPTIC_LANES void put(Row& to) const noexcept {
        for (std::size_t p = 0; p < kParts; ++p) {
            store(part_[p], to.number + p * kLanes<Part>);
        }
        if constexpr (kHasRest) {
            store(rest_, to.number + kParts * kLanes<Part>);
        }
    }
    HAPTIC_LANES void subtract(double factor, const SideNumbers& other) noexcept {
        const Part factors = broadcast<Part>(factor);
        for (std::size_t p = 0; p < kParts; ++p) {
            part_[p] -= factors * other.part_[p];
        }
        if constexpr (kHasRest) {
            rest_ -= __builtin_shufflevector(factors, factors, 0, 1) * other.rest_;
        }
    }
    HAPTIC_LANES void scale(double factor) noexcept {
        for (std::size_t p = 0; p < kParts; ++p) {
            part_[p] *= factor;
        }
        if constexpr (kHasRest) {
            rest_ *= factor;
        }
    }

  private:
    // Six numbers are a register of four and half a one, or, with unused ones, one of eight.
    static constexpr std::size_t kNumbers = Sides == 1 ? 4 : 6;
    static constexpr std::size_t kRoom = 4 * Sides;
    using Part = typename LaneTypes<(Lanes < kRoom ? Lanes : kRoom)>::Real;
    static constexpr std::size_t kParts = kLanes<Part> < kNumbers ? kNumbers / kLanes<Part> : 1;
    static constexpr bool kHasRest = kParts * kLanes<Part> < kNumbers;
    using Rest = typename LaneTypes<2>::Real;

    Part part_[kParts]{};
    Rest rest_{};
};

/// L y = b for the columns of a panel.
template <std::size_t Lanes, std::size_t Sides, std::size_t Width>
HAPTIC_LANES void solve_forward(const FactorPanels& f, const FactorPanel& panel) noexcept {
    using Side = SideNumbers<Lanes, Sides>;
    const double* below = f.below + panel.first;
    Side known[Width];
    for (std::size_t c = 0; c < Width; ++c, below += Width) {
        Row& side = f.side[Sides * (panel.column + c)];
        known[c] = Side(side);
        for (std::size_t d = 0; d < c; ++d) {
            known[c].subtract(below[d], known[d]);
        }
        known[c].put(side);
    }
    const std::uint32_t* const row = f.row + panel.first_row;
    for (std::size_t t = Width; t < panel.rows; ++t, below += Width) {
        Side side(f.side[Sides * row[t]]);
        for (std::size_t c = 0; c < Width; ++c) {
            side.subtract(below[c], known[c]);
        }
        side.put(f.side[Sides * row[t]]);
    }
}

/// L^T x = y / D for the columns of a panel.
template <std::size_t Lanes, std::size_t Sides, std::size_t Width>
HAPTIC_LANES void solve_backward(const FactorPanels& f, const FactorPanel& panel) noexcept {
    using Side = SideNumbers<Lanes, Sides>;
    Side sum[Width];
    for (std::size_t c = 0; c < Width; ++c) {
        const std::size_t column = panel.column + c;
        sum[c] = Side(f.side[Sides * column]);
        sum[c].scale(f.inverse_diagonal[column]);
    }
    const std::uint32_t* const row = f.row + panel.first_row;
    const double* const below = f.below + panel.first;
    for (std::size_t t = Width; t < panel.rows; ++t) {
        const Side known(f.side[Sides * row[t]]);
        for (std::size_t c = 0; c < Width; ++c) {
            sum[c].subtract(below[t * Width + c], known);
        }
    }
    for (std::size_t c = Width; c-- > 0;) {
        for (std::size_t d = c + 1; d < Width; ++d) {
            sum[c].subtract(below[d * Width + c], sum[d]);
        }
        sum[c].put(f.side[Sides * (panel.column + c)]);
    }
}

/// Calls with the panel's width as a constant, so that its columns stay in registers.
template <class Call>
HAPTIC_LANES void with_width(const FactorPanel& panel, const Call& call) noexcept {
    static_assert(kPanelColumns == 4);
    switch (panel.width) {
        case 1:
            return call(std::integral_constant<std::size_t, 1>{});
        case 2:
            return call(std::integral_constant<std::size_t, 2>{});
        case 3:
            return call(std::integral_constant<std::size_t, 3>{});
        default:
            return call(std::integral_constant<std::size_t, 4>{});
    }
}

template <std::size_t Lanes, std::size_t Sides>
void solve_panels(const FactorPanels& f) noexcept {
    for (std::size_t p = 0; p < f.panels; ++p) {
        const FactorPanel& panel = f.panel[p];
        with_width(panel,
                   [&](auto width) __attribute__((always_inline)) { solve_forward<Lanes, Sides, width()>(f, panel); });
    }
    for (std::size_t p = f.panels; p-- > 0;) {
        const FactorPanel& panel = f.panel[p];
        with_width(panel,
                   [&](auto width) __attribute__((always_inline)) { solve_backward<Lanes, Sides, width()>(f, panel); });
    }
}

/// Moves the particles from j on that fit into a Real side by side.
template <class Real>
HAPTIC_LANES void move_from(const PushedRows& m, std::size_t j) noexcept {
    constexpr std::size_t n = kLanes<Real>;
    // x, y and z. Two sums each, so that additions need not wait for one another.
    Real even[3]{};
    Real odd[3]{};
    const auto add = [&](Real(&sum)[3], const double* factor, const Row& term) __attribute__((always_inline)) {
        const Real factors = load<Real>(factor + j);
        for (std::size_t c = 0; c < 3; ++c) {
            sum[c] = sum[c] + factors * term.number[c];
        }
    };
    std::size_t p = 0;
    for (; p + 1 < m.pushes; p += 2) {
        add(even, m.column[p], m.force[p]);
        add(odd, m.column[p + 1], m.force[p + 1]);
    }
    if (p < m.pushes) {
        add(even, m.column[p], m.force[p]);
    }
    for (std::size_t k = 0; k < kLevers && m.lever != nullptr; k += 2) {
        add(even, m.lever + k * m.lever_length, m.terms[k]);
        add(odd, m.lever + (k + 1) * m.lever_length, m.terms[k + 1]);
    }
    double moved[3][n];
    for (std::size_t c = 0; c < 3; ++c) {
        store(even[c] + odd[c], moved[c]);
    }
    for (std::size_t lane = 0; lane < n; ++lane) {
        for (std::size_t c = 0; c < 3; ++c) {
            m.position[j + lane].number[c] += moved[c][lane];
        }
    }
}

template <std::size_t Lanes>
void move_rows(const PushedRows& m) noexcept {
    std::size_t j = 0;
    for (; j + Lanes <= m.count; j += Lanes) {
        move_from<typename LaneTypes<Lanes>::Real>(m, j);
    }
    for (; j < m.count; ++j) {
        move_from<double>(m, j);
    }
}

/// The sum of rows by the coordinates of a vector.
template <std::size_t Lanes>
HAPTIC_LANES DoubleRow<2 * Lanes> sum_by(const LaneVec<double>& vector, const Row (&row)[3]) noexcept {
    return (vector.x * load_row<2 * Lanes>(row[0]) + vector.y * load_row<2 * Lanes>(row[1])) +
           vector.z * load_row<2 * Lanes>(row[2]);
}

HAPTIC_LANES LaneVec<double> first_three(const Row& row) noexcept {
    return {row.number[0], row.number[1], row.number[2]};
}

/// Pushes at a place, an arm away from its particle: moves the places of its body, and turns it.
template <std::size_t Lanes>
HAPTIC_LANES void push_at(PushedPlace& place, const LaneVec<double>& arm, const DoubleRow<2 * Lanes>& force) noexcept {
    using Real = typename LaneTypes<Lanes>::Real;
    PushedBody& body = *place.body;
    const LaneVec<double> f{number_of(force, 0), number_of(force, 1), number_of(force, 2)};
    const Real x = broadcast<Real>(f.x);
    const Real y = broadcast<Real>(f.y);
    const Real z = broadcast<Real>(f.z);
    for (std::size_t k = 0; k < body.places; k += Lanes) {
        const Real response = load<Real>(place.response + k);
        store(load<Real>(body.moved[0] + k) + response * x, body.moved[0] + k);
        store(load<Real>(body.moved[1] + k) + response * y, body.moved[1] + k);
        store(load<Real>(body.moved[2] + k) + response * z, body.moved[2] + k);
    }
    store_row(load_row<2 * Lanes>(*place.force) + force, *place.force);
    const auto by_torque = sum_by<Lanes>(cross(arm, f), body.by_torque);
    const auto alpha = sum_by<Lanes>(f, place.alpha);
    store_row(load_row<2 * Lanes>(body.alpha) + alpha, body.alpha);
    store_row(load_row<2 * Lanes>(body.gamma) + (sum_by<Lanes>(f, place.gamma) + by_torque), body.gamma);
    store_row(load_row<2 * Lanes>(body.turned_by_pushes) + (body.h_squared * alpha + by_torque), body.turned_by_pushes);
    body.pushed = true;
}

/// Where the particle on one side of a contact would be if it had moved as the end of its arm.
template <std::size_t Lanes>
HAPTIC_LANES DoubleRow<2 * Lanes> position_of(const PushedContact::Side& side) noexcept {
    const DoubleRow<2 * Lanes> position = load_row<2 * Lanes>(*side.position);
    if (side.place == nullptr) {
        return position;
    }
    const PushedPlace& place = *side.place;
    const PushedBody& body = *place.body;
    const auto moved =
        row_of_three<2 * Lanes>(body.moved[0][place.index], body.moved[1][place.index], body.moved[2][place.index]);
    const LaneVec<double> arm = cross(first_three(body.turned_by_pushes), side.arm);
    return (position + moved) + ((sum_by<Lanes>(first_three(body.alpha), place.by_alpha) +
                                  sum_by<Lanes>(first_three(body.gamma), place.by_gamma)) +
                                 row_of_three<2 * Lanes>(arm.x, arm.y, arm.z));
}

template <std::size_t Lanes>
HAPTIC_LANES void push_side(const PushedContact::Side& side, const DoubleRow<2 * Lanes>& force) noexcept {
    if (side.place != nullptr) {
        push_at<Lanes>(*side.place, side.arm, force);
    } else if (side.alone > 0.0) {
        // The fourth number of a position is none of its coordinates.
        const auto vector = row_of_three<2 * Lanes>(number_of(force, 0), number_of(force, 1), number_of(force, 2));
        store_row(load_row<2 * Lanes>(*side.position) + side.alone * vector, *side.position);
    }
}

template <std::size_t Lanes>
void push_one_side(const PushedContact::Side& side, const Row& force) noexcept {
    push_side<Lanes>(side, load_row<2 * Lanes>(force));
}

/// Of the first three numbers.
template <std::size_t Lanes>
HAPTIC_LANES double dot_of_three(const DoubleRow<Lanes>& a, const DoubleRow<Lanes>& b) noexcept {
    const DoubleRow<Lanes> product = a * b;
    return (number_of(product, 0) + number_of(product, 1)) + number_of(product, 2);
}

/// x1 - x2 of a contact.
template <std::size_t Lanes>
HAPTIC_LANES DoubleRow<2 * Lanes> offset_of(const PushedContact& contact) noexcept {
    const DoubleRow<2 * Lanes> first = position_of<Lanes>(contact.first);
    return contact.second.position == nullptr ? first : first - position_of<Lanes>(contact.second);
}

/// Changes the push of a contact, m, with friction. `apart`: x1 - x2; `along`: that along the normal.
template <std::size_t Lanes>
HAPTIC_LANES void push_contact(const ContactPass& pass, PushedContact& contact, const DoubleRow<2 * Lanes>& apart,
                               double along, double change) noexcept {
    using Vector = DoubleRow<2 * Lanes>;
    const Vector normal = load_row<2 * Lanes>(contact.normal);
    contact.push += change;
    // Friction: undo the slip of the whole sub-step along the plane, within Coulomb's cone. Apply the change since the
    // last pass.
    const Vector moved = apart - load_row<2 * Lanes>(contact.from);
    const Vector slip = moved - (along - contact.from_along) * normal;
    const Vector before = load_row<2 * Lanes>(contact.friction);
    const double pressing = contact.along * contact.push;
    Vector friction = before - pass.relaxation * contact.across * slip;
    const double square = dot_of_three<2 * Lanes>(friction, friction);
    const double limit = pass.sticking * pressing;
    if (square > limit * limit) {
        friction = (pass.sliding * pressing / square_root(square)) * friction;
    }
    store_row(friction, contact.friction);
    const Vector force = change * contact.along * normal + (friction - before);
    push_side<Lanes>(contact.first, force);
    push_side<Lanes>(contact.second, -1.0 * force);
}

/// Lets a contact push until it is met. Returns the change of its push.
template <std::size_t Lanes>
HAPTIC_LANES double pass_contact(const ContactPass& pass, PushedContact& contact) noexcept {
    const auto apart = offset_of<Lanes>(contact);
    const double along = dot_of_three<2 * Lanes>(load_row<2 * Lanes>(contact.normal), apart);
    const double clearance = along - contact.min_separation;
    if (clearance >= 0.0 && contact.push == 0.0) {
        return 0.0;
    }
    // Push by -C and a little more, but take back no more than was pushed in this sub-step.
    const double wanted_change = -pass.relaxation * clearance;
    const double change = wanted_change > -contact.push ? wanted_change : -contact.push;
    push_contact<Lanes>(pass, contact, apart, along, change);
    return change < 0.0 ? -change : change;
}

/// Lets two contacts push until both are met. Returns the larger change of their pushes.
template <std::size_t Lanes>
HAPTIC_LANES double pass_two(const ContactPass& pass, PushedContact& one, PushedContact& other) noexcept {
    const auto normal = load_row<2 * Lanes>(other.normal);
    const auto apart = offset_of<Lanes>(one);
    const double along = dot_of_three<2 * Lanes>(load_row<2 * Lanes>(one.normal), apart);
    const double clearance[2] = {along - one.min_separation,
                                 dot_of_three<2 * Lanes>(normal, offset_of<Lanes>(other)) - other.min_separation};
    if (clearance[0] >= 0.0 && clearance[1] >= 0.0 && one.push == 0.0 && other.push == 0.0) {
        return 0.0;
    }
    // In m as if each were alone: the clearances after the changes d are c + d_0 + e d_1 and c + g d_0 + d_1.
    const double e = one.coupling * other.along;
    const double g = one.coupling * one.along;
    const double least[2] = {-one.push, -other.push};
    double d[2] = {(e * clearance[1] - clearance[0]) / (1.0 - e * g),
                   (g * clearance[0] - clearance[1]) / (1.0 - e * g)};
    if (!(d[0] >= least[0] && d[1] >= least[1])) {
        // One of the two does not push, and the other is met alone, or does not push either.
        const double first = -clearance[0] - e * least[1];
        const double second = -clearance[1] - g * least[0];
        d[0] = first > least[0] ? first : least[0];
        d[1] = least[1];
        if (!(clearance[1] + g * d[0] + d[1] >= 0.0)) {
            d[0] = least[0];
            d[1] = second > least[1] ? second : least[1];
        }
    }
    push_contact<Lanes>(pass, one, apart, along, d[0]);
    const auto other_apart = offset_of<Lanes>(other);
    push_contact<Lanes>(pass, other, other_apart, dot_of_three<2 * Lanes>(normal, other_apart), d[1]);
    const double most = d[0] < 0.0 ? -d[0] : d[0];
    const double more = d[1] < 0.0 ? -d[1] : d[1];
    return more > most ? more : most;
}

template <std::size_t Lanes>
double pass_contacts(const ContactPass& pass) noexcept {
    double error = 0.0;
    for (std::size_t k = 0, at = 0; k < pass.count; ++k) {
        if (pass.forward) {
            at += pass.stride;
            at -= at < pass.count ? 0 : pass.count;
        }
        PushedContact& contact = pass.contact[at];
        if (contact.partner >= 0) {
            const double change = contact.partner == 0 ? pass_contact<Lanes>(pass, contact)
                                                       : pass_two<Lanes>(pass, contact, *(&contact + contact.partner));
            error = change > error ? change : error;
        }
        if (!pass.forward) {
            at += at < pass.stride ? pass.count : 0;
            at -= pass.stride;
        }
    }
    return error;
}

template <std::size_t Count>
inline constexpr ElasticKernels kElasticKernels{Count,
                                                elastic_solids<typename LaneTypes<Count>::Real>,
                                                elastic_triangles<typename LaneTypes<Count>::Real>,
                                                sum_forces<Count>,
                                                solve_panels<Count, 1>,
                                                solve_panels<Count, 2>,
                                                move_rows<Count>,
                                                push_one_side<Count>,
                                                pass_contacts<Count>};

}  // namespace haptic::sim
