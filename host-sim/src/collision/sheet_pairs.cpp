#include "collision/sheet_pairs.hpp"

#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <utility>

#include "simd/kernels.hpp"

namespace haptic::sim {
namespace {

// Of the thickness: how far a vertex may leave the path expected of it before pairs are searched again.
constexpr double kSlack = 1.5;
// Most sub-steps for which a search looks ahead.
constexpr int kMostAhead = 12;
// Vertices by which the mean motion is estimated, roughly.
constexpr std::size_t kSample = 64;
// How far a vertex may move before the near pairs are chosen again: this part of the thickness, or so many of its ways
// in a sub-step.
constexpr double kNearSlack = 1.0;
constexpr double kNearAhead = 3.0;
// Room for pairs of each kind, per vertex and at most.
constexpr std::size_t kPairsPerVertex = 256;
constexpr std::size_t kMaxPairs = 1U << 19;

/// Per particle; 0 of those that are of none.
std::vector<std::uint32_t> surface_of_particles(std::size_t particles, std::span<const ParticleSurface> surfaces) {
    std::vector<std::uint32_t> surface_of(particles, 0);
    for (std::uint32_t s = 0; s < surfaces.size(); ++s) {
        std::fill_n(surface_of.begin() + surfaces[s].first_particle, surfaces[s].rest.size(), s);
    }
    return surface_of;
}

}  // namespace

SheetPairs::SheetPairs(SurfaceFeatures& features, std::size_t particles, std::span<const ParticleSurface> surfaces,
                       const Settings& settings, std::size_t lanes)
    : features_(features),
      by_number_(features_.vertices().begin(), features_.vertices().end()),
      kernels_(*find_kernels(&Kernels::features, lanes)),
      settings_(settings),
      surface_of_(surface_of_particles(particles, surfaces)),
      left_alone_(particles),
      touches_(particles),
      room_(particles, settings.thickness),
      path_(particles),
      path_end_(particles),
      reach_(particles),
      chosen_at_(particles),
      near_reach_(particles),
      start_(particles),
      ended_(particles, Row{}) {
    std::ranges::sort(by_number_);
    // What usual states need.
    room_for_pairs_ = std::min(kMaxPairs, kPairsPerVertex * by_number_.size());
    for (std::size_t list = 0; list < near_.size(); ++list) {
        found_[list].reserve(room_for_pairs_);
        near_[list].reserve(room_for_pairs_);
    }
    in_doubt_.reserve(SurfaceFeatures::kMaxTogether);
    for (const ParticleSurface& surface : surfaces) {
        std::ranges::copy(surface.left_alone, left_alone_.begin() + surface.first_particle);
        for (std::size_t v = 0; v < surface.rest.size(); ++v) {
            start_[surface.first_particle + v] = row_of(surface.rest[v]);
        }
    }
    find_room();
}

/// Features of a surface that are nearer at rest than the thickness keep that distance; those that touch, of one
/// surface or of two, are left alone, because nothing tells their sides apart.
void SheetPairs::find_room() {
    for (const std::uint32_t v : features_.vertices()) {
        const Vec3 x = vector_of(start_[v]);
        path_[v] = {.start = x, .margin = Vec3(0.5 * settings_.thickness)};
    }
    features_.search(path_, [&](PairKind kind, const auto& vertex) {
        for (std::size_t k = 0; k < vertex[0].size(); ++k) {
            const PairVertices pair{vertex[0][k], vertex[1][k], vertex[2][k], vertex[3][k]};
            const double distance = nearest_points(kind, positions_of(pair, start_.data())).distance;
            const std::uint8_t touch = distance < settings_.least_gap ? 1 : 0;
            for (const std::uint32_t v : pair) {
                if (are_of_one_surface(pair)) {
                    room_[v] = std::min(room_[v], distance);
                    left_alone_[v] |= touch;
                } else {
                    touches_[v] |= touch;
                }
            }
        }
    });
}

bool SheetPairs::are_left_alone(const PairVertices& vertex) const noexcept {
    const bool are_of_two = !are_of_one_surface(vertex);
    return std::ranges::all_of(vertex, [&](std::uint32_t v) { return leaves_alone(v, are_of_two); });
}

bool SheetPairs::begin(const ParticleModel& model) {
    // What was proved at the end of the last sub-step holds at the start of this one, unless someone moved a vertex.
    bool moved = !searched_;
    for (const std::uint32_t v : by_number_) {
        moved |= vector_of(ended_[v]) != model.position[v];
    }
    goes_on_ = !moved;
    if (goes_on_) {
        std::swap(start_, ended_);
    } else {
        searched_ = false;
        for (const std::uint32_t v : by_number_) {
            start_[v] = row_of(model.position[v]);
        }
    }
    return goes_on_;
}

void SheetPairs::end(const Row* position) noexcept {
    for (FeaturePairs& pairs : near_) {
        std::swap(pairs.gap, pairs.end_gap);
    }
    ++elapsed_;
    for (const std::uint32_t v : by_number_) {
        ended_[v] = position[v];
    }
}

/// Whether the state has diverged: rounding exceeds the least gap, and nothing tells sides apart. All pairs would be
/// near, and take minutes.
bool SheetPairs::are_lost(const Row* position) const noexcept {
    const Vec3 farthest(settings_.least_gap / std::numeric_limits<double>::epsilon());
    bool within = true;
    for (const std::uint32_t v : features_.vertices()) {
        within &= glm::all(glm::lessThan(glm::abs(vector_of(position[v])), farthest));
    }
    return !within;
}

/// m, the mean of a vector that each vertex has, estimated by some of them.
template <class Of>
Vec3 SheetPairs::mean_of(const Of& of) const noexcept {
    const std::span<const std::uint32_t> vertices = by_number_;
    const std::size_t stride = (vertices.size() / kSample) | 1U;  // odd: not along one column of a square grid
    Vec3 sum(0.0);
    double count = 0.0;
    for (std::size_t k = 0; k < vertices.size(); k += stride) {
        sum += of(vertices[k]);
        count += 1.0;
    }
    return sum / std::max(1.0, count);
}

/// Whether a vertex is off its path by more than its slack, at the end of the sub-step.
bool SheetPairs::have_left_paths(const Row* position) const noexcept {
    const double part = static_cast<double>(std::min(elapsed_ + 1, ahead_)) / std::max(1, ahead_);
    const auto deviation = [&](std::uint32_t v) {
        return vector_of(position[v]) - path_[v].start - part * path_[v].way;
    };
    // What moves all vertices alike brings none nearer to another: gravity, of a sheet that falls.
    const Vec3 common = mean_of(deviation);
    bool left = false;
    if (ahead_ > 0) {
        for (const std::uint32_t v : by_number_) {
            const Vec3 off = deviation(v) - common;
            left |= !(glm::dot(off, off) <= reach_[v] * reach_[v]);
        }
        return left;
    }
    // Half a thickness of each margin is not for its vertex: features whose boxes part are a thickness apart.
    const Vec3 not_its_own(0.5 * settings_.thickness);
    for (const std::uint32_t v : by_number_) {
        const Vec3 off = deviation(v) - common;
        left |= !glm::all(glm::lessThanEqual(glm::abs(off), path_[v].margin - not_its_own));
    }
    return left;
}

/// Whether pairs that are not near may be nearer than the thickness by now.
bool SheetPairs::have_come_near(const Row* position) const noexcept {
    if (all_are_near_) {
        return false;
    }
    const auto moved_by = [&](std::uint32_t v) { return vector_of(position[v]) - vector_of(chosen_at_[v]); };
    const Vec3 common = mean_of(moved_by);
    bool near = false;
    for (const std::uint32_t v : by_number_) {
        const Vec3 moved = moved_by(v) - common;
        near |= !(glm::dot(moved, moved) <= near_reach_[v] * near_reach_[v]);
    }
    return near;
}

bool SheetPairs::know(const Row* position) {
    if (!searched_ || have_left_paths(position)) {
        searched_ = !are_lost(position);
        if (!searched_) {
            return false;
        }
        find_pairs(position, steady_substeps(position));
    } else if (have_come_near(position)) {
        choose_again(position);
    }
    return true;
}

bool SheetPairs::know_again(const Row* position) {
    if (have_left_paths(position)) {
        find_pairs(position, 0);
        return true;
    }
    if (have_come_near(position)) {
        choose_again(position);
        return true;
    }
    return false;
}

/// For how many sub-steps straight paths will do, if velocities go on changing as since the last sub-step; 0 if for
/// less than two.
int SheetPairs::steady_substeps(const Row* position) const noexcept {
    if (!goes_on_) {
        return 0;
    }
    const auto change = [&](std::uint32_t v) {
        return (vector_of(position[v]) - vector_of(start_[v])) - (vector_of(start_[v]) - vector_of(ended_[v]));
    };
    const Vec3 common = mean_of(change);
    double most = 0.0;
    for (const std::uint32_t v : by_number_) {
        const Vec3 off = change(v) - common;
        most = std::max(most, glm::dot(off, off));
    }
    // With a constant change d of the way, a vertex is off by k (k - 1) / 2 d after k sub-steps.
    const double slack = kSlack * settings_.thickness;
    int ahead = 1;
    while (ahead < kMostAhead && 0.5 * ahead * (ahead + 1) * std::sqrt(most) <= slack) {
        ++ahead;
    }
    return ahead >= 2 ? ahead : 0;
}

/// Finds the pairs that may come within the thickness while vertices go on as from `start_` to `position` for `ahead`
/// sub-steps, and then stay. For 0: wherever they are from `start_` to twice as far as `position`.
void SheetPairs::find_pairs(const Row* position, int ahead) {
    ++counts_.searches;
    searched_ = true;
    ahead_ = ahead;
    elapsed_ = 0;
    most_reach_ = 0.0;
    const auto way_of = [&](std::uint32_t v) { return vector_of(position[v]) - vector_of(start_[v]); };
    const Vec3 common = mean_of(way_of);
    const double slack = kSlack * settings_.thickness;
    const Vec3 margin(slack + 0.5 * settings_.thickness);
    for (const std::uint32_t v : by_number_) {
        const Vec3 from = vector_of(start_[v]);
        if (ahead > 0) {
            const Vec3 way = static_cast<double>(ahead) * way_of(v);
            path_[v] = {from, way, margin};
            path_end_[v] = row_of(from + way);
            reach_[v] = slack;
        } else {
            const Vec3 way = way_of(v) - common;
            path_[v] = {from + way, Vec3(0.0), margin + glm::abs(way)};
            path_end_[v] = start_[v];
            reach_[v] = std::sqrt(3.0) * slack + 2.0 * glm::length(way);
        }
        most_reach_ = std::max(most_reach_, reach_[v]);
    }
    for (FeaturePairs& found : found_) {
        found.clear();
    }
    features_.search(path_, [&](PairKind kind, const auto& vertex) { keep_near(kind, vertex); });
    for (const FeaturePairs& found : found_) {
        counts_.pairs += found.size();
    }
    choose_near(position);
}

/// Chooses near pairs again, some sub-steps after the search.
void SheetPairs::choose_again(const Row* position) {
    for (std::size_t list = 0; list < near_.size(); ++list) {
        FeaturePairs& found = found_[list];
        const FeaturePairs& near = near_[list];
        // Better normals stay.
        for (std::size_t k = 0; k < near.size(); ++k) {
            found.set_normal(near.origin[k], near.normal_of(k));
        }
        kernels_.find_gaps(found.kind, found.rows(found.gap), found.size(), start_.data());
    }
    choose_near(position);
}

/// Chooses those of the pairs that may come within the thickness while no vertex moves farther than now, to `position`;
/// all of them where they are few.
void SheetPairs::choose_near(const Row* position) {
    all_are_near_ = found_[0].size() + found_[1].size() <= features_.vertices().size();
    VertexReaches reaches{near_reach_, 0.0};
    if (!all_are_near_) {
        const auto way_of = [&](std::uint32_t v) { return vector_of(position[v]) - vector_of(start_[v]); };
        const Vec3 common = mean_of(way_of);
        for (const std::uint32_t v : by_number_) {
            chosen_at_[v] = start_[v];
            near_reach_[v] = std::max(kNearSlack * settings_.thickness, kNearAhead * glm::length(way_of(v) - common));
            reaches.most = std::max(reaches.most, near_reach_[v]);
        }
    }
    for (std::size_t list = 0; list < near_.size(); ++list) {
        const FeaturePairs& found = found_[list];
        FeaturePairs& near = near_[list];
        near.clear();
        for (std::size_t k = 0; k < found.size(); ++k) {
            if (all_are_near_ || reaches.may_close(found.gap[k], settings_.thickness, found.kind, found.vertices(k))) {
                near.append(found, k);
            }
        }
        near.end_gap.resize(near.size());
    }
}

/// Keeps those of the pairs that are not proved to stay a thickness apart while their vertices keep to their paths.
void SheetPairs::keep_near(PairKind kind, const PairCandidates::Vertices& vertex) {
    const VertexReaches reaches{reach_, most_reach_};
    const auto may_close = [&](const FeaturePairs& pairs, std::size_t k) {
        return reaches.may_close(std::min(pairs.gap[k], pairs.end_gap[k]), settings_.thickness, kind,
                                 pairs.vertices(k));
    };
    in_doubt_.find(kernels_, kind, vertex, start_.data(), path_end_.data(), may_close);
    const FeaturePairs& some = in_doubt_.some;
    const FeaturePairs& doubtful = in_doubt_.pairs;
    FeaturePairs& found = found_[list_of(kind)];
    for (std::size_t k = 0; k < doubtful.size(); ++k) {
        const PairVertices pair = doubtful.vertices(k);
        if (!may_close(doubtful, k) || are_left_alone(pair) ||
            !(settings_.between_bodies || are_of_one_surface(pair))) {
            continue;
        }
        const std::uint32_t quick = doubtful.origin[k];
        if (some.gap[quick] > settings_.least_gap) {
            found.append(some, quick);
        } else {
            found.append(doubtful, k);
        }
    }
}

}  // namespace haptic::sim
