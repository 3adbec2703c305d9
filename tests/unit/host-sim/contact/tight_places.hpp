// Tight places: geometry that is hard to pop out of, for both methods. The fan of figure 4.14 of the thesis and the
// three cases of its figure 4.19.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include "contact/oracle.hpp"
#include "contact/scenes.hpp"

namespace haptic::sim::tight {

using scenes::kRadius;

/// Fan: a centre pressed down into a cone, surrounded by 32 fixed vertices; 33 vertices, 32 triangles, single-faced.
inline TriangleMesh fan(double rim, double depth) {
    TriangleMesh mesh;
    mesh.vertices.emplace_back(0.0, -depth, 0.0);
    for (std::uint32_t k = 0; k < 32; ++k) {
        mesh.vertices.emplace_back(rim * std::cos(k * M_PI / 16), 0.0, rim * std::sin(k * M_PI / 16));
        mesh.triangles.push_back({0, 1 + (k + 1) % 32, 1 + k});
    }
    return mesh;
}

/// The same triangles in random order (Fisher, Yates).
inline void shuffle(TriangleMesh& mesh, oracle::Random& random) {
    for (std::size_t j = mesh.triangles.size() - 1; j > 0; --j) {
        std::swap(mesh.triangles[j], mesh.triangles[random.below(static_cast<std::uint32_t>(j + 1))]);
    }
}

inline void append(TriangleMesh& to, const TriangleMesh& what, const Mat3& turn, const Vec3& shift) {
    const auto first = static_cast<std::uint32_t>(to.vertices.size());
    for (const Vec3& v : what.vertices) {
        to.vertices.push_back(turn * v + shift);
    }
    for (const Triangle& t : what.triangles) {
        to.triangles.push_back({first + t[0], first + t[1], first + t[2]});
    }
}

/// Figure 4.19, left: a thin wall in the plane x = 0 that faces right, and to its right a face that clips the proxy
/// with its back.
inline constexpr double kClip = 0.7 * kRadius;
inline const Vec3 kBesideWall(0.3 * kRadius, 0.002, 0.001);
inline TriangleMesh clipped_wall(std::uint32_t cells) {
    // A sheet's normal is +y; rotated by -90 degrees about z it is +x.
    const Mat3 upright = scenes::rotation({0, 0, 1}, -M_PI / 2);
    TriangleMesh mesh;
    append(mesh, scenes::sheet(0.2, cells, false), upright, Vec3(0.0));
    append(mesh, scenes::sheet(0.2, cells, false), upright, Vec3(kClip, 0.0, 0.0));
    return mesh;
}

/// Figure 4.19, middle: two parallel faces at y = -half and y = half.
inline scenes::World slit(double half, bool lower_first) {
    scenes::World world;
    for (const bool lower : {lower_first, !lower_first}) {
        scenes::Body& face = world.add(scenes::sheet(0.5, 4, false));
        face.start = face.end = scenes::placed(face.mesh.vertices, Mat3(1.0), {0, lower ? -half : half, 0});
    }
    world.refit();
    return world;
}

/// Figure 4.19, right: a closed pocket half the size of the proxy, and a position in it.
inline const Vec3 kPocket(0.02, 0.025, 0.02);
inline const Vec3 kInPocket(0.01, 0.0, -0.012);

}  // namespace haptic::sim::tight
