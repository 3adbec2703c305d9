#include "device/reachable_region.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <limits>
#include <numbers>
#include <numeric>
#include <vector>

#include "device/kinematics.hpp"

namespace haptic::rt {
namespace {

constexpr std::size_t kAxes = 6;
constexpr double kMarginShare = 0.05;                     // of the margin at the centre
constexpr double kLengthShare = 0.25;                     // of each string's length at the centre
constexpr double kLargestAngle = std::numbers::pi / 3.0;  // rad
constexpr double kAngleForPositions = 0.5;                // of the angle that the centre alone allows
constexpr double kResolution = 0.5e-3;                    // m
constexpr int kDirections = 40;                           // of sampled positions

/// Vector orthogonal to five columns: the null vector of their 5 x 6 matrix; zero if they are dependent.
Vec6 normal_of(std::array<Vec6, kAxes - 1> rows) {
    std::array<std::size_t, kAxes> order{0, 1, 2, 3, 4, 5};
    for (std::size_t k = 0; k < rows.size(); ++k) {
        // Full pivoting: the largest remaining entry to row k, column order[k].
        std::size_t row = k;
        std::size_t column = k;
        for (std::size_t r = k; r < rows.size(); ++r) {
            for (std::size_t c = k; c < kAxes; ++c) {
                if (std::fabs(rows[r][order[c]]) > std::fabs(rows[row][order[column]])) {
                    row = r;
                    column = c;
                }
            }
        }
        std::swap(rows[k], rows[row]);
        std::swap(order[k], order[column]);
        const double pivot = rows[k][order[k]];
        if (std::fabs(pivot) < 1e-9) {
            return {};
        }
        // Gauss-Jordan: column order[k] becomes a unit vector.
        for (double& entry : rows[k]) {
            entry /= pivot;
        }
        for (std::size_t r = 0; r < rows.size(); ++r) {
            const double factor = r == k ? 0.0 : rows[r][order[k]];
            for (std::size_t c = 0; c < kAxes; ++c) {
                rows[r][c] -= factor * rows[k][c];
            }
        }
    }
    // The free column is 1; each pivot row gives the negative of its entry there.
    Vec6 normal{};
    normal[order[5]] = 1.0;
    for (std::size_t k = 0; k < rows.size(); ++k) {
        normal[order[k]] = -rows[k][order[5]];
    }
    double squared = 0.0;
    for (const double entry : normal) {
        squared += entry * entry;
    }
    for (double& entry : normal) {
        entry /= std::sqrt(squared);
    }
    return normal;
}

double grip_radius(const device::DeviceGeometry& geometry) {
    double radius = 0.0;
    for (const device::StringFacts& string : geometry.strings) {
        radius = std::max(radius, glm::length(string.grip));
    }
    return radius > 0.0 ? radius : 1.0;
}

StringArray lengths_at(const device::DeviceGeometry& geometry, const Pose& pose) {
    StringArray lengths{};
    for (std::size_t i = 0; i < kStrings; ++i) {
        const device::StringFacts& string = geometry.strings[i];
        lengths[i] = glm::length(string.motor - pose.position - pose.orientation * string.grip);
    }
    return lengths;
}

/// Whether a pose is reachable, compared with the centre.
class ReachJudge {
  public:
    explicit ReachJudge(const device::DeviceGeometry& geometry)
        : geometry_(geometry), margin_(wrench_margin(geometry, Pose{})), lengths_(lengths_at(geometry, Pose{})) {}

    [[nodiscard]] bool centre() const { return margin_ > 0.0; }
    [[nodiscard]] bool reachable(const Pose& pose) const {
        const StringArray lengths = lengths_at(geometry_, pose);
        for (std::size_t i = 0; i < kStrings; ++i) {
            if (lengths[i] < kLengthShare * lengths_[i]) {
                return false;
            }
        }
        return wrench_margin(geometry_, pose) >= kMarginShare * margin_;
    }
    /// At this position, unrotated and rotated by the angle about the three axes and the four diagonals, both ways.
    [[nodiscard]] bool reachable(const Vec3& position, double angle) const {
        if (!reachable(Pose{position, Quat(1.0, 0.0, 0.0, 0.0)})) {
            return false;
        }
        for (int code = 0; code < 27; ++code) {
            const Vec3 axis(code % 3 - 1, code / 3 % 3 - 1, code / 9 - 1);
            const double squared = glm::dot(axis, axis);
            if ((squared == 1.0 || squared == 3.0) &&
                !reachable(Pose{position, glm::angleAxis(angle, glm::normalize(axis))})) {
                return false;
            }
        }
        return true;
    }

  private:
    const device::DeviceGeometry& geometry_;
    double margin_;
    StringArray lengths_;
};

/// Largest value up to `most` that holds, to a resolution; 0 if none does.
template <typename Holds>
double largest(double most, double resolution, const Holds& holds) {
    double good = 0.0;
    double bad = most;
    if (holds(most)) {
        return most;
    }
    while (bad - good > resolution) {
        const double middle = 0.5 * (good + bad);
        (holds(middle) ? good : bad) = middle;
    }
    return good;
}

/// Directions spread evenly over the sphere (Fibonacci lattice).
std::vector<Vec3> directions() {
    std::vector<Vec3> result;
    const double golden = std::numbers::pi * (3.0 - std::sqrt(5.0));
    for (int k = 0; k < kDirections; ++k) {
        const double y = 1.0 - 2.0 * (k + 0.5) / kDirections;
        const double radius = std::sqrt(1.0 - y * y);
        result.emplace_back(radius * std::cos(golden * k), y, radius * std::sin(golden * k));
    }
    return result;
}

}  // namespace

double wrench_margin(const device::DeviceGeometry& geometry, const Pose& device_from_grip) {
    // Columns of A^T, torques by the grip's radius.
    const WireMatrix wires = wire_matrix(geometry, device_from_grip);
    const double radius = grip_radius(geometry);
    std::array<Vec6, kStrings> columns{};
    for (std::size_t i = 0; i < kStrings; ++i) {
        for (std::size_t k = 0; k < kAxes; ++k) {
            columns[i][k] = k < 3 ? wires[i][k] : wires[i][k] / radius;
        }
    }
    // Five strings span a facet; the three others, the bits of `left_out`, set its distance.
    double margin = std::numeric_limits<double>::infinity();
    for (unsigned left_out = 0; left_out < 256; ++left_out) {
        if (__builtin_popcount(left_out) != 3) {
            continue;
        }
        std::array<Vec6, kAxes - 1> spanning{};
        std::size_t count = 0;
        for (std::size_t i = 0; i < kStrings; ++i) {
            if ((left_out >> i & 1U) == 0) {
                spanning[count++] = columns[i];
            }
        }
        const Vec6 normal = normal_of(spanning);
        if (normal == Vec6{}) {
            continue;  // five dependent strings span no facet
        }
        // Support of the zonotope along the normal, and against it.
        double along = 0.0;
        double against = 0.0;
        for (const Vec6& column : columns) {
            const double part = std::inner_product(normal.begin(), normal.end(), column.begin(), 0.0);
            along += part * (part > 0.0 ? geometry.maximum_tension : geometry.minimum_tension);
            against -= part * (part > 0.0 ? geometry.minimum_tension : geometry.maximum_tension);
        }
        margin = std::min({margin, along, against});
    }
    return std::isfinite(margin) ? margin : 0.0;
}

ReachableRegion reachable_region(const device::DeviceGeometry& geometry) {
    const ReachJudge judge(geometry);
    ReachableRegion region;
    if (!judge.centre()) {
        return region;
    }
    // Angle: a part of what the centre alone allows, so that room is left for positions.
    const double angle =
        kAngleForPositions * largest(kLargestAngle, 0.01, [&](double a) { return judge.reachable(Vec3(0.0), a); });
    // Proportions: how far the grip reaches along each axis, both ways.
    Vec3 extent(0.0);
    const StringArray lengths = lengths_at(geometry, Pose{});
    const double farthest = *std::max_element(lengths.begin(), lengths.end());
    for (int k = 0; k < 3; ++k) {
        extent[k] = largest(farthest, kResolution, [&](double distance) {
            Vec3 position(0.0);
            position[k] = distance;
            return judge.reachable(position, angle) && judge.reachable(-position, angle);
        });
    }
    // Scale: as large as every sampled position of the ellipsoid allows.
    const std::vector<Vec3> sampled = directions();
    const double scale = largest(1.0, 0.02, [&](double s) {
        return std::all_of(sampled.begin(), sampled.end(),
                           [&](const Vec3& direction) { return judge.reachable(s * (direction * extent), angle); });
    });
    if (scale > 0.0 && angle > 0.0 && std::min({extent.x, extent.y, extent.z}) > 0.0) {
        region = {.semi_axes = scale * extent, .angle = angle};
    }
    return region;
}

}  // namespace haptic::rt
