#include "haptic/sim/fan.hpp"

#include <cmath>
#include <glm/geometric.hpp>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace haptic::sim {
namespace {

constexpr std::uint32_t kMinOnRim = 3;
constexpr std::uint32_t kMaxOnRim = 4096;
constexpr double kHalfPi = 1.5707963267948966;

/// Cosine and sine of `turns` quarter turns, 0 to 1/2, accurate to rounding. Power series, because the functions of the
/// mathematical library differ between machines.
std::pair<double, double> cosine_and_sine(double turns) {
    const double angle = turns * kHalfPi;
    const double square = angle * angle;
    double cosine = 1.0;
    double sine = 1.0;
    for (int n = 18; n >= 2; n -= 2) {  // Horner; the first omitted term is (pi/4)^20 / 20!, 3e-21
        cosine = 1.0 - cosine * square / (n * (n - 1));
        sine = 1.0 - sine * square / (n * (n + 1));
    }
    return {cosine, sine * angle};
}

/// Point `k` of `n` evenly spaced points of the unit circle, k < n, as (cosine, sine).
std::pair<double, double> circle_point(std::uint32_t k, std::uint32_t n) {
    // Reduce to the first octant: quarter turn and fraction of it, mirrored at 45 degrees.
    const std::uint32_t quarter = 4 * k / n;
    const double turns = static_cast<double>(4 * k - quarter * n) / n;  // 0 to 1, from the start of the quarter
    const bool beyond_middle = turns > 0.5;
    auto [x, y] = cosine_and_sine(beyond_middle ? 1.0 - turns : turns);
    if (beyond_middle) {
        std::swap(x, y);
    }
    switch (quarter) {
        case 0:
            return {x, y};
        case 1:
            return {-y, x};
        case 2:
            return {-x, -y};
        default:
            return {y, -x};
    }
}

std::vector<Vec3> vertices_of(const FanShape& shape) {
    std::vector<Vec3> vertices{shape.centre};
    vertices.reserve(shape.rim_vertices + 1);
    for (std::uint32_t k = 0; k < shape.rim_vertices; ++k) {
        const auto [x, y] = circle_point(k, shape.rim_vertices);
        vertices.push_back(shape.centre + shape.rim_radius * Vec3(x, 0.0, -y));
    }
    return vertices;
}

}  // namespace

void FanShape::check() const {
    if (rim_vertices < kMinOnRim || rim_vertices > kMaxOnRim) {
        throw std::invalid_argument("fan: rim vertices must be " + std::to_string(kMinOnRim) + " to " +
                                    std::to_string(kMaxOnRim));
    }
    if (!(rim_radius > 0.0) || !std::isfinite(rim_radius) || !(mass > 0.0) || !std::isfinite(mass)) {
        throw std::invalid_argument("fan: rim radius and mass must be positive");
    }
}

TriangleMesh make_fan_mesh(const FanShape& shape) {
    shape.check();
    TriangleMesh mesh;
    mesh.vertices = vertices_of(shape);
    mesh.triangles.reserve(shape.rim_vertices);
    for (std::uint32_t k = 0; k < shape.rim_vertices; ++k) {
        mesh.triangles.push_back({0, 1 + k, 1 + (k + 1) % shape.rim_vertices});
    }
    return mesh;
}

ParticleModel make_fan_particles(const FanShape& shape, double group_stiffness) {
    shape.check();
    const std::vector<Vec3> vertices = vertices_of(shape);
    // Balls that touch along the rim.
    const double radius = 0.5 * glm::length(vertices[2] - vertices[1]);
    ParticleModel model;
    const std::uint32_t n = shape.rim_vertices;
    // The centre's group has all particles; a rim particle's has the centre and its neighbours.
    Group about_centre{0, {}, group_stiffness};
    about_centre.members.reserve(vertices.size());
    for (std::uint32_t i = 0; i < vertices.size(); ++i) {
        model.add(vertices[i], shape.mass / static_cast<double>(vertices.size()), radius);
        model.pinned[i] = i > 0 ? 1 : 0;
        about_centre.members.push_back(i);
    }
    model.groups.reserve(vertices.size());
    model.groups.push_back(std::move(about_centre));
    for (std::uint32_t k = 0; k < n; ++k) {
        model.groups.push_back({1 + k, {0, 1 + k, 1 + (k + 1) % n, 1 + (k + n - 1) % n}, group_stiffness});
    }
    return model;
}

}  // namespace haptic::sim
