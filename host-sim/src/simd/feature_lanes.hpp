// Feature kernels of features.hpp for any number of lanes. Only the source file compiled for registers of that width
// may instantiate them (see lanes.hpp).
#pragma once

#include "simd/collider_lanes.hpp"
#include "simd/features.hpp"
#include "simd/lane_rows.hpp"
#include "simd/lanes.hpp"

namespace haptic::sim {

/// The four vertices of as many pairs as there are lanes, m.
template <class Real>
struct FeatureLanes {
    LaneVec<Real> x[4];
};

template <class Real>
HAPTIC_LANES FeatureLanes<Real> load_features(const FeatureRows& pairs, std::size_t at, const Row* position) noexcept {
    FeatureLanes<Real> features{};
    for (std::size_t k = 0; k < 4; ++k) {
        const std::uint32_t* const vertex = pairs.vertex[k] + at;
        features.x[k] = head(gather<Real>(
            [&](std::size_t lane) __attribute__((always_inline)) { return position[vertex[lane]].number; }));
    }
    return features;
}

template <PairKind kind, class Real>
HAPTIC_LANES Real gap_along(const LaneVec<Real>& normal, const FeatureLanes<Real>& of) noexcept {
    const Real first = dot(normal, of.x[0]);
    const Real second = dot(normal, of.x[1]);
    const Real third = dot(normal, of.x[2]);
    const Real fourth = dot(normal, of.x[3]);
    if constexpr (kind == PairKind::VertexTriangle) {
        return first - max_of(second, max_of(third, fourth));
    } else {
        return min_of(first, second) - max_of(third, fourth);
    }
}

/// 0 for a vector without length.
template <class Real>
HAPTIC_LANES LaneVec<Real> unit_or_zero(const LaneVec<Real>& v) noexcept {
    const Real length = square_root(dot(v, v));
    const Real zero = broadcast<Real>(0.0);
    const LaneVec<Real> unit = v / length;  // not a number if the length is 0: not selected
    return select(length > 0.0, unit, LaneVec<Real>{zero, zero, zero});
}

template <PairKind kind, class Real>
HAPTIC_LANES void find_normals_at(const FeatureRows& pairs, std::size_t at, const Row* position) noexcept {
    const FeatureLanes<Real> of = load_features<Real>(pairs, at, position);
    // From the middle of the second to that of the first, of any length, and across what is flat.
    LaneVec<Real> apart{};
    LaneVec<Real> across{};
    if constexpr (kind == PairKind::VertexTriangle) {
        const LaneVec<Real> ab = of.x[2] - of.x[1];
        const LaneVec<Real> ac = of.x[3] - of.x[1];
        const LaneVec<Real> ap = of.x[0] - of.x[1];
        apart = broadcast<Real>(3.0) * ap - ab - ac;
        across = cross(ab, ac);
    } else {
        apart = of.x[0] - of.x[2] + (of.x[1] - of.x[3]);
        across = cross(of.x[1] - of.x[0], of.x[3] - of.x[2]);
    }
    const LaneVec<Real> middle = unit_or_zero(apart);
    const LaneVec<Real> side = unit_or_zero(across);
    const LaneVec<Real> flat = copy_sign(broadcast<Real>(1.0), dot(side, apart)) * side;
    // The one along which they are farther apart.
    const Real middle_gap = gap_along<kind>(middle, of);
    const Real flat_gap = gap_along<kind>(flat, of);
    const auto is_flat = flat_gap > middle_gap;
    const LaneVec<Real> normal = select(is_flat, flat, middle);
    store(normal.x, pairs.normal[0] + at);
    store(normal.y, pairs.normal[1] + at);
    store(normal.z, pairs.normal[2] + at);
    store(select(is_flat, flat_gap, middle_gap), pairs.gap + at);
}

template <PairKind kind, class Real>
HAPTIC_LANES void find_gaps_at(const FeatureRows& pairs, std::size_t at, const Row* position) noexcept {
    const LaneVec<Real> normal{load<Real>(pairs.normal[0] + at), load<Real>(pairs.normal[1] + at),
                               load<Real>(pairs.normal[2] + at)};
    store(gap_along<kind>(normal, load_features<Real>(pairs, at, position)), pairs.gap + at);
}

/// A point of the second feature, and how far the first one's vertex is from it.
template <class Real>
struct NearestOnTriangle {
    LaneVec<Real> weight;  // of the corners
    LaneVec<Real> apart;   // m, to the vertex
};

/// Part of the way along `edge`, in 0..1, that is nearest to what lies at `apart` from its beginning.
template <class Real>
HAPTIC_LANES Real nearest_part(const LaneVec<Real>& apart, const LaneVec<Real>& edge) noexcept {
    const Real zero = broadcast<Real>(0.0);
    const Real one = broadcast<Real>(1.0);
    const Real square = dot(edge, edge);
    const Real part = dot(apart, edge) / square;  // not a number for an edge without length: not selected
    return select(square > 0.0, min_of(max_of(part, zero), one), zero);
}

/// The nearest point of a triangle without its interior: of its edges.
template <class Real>
HAPTIC_LANES NearestOnTriangle<Real> nearest_on_edges(const LaneVec<Real> (&corner)[3],
                                                      const LaneVec<Real> (&from)[3]) noexcept {
    const Real zero = broadcast<Real>(0.0);
    const Real one = broadcast<Real>(1.0);
    const auto on_edge = [&](std::size_t k) __attribute__((always_inline)) {
        const LaneVec<Real> edge = corner[(k + 1) % 3] - corner[k];
        const Real part = nearest_part(from[k], edge);
        Real weight[3] = {zero, zero, zero};
        weight[k] = one - part;
        weight[(k + 1) % 3] = part;
        return NearestOnTriangle<Real>{{weight[0], weight[1], weight[2]}, from[k] - part * edge};
    };
    NearestOnTriangle<Real> best = on_edge(0);
    for (std::size_t k = 1; k < 3; ++k) {
        const NearestOnTriangle<Real> other = on_edge(k);
        const auto is_nearer = dot(other.apart, other.apart) < dot(best.apart, best.apart);
        best = {select(is_nearer, other.weight, best.weight), select(is_nearer, other.apart, best.apart)};
    }
    return best;
}

// A triangle whose height is below this part of its sides counts as its edges, as in closest_point_on_triangle().
inline constexpr double kThinTriangle = 1e-7;

/// Above the triangle its foot is nearest, by the areas that it makes with the edges; else a point of an edge.
template <class Real>
HAPTIC_LANES NearestOnTriangle<Real> nearest_on_triangle(const FeatureLanes<Real>& of) noexcept {
    const LaneVec<Real> corner[3] = {of.x[1], of.x[2], of.x[3]};
    const LaneVec<Real> from[3] = {of.x[0] - corner[0], of.x[0] - corner[1], of.x[0] - corner[2]};
    const NearestOnTriangle<Real> border = nearest_on_edges(corner, from);
    const LaneVec<Real> ab = corner[1] - corner[0];
    const LaneVec<Real> ac = corner[2] - corner[0];
    const LaneVec<Real> across = cross(ab, ac);
    const Real a = dot(across, cross(from[1], from[2]));
    const Real b = dot(across, cross(from[2], from[0]));
    const Real c = dot(across, cross(from[0], from[1]));
    const Real thin = broadcast<Real>(kThinTriangle * kThinTriangle);
    const auto is_above = (dot(across, across) > thin * dot(ab, ab) * dot(ac, ac)) & (a > 0.0) & (b > 0.0) & (c > 0.0);
    const Real sum = a + b + c;
    const LaneVec<Real> weight{a / sum, b / sum, c / sum};
    const LaneVec<Real> apart = from[0] - weight.y * ab - weight.z * ac;
    return {select(is_above, weight, border.weight), select(is_above, apart, border.apart)};
}

template <PairKind kind, class Real>
HAPTIC_LANES void find_nearest_at(const FeatureRows& pairs, std::size_t at, const Row* position,
                                  const NearestRows& nearest) noexcept {
    const Real zero = broadcast<Real>(0.0);
    const Real one = broadcast<Real>(1.0);
    const FeatureLanes<Real> of = load_features<Real>(pairs, at, position);
    LaneVec<Real> apart{};
    Real weight[4];
    if constexpr (kind == PairKind::VertexTriangle) {
        const NearestOnTriangle<Real> point = nearest_on_triangle(of);
        apart = point.apart;
        weight[0] = one;
        weight[1] = zero - point.weight.x;
        weight[2] = zero - point.weight.y;
        weight[3] = zero - point.weight.z;
    } else {
        // Of the lines, then of the edges: clamp one, find the other for it, and clamp and find again.
        const LaneVec<Real> e = of.x[1] - of.x[0];
        const LaneVec<Real> f = of.x[3] - of.x[2];
        const LaneVec<Real> between = of.x[0] - of.x[2];
        const Real ee = dot(e, e);
        const Real ff = dot(f, f);
        const Real ef = dot(e, f);
        const LaneVec<Real> across = cross(e, f);
        const Real determinant = dot(across, across);
        const auto meet = determinant > broadcast<Real>(kParallelEdges * kParallelEdges) * ee * ff;
        const Real on_line = (ef * dot(f, between) - ff * dot(e, between)) / determinant;
        Real s = select(meet, min_of(max_of(on_line, zero), one), broadcast<Real>(0.5));
        const Real t = nearest_part(between + s * e, f);
        s = nearest_part(t * f - between, e);
        apart = between + s * e - t * f;
        weight[0] = one - s;
        weight[1] = s;
        weight[2] = t - one;
        weight[3] = zero - t;
    }
    const Real distance = square_root(dot(apart, apart));
    const LaneVec<Real> direction = apart / distance;  // not a number if they touch: not selected
    const LaneVec<Real> normal = select(distance > 0.0, direction, LaneVec<Real>{zero, zero, zero});
    for (std::size_t k = 0; k < 4; ++k) {
        store(weight[k], nearest.weight[k] + at);
    }
    store(distance, nearest.distance + at);
    store(normal.x, pairs.normal[0] + at);
    store(normal.y, pairs.normal[1] + at);
    store(normal.z, pairs.normal[2] + at);
    store(gap_along<kind>(normal, of), pairs.gap + at);
}

/// Calls find<kind, Real>(k) for whole vectors of pairs, then find<kind, double>(k) for those that are left.
template <PairKind kind, class Real, class Find>
HAPTIC_LANES void find_all_of(std::size_t count, const Find& find) noexcept {
    std::size_t k = 0;
    for (; k + kLanes<Real> <= count; k += kLanes<Real>) {
        find.template operator()<kind, Real>(k);
    }
    for (; k < count; ++k) {
        find.template operator()<kind, double>(k);
    }
}

template <class Real, class Find>
HAPTIC_LANES void find_all(PairKind kind, std::size_t count, const Find& find) noexcept {
    if (kind == PairKind::VertexTriangle) {
        find_all_of<PairKind::VertexTriangle, Real>(count, find);
    } else {
        find_all_of<PairKind::EdgeEdge, Real>(count, find);
    }
}

template <class Real>
void find_normals(PairKind kind, const FeatureRows& pairs, std::size_t count, const Row* position) noexcept {
    find_all<Real>(kind, count, [&]<PairKind of, class Some>(std::size_t at) __attribute__((always_inline)) {
        find_normals_at<of, Some>(pairs, at, position);
    });
}

template <class Real>
void find_gaps(PairKind kind, const FeatureRows& pairs, std::size_t count, const Row* position) noexcept {
    find_all<Real>(kind, count, [&]<PairKind of, class Some>(std::size_t at) __attribute__((always_inline)) {
        find_gaps_at<of, Some>(pairs, at, position);
    });
}

template <class Real>
void find_nearest(PairKind kind, const FeatureRows& pairs, std::size_t count, const Row* position,
                  const NearestRows& nearest) noexcept {
    find_all<Real>(kind, count, [&]<PairKind of, class Some>(std::size_t at) __attribute__((always_inline)) {
        find_nearest_at<of, Some>(pairs, at, position, nearest);
    });
}

template <std::size_t Count>
inline constexpr FeatureKernels kFeatureKernels{Count, find_normals<typename LaneTypes<Count>::Real>,
                                                find_gaps<typename LaneTypes<Count>::Real>,
                                                find_nearest<typename LaneTypes<Count>::Real>};

}  // namespace haptic::sim
