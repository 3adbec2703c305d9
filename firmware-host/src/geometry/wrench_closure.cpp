#include "haptic/device/wrench_closure.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <utility>

namespace haptic::device {
namespace {

constexpr std::size_t kAxes = 6;
constexpr std::size_t kNullity = kStrings - kAxes;  // dimension of the tensions that cancel

// Pivot of the wire matrix, scaled to entries of about 1: a smaller one means that the rank is below 6.
constexpr double kMinPivot = 1e-6;
// Tolerance by which a vertex may violate a constraint, in units of the constraints (entries of about 1).
constexpr double kFeasible = 1e-9;
// Three constraints with a smaller determinant have no vertex.
constexpr double kMinDeterminant = 1e-12;
// A smaller tension factor is a rounding error of 0.
constexpr double kMinTensionFactor = 1e-6;

constexpr std::array<const char*, kAxes> kAxisNames = {"Fx", "Fy", "Fz", "Tx", "Ty", "Tz"};

using Tensions = std::array<double, kStrings>;

/// Transposed wire matrix, torques divided by `radius` so that all entries are about 1.
std::array<Tensions, kAxes> wire_matrix(const DeviceGeometry& geometry, const Pose& pose, double radius) {
    std::array<Tensions, kAxes> rows{};
    for (std::size_t i = 0; i < kStrings; ++i) {
        // Column i: [u_i, r_i x u_i / radius].
        const Vec3 moment_arm = pose.orientation * geometry.strings[i].grip;
        const Vec3 span = geometry.strings[i].motor - pose.position - moment_arm;
        const double length = glm::length(span);
        const Vec3 direction = length > 0.0 ? span / length : Vec3(0.0);
        const Vec3 moment = glm::cross(moment_arm, direction) / radius;
        for (int k = 0; k < 3; ++k) {
            rows[static_cast<std::size_t>(k)][i] = direction[k];
            rows[static_cast<std::size_t>(k) + 3][i] = moment[k];
        }
    }
    return rows;
}

/// All tensions that exert a wrench: particular + null[0] z0 + null[1] z1, that is t_w + N z.
struct TensionFamily {
    Tensions particular{};
    std::array<Tensions, kNullity> null{};
};

/// Gauss-Jordan elimination with full pivoting. Empty if the rank is below 6.
std::optional<TensionFamily> family_of(std::array<Tensions, kAxes> rows, WrenchVector wrench) {
    // Columns are exchanged by renumbering: order[c] is the string in column c.
    std::array<std::size_t, kStrings> order{};
    for (std::size_t i = 0; i < kStrings; ++i) {
        order[i] = i;
    }
    for (std::size_t k = 0; k < kAxes; ++k) {
        // Largest remaining entry, moved to row and column k. `order` maps columns to strings.
        std::size_t row = k;
        std::size_t column = k;
        for (std::size_t r = k; r < kAxes; ++r) {
            for (std::size_t c = k; c < kStrings; ++c) {
                if (std::fabs(rows[r][order[c]]) > std::fabs(rows[row][order[column]])) {
                    row = r;
                    column = c;
                }
            }
        }
        std::swap(rows[k], rows[row]);
        std::swap(wrench[k], wrench[row]);
        std::swap(order[k], order[column]);
        // No pivot left: the strings span fewer than six axes here.
        const double pivot = rows[k][order[k]];
        if (!(std::fabs(pivot) > kMinPivot)) {
            return std::nullopt;
        }
        // Normalise row k and eliminate its column from all other rows.
        for (std::size_t c = 0; c < kStrings; ++c) {
            rows[k][c] /= pivot;
        }
        wrench[k] /= pivot;
        for (std::size_t r = 0; r < kAxes; ++r) {
            if (r == k) {
                continue;
            }
            // Row r minus factor times row k clears column k.
            const double factor = rows[r][order[k]];
            for (std::size_t c = 0; c < kStrings; ++c) {
                rows[r][c] -= factor * rows[k][c];
            }
            wrench[r] -= factor * wrench[k];
        }
    }
    // The rows are now [I, B] with respect to the pivot columns: t_pivot = w - B z, where z are the two other tensions.
    TensionFamily family;
    for (std::size_t k = 0; k < kAxes; ++k) {
        family.particular[order[k]] = wrench[k];
        // Null vector s: the s-th free tension is 1 and the other 0.
        for (std::size_t s = 0; s < kNullity; ++s) {
            family.null[s][order[k]] = -rows[k][order[kAxes + s]];
        }
    }
    for (std::size_t s = 0; s < kNullity; ++s) {
        family.null[s][order[kAxes + s]] = 1.0;
    }
    return family;
}

/// dot(normal, x) <= bound.
struct Constraint {
    Vec3 normal;
    double bound;
};

/// Largest x.z over all x that satisfy every constraint; empty if none does. Precondition: the feasible set has a
/// vertex and x.z is bounded from above. Both hold below: the normals span the space, and every programme limits x.z.
std::optional<double> maximise_last(const std::vector<Constraint>& constraints) {
    // The maximum of a linear programme lies at a vertex: try every intersection of three constraints.
    std::optional<double> best;
    for (std::size_t a = 0; a < constraints.size(); ++a) {
        for (std::size_t b = a + 1; b < constraints.size(); ++b) {
            const Vec3 line = glm::cross(constraints[a].normal, constraints[b].normal);
            for (std::size_t c = b + 1; c < constraints.size(); ++c) {
                // The planes of three dependent constraints have no common point.
                const double determinant = glm::dot(line, constraints[c].normal);
                if (!(std::fabs(determinant) > kMinDeterminant)) {
                    continue;
                }
                // Cramer's rule for the intersection of the planes a, b and c.
                const Vec3 vertex = (constraints[a].bound * glm::cross(constraints[b].normal, constraints[c].normal) +
                                     constraints[b].bound * glm::cross(constraints[c].normal, constraints[a].normal) +
                                     constraints[c].bound * line) /
                                    determinant;
                // The feasibility test is the expensive part: skip vertices that cannot improve the maximum.
                if (best && !(vertex.z > *best)) {
                    continue;
                }
                const bool feasible = std::all_of(constraints.begin(), constraints.end(), [&](const Constraint& other) {
                    return glm::dot(other.normal, vertex) <=
                           other.bound + kFeasible * std::max(1.0, std::fabs(other.bound));
                });
                if (feasible) {
                    best = vertex.z;
                }
            }
        }
    }
    return best;
}

/// Tension factor: max s over z, s with N z >= s, N z <= 1 (the largest tension is scaled to 1).
double tension_factor_of(const TensionFamily& family) {
    std::vector<Constraint> constraints;
    for (std::size_t i = 0; i < kStrings; ++i) {
        // s - (N z)_i <= 0 and (N z)_i <= 1.
        constraints.push_back({{-family.null[0][i], -family.null[1][i], 1.0}, 0.0});
        constraints.push_back({{family.null[0][i], family.null[1][i], 0.0}, 1.0});
    }
    // z = 0, s = 0 is always feasible, so an s of rounding size means zero.
    const double factor = maximise_last(constraints).value_or(0.0);
    return factor > kMinTensionFactor ? factor : 0.0;
}

/// Whether some t >= 0 exerts the family's wrench: max s over z, s with t_w + N z >= s, s <= 1 is not negative.
bool is_feasible(const TensionFamily& family) {
    std::vector<Constraint> constraints{{{0.0, 0.0, 1.0}, 1.0}};
    for (std::size_t i = 0; i < kStrings; ++i) {
        // s - (N z)_i <= (t_w)_i.
        constraints.push_back({{-family.null[0][i], -family.null[1][i], 1.0}, family.particular[i]});
    }
    return maximise_last(constraints).value_or(-1.0) >= -kFeasible;
}

/// Largest distance of a knot from the grip's origin, m: the unit of moment arms.
double radius_of(const DeviceGeometry& geometry) {
    double radius = 0.0;
    for (const StringFacts& string : geometry.strings) {
        radius = std::max(radius, glm::length(string.grip));
    }
    return radius > 0.0 ? radius : 1.0;
}

}  // namespace

WrenchClosure wrench_closure(const DeviceGeometry& geometry, const Pose& device_from_grip) {
    // Tensions that cancel: those that make the zero wrench.
    WrenchClosure closure;
    const std::array<Tensions, kAxes> rows = wire_matrix(geometry, device_from_grip, radius_of(geometry));
    const std::optional<TensionFamily> cancelling = family_of(rows, {});
    closure.determined = cancelling.has_value();
    if (!cancelling) {
        return closure;
    }
    // A positive factor: tensions that are all positive cancel, so the strings can make every wrench.
    closure.tension_factor = tension_factor_of(*cancelling);
    if (closure.closed()) {
        return closure;
    }
    // Not closed: test each unit force and torque of either sign.
    for (std::size_t k = 0; k < kAxes; ++k) {
        for (const double sign : {1.0, -1.0}) {
            // Axis k is missing if no tensions >= 0 make its unit wrench.
            WrenchVector wrench{};
            wrench[k] = sign;
            const std::optional<TensionFamily> family = family_of(rows, wrench);
            if (!family || !is_feasible(*family)) {
                closure.missing.push_back(std::string(sign > 0.0 ? "+" : "-") + kAxisNames[k]);
            }
        }
    }
    return closure;
}

std::optional<double> wrench_reach(const DeviceGeometry& geometry, const Pose& device_from_grip,
                                   const WrenchVector& direction) {
    // Torques in the same unit as forces, like the wire matrix.
    const double radius = radius_of(geometry);
    WrenchVector scaled = direction;
    for (std::size_t k = 3; k < kAxes; ++k) {
        scaled[k] /= radius;
    }
    double size = 0.0;
    for (const double component : scaled) {
        size = std::max(size, std::fabs(component));
    }
    if (!(size > 0.0) || !std::isfinite(size)) {
        return std::nullopt;
    }
    // Normalise the wrench to its largest component and tensions to maximum_tension, so that all numbers are about 1.
    for (double& component : scaled) {
        component /= size;
    }
    const std::optional<TensionFamily> family = family_of(wire_matrix(geometry, device_from_grip, radius), scaled);
    if (!family) {
        return std::nullopt;
    }
    // max f over z, f with minimum <= N z + f t_w <= 1 for every string.
    const double minimum = geometry.minimum_tension / geometry.maximum_tension;
    std::vector<Constraint> constraints;
    for (std::size_t i = 0; i < kStrings; ++i) {
        // Upper and lower bound of string i.
        const Vec3 row(family->null[0][i], family->null[1][i], family->particular[i]);
        constraints.push_back({row, 1.0});
        constraints.push_back({-row, -minimum});
    }
    const std::optional<double> factor = maximise_last(constraints);
    if (!factor || *factor < 0.0) {
        return std::nullopt;
    }
    // Undo both normalisations.
    return *factor * geometry.maximum_tension / size;
}

std::optional<double> share_of_reach(const DeviceGeometry& geometry, const Pose& device_from_grip,
                                     const Wrench& wrench) {
    const auto& [force, torque] = wrench;
    const std::optional<double> reach =
        wrench_reach(geometry, device_from_grip, {force.x, force.y, force.z, torque.x, torque.y, torque.z});
    return reach && *reach > 0.0 ? std::optional(1.0 / *reach) : std::nullopt;
}

}  // namespace haptic::device
