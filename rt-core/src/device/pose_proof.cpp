#include "device/pose_proof.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

namespace haptic::rt {
namespace {

using Mat6 = std::array<Vec6, 6>;

// Samples whose noise must be exceeded before anything counts as visible.
constexpr double kFewSamples = 10.0;

// A mix-up must leave less than this share of the squares to be named.
constexpr double kMuchBetter = 0.5;

// Pivot of a Cholesky factor, relative to the diagonal, below which the matrix counts as singular.
constexpr double kSmallestPivot = 1e-9;

/// Replaces the lower triangle of a by its Cholesky factor. False if a is not safely positive definite.
bool factorise(Mat6& a) HAPTIC_RT {
    for (std::size_t j = 0; j < 6; ++j) {
        double pivot = a[j][j];
        for (std::size_t k = 0; k < j; ++k) {
            pivot -= a[j][k] * a[j][k];
        }
        if (!(pivot > kSmallestPivot * a[j][j])) {
            return false;
        }
        a[j][j] = std::sqrt(pivot);
        for (std::size_t i = j + 1; i < 6; ++i) {
            double sum = a[i][j];
            for (std::size_t k = 0; k < j; ++k) {
                sum -= a[i][k] * a[j][k];
            }
            a[i][j] = sum / a[j][j];
        }
    }
    return true;
}

/// Forward substitution L y = b.
Vec6 solve_lower(const Mat6& factor, const Vec6& b) HAPTIC_RT {
    Vec6 y = b;
    for (std::size_t i = 0; i < 6; ++i) {
        for (std::size_t k = 0; k < i; ++k) {
            y[i] -= factor[i][k] * y[k];
        }
        y[i] /= factor[i][i];
    }
    return y;
}

/// Back substitution L^T x = y.
Vec6 solve_upper(const Mat6& factor, const Vec6& y) HAPTIC_RT {
    Vec6 x = y;
    for (std::size_t i = 6; i-- > 0;) {
        for (std::size_t k = i + 1; k < 6; ++k) {
            x[i] -= factor[k][i] * x[k];
        }
        x[i] /= factor[i][i];
    }
    return x;
}

double length_of(double x, double y, double z) HAPTIC_RT {
    return std::sqrt(x * x + y * y + z * z);
}

void require(double value, const char* name) {
    if (!(value > 0.0) || !std::isfinite(value)) {
        throw std::invalid_argument(std::string("pose proof: ") + name + " must be positive and finite");
    }
}

}  // namespace

PoseProof::PoseProof(const device::DeviceGeometry& geometry, const PoseProofSettings& settings)
    : settings_(settings), centre_(wire_matrix(geometry, Pose{})) {
    require(settings.position, "position");
    require(settings.angle, "angle");
    require(settings.certainty, "certainty");
    require(settings.length_error, "length_error");
    require(settings.unexplained, "unexplained");
    require(settings.visible, "visible");
    require(settings.spacing, "spacing");
    // W_0 for offsets in units of the limits.
    for (Vec6& row : centre_) {
        for (std::size_t i = 0; i < 6; ++i) {
            row[i] *= i < 3 ? settings.position : settings.angle;
        }
    }
    for (std::size_t i = 0; i < kStrings; ++i) {
        rest_[i] = geometry.rest_length(i);
    }
    reset();
}

void PoseProof::reset() HAPTIC_RT {
    information_ = Mat6{};
    evidence_ = Vec6{};
    squares_ = 0.0;
    std::size_t next = 0;
    for (std::size_t i = 0; i < kStrings; ++i) {
        for (std::size_t j = i; j < kStrings; ++j) {
            mix_ups_[next++] = MixUp{.first = i, .second = j};
        }
    }
    offset_ = Vec6{};
    uncertainty_ = 1.0;
    samples_ = 0;
    verdict_ = Verdict::Pending;
}

PoseProof::Verdict PoseProof::update(const StringArray& lengths, const PoseEstimate& estimate,
                                     const WireMatrix& wires) HAPTIC_RT {
    if (verdict_ != Verdict::Pending || estimate.status != PoseStatus::Ok) {
        return verdict_;
    }
    // Only movement adds evidence: the errors of neighbouring poses are the same.
    double moved = 0.0;
    for (std::size_t i = 0; i < kStrings; ++i) {
        moved = std::max(moved, std::fabs(lengths[i] - last_[i]));
    }
    if (samples_ > 0 && moved < settings_.spacing) {
        return verdict_;
    }
    last_ = lengths;
    add_sample(lengths, estimate, wires);
    judge();
    return verdict_;
}

void PoseProof::add_sample(const StringArray& lengths, const PoseEstimate& estimate,
                           const WireMatrix& wires) HAPTIC_RT {
    // W^T W = L L^T, with rotation columns scaled to the size of the others.
    WireMatrix scaled = wires;
    const double ratio = settings_.angle / settings_.position;
    Mat6 factor{};
    for (Vec6& row : scaled) {
        for (std::size_t i = 0; i < 6; ++i) {
            row[i] *= i < 3 ? 1.0 : ratio;
        }
        for (std::size_t i = 0; i < 6; ++i) {
            for (std::size_t j = 0; j < 6; ++j) {
                factor[i][j] += row[i] * row[j];
            }
        }
    }
    if (!factorise(factor)) {
        return;
    }
    // Q = 1 - Z Z^T, with Z = W L^-T.
    for (Vec6& row : scaled) {
        row = solve_lower(factor, row);
    }
    Projection projection{};
    for (std::size_t s = 0; s < kStrings; ++s) {
        for (std::size_t t = 0; t < kStrings; ++t) {
            projection[s][t] = s == t ? 1.0 : 0.0;
            for (std::size_t i = 0; i < 6; ++i) {
                projection[s][t] -= scaled[s][i] * scaled[t][i];
            }
        }
    }
    // H += W_0^T Q W_0, g += W_0^T r.
    for (std::size_t s = 0; s < kStrings; ++s) {
        Vec6 projected{};  // row s of Q W_0
        for (std::size_t t = 0; t < kStrings; ++t) {
            for (std::size_t j = 0; j < 6; ++j) {
                projected[j] += projection[s][t] * centre_[t][j];
            }
        }
        for (std::size_t i = 0; i < 6; ++i) {
            for (std::size_t j = 0; j < 6; ++j) {
                information_[i][j] += centre_[s][i] * projected[j];
            }
            evidence_[i] += centre_[s][i] * estimate.residuals[s];
        }
        squares_ += estimate.residuals[s] * estimate.residuals[s];
    }
    for (MixUp& mix_up : mix_ups_) {
        add_mix_up(mix_up, lengths, estimate.residuals, projection);
    }
    ++samples_;
}

void PoseProof::add_mix_up(MixUp& mix_up, const StringArray& lengths, const StringArray& residuals,
                           const Projection& projection) HAPTIC_RT {
    // d: string i reads minus its change, or strings i and j read each other's.
    const std::size_t i = mix_up.first;
    const std::size_t j = mix_up.second;
    const double change = lengths[i] - rest_[i];
    const double size = i == j ? -2.0 * change : lengths[j] - rest_[j] - change;
    mix_up.cross += size * (residuals[i] - (i == j ? 0.0 : residuals[j]));
    StringArray left{};  // Q d
    for (std::size_t s = 0; s < kStrings; ++s) {
        left[s] = size * (projection[s][i] - (i == j ? 0.0 : projection[s][j]));
        mix_up.squares += left[s] * left[s];
        for (std::size_t k = 0; k < 6; ++k) {
            mix_up.explained[k] += centre_[s][k] * left[s];
        }
    }
}

double PoseProof::tolerated() const HAPTIC_RT {
    const double rms = settings_.unexplained * settings_.length_error;
    return 2.0 * static_cast<double>(samples_) * rms * rms;
}

bool PoseProof::excludes_mix_ups(const Mat6& factor, double unexplained) const HAPTIC_RT {
    const double noise = settings_.length_error * settings_.length_error;
    const double least = settings_.visible * std::max(unexplained, kFewSamples * noise);
    for (const MixUp& mix_up : mix_ups_) {
        // c H^-1 c = |L^-1 c|^2.
        double left = mix_up.squares;
        for (const double value : solve_lower(factor, mix_up.explained)) {
            left -= value * value;
        }
        if (left < least) {
            return false;
        }
    }
    return true;
}

std::uint8_t PoseProof::suspects() const HAPTIC_RT {
    Mat6 factor = information_;
    if (!factorise(factor)) {
        return 0;
    }
    // What remains of the residuals corrected for a mix-up: |r + Q d|^2 without the part that an offset explains.
    const auto remaining = [&](double squares, const Vec6& evidence) HAPTIC_RT {
        for (const double value : solve_lower(factor, evidence)) {
            squares -= value * value;
        }
        return squares;
    };
    double least = kMuchBetter * remaining(squares_, evidence_);
    unsigned strings = 0;
    for (const MixUp& mix_up : mix_ups_) {
        Vec6 evidence = evidence_;
        for (std::size_t k = 0; k < 6; ++k) {
            evidence[k] += mix_up.explained[k];
        }
        const double left = remaining(squares_ + 2.0 * mix_up.cross + mix_up.squares, evidence);
        if (left < least) {
            least = left;
            strings = 1U << mix_up.first | 1U << mix_up.second;
        }
    }
    return static_cast<std::uint8_t>(strings);
}

void PoseProof::judge() HAPTIC_RT {
    // H x = g, and the variances: the diagonal of H^-1, times the variance of a length.
    Mat6 factor = information_;
    if (!factorise(factor)) {
        return;
    }
    const Vec6 x = solve_upper(factor, solve_lower(factor, evidence_));
    double variance = 0.0;
    for (std::size_t i = 0; i < 6; ++i) {
        Vec6 unit{};
        unit[i] = 1.0;
        double square = 0.0;
        for (const double value : solve_lower(factor, unit)) {
            square += value * value;
        }
        variance = std::max(variance, square);
        offset_[i] = x[i] * (i < 3 ? settings_.position : settings_.angle);
    }
    uncertainty_ = std::min(1.0, settings_.length_error * std::sqrt(variance));
    if (uncertainty_ > settings_.certainty) {
        return;
    }
    // Certain enough: an offset beyond its limits, or residuals that no offset explains, refuse.
    const bool centred = length_of(x[0], x[1], x[2]) <= 1.0 && length_of(x[3], x[4], x[5]) <= 1.0;
    double unexplained = squares_;
    for (std::size_t i = 0; i < 6; ++i) {
        unexplained -= evidence_[i] * x[i];
    }
    if (!centred || unexplained > tolerated()) {
        verdict_ = Verdict::Refused;
    } else if (excludes_mix_ups(factor, unexplained)) {
        verdict_ = Verdict::Passed;
    }
}

}  // namespace haptic::rt
