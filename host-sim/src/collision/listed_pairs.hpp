// Lists of near pairs of features, with what is known of each pair over a step.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "collision/feature_pairs.hpp"
#include "simd/projection.hpp"

namespace haptic::sim {

/// Near pairs of features, with what is known of each. FeaturePairs::origin is, of pairs of one surface, the block in
/// whose surroundings they lie.
struct ListedPairs : FeaturePairs {
    using FeaturePairs::FeaturePairs;
    /// `proved`: the round in which they were last proved apart all the way; 0: none.
    struct Known {
        NearestPoints first{.distance = -1.0};  // at the start, once they were asked for
        std::uint64_t proved = 0;
    };
    std::vector<Known> known;

    void make_room(std::size_t size);
    void forget_all() noexcept;
    /// With the gap at the end.
    void add(const FeaturePairs& from, std::size_t at);
    template <class IsDropped>
    void leave_out(const IsDropped& is_dropped);
    [[nodiscard]] const NearestPoints& nearest_at_start(std::size_t at, const Row* start) noexcept;
};

/// A listed pair that is not proved apart. Valid until pairs are searched again.
struct UnsafePair {
    ListedPairs* list = nullptr;
    std::size_t at = 0;
    [[nodiscard]] PairVertices vertices() const noexcept { return list->vertices(at); }
};

template <class IsDropped>
void ListedPairs::leave_out(const IsDropped& is_dropped) {
    drop(is_dropped);
    keep_others(known, is_dropped);
}

}  // namespace haptic::sim
