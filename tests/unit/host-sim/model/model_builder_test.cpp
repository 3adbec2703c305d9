#include "haptic/sim/model_builder.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <functional>
#include <glm/geometric.hpp>
#include <limits>
#include <numeric>
#include <queue>
#include <stdexcept>
#include <string>
#include <vector>

#include "dynamics/rotation.hpp"
#include "haptic/sim/cloth.hpp"
#include "haptic/sim/fish.hpp"
#include "mesh/mesh_topology.hpp"
#include "model/sample_distances.hpp"
#include "scene/state_hash.hpp"

namespace haptic::sim {
namespace {

const DeformableBody& fish_body() {
    static const DeformableBody body = build_body(make_fish_mesh({}), {});
    return body;
}

/// A closed box; each side is a grid of n by n squares.
TriangleMesh box(const Vec3& low, const Vec3& high, std::uint32_t n) {
    TriangleMesh mesh;
    mesh.closed = true;
    const auto vertex = [&](const Vec3& unit) {
        const Vec3 p = low + unit * (high - low);
        const auto same = std::find(mesh.vertices.begin(), mesh.vertices.end(), p);
        if (same != mesh.vertices.end()) {
            return static_cast<std::uint32_t>(same - mesh.vertices.begin());
        }
        mesh.vertices.push_back(p);
        return static_cast<std::uint32_t>(mesh.vertices.size() - 1);
    };
    for (int axis = 0; axis < 3; ++axis) {
        for (const double side : {0.0, 1.0}) {
            for (std::uint32_t i = 0; i < n; ++i) {
                for (std::uint32_t j = 0; j < n; ++j) {
                    const auto corner = [&](std::uint32_t u, std::uint32_t v) {
                        Vec3 unit(0.0);
                        unit[axis] = side;
                        unit[(axis + 1) % 3] = static_cast<double>(u) / n;
                        unit[(axis + 2) % 3] = static_cast<double>(v) / n;
                        return vertex(unit);
                    };
                    std::array<std::uint32_t, 4> q{corner(i, j), corner(i + 1, j), corner(i + 1, j + 1),
                                                   corner(i, j + 1)};
                    if (side == 0.0) {
                        std::reverse(q.begin(), q.end());
                    }
                    mesh.triangles.push_back({q[0], q[1], q[2]});
                    mesh.triangles.push_back({q[0], q[2], q[3]});
                }
            }
        }
    }
    return mesh;
}

/// Particles connected to the first one by groups, directly or through others.
std::size_t held_by_first(const ParticleModel& model) {
    std::vector<std::vector<std::uint32_t>> tied(model.size());
    for (const Group& group : model.groups) {
        for (const std::uint32_t member : group.members) {
            tied[group.centre].push_back(member);
            tied[member].push_back(group.centre);
        }
    }
    std::vector<bool> seen(model.size(), false);
    std::queue<std::uint32_t> next;
    seen[0] = true;
    std::size_t count = 0;
    for (next.push(0); !next.empty(); next.pop()) {
        ++count;
        for (const std::uint32_t other : tied[next.front()]) {
            if (!seen[other]) {
                seen[other] = true;
                next.push(other);
            }
        }
    }
    return count;
}

double sum_of(const std::vector<double>& values) {
    return std::accumulate(values.begin(), values.end(), 0.0);
}

void expect_sound(const DeformableBody& body, std::size_t particles, const BuilderSettings& settings) {
    const ParticleModel& model = body.particles;
    EXPECT_NO_THROW(model.check());
    ASSERT_EQ(model.size(), particles);
    EXPECT_EQ(model.groups.size(), particles);
    EXPECT_EQ(held_by_first(model), particles);
    EXPECT_NEAR(sum_of(model.mass), settings.mass, 1e-12 * settings.mass);
    for (std::size_t i = 0; i < particles; ++i) {
        EXPECT_GT(model.radius[i], 0.0);
        EXPECT_GT(std::min({model.semi_axes[i].x, model.semi_axes[i].y, model.semi_axes[i].z}), 0.0);
        EXPECT_NEAR(glm::length(model.axes[i]), 1.0, 1e-12);
    }
    EXPECT_NO_THROW(Skinner(body.mesh.vertices, model, body.skin));
    for (const SkinVertex& vertex : body.skin) {
        EXPECT_NEAR(vertex.weight[0] + vertex.weight[1] + vertex.weight[2] + vertex.weight[3], 1.0, 1e-15);
    }
}

TEST(ModelBuilder, GivesAFishTheParticlesOfTheThesis) {
    expect_sound(fish_body(), 137, {});
    for (const Group& group : fish_body().particles.groups) {
        EXPECT_GE(group.members.size(), 9u);  // itself and eight neighbours
        EXPECT_LE(group.members.size(), 11u);
    }
    EXPECT_TRUE(fish_body().particles.links.empty());
}

TEST(ModelBuilder, GivesTheSameBitsOnEveryMachine) {
    const ParticleModel& model = fish_body().particles;
    StateHash hash;
    hash.add(std::span<const Vec3>(model.rest_position));
    hash.add(std::span<const Vec3>(model.semi_axes));
    hash.add(std::span<const Quat>(model.axes));
    for (std::size_t i = 0; i < model.size(); ++i) {
        const Vec3 scalars(model.mass[i], model.radius[i], model.groups[i].members[0]);
        hash.add(std::span<const Vec3>(&scalars, 1));
    }
    for (const SkinVertex& vertex : fish_body().skin) {
        const Quat weights(vertex.weight[0], vertex.weight[1], vertex.weight[2], vertex.weight[3]);
        hash.add(std::span<const Quat>(&weights, 1));
    }
    EXPECT_EQ(hash.value(), 0xa34092eb98b90493u);
}

TEST(ModelBuilder, SpreadsParticlesEvenly) {
    const ParticleModel& model = fish_body().particles;
    std::vector<double> nearest(model.size(), std::numeric_limits<double>::infinity());
    for (std::size_t i = 0; i < model.size(); ++i) {
        for (std::size_t j = 0; j < model.size(); ++j) {
            if (i != j) {
                nearest[i] = std::min(nearest[i], glm::length(model.rest_position[i] - model.rest_position[j]));
            }
        }
    }
    const auto [closest, farthest] = std::minmax_element(nearest.begin(), nearest.end());
    // Random positions would give a ratio of hundreds, a lattice 1.
    EXPECT_LT(*farthest / *closest, 2.5);
}

TEST(ModelBuilder, CoversTheBodyWithEllipsoids) {
    const ParticleModel& model = fish_body().particles;
    std::size_t covered = 0;
    for (const Vec3& p : fish_body().mesh.vertices) {
        bool inside = false;
        for (std::size_t i = 0; i < model.size() && !inside; ++i) {
            const Vec3 q = glm::transpose(to_matrix(model.axes[i])) * (p - model.rest_position[i]) / model.semi_axes[i];
            inside = glm::dot(q, q) <= 1.0;
        }
        covered += inside ? 1u : 0u;
    }
    EXPECT_GT(static_cast<double>(covered), 0.9 * static_cast<double>(fish_body().mesh.vertices.size()));
    // But not much more: the ellipsoids do not protrude from the body's box.
    for (std::size_t i = 0; i < model.size(); ++i) {
        const Mat3 axes = to_matrix(model.axes[i]);
        for (int k = 0; k < 3; ++k) {
            const Vec3 row(axes[0][k], axes[1][k], axes[2][k]);
            const double half_width = glm::length(row * model.semi_axes[i]);
            const std::array<double, 3> border{0.15, 0.06, 0.045};
            EXPECT_LT(std::abs(model.rest_position[i][k]) - border[static_cast<std::size_t>(k)],
                      0.02 - 0.3 * half_width);
        }
    }
}

TEST(ModelBuilder, DistributesMassByVolume) {
    // Two cubes with a volume ratio of eight, joined at their nearest sides.
    TriangleMesh mesh = box(Vec3(0.0), Vec3(0.2), 4);
    detail::append(mesh, box(Vec3(0.21, 0.0, 0.0), Vec3(0.31, 0.1, 0.1), 4));
    const DeformableBody body = build_body(mesh, {.particles = 90, .mass = 0.9});
    double left = 0.0;
    for (std::size_t i = 0; i < 90; ++i) {
        left += body.particles.rest_position[i].x < 0.205 ? body.particles.mass[i] : 0.0;
    }
    EXPECT_NEAR(left, 0.8, 0.02);
}

TEST(ModelBuilder, LinksNothingAcrossAGap) {
    // A comb: three teeth 0.02 thick, 0.02 apart and 0.2 long, on a back. Particles are 0.03 apart, so that in straight
    // distance the next tooth would be among the nearest.
    TriangleMesh mesh;
    mesh.closed = true;
    const std::array<double, 6> teeth{0.0, 0.02, 0.04, 0.06, 0.08, 0.10};
    std::vector<Vec3> outline;  // x, y
    outline.emplace_back(0.0, 0.04, 0.0);
    for (std::size_t k = 0; k < teeth.size(); k += 2) {
        if (k > 0) {
            outline.emplace_back(teeth[k], 0.0, 0.0);
        }
        outline.emplace_back(teeth[k], -0.2, 0.0);
        outline.emplace_back(teeth[k + 1], -0.2, 0.0);
        outline.emplace_back(teeth[k + 1], 0.0, 0.0);
    }
    outline.back().y = 0.04;
    const auto n = static_cast<std::uint32_t>(outline.size());
    for (const double z : {0.0, 0.02}) {
        for (const Vec3& p : outline) {
            mesh.vertices.emplace_back(p.x, p.y, z);
        }
    }
    for (std::uint32_t i = 0; i < n; ++i) {
        const std::uint32_t j = (i + 1) % n;
        mesh.triangles.push_back({i, j, n + j});
        mesh.triangles.push_back({i, n + j, n + i});
    }
    // The caps: a quad for each tooth, and a polygon for the back.
    const auto quad = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t d) {
        mesh.triangles.push_back({a, c, b});
        mesh.triangles.push_back({a, d, c});
        mesh.triangles.push_back({n + a, n + b, n + c});
        mesh.triangles.push_back({n + a, n + c, n + d});
    };
    // Outline: 0 top left, 1 2 tooth, 3 root, 4 root, 5 6 tooth, 7 root, 8 root, 9 10 tooth, 11 top right.
    ASSERT_EQ(n, 12u);
    quad(0, 1, 2, 3);
    quad(4, 5, 6, 7);
    quad(8, 9, 10, 11);
    const auto triangle = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c) {
        mesh.triangles.push_back({a, c, b});
        mesh.triangles.push_back({n + a, n + b, n + c});
    };
    triangle(0, 3, 4);
    triangle(0, 4, 7);
    triangle(0, 7, 8);
    triangle(0, 8, 11);
    const DeformableBody body = build_body(mesh, {.particles = 30, .neighbours = 4});
    expect_sound(body, 30, {});
    const auto tooth = [](const Vec3& p) { return p.y > -0.06 ? -1 : static_cast<int>(std::floor(p.x / 0.04)); };
    const auto in_two_teeth = [&](const Vec3& p, const Vec3& q) {
        return tooth(p) >= 0 && tooth(q) >= 0 && tooth(p) != tooth(q);
    };
    const std::vector<Vec3>& at = body.particles.rest_position;
    for (const Group& group : body.particles.groups) {
        for (const std::uint32_t member : group.members) {
            EXPECT_FALSE(in_two_teeth(at[group.centre], at[member])) << group.centre << " and " << member;
        }
    }
    for (std::size_t j = 0; j < body.skin.size(); ++j) {
        for (std::size_t k = 0; k < 4; ++k) {
            if (body.skin[j].weight[k] > 0.0 && mesh.vertices[j].y < -0.1) {
                EXPECT_FALSE(in_two_teeth(mesh.vertices[j], at[body.skin[j].particle[k]])) << j;
            }
        }
    }
}

TEST(ModelBuilder, HasContinuousWeights) {
    // Weights decrease with distance over spacing, here 14 mm. Along an edge of length l no weight may change by more
    // than a few l / 14 mm.
    const DeformableBody& body = fish_body();
    const auto weight_of = [&](std::uint32_t vertex, std::uint32_t particle) {
        double sum = 0.0;
        for (std::size_t k = 0; k < 4; ++k) {
            sum += body.skin[vertex].particle[k] == particle ? body.skin[vertex].weight[k] : 0.0;
        }
        return sum;
    };
    double steepest = 0.0;
    for (const Triangle& t : body.mesh.triangles) {
        for (std::size_t e = 0; e < 3; ++e) {
            const std::uint32_t a = t[e];
            const std::uint32_t b = t[(e + 1) % 3];
            const double length = glm::length(body.mesh.vertices[a] - body.mesh.vertices[b]);
            for (const std::uint32_t particle : body.skin[a].particle) {
                steepest =
                    std::max(steepest, std::abs(weight_of(a, particle) - weight_of(b, particle)) / (length + 0.002));
            }
        }
    }
    EXPECT_LT(steepest * 0.014, 2.5);
}

TEST(ModelBuilder, PutsAParticleOnEveryVertexIfAskedTo) {
    TriangleMesh mesh = make_cloth_mesh({.vertices_per_side = 9});
    const BuilderSettings settings{.particles = 0, .mass = 0.1, .link_stiffness = 1.0};
    const DeformableBody body = build_body(mesh, settings);
    expect_sound(body, 81, settings);
    EXPECT_EQ(body.particles.rest_position, mesh.vertices);
    // Away from the border the eight nearest are the grid neighbours that the cloth generator links.
    const ParticleModel made = make_cloth_particles({.vertices_per_side = 9}, 0.3, 1.0);
    EXPECT_EQ(body.particles.groups[40].members, made.groups[40].members);
}

TEST(ModelBuilder, BuildsOnAFlatSheet) {
    const DeformableBody body = build_body(make_cloth_mesh({.vertices_per_side = 5}), {.particles = 20});
    expect_sound(body, 20, {});
    for (const Vec3& p : body.particles.rest_position) {
        EXPECT_EQ(p.y, 0.0);
    }
}

TEST(ModelBuilder, BuildsOnASingleTriangle) {
    TriangleMesh mesh;
    mesh.vertices = {{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}};
    mesh.triangles = {{0, 1, 2}};
    for (const std::size_t particles : {1u, 2u, 3u, 4u, 5u, 40u}) {
        expect_sound(build_body(mesh, {.particles = particles}), particles, {});
    }
}

TEST(ModelBuilder, BuildsOnAThinRod) {
    const DeformableBody body = build_body(box(Vec3(0.0), Vec3(1.0, 0.01, 0.01), 2), {.particles = 20});
    expect_sound(body, 20, {});
    std::vector<double> along;
    for (const Vec3& p : body.particles.rest_position) {
        along.push_back(p.x);
    }
    std::sort(along.begin(), along.end());
    for (std::size_t k = 0; k < along.size(); ++k) {
        EXPECT_NEAR(along[k], (static_cast<double>(k) + 0.5) / 20.0, 0.04);  // less than the spacing
    }
}

TEST(ModelBuilder, BuildsOneParticleInTheMiddle) {
    const DeformableBody body = build_body(box(Vec3(-1.0), Vec3(1.0), 3), {.particles = 1, .mass = 2.0});
    expect_sound(body, 1, {.mass = 2.0});
    EXPECT_LT(glm::length(body.particles.rest_position[0]), 0.05);
    // The ellipsoid of a cube is a ball; with the same second moments its radius is sqrt(5 / 3).
    EXPECT_NEAR(body.particles.radius[0], std::sqrt(5.0 / 3.0), 0.1);
    for (int k = 0; k < 3; ++k) {
        EXPECT_NEAR(body.particles.semi_axes[0][k], 1.2 * std::sqrt(5.0 / 3.0), 0.1);
    }
}

TEST(ModelBuilder, BuildsTwoParticlesThatShareTheBody) {
    const DeformableBody body = build_body(box(Vec3(0.0), Vec3(2.0, 1.0, 1.0), 3), {.particles = 2, .mass = 1.0});
    expect_sound(body, 2, {.mass = 1.0});
    EXPECT_NEAR(body.particles.mass[0], 0.5, 0.1);
    EXPECT_NEAR(std::abs(body.particles.rest_position[0].x - body.particles.rest_position[1].x), 1.0, 0.3);
}

TEST(ModelBuilder, JoinsPartsThatAreNear) {
    TriangleMesh mesh = box(Vec3(0.0), Vec3(0.2), 3);
    detail::append(mesh, box(Vec3(0.205, 0.05, 0.05), Vec3(0.22, 0.06, 0.06), 1));
    expect_sound(build_body(mesh, {.particles = 20}), 20, {});
}

TEST(ModelBuilder, RefusesUnconnectedPartsAndNamesTheRemedy) {
    TriangleMesh mesh = box(Vec3(0.0), Vec3(0.2), 3);
    detail::append(mesh, box(Vec3(0.7, 0.0, 0.0), Vec3(0.9, 0.2, 0.2), 3));
    try {
        (void)build_body(mesh, {.particles = 40});
        FAIL() << "built";
    } catch (const std::invalid_argument& error) {
        const std::string what = error.what();
        EXPECT_NE(what.find("vertex 56"), std::string::npos) << what;
        EXPECT_NE(what.find("bridge"), std::string::npos) << what;
    }
    expect_sound(build_body(mesh, {.particles = 40, .bridge = 0.6}), 40, {});
}

TEST(ModelBuilder, RefusesInvalidInput) {
    const TriangleMesh good = box(Vec3(0.0), Vec3(1.0), 1);
    const auto refused = [](const TriangleMesh& mesh, const BuilderSettings& settings, const std::string& why) {
        try {
            (void)build_body(mesh, settings);
        } catch (const std::invalid_argument& error) {
            return std::string(error.what()).find(why) != std::string::npos;
        }
        return false;
    };
    EXPECT_TRUE(refused(good, {.particles = 30'000}, "20000"));
    EXPECT_TRUE(refused(good, {.neighbours = 0}, "neighbours"));
    EXPECT_TRUE(refused(good, {.mass = 0.0}, "mass"));
    EXPECT_TRUE(refused(good, {.mass = std::numeric_limits<double>::quiet_NaN()}, "mass"));
    EXPECT_TRUE(refused({}, {}, "area"));
    TriangleMesh bad = good;
    bad.triangles[3][1] = 99;
    EXPECT_TRUE(refused(bad, {}, "triangle 3"));
    bad = good;
    bad.vertices[5].y = std::numeric_limits<double>::infinity();
    EXPECT_TRUE(refused(bad, {}, "vertex 5"));
    bad = good;
    bad.vertices.emplace_back(0.0);
    EXPECT_TRUE(refused(bad, {}, "vertex 8"));
    bad = good;
    for (Vec3& p : bad.vertices) {
        p.y = p.z = 0.0;
    }
    EXPECT_TRUE(refused(bad, {}, "area"));
}

TEST(ModelBuilder, RebuildsTheSkinOfItsOwnParticles) {
    const DeformableBody& body = fish_body();
    const Skin again = build_skin(body.mesh, body.particles, 0.0);
    ASSERT_EQ(again.size(), body.skin.size());
    for (std::size_t j = 0; j < again.size(); ++j) {
        EXPECT_EQ(again[j].particle, body.skin[j].particle) << j;
        EXPECT_EQ(again[j].weight, body.skin[j].weight) << j;
    }
}

/// Sites by the definition: each is the sample farthest, along edges, from those before, the first of those equally
/// far.
std::vector<std::uint32_t> spread_by_definition(const SampleGraph& graph, std::uint32_t first, std::size_t count) {
    std::vector<std::uint32_t> chosen{first};
    std::vector<double> distance(graph.size(), std::numeric_limits<double>::infinity());
    while (chosen.size() < count) {
        distance[chosen.back()] = 0.0;
        for (bool changed = true; changed;) {
            changed = false;
            for (std::uint32_t i = 0; i < graph.size(); ++i) {
                for (const Edge& edge : graph.edges_from(i)) {
                    changed = changed || distance[i] + edge.length < distance[edge.to];
                    distance[edge.to] = std::min(distance[edge.to], distance[i] + edge.length);
                }
            }
        }
        chosen.push_back(
            static_cast<std::uint32_t>(std::max_element(distance.begin(), distance.end()) - distance.begin()));
    }
    return chosen;
}

TEST(ModelBuilder, SpreadsSitesToTheFarthestSampleEachTime) {
    const SampleGraph graph = make_sample_graph(box(Vec3(0.0), Vec3(0.1, 0.05, 0.03), 3), 0.006, 0.01);
    const std::vector<Site> sites = spread_evenly(graph, 60);
    const std::vector<std::uint32_t> expected = spread_by_definition(graph, sites.front().sample, 60);
    for (std::size_t k = 0; k < sites.size(); ++k) {
        ASSERT_EQ(sites[k].sample, expected[k]) << k;
    }
}

TEST(ModelBuilder, SaysHowFarItIs) {
    std::vector<double> shares;
    const DeformableBody body = build_body(make_fish_mesh({}), {}, [&](double share) { shares.push_back(share); });
    ASSERT_GT(shares.size(), 100u);
    EXPECT_TRUE(std::is_sorted(shares.begin(), shares.end()));
    EXPECT_GE(shares.front(), 0.0);
    EXPECT_LE(shares.back(), 1.0);
    EXPECT_GT(shares.back(), 0.9);
    EXPECT_EQ(body.particles.position, fish_body().particles.position) << "asking changes nothing";
}

}  // namespace
}  // namespace haptic::sim
