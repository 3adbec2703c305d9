// Distances within a body, along the ways of its sample graph (Dijkstra 1959).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "model/sample_graph.hpp"

namespace haptic::sim {

/// A source and how far it is.
struct Source {
    double distance = 0.0;  // m, along ways
    std::uint32_t index = 0;
};

/// Order by distance; of two equally far the one with the lower index comes first.
[[nodiscard]] bool nearer(const Source& a, const Source& b) noexcept;

/// Where a particle is, and a piece there.
struct Site {
    Vec3 position{0.0};  // m
    std::uint32_t piece = 0;
};

/// For each piece up to `count` nearest sites, nearest first; of two equally far the one with the lower index.
[[nodiscard]] std::vector<std::vector<Source>> nearest_sources(const SampleGraph& graph, std::span<const Site> sites,
                                                               std::size_t count);

/// As many sites as asked for, evenly spread: each is the piece farthest from those before it (Gonzalez 1985), the
/// first the one farthest from the pieces' mean.
[[nodiscard]] std::vector<Site> spread_evenly(const SampleGraph& graph, std::size_t count);

/// Moves each site to the centroid of what is nearest to it, over and over (Lloyd 1982). In the end the piece nearest
/// to a site, whatever lies between, is one that no other site is nearer to.
void relax(const SampleGraph& graph, std::vector<Site>& sites, int iterations);

/// Sites for places, each with the piece nearest to it.
[[nodiscard]] std::vector<Site> sites_at(const SampleGraph& graph, std::span<const Vec3> places);

}  // namespace haptic::sim
