// Elastic kernels of elastic.hpp for any number of lanes. Only the source file compiled for registers of that width may
// instantiate them (see lanes.hpp).
#pragma once

#include "simd/elastic.hpp"
#include "simd/lane_rotation.hpp"
#include "simd/lane_rows.hpp"

namespace haptic::sim {

// Steps toward the rotation of an element, from that which its angular velocity predicts.
inline constexpr int kRotationSteps = 2;
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

/// Stores the force of each lane at its place.
template <class Real>
HAPTIC_LANES void store_forces(const LaneVec<Real>& force, Row* to) noexcept {
    scatter<Real>({force.x, force.y, force.z, Real{}},
                  [to](std::size_t lane) __attribute__((always_inline)) { return to[lane].number; });
}

/// sum of the members' rows, from the centre's, times the gradient: F, or its rate.
template <class Real>
HAPTIC_LANES LaneMat<Real> solid_gradient(const ElasticBatches& b, std::size_t batch, const Row* rows) noexcept {
    constexpr std::size_t n = kLanes<Real>;
    const LaneVec<Real> centre = head(gather<Real>(rows_at(rows, b.centre + batch * n)));
    LaneMat<Real> sum{};
    const std::size_t first = b.batch[batch].first_slot;
    for (std::size_t slot = first; slot < first + b.batch[batch].slots; ++slot) {
        const LaneVec<Real> p = head(gather<Real>(rows_at(rows, b.member + slot * n))) - centre;
        const LaneVec<Real> g = vector_from<Real>(b.gradient + 3 * slot * n);
        sum = sum + LaneMat<Real>{g.x * p, g.y * p, g.z * p};
    }
    return sum;
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
        const LaneQuat<Real> turn = lane_extract_rotation(f, quat_of(gather<Real>(turn_at)), kRotationSteps);
        scatter(row_of(turn), turn_at);
        const LaneMat<Real> r = lane_matrix(turn);
        // Strain e = sym(R^T F) - N, and damping times its rate.
        const double* const spread_at = b.spread + 6 * batch * n;
        const auto spread_row = [&](std::size_t k)
                                    __attribute__((always_inline)) { return load<Real>(spread_at + k * n); };
        const LaneSymmetric<Real> spread{spread_row(0), spread_row(1), spread_row(2),
                                         spread_row(3), spread_row(4), spread_row(5)};
        LaneSymmetric<Real> e = turned_back(r, f) + broadcast<Real>(-1.0) * spread;
        if (b.batch[batch].damped) {
            const LaneMat<Real> rate = solid_gradient<Real>(b, batch, particles.velocity);
            e = e + load<Real>(b.damping + batch * n) * turned_back(r, rate);
        }
        // Minus the stress times the volume, R (2 mu e + lambda tr(e) N).
        const Real shear = -load<Real>(b.shear + batch * n);
        const Real sum = -load<Real>(b.lame + batch * n) * (e.xx + e.yy + e.zz);
        const LaneSymmetric<Real> s = shear * e + sum * spread;
        const LaneMat<Real> pull{s.xx * r.x + s.yx * r.y + s.zx * r.z, s.yx * r.x + s.yy * r.y + s.zy * r.z,
                                 s.zx * r.x + s.zy * r.y + s.zz * r.z};
        // The force on each member.
        const std::size_t first = b.batch[batch].first_slot;
        for (std::size_t slot = first; slot < first + b.batch[batch].slots; ++slot) {
            store_forces<Real>(pull * vector_from<Real>(b.gradient + 3 * slot * n), b.force + slot * n);
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
        if (b.batch[batch].damped) {
            const TriangleGradient<Real> rate = triangle_gradient<Real>(b, batch, particles.velocity);
            const Real damping = load<Real>(b.damping + batch * n);
            exx = exx + damping * dot(rx, rate.x);
            eyy = eyy + damping * dot(ry, rate.y);
            exy = exy + broadcast<Real>(0.5) * damping * (dot(rx, rate.y) + dot(ry, rate.x));
        }
        // Minus the stress times the area, and the force on each corner.
        const Real shear = -load<Real>(b.shear + batch * n);
        const Real sum = -load<Real>(b.lame + batch * n) * (exx + eyy);
        const Real sxy = shear * exy;
        const LaneVec<Real> px = (shear * exx + sum) * rx + sxy * ry;
        const LaneVec<Real> py = sxy * rx + (shear * eyy + sum) * ry;
        const std::size_t first = b.batch[batch].first_slot;
        for (std::size_t slot = first; slot < first + 3; ++slot) {
            const double* const at = b.gradient + 2 * slot * n;
            store_forces<Real>(load<Real>(at) * px + load<Real>(at + n) * py, b.force + slot * n);
        }
    }
}

template <std::size_t Lanes>
void sum_forces(const ForceSums& s) noexcept {
    using Sum = DoubleRow<Lanes>;
    for (std::size_t r = 0; r < s.count; ++r) {
        const std::uint32_t i = s.particle[r];
        Sum sum = load_row<Lanes>(s.given[i]);
        for (std::uint32_t k = s.first_force[i]; k < s.first_force[i + 1]; ++k) {
            const std::uint32_t place = s.force[k];
            sum = sum + load_row<Lanes>(place < s.solid_places ? s.solid_force[place]
                                                               : s.triangle_force[place - s.solid_places]);
        }
        const Sum at = load_row<Lanes>(s.position[i]);
        const Sum velocity = load_row<Lanes>(s.velocity[i]);
        for (std::uint32_t k = s.first_pair[i]; k < s.first_pair[i + 1]; ++k) {
            sum = sum + s.stiffness[k] * (load_row<Lanes>(s.position[s.other[k]]) - at);
            if (s.damped) {
                sum = sum + s.viscosity[k] * (load_row<Lanes>(s.velocity[s.other[k]]) - velocity);
            }
        }
        store_row<Lanes>(sum, s.sum[r]);
    }
}

template <std::size_t Lanes>
void solve_columns(const FactorColumns& f) noexcept {
    using Side = DoubleRow<Lanes>;
    // L y = b, column by column.
    for (std::size_t column = 0; column < f.rows; ++column) {
        const Side known = load_row<Lanes>(f.side[column]);
        for (std::uint32_t k = f.first[column]; k < f.first[column + 1]; ++k) {
            Row& to = f.side[f.row[k]];
            store_row<Lanes>(load_row<Lanes>(to) - f.below[k] * known, to);
        }
    }
    // L^T x = y / D, from the last column to the first, in two sums, so that additions need not wait for one another.
    for (std::size_t column = f.rows; column-- > 0;) {
        Side even = f.inverse_diagonal[column] * load_row<Lanes>(f.side[column]);
        Side odd{};
        const std::uint32_t end = f.first[column + 1];
        std::uint32_t k = f.first[column];
        for (; k + 1 < end; k += 2) {
            even = even - f.below[k] * load_row<Lanes>(f.side[f.row[k]]);
            odd = odd - f.below[k + 1] * load_row<Lanes>(f.side[f.row[k + 1]]);
        }
        if (k < end) {
            even = even - f.below[k] * load_row<Lanes>(f.side[f.row[k]]);
        }
        store_row<Lanes>(even + odd, f.side[column]);
    }
}

/// Lanes of float in registers with `Count` lanes of double, for DoubleRow.
template <std::size_t Count>
inline constexpr std::size_t kFloatLanes = Count == 1 ? 1 : 2 * Count;

template <std::size_t Count>
inline constexpr ElasticKernels kElasticKernels{Count, elastic_solids<typename LaneTypes<Count>::Real>,
                                                elastic_triangles<typename LaneTypes<Count>::Real>, sum_forces<Count>,
                                                solve_columns<Count>};

}  // namespace haptic::sim
