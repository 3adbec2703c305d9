#include "view/sample_history.hpp"

#include <algorithm>

namespace haptic::sim::view {

void SampleHistory::add(const NumberedSample& sample) {
    if (ring_.size() < kCapacity) {
        ring_.push_back(sample);
    } else {
        ring_[begin_] = sample;
        begin_ = (begin_ + 1) % kCapacity;
    }
    end_ = sample.number + 1;
}

void SampleHistory::clear() noexcept {
    ring_.clear();
    begin_ = 0;
}

SampleHistory::Run SampleHistory::from(std::uint64_t number, std::size_t max_count) const {
    const auto at = [&](std::size_t k) -> const NumberedSample& { return ring_[(begin_ + k) % ring_.size()]; };
    std::size_t first = 0;  // binary search: numbers increase
    for (std::size_t last = ring_.size(); first < last;) {
        const std::size_t middle = first + (last - first) / 2;
        if (at(middle).number < number) {
            first = middle + 1;
        } else {
            last = middle;
        }
    }
    // Copy samples up to the first gap.
    Run run;
    for (std::size_t k = first; k < ring_.size() && run.samples.size() < max_count; ++k) {
        if (run.samples.empty()) {
            run.number = at(k).number;
        } else if (at(k).number != run.number + run.samples.size()) {
            break;
        }
        run.samples.push_back(at(k).sample);
    }
    return run;
}

}  // namespace haptic::sim::view
