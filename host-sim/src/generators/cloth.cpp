#include "haptic/sim/cloth.hpp"

#include <cmath>
#include <glm/geometric.hpp>
#include <stdexcept>
#include <string>

#include "dynamics/rotation.hpp"
#include "generators/grid_triangles.hpp"

namespace haptic::sim {
namespace {

// Limits memory and running time.
constexpr std::uint32_t kMaxPerSide = 1024;

void check(const ClothShape& shape) {
    if (shape.vertices_per_side < 2 || shape.vertices_per_side > kMaxPerSide) {
        throw std::invalid_argument("cloth: vertices per side must be 2 to " + std::to_string(kMaxPerSide));
    }
    if (!(shape.side > 0.0) || !(shape.mass > 0.0)) {
        throw std::invalid_argument("cloth: side and mass must be positive");
    }
}

Vec3 vertex(const ClothShape& shape, const Mat3& scene_from_cloth, std::uint32_t i, std::uint32_t j) {
    const double cells = shape.vertices_per_side - 1;
    const Vec3 local((i / cells - 0.5) * shape.side, 0.0, (j / cells - 0.5) * shape.side);
    return shape.centre + scene_from_cloth * local;
}

}  // namespace

TriangleMesh make_cloth_mesh(const ClothShape& shape) {
    check(shape);
    const std::uint32_t n = shape.vertices_per_side;
    const Mat3 scene_from_cloth = to_matrix(shape.orientation);
    TriangleMesh mesh;
    mesh.vertices.reserve(std::size_t{n} * n);
    for (std::uint32_t j = 0; j < n; ++j) {
        for (std::uint32_t i = 0; i < n; ++i) {
            mesh.vertices.push_back(vertex(shape, scene_from_cloth, i, j));
        }
    }
    mesh.triangles = grid_triangles(n, n);
    // Back faces: the same triangles with reversed winding.
    const std::size_t one_side = mesh.triangles.size();
    for (std::size_t t = 0; t < one_side; ++t) {
        const Triangle front = mesh.triangles[t];
        mesh.triangles.push_back({front[0], front[2], front[1]});
    }
    mesh.double_faced = true;
    return mesh;
}

ParticleModel make_cloth_particles(const ClothShape& shape, double group_stiffness, double link_stiffness) {
    check(shape);
    const std::uint32_t n = shape.vertices_per_side;
    const Mat3 scene_from_cloth = to_matrix(shape.orientation);
    const double particle_mass = shape.mass / (static_cast<double>(n) * n);
    const double spacing = shape.side / (n - 1);
    ParticleModel model;
    for (std::uint32_t j = 0; j < n; ++j) {
        for (std::uint32_t i = 0; i < n; ++i) {
            // Balls that touch along the grid.
            model.add(vertex(shape, scene_from_cloth, i, j), particle_mass, 0.5 * spacing);
            model.semi_axes.back() = Vec3(0.5 * spacing);
        }
    }
    const auto link = [&](std::uint32_t a, std::uint32_t b) {
        model.links.push_back({a, b, glm::length(model.rest_position[b] - model.rest_position[a]), link_stiffness});
    };
    // A group of each particle with its neighbours in the 3 x 3 block, and a link to each later one.
    for (std::uint32_t j = 0; j < n; ++j) {
        for (std::uint32_t i = 0; i < n; ++i) {
            const std::uint32_t self = j * n + i;
            Group group{self, {}, group_stiffness};
            for (std::uint32_t row = j == 0 ? 0 : j - 1; row <= j + 1 && row < n; ++row) {
                for (std::uint32_t column = i == 0 ? 0 : i - 1; column <= i + 1 && column < n; ++column) {
                    const std::uint32_t other = row * n + column;
                    group.members.push_back(other);
                    if (other > self) {
                        link(self, other);
                    }
                }
            }
            model.groups.push_back(std::move(group));
        }
    }
    return model;
}

}  // namespace haptic::sim
