// Zones of impact: vertices of sheets that would come too near, and move as one rigid body so that they do not.
//
// A zone has the linear and angular momentum of its vertices, and loses a part of their motion relative to it, at last
// all of it: so it takes energy out and nothing else. A rigid motion brings nothing nearer: with linear ways that turn
// by theta, |d + theta x d| >= |d|. The ground holds a zone where it is, and what is pinned holds or leads it; these
// take its momentum.
// @source X. Provot, "Collision and Self-Collision Handling in Cloth Model Dedicated to Design Garments", 1997;
// R. Bridson, R. Fedkiw, J. Anderson, "Robust Treatment of Collisions, Contact and Friction for Cloth Animation", 2002
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "collision/feature_pairs.hpp"
#include "collision/vertex_masses.hpp"
#include "dynamics/rows.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

class ImpactZones {
  public:
    /// Of these vertices, of surfaces with these numbers, by vertex. They and the masses outlive it.
    ImpactZones(std::span<const std::uint32_t> vertices, std::span<const std::uint32_t> surface_of,
                const VertexMasses& masses);
    ImpactZones(const ImpactZones&) = delete;
    ImpactZones& operator=(const ImpactZones&) = delete;

    /// Leaves no zones.
    void clear() noexcept;
    /// Unites the zones of a pair's vertices. Of the motion within the new one this part of the least is left that one
    /// of them had.
    void unite(const PairVertices& vertex, double part) noexcept;
    /// The ground belongs to the zone of a vertex, in which this part of its motion is left.
    void ground(std::uint32_t vertex, double part) noexcept;
    /// Makes one zone of all, with the ground or not, in which no motion is left.
    void unite_all(bool grounded) noexcept;

    /// Moves the vertices of zones on their way from `start` to where they wish to be, m: by the motion of the zone,
    /// which turns or not, and by what is left relative to it.
    void move(const Row* start, const Row* wish, bool turning, Row* position) noexcept;
    /// From now on are_rigid() knows the zones as they are.
    void find_rigid() noexcept;
    /// Whether one zone moves all vertices of a pair as a rigid body. It does so from then on, because zones only grow.
    [[nodiscard]] bool are_rigid(const PairVertices& vertex) const noexcept;
    /// Whether a vertex is in a zone.
    [[nodiscard]] bool contain(std::uint32_t vertex) noexcept { return part_[zone_of(vertex)] < 1.0; }
    /// Whether its zone, when it was moved last, had to do with more than its surface.
    [[nodiscard]] bool are_mixed(std::uint32_t vertex) noexcept {
        const Zone& zone = zone_[zone_of(vertex)];
        return zone.is_held() || zone.mixed;
    }

  private:
    /// Motion of a zone as a rigid body: sums over its vertices, then what follows from them.
    struct Zone {
        double mass = 0.0;   // kg, of what is not pinned
        Vec3 centre{0.0};    // kg m, then m: at the start
        Vec3 way{0.0};       // kg m, then m
        Vec3 turn{0.0};      // kg m^2, then rad
        Mat3 scatter{0.0};   // kg m^2
        bool mixed = false;  // of several surfaces
        bool grounded = false;
        bool pinned = false;       // some vertex is
        bool pinned_alike = true;  // and these have the same way
        Vec3 pinned_way{0.0};      // m
        /// Whether the ground or what is pinned takes its momentum.
        [[nodiscard]] bool is_held() const noexcept { return grounded || pinned; }
    };
    static constexpr std::uint32_t kNoZone = 0xffff'ffff;

    void find_motions(const Row* start, const Row* wish, bool turning) noexcept;
    [[nodiscard]] std::uint32_t zone_of(std::uint32_t vertex) noexcept;

    std::span<const std::uint32_t> vertices_;
    std::span<const std::uint32_t> surface_of_;  // per vertex
    const VertexMasses& masses_;
    // Per vertex.
    std::vector<std::uint32_t> parent_;      // a vertex of the same zone; one of each is its own
    std::vector<std::uint8_t> grounded_;     // of that one: the ground belongs to the zone
    std::vector<double> part_;               // of that one: what is left of motion within the zone; 1: it is no zone
    std::vector<Zone> zone_;                 // of that one
    std::vector<std::uint32_t> rigid_zone_;  // the zone that moves the vertex as a rigid body; kNoZone
};

}  // namespace haptic::sim
