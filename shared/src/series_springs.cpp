#include "haptic/series_springs.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>

namespace haptic {
namespace {

constexpr std::size_t kUnknowns = 6;
using Vec6 = std::array<double, kUnknowns>;
using Mat6 = std::array<Vec6, kUnknowns>;  // only what is on and below the diagonal

// A step of Newton's counts as good if it brings this part of what its slope promises.
constexpr double kEnough = 1e-4;
constexpr int kMostHalvings = 12;

double dot(const Vec6& a, const Vec6& b) HAPTIC_RT {
    double sum = 0.0;
    for (std::size_t i = 0; i < kUnknowns; ++i) {
        sum += a[i] * b[i];
    }
    return sum;
}

Vec6 ahead(const Vec6& from, double part, const Vec6& step) HAPTIC_RT {
    Vec6 to;
    for (std::size_t i = 0; i < kUnknowns; ++i) {
        to[i] = from[i] + part * step[i];
    }
    return to;
}

/// The function that is minimised, in units of the stiffness: |z|^2 / 2 + sum [s - a z]+^2 / 2 over rows that can act.
// Rows beyond count are not read, and 12 kB need not be cleared in each tick.
// NOLINTNEXTLINE(cppcoreguidelines-pro-type-member-init)
struct Energy {
    struct Row {
        Vec6 a;
        double depth;
        std::uint32_t from;  // its place among the caller's rows
    };
    std::array<Row, kMaxSpringRows> rows;
    std::size_t count = 0;

    struct At {
        Vec6 z;
        double value;
        Vec6 slope;
        std::array<std::uint64_t, kMaxSpringRows / 64> active;
        [[nodiscard]] bool acts(std::size_t row) const HAPTIC_RT {
            return ((active[row / 64] >> (row % 64)) & 1u) != 0;
        }
    };
    static_assert(kMaxSpringRows % 64 == 0);

    [[nodiscard]] At at(const Vec6& z) const HAPTIC_RT {
        At here{z, 0.5 * dot(z, z), z, {}};
        for (std::size_t k = 0; k < count; ++k) {
            const double left = rows[k].depth - dot(rows[k].a, z);
            if (left > 0.0) {
                here.value += 0.5 * left * left;
                here.slope = ahead(here.slope, -left, rows[k].a);
                here.active[k / 64] |= std::uint64_t{1} << (k % 64);
            }
        }
        return here;
    }

    /// -H^-1 slope with H = I + sum a a^T over the rows that act.
    [[nodiscard]] Vec6 newton_step(const At& here) const HAPTIC_RT;
};

Vec6 Energy::newton_step(const At& here) const HAPTIC_RT {
    Mat6 h{};
    for (std::size_t i = 0; i < kUnknowns; ++i) {
        h[i][i] = 1.0;
    }
    for (std::size_t k = 0; k < count; ++k) {
        if (here.acts(k)) {
            const Vec6& a = rows[k].a;
            for (std::size_t i = 0; i < kUnknowns; ++i) {
                for (std::size_t j = 0; j <= i; ++j) {
                    h[i][j] += a[i] * a[j];
                }
            }
        }
    }
    // L D L^T in place; every pivot is at least 1, because H - I is positive semidefinite.
    for (std::size_t i = 0; i < kUnknowns; ++i) {
        for (std::size_t j = 0; j < i; ++j) {
            double sum = h[i][j];
            for (std::size_t m = 0; m < j; ++m) {
                sum -= h[i][m] * h[m][m] * h[j][m];
            }
            h[i][j] = sum / h[j][j];
        }
        for (std::size_t m = 0; m < i; ++m) {
            h[i][i] -= h[i][m] * h[i][m] * h[m][m];
        }
        h[i][i] = std::max(h[i][i], 1.0);
    }
    Vec6 x;
    for (std::size_t i = 0; i < kUnknowns; ++i) {
        x[i] = -here.slope[i];
        for (std::size_t m = 0; m < i; ++m) {
            x[i] -= h[i][m] * x[m];
        }
    }
    for (std::size_t i = kUnknowns; i-- > 0;) {
        x[i] /= h[i][i];
        for (std::size_t m = i + 1; m < kUnknowns; ++m) {
            x[i] -= h[m][i] * x[m];
        }
    }
    return x;
}

}  // namespace

double gyration(double squares, std::size_t count) HAPTIC_RT {
    return count > 0 ? std::sqrt(2.0 / 3.0 * squares / static_cast<double>(count)) : 0.0;
}

Wrench SeriesSprings::solve(std::span<SpringRow> all_rows, const SeriesCoupling& coupling) HAPTIC_RT {
    Wrench wrench;
    stored_ = 0.0;
    rounds_ = 0;
    double squares = 0.0;
    for (SpringRow& row : all_rows) {
        row.push = 0.0;
    }
    const std::span<SpringRow> given = all_rows.first(std::min(all_rows.size(), kMaxSpringRows));
    for (const SpringRow& row : given) {
        squares += row.depth > 0.0 ? row.depth * row.depth : 0.0;
    }
    if (!(squares > 0.0) || !(coupling.stiffness > 0.0)) {
        offset_ = {};
        return wrench;
    }
    const double turn = coupling.gyration * std::sqrt(coupling.torque_stiffness / coupling.stiffness);  // m
    // The minimum is at most what z = 0 gives, so it is within this distance, and many rows cannot act there.
    const double farthest = std::sqrt(squares);
    Energy energy;
    for (std::size_t k = 0; k < given.size(); ++k) {
        const SpringRow& row = given[k];
        const Vec3 angular = turn > 0.0 ? glm::cross(row.lever, row.normal) / turn : Vec3(0.0);
        const double size = std::sqrt(glm::dot(row.normal, row.normal) + glm::dot(angular, angular));
        if (row.depth + size * farthest > 0.0) {
            energy.rows[energy.count++] = {{row.normal.x, row.normal.y, row.normal.z, angular.x, angular.y, angular.z},
                                           row.depth,
                                           static_cast<std::uint32_t>(k)};
        }
    }
    Energy::At here = energy.at(offset_);
    if (!(here.value <= 0.5 * squares)) {
        here = energy.at(Vec6{});
    }
    bool exact = false;
    while (!exact && rounds_ < kMostRounds) {
        ++rounds_;
        const Vec6 step = energy.newton_step(here);
        const double promised = kEnough * dot(here.slope, step);
        double part = 1.0;
        Energy::At there = energy.at(ahead(here.z, part, step));
        exact = there.active == here.active;
        for (int i = 0; !exact && i < kMostHalvings && !(there.value <= here.value + part * promised); ++i) {
            part *= 0.5;
            there = energy.at(ahead(here.z, part, step));
        }
        if (!exact && !(there.value < here.value)) {
            break;  // rounding is all that is left
        }
        here = there;
    }
    offset_ = here.z;
    const Vec3 phi = turn > 0.0 ? Vec3(offset_[3], offset_[4], offset_[5]) / turn : Vec3(0.0);
    stored_ = coupling.stiffness * here.value;
    for (std::size_t k = 0; k < energy.count; ++k) {
        if (here.acts(k)) {
            SpringRow& row = given[energy.rows[k].from];
            row.push = coupling.stiffness * (row.depth - dot(energy.rows[k].a, here.z));
            const Vec3 force = row.push * row.normal;
            wrench.force += force;
            wrench.torque += glm::cross(row.lever, force + glm::cross(force, phi));
        }
    }
    return wrench;
}

}  // namespace haptic
