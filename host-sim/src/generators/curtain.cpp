#include "haptic/sim/curtain.hpp"

#include <cmath>
#include <stdexcept>

#include "dynamics/rotation.hpp"

namespace haptic::sim {
namespace {

/// The horizontal cloth about the origin.
ClothShape horizontal_cloth(const CurtainShape& shape) {
    return {.vertices_per_side = shape.vertices_per_side, .side = shape.side, .mass = shape.mass};
}

/// Turns the horizontal cloth upright: x stays, z points down, the front looks along +z. Exact, unlike a rotation with
/// sqrt(1/2).
void hang(std::vector<Vec3>& points, const CurtainShape& shape) {
    const Mat3 scene_from_curtain = to_matrix(shape.orientation);
    for (Vec3& p : points) {
        p = shape.centre + scene_from_curtain * Vec3(p.x, -p.z, p.y);
    }
}

}  // namespace

void CurtainShape::check() const {
    if (vertices_per_side < 2 || vertices_per_side > 1024) {
        throw std::invalid_argument("curtain: vertices per side must be 2 to 1024");
    }
    if (!(side > 0.0) || !std::isfinite(side) || !(mass > 0.0) || !std::isfinite(mass)) {
        throw std::invalid_argument("curtain: side and mass must be positive");
    }
}

TriangleMesh make_curtain_mesh(const CurtainShape& shape) {
    shape.check();
    TriangleMesh mesh = make_cloth_mesh(horizontal_cloth(shape));
    hang(mesh.vertices, shape);
    return mesh;
}

ParticleModel make_curtain_particles(const CurtainShape& shape, double group_stiffness, double link_stiffness) {
    shape.check();
    ParticleModel model = make_cloth_particles(horizontal_cloth(shape), group_stiffness, link_stiffness);
    hang(model.rest_position, shape);
    model.position = model.rest_position;
    for (std::uint32_t i = 0; i < shape.vertices_per_side; ++i) {
        model.pinned[i] = 1;
    }
    return model;
}

}  // namespace haptic::sim
