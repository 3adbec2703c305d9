#include "collision/surface_paths.hpp"

#include <algorithm>
#include <glm/geometric.hpp>
#include <limits>
#include <utility>

#include "dynamics/rows.hpp"

namespace haptic::sim {

double mean_edge_of(const SolidSurface& surface, std::span<const Vec3> vertices) {
    double sum = 0.0;
    for (const Triangle& t : surface.triangles) {
        for (std::size_t k = 0; k < 3; ++k) {
            sum += glm::length(vertices[surface.first_vertex + t[k]] - vertices[surface.first_vertex + t[(k + 1) % 3]]);
        }
    }
    return sum / (3.0 * static_cast<double>(surface.triangles.size()));
}

namespace {

// Of the mean edge of the finest surface: the gap that is guaranteed, far above rounding and far below what is seen or
// felt.
constexpr double kLeastGapOfEdge = 1.0 / 2048.0;

/// m, the least mean edge of surfaces that may meet something and are not exact; 0: there are none.
double finest_of(std::span<const SolidSurface> surfaces, std::span<const Vec3> vertices) {
    double finest = std::numeric_limits<double>::max();
    for (const SolidSurface& surface : surfaces) {
        if ((surface.meets_others || surface.meets_itself) && !surface.triangles.empty() && !surface.exact) {
            finest = std::min(finest, mean_edge_of(surface, vertices));
        }
    }
    return finest < std::numeric_limits<double>::max() ? finest : 0.0;
}

}  // namespace

SurfacePaths::SurfacePaths(std::vector<SolidSurface> all, std::span<const Vec3> vertices)
    : surfaces(std::move(all)),
      finest_edge(finest_of(surfaces, vertices)),
      least_gap(kLeastGapOfEdge * finest_edge),
      surface_of(vertices.size(), 0),
      yields(surfaces.size(), 0),
      motion_of(surfaces.size(), kFollows),
      takes_part(surfaces.size(), 0),
      start(vertices.size()),
      end(vertices.size()),
      is_moved(vertices.size(), 0),
      moved_in(vertices.size(), 0),
      asked(vertices.size()),
      searched(vertices.size()),
      own_searched(vertices.size()),
      parent(vertices.size(), kFree) {
    for (std::uint32_t s = 0; s < surfaces.size(); ++s) {
        const SolidSurface& surface = surfaces[s];
        std::fill_n(surface_of.begin() + static_cast<std::ptrdiff_t>(surface.first_vertex), surface.vertices, s);
        yields[s] = surface.movable ? 1 : 0;
    }
    moved.reserve(vertices.size());
}

void SurfacePaths::begin_attempt() noexcept {
    std::ranges::fill(takes_part, std::uint8_t{0});
    for (const std::uint32_t v : moved) {
        is_moved[v] = 0;
    }
    moved.clear();
}

void SurfacePaths::take_part(std::uint32_t surface, std::span<const Vec3> from, std::span<const Vec3> to) noexcept {
    if (std::exchange(takes_part[surface], std::uint8_t{1}) != 0) {
        return;
    }
    const SolidSurface& of = surfaces[surface];
    for (std::size_t v = of.first_vertex; v < of.first_vertex + of.vertices; ++v) {
        start[v] = row_of(from[v]);
        end[v] = row_of(to[v]);
    }
}

void SurfacePaths::note_move(std::uint32_t vertex) {
    if (std::exchange(is_moved[vertex], std::uint8_t{1}) == 0) {
        moved.push_back(vertex);
        asked[vertex] = searched[vertex] = own_searched[vertex] = end[vertex];
    }
}

void SurfacePaths::move_end(std::uint32_t vertex, const Vec3& to) noexcept {
    if (vector_of(end[vertex]) != to) {
        set_vector(end[vertex], to);
        moved_in[vertex] = round;
    }
}

bool SurfacePaths::can_move(std::uint32_t vertex) const noexcept {
    const std::uint32_t surface = surface_of[vertex];
    return yields[surface] != 0 && motion_of[surface] == kFollows;
}

bool SurfacePaths::goes_as_asked(std::uint32_t vertex) const noexcept {
    const std::uint32_t surface = surface_of[vertex];
    return motion_of[surface] != kFollows || (surfaces[surface].movable && yields[surface] == 0);
}

bool SurfacePaths::is_of_one_patch(const PairVertices& vertex) const noexcept {
    return parent[vertex[0]] != kFree &&
           std::ranges::all_of(vertex, [&](std::uint32_t v) { return parent[v] == parent[vertex[0]]; });
}

}  // namespace haptic::sim
