// Feature kernels of features.hpp for any number of lanes. Only the source file compiled for registers of that width
// may instantiate them (see lanes.hpp).
#pragma once

#include "simd/collider_lanes.hpp"
#include "simd/features.hpp"
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
        const auto coordinate = [&](std::size_t axis) __attribute__((always_inline)) {
            return fill<Real>([&](std::size_t lane)
                                  __attribute__((always_inline)) { return position[vertex[lane]].number[axis]; });
        };
        features.x[k] = {coordinate(0), coordinate(1), coordinate(2)};
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

/// Calls find<Real>(k) for whole vectors of pairs, then find<double>(k) for those that are left.
template <class Real, class Find>
HAPTIC_LANES void find_all(std::size_t count, const Find& find) noexcept {
    std::size_t k = 0;
    for (; k + kLanes<Real> <= count; k += kLanes<Real>) {
        find.template operator()<Real>(k);
    }
    for (; k < count; ++k) {
        find.template operator()<double>(k);
    }
}

template <class Real>
void find_normals(PairKind kind, const FeatureRows& pairs, std::size_t count, const Row* position) noexcept {
    if (kind == PairKind::VertexTriangle) {
        find_all<Real>(count, [&]<class Some>(std::size_t at) __attribute__((always_inline)) {
            find_normals_at<PairKind::VertexTriangle, Some>(pairs, at, position);
        });
    } else {
        find_all<Real>(count, [&]<class Some>(std::size_t at) __attribute__((always_inline)) {
            find_normals_at<PairKind::EdgeEdge, Some>(pairs, at, position);
        });
    }
}

template <class Real>
void find_gaps(PairKind kind, const FeatureRows& pairs, std::size_t count, const Row* position) noexcept {
    if (kind == PairKind::VertexTriangle) {
        find_all<Real>(count, [&]<class Some>(std::size_t at) __attribute__((always_inline)) {
            find_gaps_at<PairKind::VertexTriangle, Some>(pairs, at, position);
        });
    } else {
        find_all<Real>(count, [&]<class Some>(std::size_t at) __attribute__((always_inline)) {
            find_gaps_at<PairKind::EdgeEdge, Some>(pairs, at, position);
        });
    }
}

template <std::size_t Count>
inline constexpr FeatureKernels kFeatureKernels{Count, find_normals<typename LaneTypes<Count>::Real>,
                                                find_gaps<typename LaneTypes<Count>::Real>};

}  // namespace haptic::sim
