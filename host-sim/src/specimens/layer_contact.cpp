#include "specimens/layer_contact.hpp"

#include <Eigen/Dense>
#include <array>
#include <cmath>
#include <numbers>

namespace haptic::sim {
namespace {

constexpr Eigen::Index kNodes = 24;     // of Gauss-Legendre quadrature over the contact
constexpr Eigen::Index kWaves = 400;    // of Simpson's rule over the wave numbers, even
constexpr double kHighestWave = 25.0;   // 1 - M is 1e-18 there
constexpr int kBisections = 50;         // of the contact radius, to rounding
constexpr double kWidestContact = 2.0;  // radius per thickness, an upper bound
constexpr int kNewtonSteps = 50;        // at most, to a node of the quadrature

/// 1 - M(u) of the layer.
double stiffening(double u, double poisson) {
    const double k = 3.0 - 4.0 * poisson;
    return 1.0 - (k * std::sinh(2.0 * u) - 2.0 * u) /
                     (k * std::cosh(2.0 * u) + 2.0 * u * u + 5.0 - 12.0 * poisson + 8.0 * poisson * poisson);
}

struct Quadrature {
    Eigen::VectorXd node{kNodes};
    Eigen::VectorXd weight{kNodes};
};

/// Gauss-Legendre, from 0 to 1.
Quadrature gauss_legendre() {
    Quadrature q;
    const auto n = static_cast<double>(kNodes);
    for (Eigen::Index i = 0; i < kNodes; ++i) {
        double x = std::cos(std::numbers::pi * (static_cast<double>(i) + 0.75) / (n + 0.5));
        double slope = 1.0;
        for (int step = 0; step < kNewtonSteps; ++step) {
            // Legendre's polynomials by their recurrence.
            double before = 1.0;
            double value = x;
            for (Eigen::Index k = 2; k <= kNodes; ++k) {
                const auto order = static_cast<double>(k);
                const double next = ((2.0 * order - 1.0) * x * value - (order - 1.0) * before) / order;
                before = value;
                value = next;
            }
            slope = n * (x * value - before) / (x * x - 1.0);
            x -= value / slope;
        }
        q.node[i] = 0.5 * (1.0 + x);
        q.weight[i] = 1.0 / ((1.0 - x * x) * slope * slope);
    }
    return q;
}

/// Answer to one contact radius, in units of the thickness: depth times R, and the integral of phi times
/// pi (1 - nu^2) R / E.
struct LayerSolution {
    double depth = 0.0;
    double force = 0.0;
};

LayerSolution solve_layer(double radius, const Quadrature& unit, const Eigen::VectorXd& stiff) {
    const Eigen::VectorXd node = radius * unit.node;
    const Eigen::VectorXd weight = radius * unit.weight;
    // cos(u t) at the nodes, and at the edge in the last row.
    Eigen::MatrixXd wave(kNodes + 1, kWaves + 1);
    for (Eigen::Index i = 0; i <= kNodes; ++i) {
        for (Eigen::Index w = 0; w <= kWaves; ++w) {
            const double u = kHighestWave * static_cast<double>(w) / kWaves;
            wave(i, w) = std::cos(u * (i < kNodes ? node[i] : radius));
        }
    }
    const Eigen::MatrixXd kernel =
        2.0 / std::numbers::pi * wave * stiff.asDiagonal() * wave.topRows(kNodes).transpose() * weight.asDiagonal();
    const Eigen::MatrixXd system = Eigen::MatrixXd::Identity(kNodes, kNodes) - kernel.topRows(kNodes);
    Eigen::MatrixXd right(kNodes, 2);
    right.col(0).setOnes();
    right.col(1) = node.cwiseProduct(node);
    // phi = depth * first - second, with the depth that makes it 0 at the edge.
    const Eigen::MatrixXd phi = system.partialPivLu().solve(right);
    const Eigen::RowVector2d edge = Eigen::RowVector2d(1.0, radius * radius) + kernel.row(kNodes) * phi;
    LayerSolution result;
    result.depth = edge[1] / edge[0];
    result.force = weight.dot(result.depth * phi.col(0) - phi.col(1));
    return result;
}

}  // namespace

double half_space_force(const LayerContact& contact, double depth) noexcept {
    const double nu = contact.material.poisson_ratio;
    return 4.0 / 3.0 * contact.material.young_modulus / (1.0 - nu * nu) * std::sqrt(contact.radius * depth) * depth;
}

double layer_series_force(const LayerContact& contact, double depth) noexcept {
    const double nu = contact.material.poisson_ratio;
    const double alpha = -(1.2876 - 1.4678 * nu + 1.3442 * nu * nu) / (1.0 - nu);
    const double beta = (0.6387 - 1.0277 * nu + 1.5164 * nu * nu) / (1.0 - nu);
    const double cube = alpha * alpha * alpha;
    const std::array<double, 4> c{
        -2.0 * alpha / std::numbers::pi, 4.0 * alpha * alpha / (std::numbers::pi * std::numbers::pi),
        -8.0 / std::pow(std::numbers::pi, 3) * (cube + 4.0 * std::numbers::pi * std::numbers::pi / 15.0 * beta),
        16.0 * alpha / std::pow(std::numbers::pi, 4) * (cube + 3.0 * std::numbers::pi * std::numbers::pi / 5.0 * beta)};
    const double x = std::sqrt(contact.radius * depth) / contact.thickness;
    return half_space_force(contact, depth) * (1.0 + x * (c[0] + x * (c[1] + x * (c[2] + x * c[3]))));
}

double layer_force(const LayerContact& contact, double depth) {
    const double nu = contact.material.poisson_ratio;
    // Weights of Simpson's rule, times 1 - M.
    Eigen::VectorXd stiff(kWaves + 1);
    for (Eigen::Index w = 0; w <= kWaves; ++w) {
        const double rule = w == 0 || w == kWaves ? 1.0 : w % 2 == 1 ? 4.0 : 2.0;
        stiff[w] =
            kHighestWave / (3.0 * kWaves) * rule * stiffening(kHighestWave * static_cast<double>(w) / kWaves, nu);
    }
    const Quadrature unit = gauss_legendre();
    // The contact radius with this depth.
    const double h = contact.thickness;
    const double wanted = depth * contact.radius / (h * h);
    double low = 0.0;
    double high = kWidestContact;
    for (int i = 0; i < kBisections; ++i) {
        const double middle = 0.5 * (low + high);
        (solve_layer(middle, unit, stiff).depth < wanted ? low : high) = middle;
    }
    const double stiffness = contact.material.young_modulus / (std::numbers::pi * (1.0 - nu * nu));
    return 2.0 * std::numbers::pi * stiffness * solve_layer(high, unit, stiff).force * h * h * h / contact.radius;
}

}  // namespace haptic::sim
