#include "scene/relief.hpp"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <utility>

namespace haptic::sim {
namespace {

constexpr double kCellsPerRadius = 8.0;
constexpr double kNothing = -std::numeric_limits<double>::infinity();
// A slope of 0.5, where friction no longer holds the sphere, counts as much as the farthest distance.
constexpr double kSlopeWeight = 2.0;

}  // namespace

Relief::Relief(std::span<const Vec3> vertices, std::span<const Triangle> triangles, double radius)
    : radius_(radius), cell_(radius / kCellsPerRadius) {
    low_ = high_ = vertices.front();
    for (const Vec3& p : vertices) {
        low_ = glm::min(low_, p);
        high_ = glm::max(high_, p);
    }
    columns_ = static_cast<std::ptrdiff_t>((high_.x - low_.x) / cell_) + 1;
    rows_ = static_cast<std::ptrdiff_t>((high_.z - low_.z) / cell_) + 1;
    tops_.assign(static_cast<std::size_t>(columns_ * rows_), Vec3(0.0, kNothing, 0.0));
    for (const auto& [a, b, c] : triangles) {
        // Points of the triangle no farther apart than a cell.
        const Vec3 u = vertices[b] - vertices[a];
        const Vec3 v = vertices[c] - vertices[a];
        const double longest = std::max({glm::length(u), glm::length(v), glm::length(v - u)});
        const auto parts = static_cast<int>(longest / cell_) + 1;
        for (int i = 0; i <= parts; ++i) {
            for (int j = 0; i + j <= parts; ++j) {
                add(vertices[a] + (static_cast<double>(i) / parts) * u + (static_cast<double>(j) / parts) * v);
            }
        }
    }
}

std::ptrdiff_t Relief::column_of(double x) const noexcept {
    return static_cast<std::ptrdiff_t>(std::floor((x - low_.x) / cell_));
}

std::ptrdiff_t Relief::row_of(double z) const noexcept {
    return static_cast<std::ptrdiff_t>(std::floor((z - low_.z) / cell_));
}

void Relief::add(const Vec3& p) noexcept {
    const std::ptrdiff_t column = std::clamp<std::ptrdiff_t>(column_of(p.x), 0, columns_ - 1);
    const std::ptrdiff_t row = std::clamp<std::ptrdiff_t>(row_of(p.z), 0, rows_ - 1);
    Vec3& top = tops_[static_cast<std::size_t>(row * columns_ + column)];
    if (p.y > top.y) {
        top = p;
    }
}

double Relief::rest_height(double x, double z) const noexcept {
    double height = kNothing;
    const std::ptrdiff_t last_column = std::min(column_of(x + radius_), columns_ - 1);
    const std::ptrdiff_t last_row = std::min(row_of(z + radius_), rows_ - 1);
    for (std::ptrdiff_t row = std::max<std::ptrdiff_t>(row_of(z - radius_), 0); row <= last_row; ++row) {
        for (std::ptrdiff_t column = std::max<std::ptrdiff_t>(column_of(x - radius_), 0); column <= last_column;
             ++column) {
            const Vec3& top = tops_[static_cast<std::size_t>(row * columns_ + column)];
            // The sphere above a point: y + sqrt(r^2 - d^2).
            const double room = radius_ * radius_ - (top.x - x) * (top.x - x) - (top.z - z) * (top.z - z);
            if (room >= 0.0) {
                height = std::max(height, top.y + std::sqrt(room));
            }
        }
    }
    return height;
}

double Relief::slope_at(const Vec3& centre) const noexcept {
    const double apart = 0.5 * radius_;
    double steepest = 0.0;
    for (const auto& [x, z] : {std::pair{apart, 0.0}, {-apart, 0.0}, {0.0, apart}, {0.0, -apart}}) {
        steepest = std::max(steepest, std::abs(rest_height(centre.x + x, centre.z + z) - centre.y) / apart);
    }
    return steepest;
}

Vec3 Relief::best_spot() const {
    const Vec3 middle = 0.5 * (low_ + high_);
    const double half_length = 0.5 * std::max(high_.x - low_.x, high_.z - low_.z);
    Vec3 best(middle.x, kNothing, middle.z);
    double least = std::numeric_limits<double>::infinity();
    for (const Vec3& top : tops_) {
        if (top.y == kNothing) {
            continue;
        }
        const Vec3 centre(top.x, rest_height(top.x, top.z), top.z);
        const double distance = glm::length(Vec3(top.x - middle.x, 0.0, top.z - middle.z)) / half_length;
        // The distance alone is a lower bound: most spots need no slope.
        if (distance >= least) {
            continue;
        }
        const double cost = distance + kSlopeWeight * slope_at(centre);
        if (cost < least) {
            least = cost;
            best = centre;
        }
    }
    return best;
}

}  // namespace haptic::sim
