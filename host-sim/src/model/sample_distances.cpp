#include "model/sample_distances.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <glm/geometric.hpp>
#include <limits>
#include <queue>
#include <tuple>
#include <utility>

namespace haptic::sim {
namespace {

constexpr std::size_t kReported = 10'000;  // extended samples from one report of progress to the next
constexpr double kInfinity = std::numeric_limits<double>::infinity();

using QueueEntry = std::tuple<double, std::uint32_t, std::uint32_t>;  // distance, source, sample
using Entry = std::pair<double, std::uint32_t>;                       // distance, sample
using Frontier = std::priority_queue<QueueEntry, std::vector<QueueEntry>, std::greater<>>;

std::uint32_t farthest_from_mean(const SampleGraph& graph) {
    Vec3 mean(0.0);
    for (const Vec3& p : graph.position) {
        mean += p / static_cast<double>(graph.size());
    }
    std::uint32_t farthest = 0;
    for (std::uint32_t i = 1; i < graph.size(); ++i) {
        if (glm::length(graph.position[i] - mean) > glm::length(graph.position[farthest] - mean)) {
            farthest = i;
        }
    }
    return farthest;
}

/// The centroid of each cell, with the sample of the cell nearest to it.
std::vector<Site> centroids(const SampleGraph& graph, const std::vector<std::vector<Source>>& nearest,
                            std::size_t cells) {
    std::vector<Site> centroid(cells);
    std::vector<double> share(cells, 0.0);
    for (std::size_t i = 0; i < graph.size(); ++i) {
        const std::uint32_t cell = nearest[i].front().index;
        centroid[cell].position += graph.share[i] * graph.position[i];
        share[cell] += graph.share[i];
    }
    for (std::size_t c = 0; c < cells; ++c) {
        centroid[c].position /= share[c];
    }
    std::vector<double> min_distance(cells, kInfinity);
    for (std::uint32_t i = 0; i < graph.size(); ++i) {
        const std::uint32_t cell = nearest[i].front().index;
        const double distance = glm::length(graph.position[i] - centroid[cell].position);
        if (distance < min_distance[cell]) {
            min_distance[cell] = distance;
            centroid[cell].sample = i;
        }
    }
    return centroid;
}

}  // namespace

bool nearer(const Source& a, const Source& b) noexcept {
    return a.distance < b.distance || (a.distance == b.distance && a.index < b.index);
}

std::vector<std::vector<Source>> nearest_sources(const SampleGraph& graph, std::span<const Site> sites,
                                                 std::size_t count, const Progress& progress) {
    std::vector<std::vector<Source>> found(graph.size());  // per sample, sorted by nearer()
    Frontier frontier;
    // Inserts a source into the list of a sample if it is among the `count` nearest so far.
    const auto insert_if_nearer = [&](std::uint32_t sample, const Source& source) {
        std::vector<Source>& known = found[sample];
        const auto same =
            std::find_if(known.begin(), known.end(), [&](const Source& s) { return s.index == source.index; });
        if (same != known.end() ? !nearer(source, *same) : known.size() == count && !nearer(source, known.back())) {
            return;
        }
        if (same != known.end()) {
            known.erase(same);
        } else if (known.size() == count) {
            known.pop_back();
        }
        known.insert(std::upper_bound(known.begin(), known.end(), source, nearer), source);
        frontier.emplace(source.distance, source.index, sample);
    };
    // A site reaches its own sample and the samples next to it along straight lines.
    for (std::uint32_t s = 0; s < sites.size(); ++s) {
        const auto seed = [&](std::uint32_t sample) {
            insert_if_nearer(sample, {glm::length(graph.position[sample] - sites[s].position), s});
        };
        seed(sites[s].sample);
        for (const Edge& edge : graph.edges_from(sites[s].sample)) {
            seed(edge.to);
        }
    }
    // Dijkstra with several sources: extend the nearest entry, unless a shorter one has replaced it. Each sample is
    // extended from at most `count` sources.
    const auto entries = static_cast<double>(graph.size() * count);
    std::size_t extended = 0;
    while (!frontier.empty()) {
        const auto [distance, source, sample] = frontier.top();
        frontier.pop();
        const bool replaced =
            std::none_of(found[sample].begin(), found[sample].end(),
                         [&, d = distance, i = source](const Source& s) { return s.index == i && s.distance == d; });
        if (replaced) {
            continue;
        }
        if (++extended % kReported == 0) {
            report(progress, static_cast<double>(extended) / entries);
        }
        for (const Edge& edge : graph.edges_from(sample)) {
            insert_if_nearer(edge.to, {distance + edge.length, source});
        }
    }
    return found;
}

std::vector<Site> spread_evenly(const SampleGraph& graph, std::size_t count, const Progress& progress) {
    std::vector<Site> chosen;
    std::vector<double> distance(graph.size(), kInfinity);
    // Samples by their distance to the nearest site, the farthest first, then the first. Distances only shrink, so an
    // entry is an upper bound; one that is not exact is put back with its present distance.
    const auto nearer_or_later = [](const Entry& a, const Entry& b) {
        return a.first < b.first || (a.first == b.first && a.second > b.second);
    };
    std::vector<Entry> farthest;
    farthest.reserve(graph.size());
    for (std::uint32_t i = 0; i < graph.size(); ++i) {
        farthest.emplace_back(kInfinity, i);
    }
    std::make_heap(farthest.begin(), farthest.end(), nearer_or_later);
    const auto find_farthest = [&] {
        while (farthest.front().first != distance[farthest.front().second]) {
            std::pop_heap(farthest.begin(), farthest.end(), nearer_or_later);
            farthest.back().first = distance[farthest.back().second];
            std::push_heap(farthest.begin(), farthest.end(), nearer_or_later);
        }
        return farthest.front().second;
    };
    std::uint32_t next = farthest_from_mean(graph);
    // Each new site updates the distance to the nearest site; the sample with the largest distance is next.
    while (chosen.size() < count) {
        chosen.push_back({graph.position[next], next});
        report(progress, static_cast<double>(chosen.size()) / static_cast<double>(count));
        std::priority_queue<Entry, std::vector<Entry>, std::greater<>> frontier;
        distance[next] = 0.0;
        frontier.emplace(0.0, next);
        while (!frontier.empty()) {
            const auto [reached, sample] = frontier.top();
            frontier.pop();
            if (reached > distance[sample]) {
                continue;
            }
            for (const Edge& edge : graph.edges_from(sample)) {
                if (reached + edge.length < distance[edge.to]) {
                    distance[edge.to] = reached + edge.length;
                    frontier.emplace(distance[edge.to], edge.to);
                }
            }
        }
        next = find_farthest();
    }
    return chosen;
}

void relax(const SampleGraph& graph, std::vector<Site>& sites, int iterations, const Progress& progress) {
    for (int k = 0; k < iterations; ++k) {
        report(progress, static_cast<double>(k) / static_cast<double>(iterations + 1));
        sites = centroids(graph, nearest_sources(graph, sites, 1), sites.size());
    }
    // In a bent body a centroid may lie outside, next to samples of another site. Such a site returns to its own
    // sample.
    const std::vector<std::vector<Source>> nearest = nearest_sources(graph, sites, 1);
    std::vector<Vec3> positions;
    positions.reserve(sites.size());
    for (const Site& site : sites) {
        positions.push_back(site.position);
    }
    const std::vector<Site> found = sites_at(graph, positions);
    for (std::uint32_t s = 0; s < sites.size(); ++s) {
        if (nearest[found[s].sample].front().index == s) {
            sites[s].sample = found[s].sample;
        } else {
            sites[s].position = graph.position[sites[s].sample];
        }
    }
}

std::vector<Site> sites_at(const SampleGraph& graph, std::span<const Vec3> positions) {
    // Search the samples sorted by x in both directions, until the distance in x alone exceeds the smallest distance.
    std::vector<std::pair<double, std::uint32_t>> samples_by_x;
    samples_by_x.reserve(graph.size());
    for (std::uint32_t i = 0; i < graph.size(); ++i) {
        samples_by_x.emplace_back(graph.position[i].x, i);
    }
    std::sort(samples_by_x.begin(), samples_by_x.end());
    std::vector<Site> sites;
    for (const Vec3& position : positions) {
        std::pair<double, std::uint32_t> nearest{kInfinity, 0};
        const auto consider = [&](const std::pair<double, std::uint32_t>& sample) {
            if (std::abs(sample.first - position.x) > nearest.first) {
                return false;
            }
            nearest = std::min(nearest, {glm::length(graph.position[sample.second] - position), sample.second});
            return true;
        };
        const auto start =
            std::lower_bound(samples_by_x.begin(), samples_by_x.end(), std::pair{position.x, std::uint32_t{0}});
        for (auto next = start; next != samples_by_x.end() && consider(*next); ++next) {
        }
        for (auto next = start; next != samples_by_x.begin() && consider(*(next - 1)); --next) {
        }
        sites.push_back({position, nearest.second});
    }
    return sites;
}

}  // namespace haptic::sim
