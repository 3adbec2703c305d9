#include "haptic/sim/contact_force.hpp"

#include <glm/geometric.hpp>
#include <stdexcept>

namespace haptic::sim {
namespace {

// Rounds of the division among two or three planes; the error falls by the square of the cosine between normals in
// each.
constexpr int kRounds = 32;

}  // namespace

ContactShares divide_force(const Vec3& force, const SurfacePlanes& contacts) noexcept {
    // Each plane in turn takes what the others leave along its normal (Gauss-Seidel on the normal equations, projected
    // onto shares that push).
    ContactShares shares{};
    Vec3 left = force;
    const int rounds = contacts.count > 1 ? kRounds : 1;
    for (int round = 0; round < rounds; ++round) {
        for (std::size_t c = 0; c < contacts.count; ++c) {
            const Vec3& normal = contacts.plane[c].normal;
            const double wanted = shares[c] + glm::dot(left, normal);
            const double allowed = wanted > 0.0 ? wanted : 0.0;
            left -= (allowed - shares[c]) * normal;
            shares[c] = allowed;
        }
    }
    return shares;
}

PressureMask::PressureMask(const TriangleMesh& rest, std::span<const double> mass, double radius)
    : rest_(rest.vertices), mass_(mass.begin(), mass.end()), triangles_(rest.triangles), radius_(radius) {
    if (!(radius >= 0.0)) {
        throw std::invalid_argument("pressure mask: radius must not be negative");
    }
    if (mass_.size() != rest_.size()) {
        throw std::invalid_argument("pressure mask: needs one mass for each vertex");
    }
    pressed_.reserve(rest_.size());
}

PressedPatch PressureMask::lay(const SurfacePoint& touched, std::span<const Vec3> vertex_velocity) {
    const Triangle& corners = triangles_[touched.triangle];
    const Vec3 centre = touched.weights.x * rest_[corners[0]] + touched.weights.y * rest_[corners[1]] +
                        touched.weights.z * rest_[corners[2]];
    const double radius_squared = radius_ * radius_;
    double sum = 0.0;
    pressed_.clear();
    for (std::uint32_t j = 0; j < rest_.size(); ++j) {
        const Vec3 apart = rest_[j] - centre;
        const double inside = radius_squared - glm::dot(apart, apart);
        if (inside > 0.0) {
            pressed_.push_back({j, inside * inside});
            sum += inside * inside;
        }
    }
    if (!(sum > 0.0)) {
        pressed_.assign(
            {{corners[0], touched.weights.x}, {corners[1], touched.weights.y}, {corners[2], touched.weights.z}});
        sum = touched.weights.x + touched.weights.y + touched.weights.z;
    }
    PressedPatch patch;
    double inverse_mass = 0.0;
    for (Pressed& p : pressed_) {
        p.weight /= sum;
        patch.velocity += p.weight * vertex_velocity[p.vertex];
        inverse_mass += p.weight * p.weight / mass_[p.vertex];
    }
    patch.mass = 1.0 / inverse_mass;
    return patch;
}

void PressureMask::press(const Vec3& force, std::span<Vec3> vertex_force) const {
    for (const Pressed& p : pressed_) {
        vertex_force[p.vertex] += p.weight * force;
    }
}

double contact_damping(double share, double patch_mass, double step_s, const Coupling& coupling) noexcept {
    const double damping = share * coupling.loss;  // k d c
    const double mass = patch_mass > coupling.tied_mass ? patch_mass : coupling.tied_mass;
    return damping / (1.0 + damping * step_s / mass);
}

double contact_push(double share, double closing, double damping) noexcept {
    const double push = share + damping * closing;
    return push > 0.0 ? push : 0.0;
}

}  // namespace haptic::sim
