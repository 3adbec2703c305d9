#include "geometry/wrench_closure.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <utility>

namespace haptic::device {
namespace {

constexpr std::size_t kAxes = 6;
constexpr std::size_t kSpare = kStrings - kAxes;  // dimensions of the tensions that cancel

// Of the wire matrix with torques at the grip's radius: entries are about 1, and a pivot that small is lost freedom.
constexpr double kLeastPivot = 1e-6;
// Of a vertex: by so much, in units of the constraints (their rows have entries of about 1), it may miss one of them.
constexpr double kFeasible = 1e-9;
// A determinant of three rows below this makes no vertex.
constexpr double kLeastDeterminant = 1e-12;
// Evenness below this is that of a frame which is closed only by rounding.
constexpr double kLeastEvenness = 1e-6;

constexpr std::array<const char*, kAxes> kAxisNames = {"Fx", "Fy", "Fz", "Tx", "Ty", "Tz"};

using Tensions = std::array<double, kStrings>;

/// Wire matrix transposed, with torques divided by `radius`.
std::array<Tensions, kAxes> wires(const Variant& variant, const Pose& pose, double radius) {
    std::array<Tensions, kAxes> rows{};
    for (std::size_t i = 0; i < kStrings; ++i) {
        const Vec3 arm = pose.orientation * variant.strings[i].grip;
        const Vec3 span = variant.strings[i].motor - pose.position - arm;
        const double length = glm::length(span);
        const Vec3 direction = length > 0.0 ? span / length : Vec3(0.0);
        const Vec3 moment = glm::cross(arm, direction) / radius;
        for (int k = 0; k < 3; ++k) {
            rows[static_cast<std::size_t>(k)][i] = direction[k];
            rows[static_cast<std::size_t>(k) + 3][i] = moment[k];
        }
    }
    return rows;
}

/// All tensions that make a wrench: particular + null[0] z0 + null[1] z1.
struct TensionFamily {
    Tensions particular{};
    std::array<Tensions, kSpare> null{};
};

/// Gauss-Jordan with full pivoting. Nothing if the rank is below 6.
std::optional<TensionFamily> family_of(std::array<Tensions, kAxes> rows, WrenchVector wrench) {
    std::array<std::size_t, kStrings> order{};
    for (std::size_t i = 0; i < kStrings; ++i) {
        order[i] = i;
    }
    for (std::size_t k = 0; k < kAxes; ++k) {
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
        const double pivot = rows[k][order[k]];
        if (!(std::fabs(pivot) > kLeastPivot)) {
            return std::nullopt;
        }
        for (std::size_t c = 0; c < kStrings; ++c) {
            rows[k][c] /= pivot;
        }
        wrench[k] /= pivot;
        for (std::size_t r = 0; r < kAxes; ++r) {
            if (r == k) {
                continue;
            }
            const double factor = rows[r][order[k]];
            for (std::size_t c = 0; c < kStrings; ++c) {
                rows[r][c] -= factor * rows[k][c];
            }
            wrench[r] -= factor * wrench[k];
        }
    }
    TensionFamily family;
    for (std::size_t k = 0; k < kAxes; ++k) {
        family.particular[order[k]] = wrench[k];
        for (std::size_t s = 0; s < kSpare; ++s) {
            family.null[s][order[k]] = -rows[k][order[kAxes + s]];
        }
    }
    for (std::size_t s = 0; s < kSpare; ++s) {
        family.null[s][order[kAxes + s]] = 1.0;
    }
    return family;
}

/// dot(normal, x) <= most.
struct Constraint {
    Vec3 normal;
    double most;
};

/// The largest x.z over all x that keep every constraint; nothing if none does. There must be a vertex, and a largest
/// value: both hold where the constraints say something of every direction, as all those below do.
std::optional<double> maximise_last(const std::vector<Constraint>& constraints) {
    std::optional<double> best;
    for (std::size_t a = 0; a < constraints.size(); ++a) {
        for (std::size_t b = a + 1; b < constraints.size(); ++b) {
            const Vec3 line = glm::cross(constraints[a].normal, constraints[b].normal);
            for (std::size_t c = b + 1; c < constraints.size(); ++c) {
                const double determinant = glm::dot(line, constraints[c].normal);
                if (!(std::fabs(determinant) > kLeastDeterminant)) {
                    continue;
                }
                const Vec3 vertex = (constraints[a].most * glm::cross(constraints[b].normal, constraints[c].normal) +
                                     constraints[b].most * glm::cross(constraints[c].normal, constraints[a].normal) +
                                     constraints[c].most * line) /
                                    determinant;
                if (best && !(vertex.z > *best)) {
                    continue;
                }
                const bool kept = std::all_of(constraints.begin(), constraints.end(), [&](const Constraint& one) {
                    return glm::dot(one.normal, vertex) <= one.most + kFeasible * std::max(1.0, std::fabs(one.most));
                });
                if (kept) {
                    best = vertex.z;
                }
            }
        }
    }
    return best;
}

/// max s over z, s:  N z >= s, N z <= 1.
double evenness_of(const TensionFamily& family) {
    std::vector<Constraint> constraints;
    for (std::size_t i = 0; i < kStrings; ++i) {
        constraints.push_back({{-family.null[0][i], -family.null[1][i], 1.0}, 0.0});
        constraints.push_back({{family.null[0][i], family.null[1][i], 0.0}, 1.0});
    }
    const double evenness = maximise_last(constraints).value_or(0.0);
    return evenness > kLeastEvenness ? evenness : 0.0;
}

/// Whether some t >= 0 makes the family's wrench: max s over z, s with t_w + N z >= s, s <= 1 is 0 or more.
bool can_pull(const TensionFamily& family) {
    std::vector<Constraint> constraints{{{0.0, 0.0, 1.0}, 1.0}};
    for (std::size_t i = 0; i < kStrings; ++i) {
        constraints.push_back({{-family.null[0][i], -family.null[1][i], 1.0}, family.particular[i]});
    }
    return maximise_last(constraints).value_or(-1.0) >= -kFeasible;
}

double radius_of(const Variant& variant) {
    double radius = 0.0;
    for (const StringFacts& string : variant.strings) {
        radius = std::max(radius, glm::length(string.grip));
    }
    return radius > 0.0 ? radius : 1.0;
}

}  // namespace

WrenchClosure wrench_closure(const Variant& variant, const Pose& device_from_grip) {
    WrenchClosure closure;
    const std::array<Tensions, kAxes> rows = wires(variant, device_from_grip, radius_of(variant));
    const std::optional<TensionFamily> none = family_of(rows, {});
    closure.determined = none.has_value();
    if (!none) {
        return closure;
    }
    closure.evenness = evenness_of(*none);
    if (closure.closed()) {
        return closure;
    }
    for (std::size_t k = 0; k < kAxes; ++k) {
        for (const double sign : {1.0, -1.0}) {
            WrenchVector wrench{};
            wrench[k] = sign;
            const std::optional<TensionFamily> family = family_of(rows, wrench);
            if (!family || !can_pull(*family)) {
                closure.missing.push_back(std::string(sign > 0.0 ? "+" : "-") + kAxisNames[k]);
            }
        }
    }
    return closure;
}

std::optional<double> wrench_reach(const Variant& variant, const Pose& device_from_grip,
                                   const WrenchVector& direction) {
    const double radius = radius_of(variant);
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
    // In units of the largest tension and the largest component, so that all numbers are about 1.
    for (double& component : scaled) {
        component /= size;
    }
    const std::optional<TensionFamily> family = family_of(wires(variant, device_from_grip, radius), scaled);
    if (!family) {
        return std::nullopt;
    }
    const double least = variant.minimum_tension / variant.maximum_tension;
    std::vector<Constraint> constraints;
    for (std::size_t i = 0; i < kStrings; ++i) {
        const Vec3 row(family->null[0][i], family->null[1][i], family->particular[i]);
        constraints.push_back({row, 1.0});
        constraints.push_back({-row, -least});
    }
    const std::optional<double> factor = maximise_last(constraints);
    if (!factor || *factor < 0.0) {
        return std::nullopt;
    }
    return *factor * variant.maximum_tension / size;
}

}  // namespace haptic::device
