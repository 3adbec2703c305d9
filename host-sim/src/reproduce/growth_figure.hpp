// Part of figure "scaling": whole scenes that grow, as data, plots, and a verdict.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "reproduce/study.hpp"

namespace haptic::sim::reproduce {

/// Sizes that are measured, ascending.
struct GrowthSizes {
    std::vector<std::size_t> heaps{1, 3, 10, 30, 100, 160};    // of four fish
    std::vector<std::uint32_t> cloths{33, 65, 129, 255, 317};  // vertices per side
};

/// Measures heaps of fish and cloths, and adds data, plots and comparisons to the figure. The last comparison of each
/// scene names every cost that grows faster than n log n.
void add_scene_growth(const Study& study, Figure& figure, const GrowthSizes& sizes);

}  // namespace haptic::sim::reproduce
