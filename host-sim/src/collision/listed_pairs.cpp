#include "collision/listed_pairs.hpp"

namespace haptic::sim {

void ListedPairs::make_room(std::size_t size) {
    reserve(size);
    known.reserve(size);
}

void ListedPairs::forget_all() noexcept {
    clear();
    known.clear();
}

void ListedPairs::add(const FeaturePairs& from, std::size_t at) {
    append(from, at);
    end_gap.push_back(from.end_gap[at]);
    known.emplace_back();
}

const NearestPoints& ListedPairs::nearest_at_start(std::size_t at, const Row* start) noexcept {
    NearestPoints& first = known[at].first;
    if (first.distance < 0.0) {
        first = nearest_points(kind, positions(at, start));
    }
    return first;
}

}  // namespace haptic::sim
