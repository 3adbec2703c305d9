#include "collision/deformation.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <limits>
#include <utility>

#include "dynamics/rotation.hpp"

namespace haptic::sim {
namespace {

// Of the widest spread: points that are flatter than this say little of what is across them.
constexpr float kLeastSpread = 1e-3F;
// Of a stretch: more than what rounding takes from it.
constexpr float kRoundingOfStretch = 1e-5F;
constexpr int kSweeps = 4;  // that diagonalise the spread
constexpr float kMostUnits = std::numeric_limits<std::int16_t>::max();

float dot(const float (&a)[3], const float (&b)[3]) noexcept {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/// Of the columns.
float square_of_difference(const AffineMap& one, const AffineMap& other) noexcept {
    float square = 0.0F;
    for (std::size_t k = 0; k < 3; ++k) {
        for (std::size_t axis = 0; axis < 3; ++axis) {
            const float difference = one.column[k][axis] - other.column[k][axis];
            square += difference * difference;
        }
    }
    return square;
}

}  // namespace

void Deformation::Residuals::make_room(std::size_t points) {
    const std::size_t groups = (points + kPointsInGroup - 1) / kPointsInGroup;
    of_point.resize(std::max(of_point.size(), groups * kPointsInGroup));
    end.resize(std::max(end.size(), groups));
}

void Deformation::refer_to(std::span<const std::uint32_t> points, std::size_t first_points, std::size_t fitted_points,
                           const FloatRow* places) {
    const auto groups_of = [](std::size_t some) { return (some + kPointsInGroup - 1) / kPointsInGroup; };
    group_.resize(groups_of(points.size()));
    first_groups_ = groups_of(first_points);
    fitted_groups_ = groups_of(fitted_points);
    const std::size_t count = group_.size() * kPointsInGroup;
    const std::size_t fitted = fitted_groups_ * kPointsInGroup;
    const auto number_of = [&](std::size_t k) { return points[std::min(k, points.size() - 1)]; };
    const auto place_of = [&](std::size_t k) {
        const float (&at)[4] = places[number_of(k)].number;
        return Vec3(at[0], at[1], at[2]);
    };
    // The middle and axes of inertia of those that are fitted.
    Vec3 middle(0.0);
    for (std::size_t k = 0; k < fitted; ++k) {
        middle += place_of(k) / static_cast<double>(fitted);
    }
    Mat3 spread(0.0);
    double farthest = std::numeric_limits<float>::min();
    for (std::size_t k = 0; k < count; ++k) {
        const Vec3 off = place_of(k) - middle;
        if (k < fitted) {
            add_outer(spread, 1.0, off, off);
        }
        farthest = std::max(farthest, glm::dot(off, off));
    }
    Mat3 axes(1.0);
    diagonalise(spread, axes, kSweeps);
    std::array<int, 3> order{0, 1, 2};
    std::ranges::sort(order, {}, [&](int k) { return std::pair(spread[k][k], k); });
    // The points along these, the narrowest first.
    const Vec3 second = axes[order[1]];
    const Vec3 third = axes[order[2]];
    const Mat3 axis(glm::cross(second, third), second, third);
    const double unit = std::sqrt(farthest) / static_cast<double>(kMostUnits - 1.0F);
    unit_ = static_cast<float>(unit);
    sum_.fill(0.0F);
    for (std::size_t k = 0; k < count; ++k) {
        PointGroup& group = group_[k / kPointsInGroup];
        const Vec3 off = place_of(k) - middle;
        for (int c = 0; c < 3; ++c) {
            const auto number = static_cast<std::int16_t>(std::lround(glm::dot(axis[c], off) / unit));
            group.number[c][k % kPointsInGroup] = number;
            if (k < fitted) {
                sum_[static_cast<std::size_t>(c)] += static_cast<float>(number);
            }
        }
        group.distance[k % kPointsInGroup] = 0;
        group.point[k % kPointsInGroup] = number_of(k);
    }
    for (int k = 0; k < 3; ++k) {
        const auto c = static_cast<std::size_t>(k);
        spread_[c] = static_cast<float>(spread[order[c]][order[c]] / (unit * unit));
        start_.origin[k] = static_cast<float>(middle[k]);
        for (int along = 0; along < 3; ++along) {
            start_.column[k][along] = static_cast<float>(unit * axis[k][along]);
        }
    }
    end_ = start_;
    start_is_known_ = true;
    limit_ = 0.0F;
}

void Deformation::measure(std::span<const float> distances, float limit) noexcept {
    for (std::size_t k = 0; k < group_.size() * kPointsInGroup; ++k) {
        const float distance = std::min(distances[std::min(k, distances.size() - 1)] / unit_, kMostUnits);
        group_[k / kPointsInGroup].distance[k % kPointsInGroup] = static_cast<std::int16_t>(distance);
    }
    limit_ = limit;
}

float Deformation::follow(const DeformationKernels& kernels, const FloatRow* start, const FloatRow* end,
                          Residuals& residuals) noexcept {
    const DeformationTask task{group_.data(), group_.size(), first_groups_, fitted_groups_};
    const auto fitted_to = [&](const FloatRow* places) {
        DeformationSums sums;  // NOLINT(cppcoreguidelines-pro-type-member-init): written by the kernel
        kernels.sum(task, places, residuals.end.data(), sums);
        return map_of(sums);
    };
    if (!std::exchange(start_is_known_, true)) {
        start_ = fitted_to(start);
    }
    end_ = fitted_to(end);
    const float square = std::min(least_square_stretch(start_), least_square_stretch(end_)) -
                         0.25F * square_of_difference(start_, end_) / (unit_ * unit_);
    const float stretch = std::sqrt(square) - kRoundingOfStretch;
    residuals.most = kernels.find_residuals(task, start_, start, end_, residuals.end.data(), stretch * unit_,
                                            limit_ / unit_, residuals.of_point.data());
    return stretch;
}

/// The map that fits best. Across flat points it keeps lengths.
AffineMap Deformation::map_of(const DeformationSums& sums) const noexcept {
    AffineMap map;  // NOLINT(cppcoreguidelines-pro-type-member-init): written here
    const float share = 1.0F / static_cast<float>(fitted_groups_ * kPointsInGroup);
    float product[3][3];  // about the middle
    for (std::size_t axis = 0; axis < 3; ++axis) {
        map.origin[axis] = share * sums.place[axis];
        for (std::size_t k = 0; k < 3; ++k) {
            product[k][axis] = sums.product[k][axis] - sum_[k] * map.origin[axis];
        }
        map.column[1][axis] = product[1][axis] / spread_[1];
        map.column[2][axis] = product[2][axis] / spread_[2];
    }
    const auto& one = map.column[1];
    const auto& other = map.column[2];
    const float across[3] = {one[1] * other[2] - one[2] * other[1], one[2] * other[0] - one[0] * other[2],
                             one[0] * other[1] - one[1] * other[0]};
    const float least = kLeastSpread * spread_[2];
    const float scale = least * unit_ / std::sqrt(dot(across, across));
    for (std::size_t axis = 0; axis < 3; ++axis) {
        map.column[0][axis] = (product[0][axis] + scale * across[axis]) / (spread_[0] + least);
    }
    return map;
}

/// The square of the least stretch, at least: a metric differs from that of a rotation by no more than the norm of the
/// difference.
float Deformation::least_square_stretch(const AffineMap& map) const noexcept {
    const float scale = 1.0F / (unit_ * unit_);
    float square = 0.0F;
    for (std::size_t i = 0; i < 3; ++i) {
        const float along = scale * dot(map.column[i], map.column[i]) - 1.0F;
        const float across = scale * dot(map.column[i], map.column[(i + 1) % 3]);
        square += along * along + 2.0F * across * across;
    }
    return 1.0F - std::sqrt(square);
}

Deformation::Motion Deformation::motion() const noexcept {
    const auto vector = [](const float (&x)[3]) { return Vec3(x[0], x[1], x[2]); };
    const auto columns = [&](const AffineMap& map) {
        return Mat3(vector(map.column[0]), vector(map.column[1]), vector(map.column[2]));
    };
    const Mat3 start = columns(start_);
    const Mat3 change = (columns(end_) - start) * glm::inverse(start);
    return {.middle = vector(start_.origin),
            .way = vector(end_.origin) - vector(start_.origin),
            .turn = 0.5 * Vec3(change[1][2] - change[2][1], change[2][0] - change[0][2], change[0][1] - change[1][0])};
}

std::array<float, 3> Deformation::reference_of(std::size_t at) const noexcept {
    const PointGroup& group = group_[at / kPointsInGroup];
    const std::size_t k = at % kPointsInGroup;
    return {unit_ * static_cast<float>(group.number[0][k]), unit_ * static_cast<float>(group.number[1][k]),
            unit_ * static_cast<float>(group.number[2][k])};
}

void Deformation::make_room_for_more(std::size_t groups, std::size_t times) {
    group_.reserve(groups + times * group_.size());
}

void Deformation::prefetch() const noexcept {
    constexpr std::size_t line = 64;
    for (std::size_t at = 0; at < group_.size() * sizeof(PointGroup); at += line) {
        __builtin_prefetch(reinterpret_cast<const std::byte*>(group_.data()) + at);
    }
}

}  // namespace haptic::sim
