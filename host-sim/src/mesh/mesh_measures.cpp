#include "mesh/mesh_measures.hpp"

#include <glm/geometric.hpp>

namespace haptic::sim {

double signed_volume(std::span<const Vec3> vertices, std::span<const Triangle> triangles) {
    double sum = 0.0;
    for (const Triangle& t : triangles) {
        // Relative to a vertex, so that a body far from the origin loses no digits.
        const Vec3 origin = vertices.front();
        sum += glm::dot(vertices[t[0]] - origin, glm::cross(vertices[t[1]] - origin, vertices[t[2]] - origin));
    }
    return sum / 6.0;
}

double surface_area(const TriangleMesh& mesh) {
    double sum = 0.0;
    for (const Triangle& t : mesh.triangles) {
        const Vec3& a = mesh.vertices[t[0]];
        sum += glm::length(glm::cross(mesh.vertices[t[1]] - a, mesh.vertices[t[2]] - a));
    }
    return 0.5 * sum;
}

}  // namespace haptic::sim
