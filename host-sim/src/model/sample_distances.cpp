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

constexpr double kFar = std::numeric_limits<double>::infinity();

using Reached = std::tuple<double, std::uint32_t, std::uint32_t>;  // distance, source, piece
using Frontier = std::priority_queue<Reached, std::vector<Reached>, std::greater<>>;

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

/// For each cell its centroid, with the piece of the cell that is nearest to it.
std::vector<Site> middles(const SampleGraph& graph, const std::vector<std::vector<Source>>& nearest,
                          std::size_t cells) {
    std::vector<Site> middle(cells);
    std::vector<double> share(cells, 0.0);
    for (std::size_t i = 0; i < graph.size(); ++i) {
        const std::uint32_t cell = nearest[i].front().index;
        middle[cell].position += graph.share[i] * graph.position[i];
        share[cell] += graph.share[i];
    }
    for (std::size_t c = 0; c < cells; ++c) {
        middle[c].position /= share[c];
    }
    std::vector<double> least(cells, kFar);
    for (std::uint32_t i = 0; i < graph.size(); ++i) {
        const std::uint32_t cell = nearest[i].front().index;
        const double distance = glm::length(graph.position[i] - middle[cell].position);
        if (distance < least[cell]) {
            least[cell] = distance;
            middle[cell].piece = i;
        }
    }
    return middle;
}

}  // namespace

bool nearer(const Source& a, const Source& b) noexcept {
    return a.distance < b.distance || (a.distance == b.distance && a.index < b.index);
}

std::vector<std::vector<Source>> nearest_sources(const SampleGraph& graph, std::span<const Site> sites,
                                                 std::size_t count) {
    std::vector<std::vector<Source>> found(graph.size());  // sorted; the final ones come first
    Frontier frontier;
    const auto offer = [&](std::uint32_t piece, const Source& source) {
        std::vector<Source>& known = found[piece];
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
        frontier.emplace(source.distance, source.index, piece);
    };
    // From its place a site reaches the next pieces straight.
    for (std::uint32_t s = 0; s < sites.size(); ++s) {
        const auto reach = [&](std::uint32_t piece) {
            offer(piece, {glm::length(graph.position[piece] - sites[s].position), s});
        };
        reach(sites[s].piece);
        for (const Way& way : graph.ways_from(sites[s].piece)) {
            reach(way.to);
        }
    }
    while (!frontier.empty()) {
        const auto [distance, source, piece] = frontier.top();
        frontier.pop();
        const bool outdone =
            std::none_of(found[piece].begin(), found[piece].end(),
                         [&, d = distance, i = source](const Source& s) { return s.index == i && s.distance == d; });
        if (outdone) {
            continue;
        }
        for (const Way& way : graph.ways_from(piece)) {
            offer(way.to, {distance + way.length, source});
        }
    }
    return found;
}

std::vector<Site> spread_evenly(const SampleGraph& graph, std::size_t count) {
    std::vector<Site> chosen;
    std::vector<double> distance(graph.size(), kFar);
    std::uint32_t next = farthest_from_mean(graph);
    while (chosen.size() < count) {
        chosen.push_back({graph.position[next], next});
        std::priority_queue<std::pair<double, std::uint32_t>, std::vector<std::pair<double, std::uint32_t>>,
                            std::greater<>>
            frontier;
        distance[next] = 0.0;
        frontier.emplace(0.0, next);
        while (!frontier.empty()) {
            const auto [reached, piece] = frontier.top();
            frontier.pop();
            if (reached > distance[piece]) {
                continue;
            }
            for (const Way& way : graph.ways_from(piece)) {
                if (reached + way.length < distance[way.to]) {
                    distance[way.to] = reached + way.length;
                    frontier.emplace(distance[way.to], way.to);
                }
            }
        }
        next = static_cast<std::uint32_t>(std::max_element(distance.begin(), distance.end()) - distance.begin());
    }
    return chosen;
}

void relax(const SampleGraph& graph, std::vector<Site>& sites, int iterations) {
    for (int k = 0; k < iterations; ++k) {
        sites = middles(graph, nearest_sources(graph, sites, 1), sites.size());
    }
    // Where the body is bent, a centroid may lie outside it and next to what is another's: back into the body then.
    const std::vector<std::vector<Source>> nearest = nearest_sources(graph, sites, 1);
    std::vector<Vec3> places;
    places.reserve(sites.size());
    for (const Site& site : sites) {
        places.push_back(site.position);
    }
    const std::vector<Site> found = sites_at(graph, places);
    for (std::uint32_t s = 0; s < sites.size(); ++s) {
        if (nearest[found[s].piece].front().index == s) {
            sites[s].piece = found[s].piece;
        } else {
            sites[s].position = graph.position[sites[s].piece];
        }
    }
}

std::vector<Site> sites_at(const SampleGraph& graph, std::span<const Vec3> places) {
    // Along x both ways from the place, until the next piece is farther in x alone than the nearest is.
    std::vector<std::pair<double, std::uint32_t>> along;
    along.reserve(graph.size());
    for (std::uint32_t i = 0; i < graph.size(); ++i) {
        along.emplace_back(graph.position[i].x, i);
    }
    std::sort(along.begin(), along.end());
    std::vector<Site> sites;
    for (const Vec3& place : places) {
        std::pair<double, std::uint32_t> nearest{kFar, 0};
        const auto consider = [&](const std::pair<double, std::uint32_t>& piece) {
            if (std::abs(piece.first - place.x) > nearest.first) {
                return false;
            }
            nearest = std::min(nearest, {glm::length(graph.position[piece.second] - place), piece.second});
            return true;
        };
        const auto start = std::lower_bound(along.begin(), along.end(), std::pair{place.x, std::uint32_t{0}});
        for (auto next = start; next != along.end() && consider(*next); ++next) {
        }
        for (auto next = start; next != along.begin() && consider(*(next - 1)); --next) {
        }
        sites.push_back({place, nearest.second});
    }
    return sites;
}

}  // namespace haptic::sim
