#include "haptic/sim/contact_force.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <stdexcept>
#include <tuple>

namespace haptic::sim {
namespace {

constexpr std::uint32_t kNone = 0xffffffffu;

}  // namespace

PressureMask::PressureMask(const TriangleMesh& rest, const Skin& skin, std::size_t particles, double radius)
    : rest_(rest.vertices), triangles_(rest.triangles), skin_(skin), radius_(radius), slot_(particles, kNone) {
    if (!(radius >= 0.0)) {
        throw std::invalid_argument("pressure mask: radius must not be negative");
    }
    if (skin_.size() != rest_.size()) {
        throw std::invalid_argument("pressure mask: needs one skin element for each vertex");
    }
    for (std::size_t j = 0; j < skin_.size(); ++j) {
        vertices_are_particles_ = vertices_are_particles_ && is_at_particle(skin_[j], j);
    }
    // Uniform grid over the rest shape. Cells have the mask's radius, with a lower limit that keeps cell indices in the
    // range of int32.
    double furthest = 0.0;
    for (const Vec3& p : rest_) {
        furthest = std::max({furthest, std::abs(p.x), std::abs(p.y), std::abs(p.z)});
    }
    cell_size_ = std::max({radius, 1e-6 * furthest, std::numeric_limits<double>::min()});
    // Vertices sorted by cell, so that find_vertices() can search for a cell.
    grid_.reserve(rest_.size());
    for (std::uint32_t j = 0; j < rest_.size(); ++j) {
        grid_.push_back({cell_of(rest_[j]), j});
    }
    std::sort(grid_.begin(), grid_.end(), [](const CellVertex& a, const CellVertex& b) {
        return std::tie(a.cell, a.vertex) < std::tie(b.cell, b.vertex);
    });
    vertices_.reserve(std::max(rest_.size(), std::size_t{3}));
    particles_.reserve(particles);
}

PressureMask::Cell PressureMask::cell_of(const Vec3& rest) const {
    const auto number = [this](double x) { return static_cast<std::int32_t>(std::floor(x / cell_size_)); };
    return {number(rest.x), number(rest.y), number(rest.z)};
}

void PressureMask::find_vertices(const Vec3& centre) {
    // w_j ~ (R^2 - d_j^2)^2 for the vertices in the 3 x 3 x 3 cells around the centre.
    const double radius_squared = radius_ * radius_;
    vertices_.clear();
    const Cell middle = cell_of(centre);
    for (std::int32_t x = middle[0] - 1; x <= middle[0] + 1; ++x) {
        for (std::int32_t y = middle[1] - 1; y <= middle[1] + 1; ++y) {
            // Cells are sorted lexicographically: those that differ only in z are adjacent.
            const Cell first{x, y, middle[2] - 1};
            const Cell last{x, y, middle[2] + 1};
            const auto before = [](const CellVertex& entry, const Cell& cell) { return entry.cell < cell; };
            for (auto at = std::lower_bound(grid_.begin(), grid_.end(), first, before);
                 at != grid_.end() && at->cell <= last; ++at) {
                const Vec3 offset = rest_[at->vertex] - centre;
                const double inside = radius_squared - glm::dot(offset, offset);
                if (inside > 0.0) {
                    vertices_.push_back({at->vertex, inside * inside});
                }
            }
        }
    }
    // Summation order independent of the grid.
    std::sort(vertices_.begin(), vertices_.end(),
              [](const PressedVertex& a, const PressedVertex& b) { return a.index < b.index; });
}

void PressureMask::find_particles() {
    // Clear only the slots that the last call set.
    for (const PressedParticle& p : particles_) {
        slot_[p.particle] = kNone;
    }
    particles_.clear();
    // W_i = sum over j of w_j b_ji
    for (const PressedVertex& v : vertices_) {
        const SkinVertex& carried = skin_[v.index];
        for (std::size_t k = 0; k < SkinVertex::kMax; ++k) {
            if (!(carried.weight[k] > 0.0)) {
                continue;
            }
            // First vertex of this particle: give it a slot.
            const std::uint32_t i = carried.particle[k];
            if (slot_[i] == kNone) {
                slot_[i] = static_cast<std::uint32_t>(particles_.size());
                particles_.push_back({i, 0.0});
            }
            particles_[slot_[i]].weight += v.weight * carried.weight[k];
        }
    }
}

void PressureMask::take_corners(const SurfacePoint& touched) {
    const Triangle& corners = triangles_[touched.triangle];
    vertices_.assign(
        {{corners[0], touched.weights.x}, {corners[1], touched.weights.y}, {corners[2], touched.weights.z}});
}

void PressureMask::normalise() {
    double sum = 0.0;
    for (const PressedVertex& v : vertices_) {
        sum += v.weight;
    }
    for (PressedVertex& v : vertices_) {
        v.weight /= sum;
    }
}

std::span<const PressedParticle> PressureMask::center_on(const SurfacePoint& touched, std::size_t most) {
    const Triangle& corners = triangles_[touched.triangle];
    find_vertices(touched.weights.x * rest_[corners[0]] + touched.weights.y * rest_[corners[1]] +
                  touched.weights.z * rest_[corners[2]]);
    // No vertex within R: the touched triangle's corners, by the barycentric weights of the point.
    if (vertices_.empty()) {
        take_corners(touched);
    }
    normalise();
    find_particles();
    // More particles than the caller has room for: the corners again.
    if (particles_.size() > most) {
        take_corners(touched);
        find_particles();
    }
    return particles_;
}

}  // namespace haptic::sim
