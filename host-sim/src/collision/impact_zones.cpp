#include "collision/impact_zones.hpp"

#include <algorithm>
#include <glm/geometric.hpp>

#include "dynamics/rotation.hpp"
#include "dynamics/united.hpp"

namespace haptic::sim {
namespace {

// m: ways of what a script leads that differ by no more are alike, but for the rounding of their ends.
constexpr double kAlike = 1e-12;

}  // namespace

ImpactZones::ImpactZones(std::span<const std::uint32_t> vertices, std::span<const std::uint32_t> surface_of,
                         const VertexMasses& masses)
    : vertices_(vertices),
      surface_of_(surface_of),
      masses_(masses),
      parent_(surface_of.size()),
      grounded_(surface_of.size()),
      part_(surface_of.size()),
      zone_(surface_of.size()),
      rigid_zone_(surface_of.size(), kNoZone) {
    clear();
}

void ImpactZones::clear() noexcept {
    for (const std::uint32_t v : vertices_) {
        part_[v] = 1.0;
        parent_[v] = v;
        grounded_[v] = 0;
        rigid_zone_[v] = kNoZone;
    }
}

std::uint32_t ImpactZones::zone_of(std::uint32_t vertex) noexcept {
    return root_of(parent_, vertex);
}

void ImpactZones::unite(const PairVertices& vertex, double part) noexcept {
    const std::uint32_t first = zone_of(vertex[0]);
    for (std::size_t k = 1; k < vertex.size(); ++k) {
        const std::uint32_t other = zone_of(vertex[k]);
        part_[first] = std::min(part_[first], part_[other]);
        grounded_[first] |= grounded_[other];
        parent_[other] = first;
    }
    part_[first] *= part;
}

void ImpactZones::ground(std::uint32_t vertex, double part) noexcept {
    const std::uint32_t zone = zone_of(vertex);
    grounded_[zone] = 1;
    part_[zone] *= part;
}

void ImpactZones::unite_all(bool grounded) noexcept {
    for (const std::uint32_t v : vertices_) {
        parent_[v] = vertices_.front();
        grounded_[v] = grounded ? 1 : 0;
        part_[v] = 0.0;
    }
}

/// The rigid motions with the momenta of the zones.
void ImpactZones::find_motions(const Row* start, const Row* wish, bool turning) noexcept {
    const auto way_of = [&](std::uint32_t v) { return vector_of(wish[v]) - vector_of(start[v]); };
    // Masses and centres, or the way of what is pinned.
    for (const std::uint32_t v : vertices_) {
        zone_[v] = {};
    }
    for (const std::uint32_t v : vertices_) {
        const std::uint32_t root = zone_of(v);
        Zone& zone = zone_[root];
        zone.mixed = zone.mixed || surface_of_[v] != surface_of_[root];
        if (masses_.inverse(v) > 0.0) {
            zone.mass += 1.0 / masses_.inverse(v);
            zone.centre += vector_of(start[v]) / masses_.inverse(v);
            zone.way += way_of(v) / masses_.inverse(v);
        } else {
            zone.pinned_way = zone.pinned ? zone.pinned_way : way_of(v);
            zone.pinned_alike = zone.pinned_alike && glm::distance(zone.pinned_way, way_of(v)) <= kAlike;
            zone.pinned = true;
        }
    }
    for (const std::uint32_t v : vertices_) {
        Zone& zone = zone_[v];
        zone.grounded = grounded_[v] != 0;
        if (zone.is_held()) {
            // The ground does not move, and neither does what is fixed: a script waits.
            zone.way = zone.grounded || !zone.pinned_alike ? Vec3(0.0) : zone.pinned_way;
        } else if (zone.mass > 0.0) {
            zone.centre /= zone.mass;
            zone.way /= zone.mass;
        }
    }
    // Turning, of what is not pinned.
    if (!turning) {
        return;
    }
    for (const std::uint32_t v : vertices_) {
        Zone& zone = zone_[zone_of(v)];
        if (!zone.is_held()) {
            const Vec3 arm = vector_of(start[v]) - zone.centre;
            zone.turn += glm::cross(arm, way_of(v)) / masses_.inverse(v);
            add_outer(zone.scatter, 1.0 / masses_.inverse(v), arm, arm);
        }
    }
    for (const std::uint32_t v : vertices_) {
        if (parent_[v] == v && part_[v] < 1.0) {
            zone_[v].turn = solve_inertia(zone_[v].scatter, zone_[v].turn);
        }
    }
}

void ImpactZones::move(const Row* start, const Row* wish, bool turning, Row* position) noexcept {
    find_motions(start, wish, turning);
    for (const std::uint32_t v : vertices_) {
        const std::uint32_t root = zone_of(v);
        if (part_[root] < 1.0) {
            const Vec3 from = vector_of(start[v]);
            const Zone& zone = zone_[root];
            const Vec3 common = zone.way + glm::cross(zone.turn, from - zone.centre);
            set_vector(position[v], from + common + part_[root] * (vector_of(wish[v]) - from - common));
        }
    }
}

void ImpactZones::find_rigid() noexcept {
    for (const std::uint32_t v : vertices_) {
        const std::uint32_t zone = zone_of(v);
        rigid_zone_[v] = part_[zone] == 0.0 ? zone : kNoZone;
    }
}

bool ImpactZones::are_rigid(const PairVertices& vertex) const noexcept {
    const std::uint32_t zone = rigid_zone_[vertex[0]];
    return zone != kNoZone && rigid_zone_[vertex[1]] == zone && rigid_zone_[vertex[2]] == zone &&
           rigid_zone_[vertex[3]] == zone;
}

}  // namespace haptic::sim
