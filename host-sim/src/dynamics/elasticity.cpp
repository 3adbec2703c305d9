#include "haptic/sim/elasticity.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <limits>
#include <map>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>

#include "dynamics/model_bodies.hpp"
#include "dynamics/stiffness_factor.hpp"
#include "haptic/sim/mesh.hpp"
#include "haptic/sim/particles.hpp"
#include "mesh/mesh_measures.hpp"
#include "simd/kernels.hpp"

namespace haptic::sim {
namespace {

/// Weight of a member at r from the particle, with its square relative to the mean square of all: the fit is that of
/// the particle's neighbourhood. Close to exp(-2 r^2), whose bits differ between mathematical libraries.
double weight_at(double square) {
    const double part = 1.0 / (1.0 + square);
    return part * part * part;
}

// Of the second derivatives, relative to the mean square of the members' weights: members that determine them badly
// leave them at 0.
constexpr double kRidge = 1e-5;
// Principal variance of the members' offsets, relative to the largest, below which the element is flat.
constexpr double kFlat = 0.02;
// Of the equations for the balance at the surface, relative to their mean diagonal: affine multipliers change nothing.
constexpr double kBalanceRidge = 1e-4;
// Energy of |H|^2 per E m2 V / 2. Bending alone needs 1/3, torsion 1/5 to 1/2, as thin as the body is; the bars of
// elasticity_test.cpp come out best with this.
constexpr double kGradientStiffness = 0.4;
// Energy of what the quadratic fit leaves over, per E V / L^2: keeps patterns of the size of two particles from moving
// freely.
constexpr double kRemainderStiffness = 0.4;
// Bounds of faithful_step(), s.
constexpr double kLeastDamping = 2e-3;
constexpr double kLongestStep = 5e-3;

[[noreturn]] void refuse_elasticity(const std::string& why) {
    throw std::invalid_argument("elasticity: " + why);
}

constexpr Eigen::Index kTerms = 10;  // of a quadratic function in space
constexpr Eigen::Index kAffineTerms = 4;
using Basis = Eigen::Matrix<double, Eigen::Dynamic, kTerms>;
using Fit = Eigen::Matrix<double, kTerms, Eigen::Dynamic>;

/// 1, x, y, z, x^2 / 2, y^2 / 2, z^2 / 2, yz, zx, xy.
Eigen::Matrix<double, 1, kTerms> terms(const Vec3& o) {
    Eigen::Matrix<double, 1, kTerms> row;
    row << 1.0, o.x, o.y, o.z, 0.5 * o.x * o.x, 0.5 * o.y * o.y, 0.5 * o.z * o.z, o.y * o.z, o.z * o.x, o.x * o.y;
    return row;
}

/// Members' offsets from the particle, in units of their root mean square, without flat directions.
struct Neighbourhood {
    double length = 0.0;  // m
    Mat3 spread{0.0};
    int directions = 0;  // that are not flat
    std::vector<Vec3> offset;
    Eigen::VectorXd weight;  // sums to 1
};

Neighbourhood neighbourhood_of(const ParticleModel& model, const Group& group) {
    Neighbourhood near;
    const Vec3 at = model.rest_position[group.centre];
    // Scale.
    double square = 0.0;
    for (const std::uint32_t p : group.members) {
        const Vec3 offset = model.rest_position[p] - at;
        square += glm::dot(offset, offset);
        near.offset.push_back(offset);
    }
    if (!(square > 0.0)) {
        refuse_elasticity("a particle has no neighbours to deform with; give the body more particles or neighbours");
    }
    near.length = std::sqrt(square / static_cast<double>(group.members.size() - 1));
    near.weight.resize(static_cast<Eigen::Index>(group.members.size()));
    Eigen::Matrix3d moments = Eigen::Matrix3d::Zero();
    for (std::size_t k = 0; k < near.offset.size(); ++k) {
        near.offset[k] /= near.length;
        const Vec3& o = near.offset[k];
        const double weight = model.mass[group.members[k]] * weight_at(glm::dot(o, o));
        near.weight[static_cast<Eigen::Index>(k)] = weight;
        const Eigen::Vector3d v(o.x, o.y, o.z);
        moments += weight * v * v.transpose();
    }
    near.weight /= near.weight.sum();
    // Directions in which the members are spread.
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(moments);
    for (Eigen::Index k = 0; k < 3; ++k) {
        if (axes.eigenvalues()[k] > kFlat * axes.eigenvalues()[2]) {
            const Eigen::Vector3d a = axes.eigenvectors().col(k);
            const Vec3 axis(a[0], a[1], a[2]);
            near.spread += glm::outerProduct(axis, axis);
            ++near.directions;
        }
    }
    for (Vec3& offset : near.offset) {
        offset = near.directions == 3 ? offset : near.spread * offset;
    }
    if (near.directions == 3) {
        near.spread = Mat3(1.0);
    }
    return near;
}

/// Coefficients of the quadratic function that fits best, per value at each member (moving least squares).
Fit fit_of(const Neighbourhood& near, Basis& basis) {
    basis.resize(near.weight.size(), kTerms);
    for (std::size_t k = 0; k < near.offset.size(); ++k) {
        basis.row(static_cast<Eigen::Index>(k)) = terms(near.offset[k]);
    }
    const Fit weighted = basis.transpose() * near.weight.asDiagonal();
    Eigen::Matrix<double, kTerms, kTerms> normal = weighted * basis;
    // Flat directions have empty columns.
    for (Eigen::Index k = 0; k < kTerms; ++k) {
        normal(k, k) += k < 4 ? 1e-12 : kRidge;
    }
    return normal.ldlt().solve(weighted);
}

/// Pairs with the energy 1/2 sum K_ij x_i x_j, from the lower triangle of K. The rows of K sum to 0.
class PairSum {
  public:
    void add(std::uint32_t i, std::uint32_t j, double element) {
        if (i != j) {
            sum_[{std::min(i, j), std::max(i, j)}] -= element;
        }
    }
    void give_to(std::vector<ElasticPair>& pairs, double damping) const {
        for (const auto& [pair, stiffness] : sum_) {
            pairs.push_back({pair.first, pair.second, stiffness, damping});
        }
    }

  private:
    std::map<std::pair<std::uint32_t, std::uint32_t>, double> sum_;
};

void add_form(const Eigen::MatrixXd& form, std::span<const std::uint32_t> members, PairSum& pairs) {
    for (Eigen::Index i = 0; i < form.rows(); ++i) {
        for (Eigen::Index j = 0; j < i; ++j) {
            pairs.add(members[static_cast<std::size_t>(i)], members[static_cast<std::size_t>(j)], form(i, j));
        }
    }
}

/// Lambda of a solid, of a plate without stress across it, of a rod without stress at its sides.
double lame_modulus(double young, double poisson, int directions) {
    const double twice_mu = young / (1.0 + poisson);
    return directions == 3   ? young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson))
           : directions == 2 ? young * poisson / (1.0 - poisson * poisson)
                             : young - twice_mu;
}

void set_moduli(ElasticElement& element, double young, double poisson, int directions) {
    element.shear_modulus = young / (2.0 * (1.0 + poisson));
    element.lame_modulus = lame_modulus(young, poisson, directions);
    element.max_modulus = 2.0 * element.shear_modulus + directions * element.lame_modulus;
}

/// The triangle's derivatives of a linear function, b_i.
std::array<Vec3, 3> triangle_gradient(const Vec3& a, const Vec3& b, const Vec3& c) {
    const Vec3 normal = glm::cross(b - a, c - a);
    const double square = glm::dot(normal, normal);
    return {glm::cross(normal, c - b) / square, glm::cross(normal, a - c) / square, glm::cross(normal, b - a) / square};
}

double cotangent(const Vec3& u, const Vec3& v) {
    return glm::dot(u, v) / glm::length(glm::cross(u, v));
}

/// Energy of bending about an edge: D / (A0 + A1) |sum c_i x_i|^2 / 2, where the sum is the edge times the angle.
/// Bergou et al. 2006 have 3 D: on regular grids a cylinder bends one edge of three, so its energy would be three times
/// that of its curvature, D / 2 per area and square of the curvature.
void add_hinge(const std::vector<Vec3>& x, const std::array<std::uint32_t, 4>& corner, double stiffness,
               PairSum& pairs) {
    // Edge from corner 0 to 1, with corner 2 and 3 on either side.
    const Vec3 edge = x[corner[1]] - x[corner[0]];
    const Vec3 left = x[corner[2]] - x[corner[0]];
    const Vec3 right = x[corner[3]] - x[corner[0]];
    const double at_start_left = cotangent(edge, left);
    const double at_start_right = cotangent(edge, right);
    const double at_end_left = cotangent(-edge, x[corner[2]] - x[corner[1]]);
    const double at_end_right = cotangent(-edge, x[corner[3]] - x[corner[1]]);
    const std::array<double, 4> weight{at_end_left + at_end_right, at_start_left + at_start_right,
                                       -(at_start_left + at_end_left), -(at_start_right + at_end_right)};
    const double area = 0.5 * (glm::length(glm::cross(edge, left)) + glm::length(glm::cross(edge, right)));
    for (std::size_t i = 0; i < 4; ++i) {
        for (std::size_t j = 0; j < i; ++j) {
            pairs.add(corner[i], corner[j], stiffness / area * weight[i] * weight[j]);
        }
    }
}

/// m, between neighbouring particles: the cube root of their mean volume.
double spacing_of(const Elasticity& elasticity) {
    double volume = 0.0;
    for (const ElasticElement& e : elasticity.elements) {
        volume += e.volume;
    }
    return std::cbrt(volume / static_cast<double>(elasticity.elements.size()));
}

/// Divides the triangles of a closed mesh into pieces with edges of at most `size`, m; visits the middle and the
/// outward area, m^2, of each.
template <class Visitor>
void for_each_piece(const TriangleMesh& mesh, double size, const Visitor& visit) {
    const double outward = signed_volume(mesh) > 0.0 ? 1.0 : -1.0;
    for (const Triangle& corner : mesh.triangles) {
        const Vec3& a = mesh.vertices[corner[0]];
        const Vec3 u = mesh.vertices[corner[1]] - a;
        const Vec3 v = mesh.vertices[corner[2]] - a;
        const double longest = std::max({glm::length(u), glm::length(v), glm::length(v - u)});
        const int parts = std::max(1, static_cast<int>(std::ceil(longest / size)));
        const Vec3 area = outward * 0.5 * glm::cross(u, v) / static_cast<double>(parts * parts);
        const auto middle = [&](double i, double j) { return a + (i * u + j * v) / static_cast<double>(parts); };
        for (int i = 0; i < parts; ++i) {
            for (int j = 0; i + j < parts; ++j) {
                visit(middle(i + 1.0 / 3.0, j + 1.0 / 3.0), area);
                if (i + j + 1 < parts) {
                    visit(middle(i + 2.0 / 3.0, j + 2.0 / 3.0), area);
                }
            }
        }
    }
}

/// Visits the particles that carry a point of the surface, with their weights, which sum to 1: the point moves with the
/// element about the nearest particle, which is exact for affine motions. A particle may be visited twice.
template <class Visitor>
void for_each_carrier(const ParticleModel& model, const Elasticity& elasticity, const Vec3& at, const Visitor& visit) {
    const ElasticElement& e = *std::min_element(elasticity.elements.begin(), elasticity.elements.end(),
                                                [&](const ElasticElement& a, const ElasticElement& b) {
                                                    const Vec3 to_a = model.rest_position[a.centre] - at;
                                                    const Vec3 to_b = model.rest_position[b.centre] - at;
                                                    return glm::dot(to_a, to_a) < glm::dot(to_b, to_b);
                                                });
    visit(e.centre, 1.0);
    for (std::size_t m = 0; m < e.members.size(); ++m) {
        visit(e.members[m], glm::dot(e.gradient[m], at - model.rest_position[e.centre]));
    }
}

/// Sets the centre's gradient so that all of them sum to 0, from which the fit's regularisation leaves them 1e-9 away.
void close_sum(ElasticElement& element) {
    Vec3 others(0.0);
    for (std::size_t k = 1; k < element.gradient.size(); ++k) {
        others += element.gradient[k];
    }
    element.gradient[0] = -others;
}

/// Changes of an element's gradients by multipliers of its members, 0 for affine ones.
Eigen::MatrixXd change_of(const ParticleModel& model, const ElasticElement& e) {
    const auto count = static_cast<Eigen::Index>(e.members.size());
    const Vec3 at = model.rest_position[e.centre];
    double square = 0.0;
    for (const std::uint32_t p : e.members) {
        const Vec3 offset = model.rest_position[p] - at;
        square += glm::dot(offset, offset) / static_cast<double>(e.members.size() - 1);
    }
    Eigen::MatrixXd basis(count, kAffineTerms);
    Eigen::VectorXd weight(count);
    for (Eigen::Index k = 0; k < count; ++k) {
        const Vec3 o = (model.rest_position[e.members[static_cast<std::size_t>(k)]] - at) / std::sqrt(square);
        basis.row(k) = terms(o).head<kAffineTerms>();
        weight[k] = weight_at(glm::dot(o, o));
    }
    const Eigen::MatrixXd weighted = weight.asDiagonal() * basis;
    Eigen::MatrixXd normal = basis.transpose() * weighted;
    normal.diagonal().array() += 1e-9;
    const Eigen::MatrixXd all = weight.asDiagonal();
    return all - weighted * normal.ldlt().solve(weighted.transpose());
}

}  // namespace

Elasticity make_solid(const ParticleModel& model, std::span<const SolidMaterial> material) {
    if (material.size() != model.size() || model.groups.empty()) {
        refuse_elasticity("needs a material for each particle, and groups");
    }
    Elasticity made;
    PairSum pairs;
    double damping = 0.0;
    for (const Group& group : model.groups) {
        const SolidMaterial& of = material[group.centre];
        check(of);
        damping = std::max(damping, of.damping);
        const Neighbourhood near = neighbourhood_of(model, group);
        Basis basis;
        const Fit fit = fit_of(near, basis);
        ElasticElement element{.centre = group.centre, .members = group.members, .spread = near.spread};
        for (Eigen::Index k = 0; k < fit.cols(); ++k) {
            element.gradient.push_back(Vec3(fit(1, k), fit(2, k), fit(3, k)) / near.length);
        }
        element.volume = model.mass[group.centre] / of.density;
        element.damping = of.damping;
        set_moduli(element, of.young_modulus, of.poisson_ratio, near.directions);
        // |H|^2 counts the mixed derivatives twice. The second moment of a ball is r^2 / 5.
        const double length2 = near.length * near.length;
        const double moment = 0.2 * model.radius[group.centre] * model.radius[group.centre];
        const double stiffness = of.young_modulus * element.volume;
        Eigen::MatrixXd form = Eigen::MatrixXd::Zero(fit.cols(), fit.cols());
        for (Eigen::Index term = 4; term < kTerms; ++term) {
            const double count = term < 7 ? 1.0 : 2.0;
            form += count * kGradientStiffness * stiffness * moment / (length2 * length2) * fit.row(term).transpose() *
                    fit.row(term);
        }
        // What the fit leaves over.
        const Eigen::MatrixXd remainder = Eigen::MatrixXd::Identity(fit.cols(), fit.cols()) - basis * fit;
        form +=
            kRemainderStiffness * stiffness / length2 * remainder.transpose() * near.weight.asDiagonal() * remainder;
        add_form(form, group.members, pairs);
        // Move the centre to the front of the members.
        const auto centre = std::find(element.members.begin(), element.members.end(), element.centre);
        std::swap(element.gradient[static_cast<std::size_t>(centre - element.members.begin())], element.gradient[0]);
        std::swap(*centre, element.members[0]);
        close_sum(element);
        made.elements.push_back(std::move(element));
    }
    pairs.give_to(made.pairs, damping);
    return made;
}

void balance_surface(const ParticleModel& model, const TriangleMesh& mesh, Elasticity& elasticity) {
    if (!mesh.closed || elasticity.elements.empty()) {
        return;
    }
    // What each particle's gradients lack: its part of the surface less the sum of V b.
    std::vector<Row> lack(model.size());
    const auto add = [&](std::uint32_t particle, const Vec3& v) {
        for (int c = 0; c < 3; ++c) {
            lack[particle].number[c] += v[c];
        }
    };
    for (const ElasticElement& e : elasticity.elements) {
        for (std::size_t k = 0; k < e.members.size(); ++k) {
            add(e.members[k], -e.volume * e.gradient[k]);
        }
    }
    for_each_piece(mesh, 0.5 * spacing_of(elasticity), [&](const Vec3& at, const Vec3& area) {
        for_each_carrier(model, elasticity, at,
                         [&](std::uint32_t particle, double weight) { add(particle, weight * area); });
    });
    // Smallest changes, weighted as the fit is, that are 0 for affine displacements: those of element k are P_k lambda,
    // with P_k = W - W B (B^T W B)^-1 B^T W, B the members' affine functions, and (sum V_k P_k) lambda = lack.
    std::vector<MatrixElement> lower;
    std::vector<Eigen::MatrixXd> projection;
    double diagonal = 0.0;
    for (const ElasticElement& e : elasticity.elements) {
        projection.push_back(change_of(model, e));
        const Eigen::MatrixXd& p = projection.back();
        for (Eigen::Index i = 0; i < p.rows(); ++i) {
            for (Eigen::Index j = 0; j < p.cols(); ++j) {
                const std::uint32_t row = e.members[static_cast<std::size_t>(i)];
                const std::uint32_t column = e.members[static_cast<std::size_t>(j)];
                if (row >= column) {
                    lower.push_back({.row = row, .column = column, .stiffness = e.volume * p(i, j)});
                }
            }
            diagonal += e.volume * p(i, i) / static_cast<double>(model.size());
        }
    }
    for (std::uint32_t i = 0; i < model.size(); ++i) {
        lower.push_back({.row = i, .column = i, .stiffness = kBalanceRidge * diagonal});
    }
    StiffnessFactor factor(model.size(), lower, 1);
    if (!factor.factorise(0, 1.0)) {
        throw std::invalid_argument("elasticity: the balance of the elements has no solution");
    }
    factor.solve(kOneLaneKernels.elastic, 0, lack);
    for (std::size_t k = 0; k < elasticity.elements.size(); ++k) {
        ElasticElement& e = elasticity.elements[k];
        const Eigen::MatrixXd& p = projection[k];
        for (std::size_t i = 0; i < e.members.size(); ++i) {
            Vec3 change(0.0);
            for (std::size_t j = 0; j < e.members.size(); ++j) {
                const double* const lambda = lack[e.members[j]].number;
                change += p(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) *
                          Vec3(lambda[0], lambda[1], lambda[2]);
            }
            e.gradient[i] += e.spread * change;
        }
        close_sum(e);
    }
}

std::vector<ParticleWeight> carriers_of(const ParticleModel& model, const Elasticity& elasticity, const Vec3& at) {
    std::map<std::uint32_t, double> sum;
    double total = 0.0;  // 1, but for rounding in the fit
    for_each_carrier(model, elasticity, at, [&](std::uint32_t particle, double weight) {
        sum[particle] += weight;
        total += weight;
    });
    std::vector<ParticleWeight> carriers;
    carriers.reserve(sum.size());
    for (const auto& [particle, weight] : sum) {
        carriers.push_back({particle, weight / total});
    }
    return carriers;
}

Elasticity make_sheet(const ParticleModel& model, const TriangleMesh& mesh, std::span<const SheetMaterial> material) {
    if (model.size() != mesh.vertices.size() || material.size() != model.size()) {
        refuse_elasticity("a sheet needs a particle at each vertex of its mesh");
    }
    Elasticity made;
    PairSum pairs;
    double damping = 0.0;
    // Each edge with the corner opposite of it: the second triangle at an edge makes a hinge of it.
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> open;
    const std::size_t faces = mesh.double_faced ? mesh.triangles.size() / 2 : mesh.triangles.size();
    for (std::size_t t = 0; t < faces; ++t) {
        const Triangle& corner = mesh.triangles[t];
        const SheetMaterial& of = material[corner[0]];
        check(of);
        damping = std::max(damping, of.damping);
        const std::vector<Vec3>& x = model.rest_position;
        const Vec3 normal = glm::cross(x[corner[1]] - x[corner[0]], x[corner[2]] - x[corner[0]]);
        const double area = 0.5 * glm::length(normal);
        if (!(area > 0.0)) {
            refuse_elasticity("triangle " + std::to_string(t) + " has no area; remove it from the mesh");
        }
        const std::array<Vec3, 3> gradient = triangle_gradient(x[corner[0]], x[corner[1]], x[corner[2]]);
        const Vec3 n = normal / (2.0 * area);
        ElasticElement element{.centre = corner[0],
                               .members = {corner.begin(), corner.end()},
                               .gradient = {gradient.begin(), gradient.end()},
                               .spread = Mat3(1.0) - glm::outerProduct(n, n),
                               .volume = area,
                               .damping = of.damping};
        set_moduli(element, of.membrane_stiffness, of.poisson_ratio, 2);
        made.elements.push_back(std::move(element));
        for (std::size_t k = 0; k < 3; ++k) {
            const std::uint32_t a = corner[k];
            const std::uint32_t b = corner[(k + 1) % 3];
            const auto [edge, first] = open.try_emplace({std::min(a, b), std::max(a, b)}, corner[(k + 2) % 3]);
            if (!first) {
                add_hinge(x, {a, b, edge->second, corner[(k + 2) % 3]}, of.bending_stiffness, pairs);
            }
        }
    }
    pairs.give_to(made.pairs, damping);
    return made;
}

double resolved_step(const ParticleModel& model) {
    // Size of each body, and the fastest wave that stretches it: sqrt(Young's modulus / density). The modulus, 2 mu (1
    // + nu), is at most 3 mu, and that of a body of several materials at most their mean (Voigt 1889).
    double step = std::numeric_limits<double>::infinity();
    const std::vector<ParticleRange> bodies = bodies_of(model);
    std::vector<double> stiffness(bodies.size(), 0.0);  // J, of a strain of 1
    for (const ElasticElement& element : model.elasticity.elements) {
        const auto body = std::upper_bound(bodies.begin(), bodies.end(), element.centre,
                                           [](std::uint32_t p, const ParticleRange& range) { return p < range.end; });
        const auto b = static_cast<std::size_t>(body - bodies.begin());
        stiffness[b] += 3.0 * element.shear_modulus * element.volume;
    }
    for (std::size_t b = 0; b < bodies.size(); ++b) {
        const ParticleRange& body = bodies[b];
        if (!(stiffness[b] > 0.0)) {
            continue;
        }
        double mass = 0.0;
        Vec3 low = model.rest_position[body.begin];
        Vec3 high = low;
        for (std::size_t i = body.begin; i < body.end; ++i) {
            mass += model.mass[i];
            low = glm::min(low, model.rest_position[i]);
            high = glm::max(high, model.rest_position[i]);
        }
        const Vec3 size = high - low;
        const double longest = std::max({size.x, size.y, size.z});
        step = std::min(step, 0.25 * longest / std::sqrt(stiffness[b] / mass));
    }
    return step;
}

double faithful_step(const ParticleModel& model) {
    double damping = kLongestStep;
    for (const ElasticElement& element : model.elasticity.elements) {
        damping = std::min(damping, element.damping);
    }
    return model.elasticity.elements.empty() ? std::numeric_limits<double>::infinity()
                                             : std::min(resolved_step(model), std::max(damping, kLeastDamping));
}

}  // namespace haptic::sim
