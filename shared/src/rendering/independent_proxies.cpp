#include "rendering/independent_proxies.hpp"

#include <algorithm>

#include "haptic/contact_problem.hpp"

namespace haptic {
namespace {

/// The best set so far: its smallest force or distance, and its forces times w.
struct Best {
    double margin;
    double x0, x1, x2;

    void consider(double m, double a, double b, double c) HAPTIC_RT {
        const bool better = m > margin;
        margin = better ? m : margin;
        x0 = better ? a : x0;
        x1 = better ? b : x1;
        x2 = better ? c : x2;
    }
};

double smallest(double a, double b, double c) HAPTIC_RT {
    return std::min(std::min(a, b), c);
}

}  // namespace

void IndependentProxies::load(const std::array<ProxyPlanes, kMaxPlanes>& planes, std::size_t plane_count,
                              std::size_t proxies, double compliance) HAPTIC_RT {
    proxies_ = proxies;
    plane_count_ = plane_count;
    compliance_ = compliance;
    if (plane_count < 2) {
        return;
    }
    const auto couple = [&](std::size_t pair, const ProxyVectors& a, const ProxyVectors& b) HAPTIC_RT {
        for (std::size_t i = 0; i < proxies; ++i) {
            const double c = (1.0 - kSurfaceShare) * (a.x[i] * b.x[i] + a.y[i] * b.y[i] + a.z[i] * b.z[i]);
            coupling_[pair][i] = c;
            inverse_pivot_[pair][i] = 1.0 / (1.0 - c * c);
        }
    };
    couple(0, planes[0].normal, planes[1].normal);
    couple(1, planes[0].normal, planes[2].normal);
    couple(2, planes[1].normal, planes[2].normal);
    // A = L D L^T: D_0 = 1, D_1 = 1 - c_01^2.
    for (std::size_t i = 0; i < proxies; ++i) {
        const double c01 = coupling_[0][i];
        const double c02 = coupling_[1][i];
        const double rest = coupling_[2][i] - c01 * c02;
        lower_[i] = rest * inverse_pivot_[0][i];
        inverse_last_pivot_[i] = 1.0 / ((1.0 - c02 * c02) - rest * lower_[i]);
    }
}

void IndependentProxies::solve(const std::array<ProxyValues, kMaxPlanes>& depth,
                               std::array<ProxyValues, kMaxPlanes>& force) const HAPTIC_RT {
    const double per_compliance = 1.0 / compliance_;
    if (plane_count_ < 2) {
        for (std::size_t i = 0; i < proxies_; ++i) {
            force[0][i] = std::max(depth[0][i], 0.0) * per_compliance;
        }
        return;
    }
    double* const __restrict force0 = force[0].data();
    double* const __restrict force1 = force[1].data();
    double* const __restrict force2 = force[2].data();
    for (std::size_t i = 0; i < proxies_; ++i) {
        const double b0 = depth[0][i];
        const double b1 = depth[1][i];
        const double b2 = depth[2][i];
        const double c01 = coupling_[0][i];
        const double c02 = coupling_[1][i];
        const double c12 = coupling_[2][i];
        // No plane pushes.
        Best best{smallest(-b0, -b1, -b2), 0.0, 0.0, 0.0};
        // One plane: its force is its depth; what the others lack then. Forward substitution needs two of these, too.
        const double lacks1 = b1 - c01 * b0;
        const double lacks2 = b2 - c02 * b0;
        const double lacks0 = b0 - c01 * b1;
        best.consider(smallest(b0, -lacks1, -lacks2), b0, 0.0, 0.0);
        best.consider(smallest(b1, -lacks0, c12 * b1 - b2), 0.0, b1, 0.0);
        best.consider(smallest(b2, c02 * b2 - b0, c12 * b2 - b1), 0.0, 0.0, b2);
        // Two planes.
        const double pair01 = lacks1 * inverse_pivot_[0][i];
        const double with1 = b0 - c01 * pair01;
        best.consider(smallest(with1, pair01, c02 * with1 + c12 * pair01 - b2), with1, pair01, 0.0);
        const double pair02 = lacks2 * inverse_pivot_[1][i];
        const double with2 = b0 - c02 * pair02;
        best.consider(smallest(with2, pair02, c01 * with2 + c12 * pair02 - b1), with2, 0.0, pair02);
        const double pair12 = (b2 - c12 * b1) * inverse_pivot_[2][i];
        const double with12 = b1 - c12 * pair12;
        best.consider(smallest(with12, pair12, c01 * with12 + c02 * pair12 - b0), 0.0, with12, pair12);
        // All three: forward and back substitution.
        const double x2 = (lacks2 - lower_[i] * lacks1) * inverse_last_pivot_[i];
        const double x1 = pair01 - lower_[i] * x2;
        const double x0 = b0 - c01 * x1 - c02 * x2;
        best.consider(smallest(x0, x1, x2), x0, x1, x2);
        // Rounding must not make a force negative.
        force0[i] = std::max(best.x0, 0.0) * per_compliance;
        force1[i] = std::max(best.x1, 0.0) * per_compliance;
        force2[i] = std::max(best.x2, 0.0) * per_compliance;
    }
}

}  // namespace haptic
