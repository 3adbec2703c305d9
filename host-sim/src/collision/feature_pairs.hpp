// Pairs of features in arrays, and the proof that a pair stays apart on its way.
//
// A fixed direction along which the gap is positive at both ends of straight paths proves it, because the gap is the
// least of linear functions of time. Where no such direction is found, conservative advancement (Mirtich 1996), from
// one direction to the next, tells how much of the way is safe.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "collision/feature_distance.hpp"
#include "haptic/types.hpp"
#include "simd/features.hpp"
#include "simd/projection.hpp"

namespace haptic::sim {

/// Those of the first feature before those of the second.
using PairVertices = std::array<std::uint32_t, 4>;

[[nodiscard]] FeatureVertices positions_of(const PairVertices& vertex, const Row* position) noexcept;
[[nodiscard]] Vec3 weighted(const std::array<double, 4>& weight, const PairVertices& vertex,
                            const Row* position) noexcept;
/// m, along a unit vector toward the first feature.
[[nodiscard]] double gap_of(PairKind kind, const Vec3& normal, const FeatureVertices& x) noexcept;

/// Drops those of some numbers for whose index is_dropped(index) holds; the others keep their order.
template <class Numbers, class IsDropped>
void keep_others(Numbers& numbers, const IsDropped& is_dropped) {
    std::size_t left = 0;
    for (std::size_t k = 0; k < numbers.size(); ++k) {
        if (!is_dropped(k)) {
            numbers[left++] = numbers[k];
        }
    }
    numbers.resize(left);
}

/// Pairs of one kind.
struct FeaturePairs {
    explicit FeaturePairs(PairKind of) : kind(of) {}
    PairKind kind;
    std::array<std::vector<std::uint32_t>, 4> vertex{};
    std::array<std::vector<double>, 3> normal{};
    std::vector<double> gap{};            // m, at the start of the way
    std::vector<double> end_gap{};        // m, at its end
    std::vector<std::uint32_t> origin{};  // in the list from which they were appended

    [[nodiscard]] std::size_t size() const noexcept { return gap.size(); }
    /// For the kernels, which write gaps into `gaps`.
    [[nodiscard]] FeatureRows rows(std::vector<double>& gaps) noexcept;
    void reserve(std::size_t size);
    /// Without normals and gaps.
    void assign(PairKind of, const std::array<std::span<const std::uint32_t>, 4>& vertices);
    /// Without the gap at the end.
    void append(const FeaturePairs& from, std::size_t at);
    void clear() noexcept;
    /// Drops those for which is_dropped(index) holds; the others keep their order.
    template <class IsDropped>
    void drop(const IsDropped& is_dropped);
    [[nodiscard]] PairVertices vertices(std::size_t at) const noexcept;
    [[nodiscard]] FeatureVertices positions(std::size_t at, const Row* position) const noexcept;
    [[nodiscard]] Vec3 normal_of(std::size_t at) const noexcept;
    [[nodiscard]] double gap_along(std::size_t at, const Row* position) const noexcept;
    void set_normal(std::size_t at, const Vec3& n) noexcept;

    /// 1 if the pair stays apart on its way, and at least `least` at its end, m, else a part of the way on which it
    /// does. `first`: its nearest points at the start. What is nearer there may not come nearer. Leaves the better
    /// normal, and its gap.
    [[nodiscard]] double safe_part(std::size_t at, const NearestPoints& first, const Row* start, const Row* end,
                                   double least) noexcept;
};

template <class IsDropped>
void FeaturePairs::drop(const IsDropped& is_dropped) {
    for (auto& of : vertex) {
        keep_others(of, is_dropped);
    }
    for (auto& of : normal) {
        keep_others(of, is_dropped);
    }
    for (auto* of : {&gap, &end_gap}) {
        keep_others(*of, is_dropped);
    }
    keep_others(origin, is_dropped);
}

/// Nearest points of pairs.
struct NearestOfPairs {
    std::array<std::vector<double>, 4> weight{};
    std::vector<double> distance{};  // m
    void resize(std::size_t size);
    [[nodiscard]] NearestRows rows() noexcept;
};

/// Pairs that two directions did not prove apart.
struct DoubtfulPairs {
    FeaturePairs some{PairKind::VertexTriangle};  // all, along normals that are quick to find
    FeaturePairs pairs{
        PairKind::VertexTriangle};  // those in doubt, along the normals of the points nearest at the start
    NearestOfPairs nearest;         // of these

    void reserve(std::size_t size);
    /// Leaves in `pairs` those for which may_close(pairs, index) holds with the quick normal, with their gaps along
    /// that of the nearest points, with which it may not hold any more.
    template <class MayClose>
    void find(const FeatureKernels& kernels, PairKind kind,
              const std::array<std::span<const std::uint32_t>, 4>& vertices, const Row* start, const Row* end,
              const MayClose& may_close) {
        // Along the quick normals most stay apart.
        some.assign(kind, vertices);
        kernels.find_normals(kind, some.rows(some.gap), some.size(), start);
        kernels.find_gaps(kind, some.rows(some.end_gap), some.size(), end);
        pairs.clear();
        pairs.kind = kind;
        for (std::size_t k = 0; k < some.size(); ++k) {
            if (may_close(some, k)) {
                pairs.append(some, k);
            }
        }
        // The quick normal may be a bad one. That of the nearest points costs more.
        pairs.end_gap.resize(pairs.size());
        nearest.resize(pairs.size());
        kernels.find_nearest(kind, pairs.rows(pairs.gap), pairs.size(), start, nearest.rows());
        kernels.find_gaps(kind, pairs.rows(pairs.end_gap), pairs.size(), end);
    }
};

}  // namespace haptic::sim
