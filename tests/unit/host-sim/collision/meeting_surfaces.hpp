// Surfaces that pass through one another and themselves, with what is to be known of the pairs of their features.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <glm/common.hpp>
#include <glm/gtc/quaternion.hpp>
#include <limits>
#include <memory>
#include <set>
#include <span>
#include <utility>
#include <vector>

#include "collision/feature_distance.hpp"
#include "collision/surface_pairs.hpp"
#include "collision/surface_paths.hpp"
#include "contact/swept_tree.hpp"
#include "dynamics/rows.hpp"
#include "dynamics/workers.hpp"
#include "haptic/sim/block.hpp"
#include "haptic/sim/collisions.hpp"
#include "random.hpp"

namespace haptic::sim {

/// The first feature's vertices before those of the second, in an order that does not depend on who lists them.
using NamedPair = std::pair<PairKind, PairVertices>;

inline NamedPair named(PairKind kind, PairVertices v) {
    if (kind == PairKind::VertexTriangle) {
        std::sort(v.begin() + 1, v.end());
        return {kind, v};
    }
    std::sort(v.begin(), v.begin() + 2);
    std::sort(v.begin() + 2, v.end());
    if (v[2] < v[0]) {
        std::rotate(v.begin(), v.begin() + 2, v.end());
    }
    return {kind, v};
}

/// A slab of 120 x 8 x 24 mm that is bent into a ring, so that its ends pass through one another, and two blocks of
/// 40 x 20 x 20 mm that pass through it and one another, some mm away at first. The last one may be exact.
class MeetingSurfaces {
  public:
    explicit MeetingSurfaces(std::uint32_t seed, bool one_is_exact = false, int threads = 1,
                             std::size_t lanes = ParticleCollisions::kWidest)
        : random_(seed), workers_(threads), mesh_{slab(), block(), block()} {
        place();
        std::vector<SolidSurface> surfaces;
        trees_.reserve(mesh_.size());
        std::size_t first = 0;
        for (const TriangleMesh& mesh : mesh_) {
            const SurfaceMotion motion = motion_of(first, mesh);
            trees_.emplace_back(motion.start, mesh.triangles);
            trees_.back().refit({motion.start, motion.start, mesh.triangles});
            surfaces.push_back({.tree = &trees_.back(),
                                .triangles = mesh.triangles,
                                .first_vertex = first,
                                .vertices = mesh.vertices.size()});
            first += mesh.vertices.size();
        }
        surfaces.back().movable = !one_is_exact;
        surfaces.back().exact = one_is_exact;
        paths_ = std::make_unique<SurfacePaths>(surfaces, start_);
        pairs_ = std::make_unique<SurfacePairs>(*paths_, start_, SurfacesAtStart{}, lanes);
        for (std::size_t s = 0; s < mesh_.size(); ++s) {
            trees_[s].refit(motion_of(surfaces[s].first_vertex, mesh_[s]));
        }
        list_features();
    }

    void search() {
        paths_->begin_attempt();
        pairs_->search(start_, end_, workers_);
    }
    /// Leads some vertices elsewhere, up to so many m.
    void move_some(std::size_t count, double way) {
        for (std::size_t k = 0; k < count; ++k) {
            const auto v = static_cast<std::uint32_t>(random_.uniform(0.0, static_cast<double>(end_.size())));
            paths_->note_move(v);
            paths_->move_end(v, vector_of(paths_->end[v]) + random_.uniform(0.0, way) * random_.direction());
        }
    }
    [[nodiscard]] bool search_again() { return pairs_->search_again(start_, end_, workers_); }

    /// In the order in which they are listed.
    [[nodiscard]] std::vector<NamedPair> listed() {
        std::vector<NamedPair> all;
        pairs_->for_each_list([&](ListedPairs& list) {
            for (std::size_t k = 0; k < list.size(); ++k) {
                all.push_back(named(list.kind, list.vertices(k)));
            }
        });
        return all;
    }
    /// Those that come nearer than so many m on the way.
    [[nodiscard]] std::set<NamedPair> nearer_than(double distance) const {
        std::set<NamedPair> all;
        const auto look = [&](PairKind kind, const PairVertices& vertex) {
            if (least_distance(kind, vertex) < distance) {
                all.insert(named(kind, vertex));
            }
        };
        for (std::uint32_t v = 0; v < start_.size(); ++v) {
            for (const Triangle& t : triangles_) {
                if (std::ranges::find(t, v) == t.end()) {
                    look(PairKind::VertexTriangle, {v, t[0], t[1], t[2]});
                }
            }
        }
        for (const auto& [a, b] : edges_) {
            for (const auto& [c, d] : edges_) {
                if (a < c && b != c && b != d) {
                    look(PairKind::EdgeEdge, {a, b, c, d});
                }
            }
        }
        return all;
    }
    /// m, on the way: of some moments, and near the one at which the pair is nearest; the greatest number if it is far
    /// apart.
    [[nodiscard]] double least_distance(PairKind kind, const PairVertices& vertex) const {
        if (boxes_stay_apart(kind, at(vertex, 0.0), at(vertex, 1.0))) {
            return std::numeric_limits<double>::max();
        }
        const auto distance = [&](double part) { return nearest_points(kind, at(vertex, part)).distance; };
        double nearest = 0.0;
        for (int m = 1; m <= kMoments; ++m) {
            const double part = static_cast<double>(m) / kMoments;
            nearest = distance(part) < distance(nearest) ? part : nearest;
        }
        double low = std::max(0.0, nearest - 1.0 / kMoments);
        double high = std::min(1.0, nearest + 1.0 / kMoments);
        for (int k = 0; k < kHalvings; ++k) {
            const double third = (high - low) / 3.0;
            (distance(low + third) < distance(high - third) ? high : low) +=
                distance(low + third) < distance(high - third) ? -third : third;
        }
        return distance(0.5 * (low + high));
    }
    [[nodiscard]] SurfacePairs& pairs() { return *pairs_; }
    [[nodiscard]] SurfacePaths& paths() { return *paths_; }

  private:
    static constexpr int kMoments = 8;
    static constexpr int kHalvings = 40;
    static constexpr double kLength = 0.12;  // m, of the slab

    static TriangleMesh slab() { return make_block_mesh({.size = {kLength, 0.008, 0.024}, .cells = 12}); }
    static TriangleMesh block() { return make_block_mesh({.size = {0.04, 0.02, 0.02}, .cells = 4}); }

    /// Bent about z by an angle from end to end, rad, away from the origin.
    static Vec3 bent(const Vec3& v, double angle) {
        const double radius = kLength / angle;
        return {std::sin(v.x / radius) * (radius - v.y), radius - std::cos(v.x / radius) * (radius - v.y), v.z};
    }

    void place() {
        const double to = random_.uniform(6.4, 7.2);
        for (const Vec3& v : mesh_[0].vertices) {
            start_.push_back(bent(v, 5.0));
            end_.push_back(bent(v, to));
        }
        // Below the slab side by side; they move up through it, and toward one another.
        for (const double side : {-1.0, 1.0}) {
            const Vec3 from(side * 0.026, -0.035, 0.0);
            const Vec3 way(-side * random_.uniform(0.005, 0.02), random_.uniform(0.025, 0.045), 0.0);
            const Quat turn = glm::angleAxis(random_.uniform(-0.1, 0.1), random_.direction());
            const Quat turned = glm::angleAxis(random_.uniform(-0.8, 0.8), random_.direction());
            for (const Vec3& v : mesh_[1].vertices) {
                start_.push_back(from + turn * v);
                end_.push_back(from + way + turned * v);
            }
        }
    }
    [[nodiscard]] SurfaceMotion motion_of(std::size_t first, const TriangleMesh& mesh) const {
        return {std::span(start_).subspan(first, mesh.vertices.size()),
                std::span(end_).subspan(first, mesh.vertices.size()), mesh.triangles};
    }
    void list_features() {
        std::uint32_t first = 0;
        for (const TriangleMesh& mesh : mesh_) {
            for (const Triangle& t : mesh.triangles) {
                triangles_.push_back({first + t[0], first + t[1], first + t[2]});
                for (std::size_t k = 0; k < 3; ++k) {
                    edges_.insert(std::minmax(triangles_.back()[k], triangles_.back()[(k + 1) % 3]));
                }
            }
            first += static_cast<std::uint32_t>(mesh.vertices.size());
        }
    }
    [[nodiscard]] FeatureVertices at(const PairVertices& vertex, double part) const {
        FeatureVertices x{};
        for (std::size_t k = 0; k < x.size(); ++k) {
            x[k] = glm::mix(start_[vertex[k]], vector_of(paths_->end[vertex[k]]), part);
        }
        return x;
    }
    /// Whether what the features sweep lies in boxes that are farther apart than the gap.
    [[nodiscard]] bool boxes_stay_apart(PairKind kind, const FeatureVertices& from, const FeatureVertices& to) const {
        std::array<Vec3, 2> low{Vec3(std::numeric_limits<double>::max()), Vec3(std::numeric_limits<double>::max())};
        std::array<Vec3, 2> high{-low[0], -low[1]};
        for (std::size_t k = 0; k < from.size(); ++k) {
            const std::size_t of = k < static_cast<std::size_t>(kind) ? 0 : 1;
            low[of] = glm::min(low[of], glm::min(from[k], to[k]));
            high[of] = glm::max(high[of], glm::max(from[k], to[k]));
        }
        const Vec3 apart = glm::max(low[0] - high[1], low[1] - high[0]);
        return std::max({apart.x, apart.y, apart.z}) > paths_->least_gap;
    }

    rt::test::Random random_;
    Workers workers_;
    std::array<TriangleMesh, 3> mesh_;
    std::vector<Vec3> start_;
    std::vector<Vec3> end_;
    std::vector<SweptTree> trees_;
    std::vector<Triangle> triangles_;
    std::set<std::pair<std::uint32_t, std::uint32_t>> edges_;
    std::unique_ptr<SurfacePaths> paths_;
    std::unique_ptr<SurfacePairs> pairs_;
};

}  // namespace haptic::sim
