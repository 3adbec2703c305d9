#include "collision/feature_pairs.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "dynamics/rows.hpp"

namespace haptic::sim {
namespace {

// Conservative advancement: steps, and the part of a safe way that is used.
constexpr int kMaxAdvances = 100;
constexpr double kSafety = 0.9;

/// At a part of the way.
FeatureVertices between(const FeatureVertices& from, const FeatureVertices& to, double part) noexcept {
    FeatureVertices x;
    for (std::size_t k = 0; k < 4; ++k) {
        x[k] = from[k] + part * (to[k] - from[k]);
    }
    return x;
}

/// m, the most that a vertex of the first feature can move relative to one of the second.
double relative_way(PairKind kind, const FeatureVertices& from, const FeatureVertices& to) noexcept {
    const auto first = static_cast<std::size_t>(kind);
    double squared = 0.0;
    for (std::size_t a = 0; a < first; ++a) {
        for (std::size_t b = first; b < 4; ++b) {
            const Vec3 way = (to[a] - from[a]) - (to[b] - from[b]);
            squared = std::max(squared, glm::dot(way, way));
        }
    }
    return std::sqrt(squared);
}

/// The last part of the way, from `part` on, up to which the gap along a normal is at least `gap`, m: it is the least
/// of linear functions of the part.
double part_apart_along(PairKind kind, const Vec3& normal, const FeatureVertices& from, const FeatureVertices& to,
                        double part, double gap) noexcept {
    std::array<double, 4> height;  // NOLINT(cppcoreguidelines-pro-type-member-init): written here
    std::array<double, 4> climb;   // NOLINT(cppcoreguidelines-pro-type-member-init)
    for (std::size_t k = 0; k < 4; ++k) {
        climb[k] = glm::dot(normal, to[k] - from[k]);
        height[k] = glm::dot(normal, from[k]) + part * climb[k];
    }
    const auto first = static_cast<std::size_t>(kind);
    double until = 1.0;
    for (std::size_t a = 0; a < first; ++a) {
        for (std::size_t b = first; b < 4; ++b) {
            const double room = height[a] - height[b] - gap;
            const double closing = climb[b] - climb[a];
            if (!(room >= 0.0)) {
                return part;
            }
            if (closing > 0.0) {
                until = std::min(until, part + room / closing);
            }
        }
    }
    return until;
}

}  // namespace

FeatureVertices positions_of(const PairVertices& vertex, const Row* position) noexcept {
    return {vector_of(position[vertex[0]]), vector_of(position[vertex[1]]), vector_of(position[vertex[2]]),
            vector_of(position[vertex[3]])};
}

Vec3 weighted(const std::array<double, 4>& weight, const PairVertices& vertex, const Row* position) noexcept {
    Vec3 sum(0.0);
    for (std::size_t k = 0; k < 4; ++k) {
        sum += weight[k] * vector_of(position[vertex[k]]);
    }
    return sum;
}

double gap_of(PairKind kind, const Vec3& normal, const FeatureVertices& x) noexcept {
    const double second = glm::dot(normal, x[1]);
    const double last = std::max(glm::dot(normal, x[2]), glm::dot(normal, x[3]));
    return kind == PairKind::VertexTriangle ? glm::dot(normal, x[0]) - std::max(second, last)
                                            : std::min(glm::dot(normal, x[0]), second) - last;
}

FeatureRows FeaturePairs::rows(std::vector<double>& gaps) noexcept {
    return {{vertex[0].data(), vertex[1].data(), vertex[2].data(), vertex[3].data()},
            {normal[0].data(), normal[1].data(), normal[2].data()},
            gaps.data()};
}

void FeaturePairs::reserve(std::size_t size) {
    for (std::vector<std::uint32_t>& of : vertex) {
        of.reserve(size);
    }
    for (std::vector<double>& of : normal) {
        of.reserve(size);
    }
    gap.reserve(size);
    end_gap.reserve(size);
    origin.reserve(size);
}

void FeaturePairs::assign(PairKind of, const std::array<std::span<const std::uint32_t>, 4>& vertices) {
    kind = of;
    for (std::size_t k = 0; k < vertices.size(); ++k) {
        vertex[k].assign(vertices[k].begin(), vertices[k].end());
    }
    for (std::vector<double>& numbers : normal) {
        numbers.resize(vertices[0].size());
    }
    gap.resize(vertices[0].size());
    end_gap.resize(vertices[0].size());
}

void FeaturePairs::append(const FeaturePairs& from, std::size_t at) {
    for (std::size_t k = 0; k < 4; ++k) {
        vertex[k].push_back(from.vertex[k][at]);
    }
    for (std::size_t k = 0; k < 3; ++k) {
        normal[k].push_back(from.normal[k][at]);
    }
    gap.push_back(from.gap[at]);
    origin.push_back(static_cast<std::uint32_t>(at));
}

void FeaturePairs::clear() noexcept {
    for (std::vector<std::uint32_t>& of : vertex) {
        of.clear();
    }
    for (std::vector<double>& of : normal) {
        of.clear();
    }
    gap.clear();
    end_gap.clear();
    origin.clear();
}

PairVertices FeaturePairs::vertices(std::size_t at) const noexcept {
    return {vertex[0][at], vertex[1][at], vertex[2][at], vertex[3][at]};
}

FeatureVertices FeaturePairs::positions(std::size_t at, const Row* position) const noexcept {
    return positions_of(vertices(at), position);
}

Vec3 FeaturePairs::normal_of(std::size_t at) const noexcept {
    return {normal[0][at], normal[1][at], normal[2][at]};
}

double FeaturePairs::gap_along(std::size_t at, const Row* position) const noexcept {
    return gap_of(kind, normal_of(at), positions(at, position));
}

void FeaturePairs::set_normal(std::size_t at, const Vec3& n) noexcept {
    for (int k = 0; k < 3; ++k) {
        normal[static_cast<std::size_t>(k)][at] = n[k];
    }
}

double FeaturePairs::safe_part(std::size_t at, const NearestPoints& first, const Row* start, const Row* end,
                               double least) noexcept {
    if (!(first.distance > 0.0)) {
        return 1.0;  // they touch already: nothing tells the sides apart
    }
    const FeatureVertices from = positions(at, start);
    const FeatureVertices to = positions(at, end);
    const NearestPoints last = nearest_points(kind, to);
    least = std::min(least, first.distance);
    // The normals at both ends.
    for (const NearestPoints& nearest : {last, first}) {
        const Vec3 n = nearest.normal();
        set_normal(at, n);
        gap[at] = gap_of(kind, n, from);
        if (gap[at] > 0.0 && gap_of(kind, n, to) >= least) {
            return 1.0;
        }
    }
    // Conservative advancement, each time to the farther of two parts: as long as the direction between the nearest
    // points keeps the pair apart, or by the way of vertices relative to each other, as no points come nearer by more.
    const double way = relative_way(kind, from, to);
    double part = 0.0;
    NearestPoints nearest = first;
    for (int k = 0; k < kMaxAdvances && nearest.distance > 0.75 * least; ++k) {
        part = std::max(part + (nearest.distance - 0.5 * least) / way,
                        part_apart_along(kind, nearest.normal(), from, to, part, 0.5 * least));
        if (part >= 1.0) {
            return last.distance >= least ? 1.0 : kSafety;
        }
        nearest = nearest_points(kind, between(from, to, part));
    }
    return kSafety * std::min(part, 1.0);
}

void NearestOfPairs::resize(std::size_t size) {
    for (std::vector<double>& of : weight) {
        of.resize(size);
    }
    distance.resize(size);
}

void DoubtfulPairs::reserve(std::size_t size) {
    some.reserve(size);
    pairs.reserve(size);
    nearest.resize(size);
}

NearestRows NearestOfPairs::rows() noexcept {
    return {{weight[0].data(), weight[1].data(), weight[2].data(), weight[3].data()}, distance.data()};
}

}  // namespace haptic::sim
