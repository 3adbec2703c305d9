#include "tool/tool_elasticity.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <stdexcept>
#include <string>

#include "simd/kernels.hpp"

namespace haptic::sim {
namespace {

// Part of the largest moment; a smaller one is rounding.
constexpr double kNoMoment = 1e-28;
// Smallest S, in units of the squared moments: a group whose quadratic modes all are strains.
constexpr double kMinQuadratic = 1e-3;

/// Eigenvectors of sum q q^T in the order of falling moments; right-handed.
std::array<Vec3, 3> principal_axes(std::span<const Vec3> offsets) {
    Eigen::Matrix3d moments = Eigen::Matrix3d::Zero();
    for (const Vec3& q : offsets) {
        const Eigen::Vector3d v(q.x, q.y, q.z);
        moments += v * v.transpose();
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(moments);
    const Eigen::Matrix3d& v = eigen.eigenvectors();
    const Vec3 first(v(0, 2), v(1, 2), v(2, 2));
    const Vec3 second(v(0, 1), v(1, 1), v(2, 1));
    return {first, second, glm::cross(first, second)};
}

/// Adds weight * v w^T.
void add_product(Mat3& m, double weight, const Vec3& v, const Vec3& w) {
    for (int column = 0; column < 3; ++column) {
        m[column] += (weight * w[column]) * v;
    }
}

/// Coordinates of the offsets along the axes, and their sums of squares.
Vec3 resolve(std::span<const Vec3> offsets, const std::array<Vec3, 3>& axes, std::span<Vec3> coordinates) {
    Vec3 moments(0.0);
    for (std::size_t a = 0; a < offsets.size(); ++a) {
        coordinates[a] = {glm::dot(offsets[a], axes[0]), glm::dot(offsets[a], axes[1]), glm::dot(offsets[a], axes[2])};
        moments += coordinates[a] * coordinates[a];
    }
    return moments;
}

/// S of a group whose first d directions are not flat: squared size of z z^T over the members, less its part linear in
/// z; divided by d.
double quadratic_residual(std::span<const Vec3> z, const Vec3& moments, int d) {
    const double count = static_cast<double>(z.size());
    double sum = 0.0;
    for (int i = 0; i < d; ++i) {
        for (int j = i; j < d; ++j) {
            // Mean and slopes of z_i z_j, which least squares gives for principal axes; then what they leave over.
            double mean = 0.0;
            Vec3 slope(0.0);
            for (const Vec3& at : z) {
                mean += at[i] * at[j] / count;
                slope += at[i] * at[j] * at;
            }
            for (int k = 0; k < 3; ++k) {
                slope[k] = k < d ? slope[k] / moments[k] : 0.0;
            }
            for (const Vec3& at : z) {
                const double residual = at[i] * at[j] - mean - glm::dot(slope, at);
                sum += (i == j ? 1.0 : 2.0) * residual * residual;
            }
        }
    }
    const double scale = moments.x + moments.y + moments.z;
    return std::max(sum / d, kMinQuadratic * scale * scale / count);
}

}  // namespace

ToolElasticity::ToolElasticity(const Shape& shape, const ToolMaterial& material, const Springs& springs)
    : rest_offset_(shape.rest_offset.begin(), shape.rest_offset.end()),
      volume_(shape.volume.begin(), shape.volume.end()),
      radius_(shape.radius.begin(), shape.radius.end()),
      groups_(shape.groups.begin(), shape.groups.end()),
      material_(material),
      springs_(springs),
      compliance_(rest_offset_.size() * rest_offset_.size()),
      rotation_(rest_offset_.size()),
      strain_response_(rest_offset_.size()) {
    if (volume_.size() != count() || radius_.size() != count()) {
        throw std::invalid_argument("tool: needs one volume and one radius for each particle");
    }
    for (const Group& group : groups_) {
        for (const std::uint32_t member : group.members) {
            if (member >= count() || group.centre >= count()) {
                throw std::invalid_argument("tool: a group refers to particle " + std::to_string(member) +
                                            "; the number of particles is " + std::to_string(count()));
            }
        }
    }
    if (!(material.young_modulus >= 0.0 && material.young_modulus <= ToolMaterial::kMaxYoungModulus) ||
        !(material.poisson_ratio >= 0.0 && material.poisson_ratio <= ToolMaterial::kMaxPoissonRatio)) {
        throw std::invalid_argument("tool: young_modulus must be 0 to 1e10 Pa and poisson_ratio 0 to 0.49");
    }
    // All memory that later calls need.
    std::size_t largest = count();
    for (const Group& group : groups_) {
        largest = std::max(largest, group.members.size());
    }
    offset_.resize(largest);
    coordinate_.resize(largest);
    gradient_.resize(largest);
    if (is_elastic()) {
        const std::size_t rows = 3 * count();
        stiffness_.resize(count() * count());
        deformation_.resize(count() * (count() + 1) / 2);
        inverse_.resize(rows * inverse_stride(rows));
        pivot_.resize(kPivotRows * inverse_stride(rows));
    }
    find_exact_shape();
    update_compliance();
}

void ToolElasticity::tabulate(const ShapeOfCurl& shape) {
    if (!is_elastic()) {
        return;
    }
    // All shapes with the present springs.
    shapes_.assign(kShapes, {rest_offset_, deformation_});
    for (std::size_t k = 0; k < kShapes; ++k) {
        shape(static_cast<double>(k) / static_cast<double>(kShapes - 1), shapes_[k].rest_offset);
        (void)tabulated_deformation(k);
    }
    find_rotations();
}

void ToolElasticity::set_curl(double curl, std::span<const Vec3> rest_offset) noexcept {
    curl_ = curl;
    std::copy(rest_offset.begin(), rest_offset.end(), rest_offset_.begin());
    if (shapes_.empty()) {
        find_exact_shape();
    } else {
        interpolate_deformation();
    }
    update_compliance();
}

void ToolElasticity::set_springs(const Springs& springs) noexcept {
    springs_ = springs;
    if (shapes_.empty()) {
        find_deformation();
    } else {
        // What the table has is that of other springs.
        for (TabulatedShape& shape : shapes_) {
            shape.known = false;
        }
        interpolate_deformation();
    }
    update_compliance();
}

/// Rotations, K and deformation of the rest offsets.
void ToolElasticity::find_exact_shape() noexcept {
    find_rotations();
    assemble_stiffness();
    find_deformation();
}

/// Of the shape k of the table. Finds it if it is not known, which leaves the rotations of that shape behind.
const std::vector<Mat3>& ToolElasticity::tabulated_deformation(std::size_t k) noexcept {
    TabulatedShape& shape = shapes_[k];
    if (!shape.known) {
        rest_offset_.swap(shape.rest_offset);
        deformation_.swap(shape.deformation);
        find_exact_shape();
        rest_offset_.swap(shape.rest_offset);
        deformation_.swap(shape.deformation);
        shape.known = true;
    }
    return shape.deformation;
}

/// Deformation at curl_, between the two nearest shapes of the table, and the rotations of the rest offsets.
void ToolElasticity::interpolate_deformation() noexcept {
    const double at = curl_ * static_cast<double>(kShapes - 1);
    const std::size_t first = std::min(static_cast<std::size_t>(at), kShapes - 2);
    const double weight = at - static_cast<double>(first);
    const std::vector<Mat3>& a = tabulated_deformation(first);
    const std::vector<Mat3>& b = tabulated_deformation(first + 1);
    for (std::size_t block = 0; block < deformation_.size(); ++block) {
        deformation_[block] = (1.0 - weight) * a[block] + weight * b[block];
    }
    find_rotations();
}

bool ToolElasticity::is_elastic() const noexcept {
    return !material_.rigid && !material_.limp() && count() > 1;
}

bool ToolElasticity::independent() const noexcept {
    const bool one_stiffness = springs_.torque_stiffness == 0.0 || springs_.torque_stiffness == springs_.stiffness;
    return count() == 1 || (material_.limp() && one_stiffness);
}

void ToolElasticity::follow_springs(const Mat3& gradient, std::span<Vec3> u) noexcept {
    if (!strain_response_known_) {
        find_strain_response();
    }
    // Translation and rotation of the ends are followed exactly, strains by the response of the tool.
    const Mat3 strain = 0.5 * (gradient + glm::transpose(gradient));
    const Mat3 rotation = 0.5 * (gradient - glm::transpose(gradient));
    const Vec3 translation = gradient * mean_;
    for (std::size_t i = 0; i < count(); ++i) {
        u[i] = translation + rotation * (rest_offset_[i] - mean_);
        const StrainResponse& response = strain_response_[i];
        u[i] += strain[0].x * response[0];
        u[i] += strain[1].y * response[1];
        u[i] += strain[2].z * response[2];
        u[i] += strain[0].y * response[3];
        u[i] += strain[0].z * response[4];
        u[i] += strain[1].z * response[5];
    }
}

/// Displacements C (Cs x I) v for ends that move by the unit strains, v_i = e (o_i - mean). Such v have a sum of 0.
void ToolElasticity::find_strain_response() noexcept {
    const auto [k, k_t] = effective_springs();
    std::fill(strain_response_.begin(), strain_response_.end(), StrainResponse{});
    for (std::size_t j = 0; j < count(); ++j) {
        const Vec3 force = k_t / static_cast<double>(count()) * (rest_offset_[j] - mean_);
        for (std::size_t i = 0; i < count(); ++i) {
            const Mat3& c = compliance_[i * count() + j];
            StrainResponse& response = strain_response_[i];
            response[0] += force.x * c[0];
            response[1] += force.y * c[1];
            response[2] += force.z * c[2];
            response[3] += force.y * c[0];
            response[3] += force.x * c[1];
            response[4] += force.z * c[0];
            response[4] += force.x * c[2];
            response[5] += force.z * c[1];
            response[5] += force.y * c[2];
        }
    }
    strain_response_known_ = true;
}

Mat3 ToolElasticity::stiffness(std::size_t i, std::size_t j) const {
    if (stiffness_.empty()) {
        return Mat3(0.0);
    }
    return i >= j ? stiffness_[i * count() + j] : glm::transpose(stiffness_[j * count() + i]);
}

ToolElasticity::Springs ToolElasticity::effective_springs() const noexcept {
    const double k = std::max(springs_.stiffness, kMinStiffness);
    return {k, springs_.torque_stiffness > 0.0 ? springs_.torque_stiffness : k};
}

/// Unit rotations about the principal axes through the mean of the particles. They and the translations are orthogonal.
void ToolElasticity::find_rotations() noexcept {
    mean_ = Vec3(0.0);
    for (const Vec3& o : rest_offset_) {
        mean_ += o / static_cast<double>(count());
    }
    const std::span<Vec3> offsets = std::span(offset_).first(count());
    std::transform(rest_offset_.begin(), rest_offset_.end(), offsets.begin(), [&](const Vec3& o) { return o - mean_; });
    const std::array<Vec3, 3> axes = principal_axes(offsets);
    const Vec3 moments = resolve(offsets, axes, coordinate_);
    turns_per_moment_ = Mat3(0.0);
    for (int k = 0; k < 3; ++k) {
        // About the axis of a row, which moves none of its particles, there is no rotation.
        const double square = moments[(k + 1) % 3] + moments[(k + 2) % 3];
        const double scale = square > kNoMoment * moments[0] ? 1.0 / std::sqrt(square) : 0.0;
        add_product(turns_per_moment_, scale * scale, axes[static_cast<std::size_t>(k)],
                    axes[static_cast<std::size_t>(k)]);
        for (std::size_t i = 0; i < count(); ++i) {
            rotation_[i][k] = scale * glm::cross(axes[static_cast<std::size_t>(k)], offsets[i]);
        }
    }
}

void ToolElasticity::assemble_stiffness() noexcept {
    std::fill(stiffness_.begin(), stiffness_.end(), Mat3(0.0));
    for (const Group& group : groups_) {
        if (!stiffness_.empty()) {
            add_group(group);
        }
    }
}

void ToolElasticity::add_group(const Group& group) noexcept {
    // Offsets from the mean, along the principal axes.
    const std::size_t members = group.members.size();
    const std::span<Vec3> offsets = std::span(offset_).first(members);
    const std::span<Vec3> z = std::span(coordinate_).first(members);
    Vec3 mean(0.0);
    for (const std::uint32_t member : group.members) {
        mean += rest_offset_[member] / static_cast<double>(members);
    }
    std::transform(group.members.begin(), group.members.end(), offsets.begin(),
                   [&](std::uint32_t member) { return rest_offset_[member] - mean; });
    const std::array<Vec3, 3> axes = principal_axes(offsets);
    const Vec3 moments = resolve(offsets, axes, z);
    // The first d directions are not flat; the projector onto them.
    int d = 0;
    Mat3 projector(0.0);
    while (d < 3 && moments[d] > kFlat * moments[0]) {
        add_product(projector, 1.0, axes[static_cast<std::size_t>(d)], axes[static_cast<std::size_t>(d)]);
        ++d;
    }
    if (d == 0) {
        return;  // a single member, or all in one place
    }
    // b_a = A^+ q_a.
    for (std::size_t a = 0; a < members; ++a) {
        gradient_[a] = Vec3(0.0);
        for (int k = 0; k < d; ++k) {
            gradient_[a] += z[a][k] / moments[k] * axes[static_cast<std::size_t>(k)];
        }
    }
    // Moduli of the strain energy, Pa, times V.
    const double e = material_.young_modulus;
    const double nu = material_.poisson_ratio;
    const double volume = volume_[group.centre];
    const double mu = volume * e / (2.0 * (1.0 + nu));
    const double lambda = volume * e * nu / ((1.0 + nu) * (1.0 - (d - 1) * nu));
    // Stiffness of the residual, N/m.
    const double radius = radius_[group.centre];
    const double kappa = e * volume * radius * radius / quadratic_residual(z, moments, d);

    for (std::size_t a = 0; a < members; ++a) {
        for (std::size_t c = 0; c <= a; ++c) {
            const Vec3& p = gradient_[a];
            const Vec3& q = gradient_[c];
            // Second derivative of V (mu |e|^2 + lambda / 2 tr(e)^2).
            Mat3 block = mu * glm::dot(p, q) * projector;
            add_product(block, mu, q, p);
            add_product(block, lambda, p, q);
            // Second derivative of kappa / 2 |u - its projection onto translations, strains and rotations|^2. In the
            // directions that are not flat strains and rotations together are all linear maps.
            block -= kappa * glm::dot(p, offsets[c]) * projector;
            block += Mat3(kappa * ((a == c ? 1.0 : 0.0) - 1.0 / static_cast<double>(members)));
            // A rotation out of them is a motion of its own.
            for (int k = d; k < 3; ++k) {
                for (int h = 0; h < k; ++h) {
                    const double square = moments[h] + moments[k];
                    if (square > kNoMoment * moments[0]) {
                        const Vec3& s = axes[static_cast<std::size_t>(h)];
                        const Vec3& t = axes[static_cast<std::size_t>(k)];
                        add_product(block, -kappa / square, z[a][h] * t - z[a][k] * s, z[c][h] * t - z[c][k] * s);
                    }
                }
            }
            // Only the lower half is kept.
            const std::size_t i = group.members[a];
            const std::size_t j = group.members[c];
            if (i >= j) {
                stiffness_[i * count() + j] += block;
            } else {
                stiffness_[j * count() + i] += glm::transpose(block);
            }
        }
    }
}

/// Block i, j of G diag(N translation, rotation) G^T.
Mat3 ToolElasticity::rigid_block(std::size_t i, std::size_t j, double translation, double rotation) const noexcept {
    Mat3 block(translation);
    for (int axis = 0; axis < 3; ++axis) {
        add_product(block, rotation, rotation_[i][axis], rotation_[j][axis]);
    }
    return block;
}

/// C - U = X - G G^T / (k_t / N + g) of the present shape.
void ToolElasticity::find_deformation() noexcept {
    if (!is_elastic()) {
        return;
    }
    const double n = static_cast<double>(count());
    const double held = invert(effective_springs().torque_stiffness / n);
    const std::size_t stride = inverse_stride(3 * count());
    std::size_t next = 0;
    for (std::size_t i = 0; i < count(); ++i) {
        for (std::size_t j = 0; j <= i; ++j) {
            Mat3 block = rigid_block(i, j, -1.0 / (held * n), -1.0 / held);
            for (std::size_t row = 0; row < 3; ++row) {
                for (std::size_t column = 0; column < 3; ++column) {
                    // Of a diagonal block only the lower half is there.
                    const std::size_t r = 3 * i + row;
                    const std::size_t c = 3 * j + column;
                    block[static_cast<int>(column)][static_cast<int>(row)] +=
                        inverse_[std::max(r, c) * stride + std::min(r, c)];
                }
            }
            deformation_[next++] = block;
        }
    }
}

/// C from U and the deformation.
void ToolElasticity::update_compliance() noexcept {
    strain_response_known_ = false;
    const double n = static_cast<double>(count());
    const auto [k, k_t] = effective_springs();
    turn_compliance_ = Mat3(0.0);
    // Limp, or a single particle: Cs^-1 = N / k_t 1 + (1 / k - 1 / k_t) 1 1^T.
    if (material_.limp() || count() == 1) {
        for (std::size_t i = 0; i < count(); ++i) {
            for (std::size_t j = 0; j < count(); ++j) {
                compliance_[i * count() + j] = Mat3((i == j ? n / k_t : 0.0) + (1.0 / k - 1.0 / k_t));
            }
        }
        return;
    }
    turn_compliance_ = n / k_t * turns_per_moment_;
    // U = G diag(N / k, N / k_t) G^T.
    std::size_t next = 0;
    for (std::size_t i = 0; i < count(); ++i) {
        for (std::size_t j = 0; j <= i; ++j) {
            Mat3 block = rigid_block(i, j, 1.0 / k, n / k_t);
            if (is_elastic()) {
                block += deformation_[next++];
            }
            // Symmetric to the last bit: C_ij = C_ji^T.
            compliance_[i * count() + j] = block;
            compliance_[j * count() + i] = glm::transpose(block);
        }
    }
}

/// Sets inverse_ to (K + shift + stiffness G G^T)^-1. Returns the eigenvalue of the rigid motions G, N/m.
double ToolElasticity::invert(double shift) noexcept {
    // The rigid motions get a stiffness like that of the material, so that the condition number is the material's.
    double trace = 0.0;
    for (std::size_t i = 0; i < count(); ++i) {
        const Mat3& block = stiffness_[i * count() + i];
        trace += block[0][0] + block[1][1] + block[2][2];
    }
    const double stiffness = trace / static_cast<double>(3 * count());
    const std::size_t stride = inverse_stride(3 * count());
    for (std::size_t i = 0; i < count(); ++i) {
        for (std::size_t j = 0; j <= i; ++j) {
            Mat3 block = stiffness_[i * count() + j];
            block += Mat3((i == j ? shift : 0.0) + stiffness / static_cast<double>(count()));
            for (int axis = 0; axis < 3; ++axis) {
                add_product(block, stiffness, rotation_[i][axis], rotation_[j][axis]);
            }
            for (std::size_t row = 0; row < 3; ++row) {
                for (std::size_t column = 0; column < 3; ++column) {
                    inverse_[(3 * i + row) * stride + 3 * j + column] =
                        block[static_cast<int>(column)][static_cast<int>(row)];
                }
            }
        }
    }
    widest_kernels().inverse(
        {.matrix = inverse_.data(), .rows = 3 * count(), .min_pivot = shift, .pivot = pivot_.data()});
    return shift + stiffness;
}

}  // namespace haptic::sim
