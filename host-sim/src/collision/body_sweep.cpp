#include "collision/body_sweep.hpp"

#include <algorithm>
#include <numeric>
#include <utility>

namespace haptic::sim {

BodySweep::BodySweep(std::size_t bodies) : order_(bodies) {
    std::iota(order_.begin(), order_.end(), 0U);
}

void BodySweep::find(std::span<const Bounds> box, std::vector<BodyPair>& near) {
    near.clear();
    const std::size_t axis = widest_axis(box.size(), [&](std::size_t b, std::size_t k) { return box[b].low[k]; });
    // Insertion: little to do while the boxes keep their order.
    for (std::size_t k = 1; k < order_.size(); ++k) {
        for (std::size_t l = k; l > 0 && box[order_[l]].low[axis] < box[order_[l - 1]].low[axis]; --l) {
            std::swap(order_[l], order_[l - 1]);
        }
    }
    // Sweep: each with those that begin before it ends.
    for (std::size_t k = 0; k < order_.size(); ++k) {
        const Bounds& first = box[order_[k]];
        for (std::size_t l = k + 1; l < order_.size() && box[order_[l]].low[axis] <= first.high[axis]; ++l) {
            if (overlap(first, box[order_[l]])) {
                const auto [low, high] = std::minmax({order_[k], order_[l]});
                near.push_back({low, high});
            }
        }
    }
    // Results must not depend on how the bodies lay before.
    std::ranges::sort(near, {}, [](const BodyPair& p) { return std::pair(p.first, p.second); });
}

}  // namespace haptic::sim
