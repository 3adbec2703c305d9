#include "rendering/coupling_bound.hpp"

#include <algorithm>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <numeric>

namespace haptic {
namespace {

// As parts of the row's own compliance. Smallest pivot: below the share of a surface.
constexpr double kMinPivot = 1e-4;
// A pivot that is less negative than this is 0 but for the rounding of W to floats, which earlier pivots amplify.
constexpr double kRounding = 1e-2;
// Part of the mean of |o|^2: proxies nearer together than this are at one point.
constexpr double kAtOnePoint = 1e-12;

/// Distribution of the rest offsets.
struct Spread {
    Vec3 centre{0.0, 0.0, 0.0};  // m, c
    double mean_square = 0.0;    // m^2, of |o_i|
};

std::span<const ProxyContact> proxies_of(const ContactFrame& frame) HAPTIC_RT {
    return std::span(frame.proxies).first(std::min<std::size_t>(frame.proxy_count, kMaxProxies));
}

Spread spread_of(const ContactFrame& frame) HAPTIC_RT {
    Spread sum;
    for (const ProxyContact& proxy : proxies_of(frame)) {
        const Vec3 offset = to_vec3(proxy.rest_offset);
        sum.centre += offset;
        sum.mean_square += glm::dot(offset, offset);
    }
    const double count = std::max(1.0, static_cast<double>(proxies_of(frame).size()));
    return {sum.centre / count, sum.mean_square / count};
}

}  // namespace

double torque_stiffness_of(const ContactFrame& frame) HAPTIC_RT {
    return frame.torque_stiffness > 0.0 ? frame.torque_stiffness : frame.stiffness;
}

double rotational_stiffness_bound(const ContactFrame& frame) HAPTIC_RT {
    // j = <|o|^2> - |c|^2
    const Spread spread = spread_of(frame);
    const double k_t = torque_stiffness_of(frame);
    return k_t * spread.mean_square + (frame.stiffness - k_t) * glm::dot(spread.centre, spread.centre);
}

CouplingBound::CouplingBound()
    : direction_(kMaxComplianceRows),
      moment_(kMaxComplianceRows),
      verified_(kMaxComplianceRows),
      order_(kMaxComplianceRows),
      reduced_(kMaxComplianceRows),
      factor_(kMaxComplianceRows) {}

void CouplingBound::load(const ContactFrame& frame, std::span<const FrameRow> rows,
                         const Quat& device_from_grip) HAPTIC_RT {
    count_ = std::min(rows.size(), kMaxComplianceRows);
    springs_added_ = false;
    clear_factor();
    // Directions, and moments about the centre.
    const Spread spread = spread_of(frame);
    const Mat3 rotation = glm::mat3_cast(device_from_grip);
    for (std::size_t r = 0; r < count_; ++r) {
        direction_[r] = rows[r].direction;
        const Vec3 arm = rotation * (to_vec3(frame.proxies[rows[r].proxy].rest_offset) - spread.centre);
        moment_[r] = glm::cross(arm, rows[r].direction);
    }
    const double j = spread.mean_square - glm::dot(spread.centre, spread.centre);
    of_rotation_ = j > kAtOnePoint * spread.mean_square ? frame.stiffness / (torque_stiffness_of(frame) * j) : 0.0;
}

bool CouplingBound::enforce(ComplianceMatrix& compliance, std::span<const double> force) HAPTIC_RT {
    for (std::size_t row = 0; row < std::min(count_, force.size()); ++row) {
        if (force[row] == 0.0 || verified_[row] != 0) {
            continue;
        }
        const double least = kMinPivot * compliance(row, row);
        const double pivot = reduce(compliance, row);
        if (!(pivot >= least)) {
            // A pivot of 0 is that of a rigid tool whose rows depend on one another; a smaller one lacks the springs.
            if (!(pivot >= -kRounding * compliance(row, row))) {
                add_springs(compliance);
            }
            complete(compliance);
            return true;
        }
        append(row, pivot);
    }
    return false;
}

double CouplingBound::translation(std::size_t r, std::size_t s) const HAPTIC_RT {
    return glm::dot(direction_[r], direction_[s]);
}

double CouplingBound::rotation(std::size_t r, std::size_t s) const HAPTIC_RT {
    return of_rotation_ * glm::dot(moment_[r], moment_[s]);
}

/// B_rs with the excesses that pass.
double CouplingBound::required(std::size_t r, std::size_t s) const HAPTIC_RT {
    return translation(r, s) / (1.0 + kTranslationExcess) + rotation(r, s) / (1.0 + kRotationExcess);
}

/// Leaves the row's column of the factor in reduced_, and returns its pivot.
double CouplingBound::reduce(const ComplianceMatrix& compliance, std::size_t row) HAPTIC_RT {
    const double* const elements = compliance.row(row);
    for (std::size_t i = 0; i < factor_.size(); ++i) {
        reduced_[i] = elements[order_[i]] - required(row, order_[i]);
    }
    factor_.solve_transposed(reduced_.data());
    const auto end = reduced_.begin() + static_cast<std::ptrdiff_t>(factor_.size());
    return elements[row] - required(row, row) - std::inner_product(reduced_.begin(), end, reduced_.begin(), 0.0);
}

void CouplingBound::append(std::size_t row, double pivot) HAPTIC_RT {
    order_[factor_.size()] = static_cast<std::uint16_t>(row);
    factor_.append(reduced_.data(), pivot);
    verified_[row] = 1;
}

/// k W + B. Rows without compliance, those of tangents without friction, stay so.
void CouplingBound::add_springs(ComplianceMatrix& compliance) HAPTIC_RT {
    springs_added_ = true;
    for (std::size_t r = 0; r < count_; ++r) {
        for (std::size_t s = 0; s <= r; ++s) {
            if (compliance(r, r) > 0.0 && compliance(s, s) > 0.0) {
                compliance.set(r, s, compliance(r, s) + translation(r, s) + rotation(r, s));
            }
        }
    }
}

/// Factor of all rows, each with the share of a surface. Rows without a sufficient pivot change.
void CouplingBound::complete(ComplianceMatrix& compliance) HAPTIC_RT {
    clear_factor();
    for (std::size_t row = 0; row < count_; ++row) {
        const double diagonal = (1.0 + kSurfaceShare) * compliance(row, row);
        if (!(diagonal > 0.0)) {
            continue;
        }
        compliance.set(row, row, diagonal);
        const double least = kMinPivot * diagonal;
        double pivot = reduce(compliance, row);
        if (!(pivot >= least)) {
            // Coupled to all others by the springs alone: its column of k W - B is 0.
            for (std::size_t s = 0; s < count_; ++s) {
                if (s != row && compliance(s, s) > 0.0) {
                    compliance.set(row, s, required(row, s));
                }
            }
            compliance.set(row, row, std::max(diagonal, required(row, row) + least));
            pivot = reduce(compliance, row);
        }
        append(row, pivot);
    }
}

void CouplingBound::clear_factor() HAPTIC_RT {
    factor_.clear();
    std::fill_n(verified_.begin(), count_, std::uint8_t{0});
}

}  // namespace haptic
