// Scenes: surfaces for the contact tests, and one whole step of a proxy among them, verified.
#pragma once

#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <memory>
#include <vector>

#include "contact/oracle.hpp"
#include "contact/pop_out.hpp"
#include "contact/secure_position.hpp"
#include "contact/swept_tree.hpp"
#include "contact/verification.hpp"
#include "contact/virtual_proxy.hpp"
#include "haptic/sim/mesh.hpp"
#include "haptic/types.hpp"

namespace haptic::sim::scenes {

inline constexpr double kRadius = 0.03;  // m, of the proxy, as in the thesis
inline constexpr double kStep = 0.01;    // s
inline constexpr double kTravel = 0.14;  // m a step: 14 m/s
inline constexpr Mat3 kUpright(1.0);

/// Square sheet in the plane y = 0 about the origin: n x n cells of two triangles, each also reversed if double-faced.
inline TriangleMesh sheet(double side, std::uint32_t n, bool double_faced) {
    TriangleMesh mesh;
    for (std::uint32_t i = 0; i <= n; ++i) {
        for (std::uint32_t j = 0; j <= n; ++j) {
            mesh.vertices.emplace_back(side * (i / static_cast<double>(n) - 0.5), 0.0,
                                       side * (j / static_cast<double>(n) - 0.5));
        }
    }
    for (std::uint32_t i = 0; i < n; ++i) {
        for (std::uint32_t j = 0; j < n; ++j) {
            const std::uint32_t a = i * (n + 1) + j;
            const std::uint32_t b = a + n + 1;
            const std::array<Triangle, 2> cell{Triangle{a, a + 1, b + 1}, Triangle{a, b + 1, b}};
            for (const Triangle& t : cell) {
                mesh.triangles.push_back(t);
                if (double_faced) {
                    mesh.triangles.push_back({t[0], t[2], t[1]});
                }
            }
        }
    }
    return mesh;
}

/// Closed sphere of `rings` rings and 2 * rings meridians, faces outward.
inline TriangleMesh ball(double radius, std::uint32_t rings) {
    TriangleMesh mesh;
    const std::uint32_t around = 2 * rings;
    mesh.vertices.emplace_back(0.0, radius, 0.0);
    for (std::uint32_t i = 1; i < rings; ++i) {
        const double a = M_PI * i / rings;
        for (std::uint32_t j = 0; j < around; ++j) {
            const double b = 2.0 * M_PI * j / around;
            mesh.vertices.emplace_back(radius * std::sin(a) * std::cos(b), radius * std::cos(a),
                                       radius * std::sin(a) * std::sin(b));
        }
    }
    mesh.vertices.emplace_back(0.0, -radius, 0.0);
    const auto at = [&](std::uint32_t i, std::uint32_t j) { return 1 + (i - 1) * around + j % around; };
    const auto last = static_cast<std::uint32_t>(mesh.vertices.size() - 1);
    for (std::uint32_t j = 0; j < around; ++j) {
        mesh.triangles.push_back({0, at(1, j + 1), at(1, j)});
        mesh.triangles.push_back({last, at(rings - 1, j), at(rings - 1, j + 1)});
        for (std::uint32_t i = 1; i + 1 < rings; ++i) {
            mesh.triangles.push_back({at(i, j), at(i, j + 1), at(i + 1, j)});
            mesh.triangles.push_back({at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)});
        }
    }
    mesh.closed = true;
    return mesh;
}

/// Closed box of 12 triangles, faces outward.
inline TriangleMesh box(const Vec3& half) {
    TriangleMesh mesh;
    for (int k = 0; k < 8; ++k) {
        mesh.vertices.emplace_back((k & 1) != 0 ? half.x : -half.x, (k & 2) != 0 ? half.y : -half.y,
                                   (k & 4) != 0 ? half.z : -half.z);
    }
    mesh.triangles = {{0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}, {0, 1, 5}, {0, 5, 4},
                      {2, 6, 7}, {2, 7, 3}, {0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}};
    mesh.closed = true;
    return mesh;
}

inline Mat3 rotation(const Vec3& axis, double angle) {
    const double c = std::cos(angle);
    const double s = std::sin(angle);
    Mat3 r(c);
    for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) {
            r[i][j] += (1.0 - c) * axis[i] * axis[j];
        }
    }
    r[1][0] -= s * axis.z;
    r[2][0] += s * axis.y;
    r[0][1] += s * axis.z;
    r[2][1] -= s * axis.x;
    r[0][2] -= s * axis.y;
    r[1][2] += s * axis.x;
    return r;
}

inline std::vector<Vec3> placed(const std::vector<Vec3>& vertices, const Mat3& turn, const Vec3& shift) {
    std::vector<Vec3> out;
    out.reserve(vertices.size());
    for (const Vec3& v : vertices) {
        out.push_back(turn * v + shift);
    }
    return out;
}

/// A mesh that moves in steps.
struct Body {
    explicit Body(TriangleMesh m) : mesh(std::move(m)), start(mesh.vertices), end(mesh.vertices) {
        tree = std::make_unique<SweptTree>(mesh.vertices, mesh.triangles);
    }
    void stay() { start = end; }
    [[nodiscard]] SurfaceMotion motion() const { return {start, end, mesh.triangles}; }

    TriangleMesh mesh;
    std::vector<Vec3> start;
    std::vector<Vec3> end;
    std::unique_ptr<SweptTree> tree;
};

class World {
  public:
    Body& add(TriangleMesh mesh) {
        bodies.push_back(std::make_unique<Body>(std::move(mesh)));
        return *bodies.back();
    }
    /// Refits all trees; call after each change of start or end.
    void refit() {
        surfaces.clear();
        for (const auto& body : bodies) {
            body->tree->refit(body->motion());
            surfaces.push_back({body->motion(), body->tree.get()});
        }
    }
    [[nodiscard]] std::vector<SurfaceMotion> motions() const {
        std::vector<SurfaceMotion> out;
        for (const auto& body : bodies) {
            out.push_back(body->motion());
        }
        return out;
    }
    /// Distance to the nearest surface at the end of the step, by brute force.
    [[nodiscard]] double clearance(const Vec3& p) const {
        double nearest = 1e300;
        for (const auto& body : bodies) {
            for (const Triangle& t : body->mesh.triangles) {
                nearest = std::min(nearest, oracle::distance(p, {body->end[t[0]], body->end[t[1]], body->end[t[2]]}));
            }
        }
        return nearest;
    }

    std::vector<std::unique_ptr<Body>> bodies;
    std::vector<MovingSurface> surfaces;
};

struct Step {
    SecurePosition secure;                // of the last attempt
    std::vector<std::uint32_t> standing;  // surfaces that had to stand still, in this order
    PopOut popped;
    ProxyMove moved;
    std::vector<Crossing> crossings;
};

/// One step: secure position, around surfaces that stand still where there is no room, pop-out and virtual proxy, with
/// the verification of the whole path.
inline Step step(World& world, const Vec3& proxy, const Vec3& hip, double radius, const ContactSettings& settings = {},
                 bool verify = true) {
    static thread_local ProxyPath path;
    path.restart(proxy);
    Step s;
    s.secure = secure_position(world.surfaces, proxy, radius, settings, &path);
    while (s.secure.no_room && s.standing.size() < world.bodies.size()) {
        s.standing.push_back(s.secure.in_the_way.object);
        Body& body = *world.bodies[s.standing.back()];
        body.end = body.start;
        world.refit();
        path.restart(proxy);
        const SecurePosition before = s.secure;
        s.secure = secure_position(world.surfaces, proxy, radius, settings, &path);
        s.secure.overconstrained = true;
        s.secure.touched = s.secure.touched || before.touched;
    }
    s.popped = pop_out(world.surfaces, s.secure.position, radius, settings, &path);
    s.moved = move_proxy(world.surfaces, s.popped.position, hip, radius, 0.01, settings, &path);
    if (verify) {
        const auto motions = world.motions();
        s.crossings = find_crossings(motions, path.knots());
    }
    return s;
}

}  // namespace haptic::sim::scenes
