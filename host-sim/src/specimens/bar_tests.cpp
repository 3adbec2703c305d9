#include "specimens/bar_tests.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <functional>
#include <glm/geometric.hpp>
#include <vector>

#include "haptic/sim/block.hpp"
#include "haptic/sim/elasticity.hpp"
#include "haptic/sim/model_builder.hpp"
#include "material/moduli.hpp"

namespace haptic::sim {
namespace {

// Strain, sag per length and angle of the tests: small, so that the textbook's lines hold.
constexpr double kStrain = 0.01;
constexpr double kSag = 0.01;
constexpr double kTwist = 0.05;  // rad, between both ends
constexpr double kTorsionConstant = 0.1406;
// At rest: the fastest particle would need this many of the bar's slowest periods to move as far as it has.
constexpr double kRestPeriods = 2e4;
constexpr double kMaxPeriods = 60.0;
constexpr double kPi = 3.14159265358979;

/// The bar from x = 0 to its length, its axis the x axis.
struct Bar {
    ParticleModel model;
    double spacing;                // m, of the particles
    std::vector<double> volume{};  // m^3, per particle
};

Bar make_bar(const BarTest& test) {
    TriangleMesh mesh = make_block_mesh({.size = Vec3(test.length, test.side, test.side), .cells = 64});
    for (Vec3& p : mesh.vertices) {
        p.x += 0.5 * test.length;
    }
    const double volume = test.length * test.side * test.side;
    BuilderSettings settings;
    settings.particles = test.particles;
    settings.neighbours = test.neighbours;
    settings.mass = test.material.density * volume;
    const DeformableBody built = build_body(mesh, settings);
    Bar bar{.model = built.particles, .spacing = std::cbrt(volume / static_cast<double>(test.particles))};
    const std::vector<SolidMaterial> material(bar.model.size(), test.material);
    bar.model.elasticity = make_solid(bar.model, material);
    balance_surface(bar.model, mesh, bar.model.elasticity);
    bar.model.groups.clear();
    for (const double mass : bar.model.mass) {
        bar.volume.push_back(mass / test.material.density);
    }
    return bar;
}

/// Critically damped by drag until the bar is at rest. `slowest`: rad/s, of its slowest motion.
Measured settle(Bar& bar, const BarTest& test, const std::vector<Vec3>& force, const Vec3& gravity, double slowest) {
    SolverSettings settings;
    settings.step = test.step;
    settings.substeps = test.substeps;
    settings.iterations = 1;
    settings.gravity = gravity;
    settings.drag = std::min(2.0 * slowest, 0.5 / test.step);
    ParticleSolver solver(bar.model, settings);
    Measured result{.substeps = solver.substeps()};
    const double period = 2.0 * kPi / slowest;
    const std::vector<Vec3> start = bar.model.position;
    while (!result.at_rest && result.simulated_s < std::max(kMaxPeriods * period, 100.0 * test.step)) {
        const int steps = static_cast<int>(std::ceil(0.25 * period / test.step));
        for (int i = 0; i < steps; ++i) {
            solver.step(bar.model, force);
        }
        result.simulated_s += steps * test.step;
        double speed = 0.0;
        double moved = 0.0;
        for (std::size_t i = 0; i < start.size(); ++i) {
            speed = std::max(speed, glm::length(bar.model.velocity[i]));
            moved = std::max(moved, glm::length(bar.model.position[i] - start[i]));
        }
        result.at_rest = speed * period * kRestPeriods < moved * 2.0 * kPi;
    }
    return result;
}

/// Volume of the particles where `inside` holds.
double volume_of(const Bar& bar, const std::function<bool(const Vec3&)>& inside) {
    double sum = 0.0;
    for (std::size_t i = 0; i < bar.volume.size(); ++i) {
        sum += inside(bar.model.rest_position[i]) ? bar.volume[i] : 0.0;
    }
    return sum;
}

bool in_middle_half(const BarTest& test, const Vec3& p) {
    return std::abs(p.x - 0.5 * test.length) < 0.25 * test.length;
}

/// Adds forces along x on the particles where `inside` holds, `pull` in all: linear in y and z, so that their resultant
/// is on the bar's axis and does not turn it.
void add_pull(const Bar& bar, const std::function<bool(const Vec3&)>& inside, double pull, std::vector<Vec3>& force) {
    Eigen::Matrix3d moments = Eigen::Matrix3d::Zero();
    for (std::size_t i = 0; i < force.size(); ++i) {
        const Vec3& p = bar.model.rest_position[i];
        const Eigen::Vector3d linear(1.0, p.y, p.z);
        if (inside(p)) {
            moments += bar.volume[i] * linear * linear.transpose();
        }
    }
    const Eigen::Vector3d coefficients = moments.ldlt().solve(Eigen::Vector3d(pull, 0.0, 0.0));
    for (std::size_t i = 0; i < force.size(); ++i) {
        const Vec3& p = bar.model.rest_position[i];
        force[i].x += inside(p) ? bar.volume[i] * coefficients.dot(Eigen::Vector3d(1.0, p.y, p.z)) : 0.0;
    }
}

/// Least squares: coefficients of the columns.
Eigen::VectorXd fitted(const std::vector<std::vector<double>>& rows, const std::vector<double>& values) {
    const auto count = static_cast<Eigen::Index>(rows.size());
    Eigen::MatrixXd matrix(count, static_cast<Eigen::Index>(rows.front().size()));
    Eigen::VectorXd side(count);
    for (Eigen::Index r = 0; r < count; ++r) {
        const auto row = static_cast<std::size_t>(r);
        side[r] = values[row];
        for (Eigen::Index c = 0; c < matrix.cols(); ++c) {
            matrix(r, c) = rows[row][static_cast<std::size_t>(c)];
        }
    }
    return matrix.colPivHouseholderQr().solve(side);
}

}  // namespace

Measured measure_tension(const BarTest& test) {
    Bar bar = make_bar(test);
    const double young = test.material.young_modulus;
    const double pull = kStrain * young * test.side * test.side;
    // Forces on the outermost layers.
    const auto at_left = [&](const Vec3& p) { return p.x < bar.spacing; };
    const auto at_right = [&](const Vec3& p) { return p.x > test.length - bar.spacing; };
    std::vector<Vec3> force(bar.model.size(), Vec3(0.0));
    add_pull(bar, at_left, -pull, force);
    add_pull(bar, at_right, pull, force);
    const double slowest = kPi / test.length * std::sqrt(young / test.material.density);
    Measured result = settle(bar, test, force, Vec3(0.0), slowest);
    // An affine map of the middle half, for each component.
    std::vector<std::vector<double>> rows;
    std::vector<std::vector<double>> values(3);
    for (std::size_t i = 0; i < force.size(); ++i) {
        const Vec3& p = bar.model.rest_position[i];
        if (in_middle_half(test, p)) {
            rows.push_back({1.0, p.x, p.y, p.z});
            for (int k = 0; k < 3; ++k) {
                values[static_cast<std::size_t>(k)].push_back(bar.model.position[i][k] - p[k]);
            }
        }
    }
    const double along = fitted(rows, values[0])[1];
    const double across = 0.5 * (fitted(rows, values[1])[2] + fitted(rows, values[2])[3]);
    result.modulus = pull / (test.side * test.side) / along;
    result.poisson_ratio = -across / along;
    return result;
}

Measured measure_bending(const BarTest& test) {
    Bar bar = make_bar(test);
    const double l = test.length;
    for (std::size_t i = 0; i < bar.model.size(); ++i) {
        bar.model.pinned[i] = bar.model.rest_position[i].x < bar.spacing ? 1 : 0;
    }
    const double young = test.material.young_modulus;
    const double shear = shear_modulus(test.material);
    const double area = test.side * test.side;
    const double inertia = area * area / 12.0;
    const double line_density = test.material.density * area;
    const double gravity = kSag * l * 8.0 * young * inertia / (line_density * std::pow(l, 4));
    const double slowest = 3.516 / (l * l) * std::sqrt(young * inertia / line_density);
    Measured result = settle(bar, test, {}, Vec3(0.0, -gravity, 0.0), slowest);
    // Height = a + b x + k line(x), from a quarter of the length to 0.95 of it.
    std::vector<std::vector<double>> rows;
    std::vector<double> values;
    const double weight = line_density * gravity;
    for (std::size_t i = 0; i < bar.model.size(); ++i) {
        const double x = bar.model.rest_position[i].x;
        if (x > 0.25 * l && x < 0.95 * l) {
            const double bent = x * x * (6.0 * l * l - 4.0 * l * x + x * x) / (24.0 * young * inertia);
            const double sheared = (l * x - 0.5 * x * x) / (5.0 / 6.0 * shear * area);
            rows.push_back({1.0, x, -weight * (bent + sheared)});
            values.push_back(bar.model.position[i].y - bar.model.rest_position[i].y);
        }
    }
    result.modulus = young / fitted(rows, values)[2];
    return result;
}

Measured measure_torsion(const BarTest& test) {
    Bar bar = make_bar(test);
    const double shear = shear_modulus(test.material);
    const double constant = kTorsionConstant * std::pow(test.side, 4);
    const double torque = shear * constant * kTwist / test.length;
    // Tangential forces on the last layer, about its own middle, so that they do not bend the bar.
    const auto at_end = [&](const Vec3& p) { return p.x > test.length - bar.spacing; };
    Vec3 middle(0.0);
    for (std::size_t i = 0; i < bar.model.size(); ++i) {
        const Vec3& p = bar.model.rest_position[i];
        bar.model.pinned[i] = p.x < bar.spacing ? 1 : 0;
        middle += at_end(p) ? bar.volume[i] * p : Vec3(0.0);
    }
    middle /= volume_of(bar, at_end);
    double polar = 0.0;
    for (std::size_t i = 0; i < bar.model.size(); ++i) {
        const Vec3 arm = bar.model.rest_position[i] - middle;
        polar += at_end(bar.model.rest_position[i]) ? bar.volume[i] * (arm.y * arm.y + arm.z * arm.z) : 0.0;
    }
    std::vector<Vec3> force(bar.model.size(), Vec3(0.0));
    for (std::size_t i = 0; i < force.size(); ++i) {
        const Vec3 arm = bar.model.rest_position[i] - middle;
        if (at_end(bar.model.rest_position[i])) {
            force[i] = torque * bar.volume[i] / polar * Vec3(0.0, -arm.z, arm.y);
        }
    }
    const double slowest = 0.5 * kPi / test.length * std::sqrt(shear / test.material.density);
    Measured result = settle(bar, test, force, Vec3(0.0), slowest);
    // In the middle half: a cubic line of the axis in y and z, and a twist that grows linearly.
    std::vector<std::vector<double>> rows;
    std::vector<double> values;
    for (std::size_t i = 0; i < force.size(); ++i) {
        const Vec3& p = bar.model.rest_position[i];
        if (!in_middle_half(test, p)) {
            continue;
        }
        const Vec3 moved = bar.model.position[i] - p;
        const double x = p.x / test.length - 0.5;
        rows.push_back({1.0, x, x * x, x * x * x, 0.0, 0.0, 0.0, 0.0, -p.z, -p.z * x});
        values.push_back(moved.y);
        rows.push_back({0.0, 0.0, 0.0, 0.0, 1.0, x, x * x, x * x * x, p.y, p.y * x});
        values.push_back(moved.z);
    }
    result.modulus = torque / (constant * fitted(rows, values)[9] / test.length);
    return result;
}

}  // namespace haptic::sim
