// Distances within a body, along the edges of its sample graph (E. W. Dijkstra, 1959).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "haptic/sim/progress.hpp"
#include "model/sample_graph.hpp"

namespace haptic::sim {

/// A source (site) and its distance.
struct Source {
    double distance = 0.0;  // m, along edges
    std::uint32_t index = 0;
};

/// Orders by distance, then by index.
[[nodiscard]] bool nearer(const Source& a, const Source& b) noexcept;

/// Position of a particle, and the sample it belongs to.
struct Site {
    Vec3 position{0.0};  // m
    std::uint32_t sample = 0;
};

/// Up to `count` nearest sites of each sample, in the order of nearer().
[[nodiscard]] std::vector<std::vector<Source>> nearest_sources(const SampleGraph& graph, std::span<const Site> sites,
                                                               std::size_t count, const Progress& progress = {});

/// Chooses `count` evenly spread sites by farthest-point sampling (T. F. Gonzalez, 1985). The first is the sample
/// farthest from the samples' mean.
[[nodiscard]] std::vector<Site> spread_evenly(const SampleGraph& graph, std::size_t count,
                                              const Progress& progress = {});

/// Moves each site repeatedly to the centroid of the samples nearest to it (S. P. Lloyd, 1982). Afterwards the sample
/// at the smallest straight distance from a site belongs to that site.
void relax(const SampleGraph& graph, std::vector<Site>& sites, int iterations, const Progress& progress = {});

/// Sites at given positions, each with the sample nearest to it.
[[nodiscard]] std::vector<Site> sites_at(const SampleGraph& graph, std::span<const Vec3> positions);

}  // namespace haptic::sim
