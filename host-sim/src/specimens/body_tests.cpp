#include "specimens/body_tests.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>

#include "material/moduli.hpp"
#include "mesh/mesh_measures.hpp"
#include "specimens/relaxation.hpp"

namespace haptic::sim {
namespace {

constexpr double kLoadStrain = 0.005;  // small, so that rotations within the body stay small too
constexpr std::size_t kNoElement = std::numeric_limits<std::size_t>::max();
constexpr Eigen::Index kAffine = 12;  // coefficients of an affine displacement

Eigen::Vector3d eigen_of(const Vec3& v) {
    return {v.x, v.y, v.z};
}

}  // namespace

/// The displacement of all particles, fitted by an affine map about the centroid and a bend, in the body's axes.
struct BodyTests::Answer {
    [[nodiscard]] BodyMeasured measured(double modulus) const {
        return {.modulus = modulus,
                .substeps = relaxed.substeps,
                .simulated_s = relaxed.simulated_s,
                .at_rest = relaxed.at_rest};
    }

    Relaxed relaxed;
    Eigen::Matrix3d gradient;  // affine part, [component][direction]
    double curvature = 0.0;    // 1/m
};

BodyTests::BodyTests(DeformableBody body, const SolidMaterial& material, const BodyTestSettings& settings)
    : body_(std::move(body)), material_(material), settings_(settings) {
    ParticleModel& model = body_.particles;
    if (!body_.mesh.closed || model.elasticity.elements.empty()) {
        throw std::invalid_argument("body tests: \"" + body_.name + "\" is not a closed body with a material");
    }
    std::fill(model.pinned.begin(), model.pinned.end(), std::uint8_t{0});
    std::fill(model.velocity.begin(), model.velocity.end(), Vec3(0.0));
    volume_ = std::abs(signed_volume(body_.mesh));
    element_of_.assign(model.size(), kNoElement);
    for (std::size_t e = 0; e < model.elasticity.elements.size(); ++e) {
        element_of_[model.elasticity.elements[e].centre] = e;
    }
    // Centroid and principal axes of the particles' volumes.
    double total = 0.0;
    for (const ElasticElement& element : model.elasticity.elements) {
        centroid_ += element.volume * model.rest_position[element.centre];
        total += element.volume;
    }
    centroid_ /= total;
    Eigen::Matrix3d moments = Eigen::Matrix3d::Zero();
    for (const ElasticElement& element : model.elasticity.elements) {
        const Eigen::Vector3d p = eigen_of(model.rest_position[element.centre] - centroid_);
        moments += element.volume * p * p.transpose();
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> principal(moments);
    for (std::size_t k = 0; k < 3; ++k) {
        const Eigen::Vector3d axis = principal.eigenvectors().col(2 - static_cast<Eigen::Index>(k));
        axes_[k] = Vec3(axis[0], axis[1], axis[2]);
    }
    axes_[2] = glm::cross(axes_[0], axes_[1]);
    for (std::size_t k = 0; k < 3; ++k) {
        const auto along = [&](const Vec3& p) { return glm::dot(p, axes_[k]); };
        const auto [low, high] = std::minmax_element(body_.mesh.vertices.begin(), body_.mesh.vertices.end(),
                                                     [&](const Vec3& p, const Vec3& q) { return along(p) < along(q); });
        size_[static_cast<int>(k)] = along(*high) - along(*low);
    }
}

std::vector<Vec3> BodyTests::forces_of(const Mat3& constant, const Mat3& linear) const {
    const TriangleMesh& mesh = body_.mesh;
    const ParticleModel& model = body_.particles;
    // Orientation of the mesh: outward, unless its volume is negative.
    const double outward = signed_volume(mesh) > 0.0 ? 1.0 : -1.0;
    const auto height = [&](std::uint32_t vertex) { return glm::dot(mesh.vertices[vertex] - centroid_, axes_[1]); };
    std::vector<Vec3> on_vertex(mesh.vertices.size(), Vec3(0.0));
    const std::size_t faces = mesh.double_faced ? mesh.triangles.size() / 2 : mesh.triangles.size();
    for (std::size_t t = 0; t < faces; ++t) {
        const Triangle& corner = mesh.triangles[t];
        const Vec3& a = mesh.vertices[corner[0]];
        const Vec3 area = outward * 0.5 * glm::cross(mesh.vertices[corner[1]] - a, mesh.vertices[corner[2]] - a);
        // The integral of a linear function times a corner's: (1 + 1 for itself) / 12 of the area for each corner.
        const double sum = height(corner[0]) + height(corner[1]) + height(corner[2]);
        for (const std::uint32_t vertex : corner) {
            on_vertex[vertex] += constant * area / 3.0 + linear * area * ((sum + height(vertex)) / 12.0);
        }
    }
    // The transpose of the vertices' motion by particles and elements.
    std::vector<Vec3> force(model.size(), Vec3(0.0));
    for (std::size_t j = 0; j < on_vertex.size(); ++j) {
        const SkinVertex& skin = body_.skin[j];
        for (std::size_t k = 0; k < SkinVertex::kMax; ++k) {
            const std::uint32_t particle = skin.particle[k];
            const Vec3 share = skin.weight[k] * on_vertex[j];
            force[particle] += share;
            if (skin.weight[k] == 0.0 || element_of_[particle] == kNoElement) {
                continue;
            }
            const ElasticElement& element = model.elasticity.elements[element_of_[particle]];
            const Vec3 arm = mesh.vertices[j] - model.rest_position[particle];
            // Across a flat element the arm turns with it.
            const Vec3 across = arm - element.spread * arm;
            for (std::size_t m = 0; m < element.members.size(); ++m) {
                const Vec3& b = element.gradient[m];
                force[element.members[m]] += glm::dot(b, arm) * share - glm::dot(b, share) * across;
            }
        }
    }
    return force;
}

BodyTests::Answer BodyTests::answer(const Mat3& constant, const Mat3& linear) const {
    ParticleModel model = body_.particles;
    model.position = model.rest_position;
    const std::vector<Vec3> force = forces_of(constant, linear);
    Answer found{.relaxed = relax(model, force,
                                  {.step = settings_.step, .substeps = settings_.substeps, .keep_placement = true}),
                 .gradient = Eigen::Matrix3d::Zero()};
    // Least squares, weighted by volume, of an affine displacement and that of bending, both in the body's axes:
    // u_a = k a b, u_b = -k (a^2 + nu (b^2 - c^2)) / 2, u_c = -k nu b c.
    const double poisson = material_.poisson_ratio;
    Eigen::Matrix<double, kAffine + 1, kAffine + 1> normal = decltype(normal)::Zero();
    Eigen::Matrix<double, kAffine + 1, 1> side = decltype(side)::Zero();
    const double unit = size_.x;
    for (const ElasticElement& element : model.elasticity.elements) {
        const std::size_t i = element.centre;
        const Vec3 from = (model.rest_position[i] - centroid_) / unit;
        const Vec3 moved = (model.position[i] - model.rest_position[i]) / unit;
        const Vec3 p(glm::dot(from, axes_[0]), glm::dot(from, axes_[1]), glm::dot(from, axes_[2]));
        const Vec3 bent(p.x * p.y, -0.5 * (p.x * p.x + poisson * (p.y * p.y - p.z * p.z)), -poisson * p.y * p.z);
        for (int k = 0; k < 3; ++k) {
            Eigen::Matrix<double, kAffine + 1, 1> row = decltype(row)::Zero();
            row.segment<4>(4 * Eigen::Index{k}) << 1.0, p.x, p.y, p.z;
            row[kAffine] = bent[k];
            normal += element.volume * row * row.transpose();
            side += element.volume * glm::dot(moved, axes_[static_cast<std::size_t>(k)]) * row;
        }
    }
    const Eigen::Matrix<double, kAffine + 1, 1> fit = normal.colPivHouseholderQr().solve(side);
    for (Eigen::Index k = 0; k < 3; ++k) {
        found.gradient.row(k) = fit.segment<3>(4 * k + 1).transpose();
    }
    found.curvature = fit[kAffine] / unit;
    return found;
}

BodyMeasured BodyTests::stretch() const {
    const double stress = kLoadStrain * material_.young_modulus;
    const Answer found = answer(stress * glm::outerProduct(axes_[0], axes_[0]), Mat3(0.0));
    const double along = found.gradient(0, 0);
    BodyMeasured result = found.measured(stress / along);
    result.poisson_ratio = -0.5 * (found.gradient(1, 1) + found.gradient(2, 2)) / along;
    return result;
}

BodyMeasured BodyTests::shear() const {
    const double modulus = shear_modulus(material_);
    const double stress = kLoadStrain * modulus;
    const Answer found =
        answer(stress * (glm::outerProduct(axes_[0], axes_[1]) + glm::outerProduct(axes_[1], axes_[0])), Mat3(0.0));
    return found.measured(stress / (found.gradient(0, 1) + found.gradient(1, 0)));
}

BodyMeasured BodyTests::swell() const {
    const double modulus = bulk_modulus(material_);
    const double tension = kLoadStrain * modulus;
    const Answer found = answer(Mat3(tension), Mat3(0.0));
    return found.measured(tension / found.gradient.trace());
}

BodyMeasured BodyTests::bend() const {
    // The strain is kLoadStrain at half the width, but the ends turn by no more than kLoadStrain * 10.
    const double curvature = std::min(kLoadStrain / (0.5 * size_.y), 20.0 * kLoadStrain / size_.x);
    const double slope = curvature * material_.young_modulus;
    const Answer found = answer(Mat3(0.0), slope * glm::outerProduct(axes_[0], axes_[0]));
    return found.measured(slope / found.curvature);
}

}  // namespace haptic::sim
