#include "haptic/sim/tool_model.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <glm/common.hpp>
#include <numbers>
#include <numeric>
#include <stdexcept>
#include <string>

#include "dynamics/rotation.hpp"
#include "generators/revolved.hpp"
#include "generators/triangle_grid.hpp"
#include "haptic/sim/mesh_file.hpp"
#include "haptic/sim/model_builder.hpp"
#include "mesh/mesh_measures.hpp"
#include "model/sample_graph.hpp"
#include "simd/aabb.hpp"
#include "tool/close_gaps.hpp"
#include "tool/hand_mesh.hpp"
#include "tool/sphere_cover.hpp"

namespace haptic::sim {
namespace {

constexpr double kDefaultCoverError = 0.02;  // default cover error, part of the longest side
// Shares of the time of building after which the spheres, and the body at their centres, are there.
constexpr double kCovered = 0.5;
constexpr double kPlaced = 0.9;
constexpr double kGridCell = 0.03;  // of the triangle grid, part of the longest side

[[noreturn]] void refuse_tool(const std::string& why) {
    throw std::invalid_argument("tool: " + why);
}

bool can_close(const ToolSettings& settings) {
    return settings.shape == ToolShape::Hand && settings.file.empty();
}

void check(const ToolSettings& s) {
    if (s.spheres > ToolSettings::kMaxSpheres) {
        refuse_tool(std::to_string(s.spheres) + " spheres exceed the maximum of " +
                    std::to_string(ToolSettings::kMaxSpheres));
    }
    if (!(s.radius >= 0.0) || !std::isfinite(s.radius) || !(s.cover_error >= 0.0) || !std::isfinite(s.cover_error)) {
        refuse_tool("radius and cover_error must be 0 or more");
    }
    const auto is_curl = [](double curl) { return curl >= 0.0 && curl <= 1.0; };
    if (!is_curl(s.curl) || !is_curl(s.close_to) || !(s.close_speed > 0.0) || !std::isfinite(s.close_speed)) {
        refuse_tool("curl and close_to must be 0 to 1, and close_speed positive");
    }
    if (!can_close(s) && (s.curl > 0.0 || s.close_button >= 0)) {
        refuse_tool("curl and close_button are for the generated hand only");
    }
}

Vec3 size_of(const TriangleMesh& mesh, Vec3& middle) {
    const Aabb box = aabb_of(mesh.vertices);
    middle = box.center();
    return box.size();
}

double longest_side(const TriangleMesh& mesh) {
    Vec3 middle(0.0);
    const Vec3 size = size_of(mesh, middle);
    return std::max({size.x, size.y, size.z});
}

TriangleMesh mesh_of_file(const ToolSettings& settings) {
    MeshFileSettings file_settings;
    // A given scale keeps the file's origin.
    if (settings.file_scale > 0.0) {
        file_settings.scale = settings.file_scale;
        return load_mesh(settings.file, file_settings);
    }
    // Without one, the mesh is centred and its longest side becomes `length`.
    TriangleMesh mesh = load_mesh(settings.file, file_settings);
    Vec3 middle(0.0);
    const Vec3 size = size_of(mesh, middle);
    const double scale = settings.length / std::max({size.x, size.y, size.z});
    for (Vec3& p : mesh.vertices) {
        p = scale * (p - middle);
    }
    return mesh;
}

TriangleMesh mesh_of(const ToolSettings& settings) {
    if (!settings.file.empty()) {
        return mesh_of_file(settings);
    }
    switch (settings.shape) {
        case ToolShape::Rod:
            return make_rod_mesh(settings.length, settings.thickness);
        case ToolShape::Probe:
            return make_probe_mesh(settings.length, settings.thickness, settings.ball_radius);
        case ToolShape::Hand:
            return make_hand_mesh(settings.length);
        case ToolShape::Sphere:
            break;
    }
    return make_sphere_mesh(settings.ball_radius);
}

/// Balls evenly spaced on the z axis, from z = first to z = last.
void add_row(std::vector<Ball>& balls, std::size_t count, double first, double last, double radius) {
    for (std::size_t k = 0; k < count; ++k) {
        const double part = count > 1 ? static_cast<double>(k) / static_cast<double>(count - 1) : 0.5;
        balls.push_back({{0.0, 0.0, glm::mix(first, last, part)}, radius});
    }
}

/// `count` spheres in a row for a rod, a probe or a sphere.
std::vector<Ball> make_row(const ToolSettings& settings, std::size_t count) {
    std::vector<Ball> balls;
    // Radius of the shaft, and z of the last sphere's centre, so that it ends where the shaft ends.
    const double shaft = 0.5 * settings.thickness;
    const double end = 0.5 * settings.length - shaft;
    switch (settings.shape) {
        case ToolShape::Rod:
            add_row(balls, count, -end, end, shaft);
            break;
        case ToolShape::Probe: {
            const double ball = -0.5 * settings.length + settings.ball_radius;
            balls.push_back({{0.0, 0.0, ball}, settings.ball_radius});
            // Half a spacing between ball and shaft: the ball covers as much of the shaft as half a sphere would.
            const double root = ball + settings.ball_radius;
            const double space = count > 1 ? (end - root) / (static_cast<double>(count) - 1.5) : 0.0;
            add_row(balls, count - 1, count > 2 ? root + 0.5 * space : end, end, shaft);
            break;
        }
        case ToolShape::Hand:
        case ToolShape::Sphere:
            add_row(balls, count, 0.0, 0.0, settings.ball_radius);
            break;
    }
    // A radius that is set overrides all.
    for (Ball& ball : balls) {
        ball.radius = settings.radius > 0.0 ? settings.radius : ball.radius;
    }
    return balls;
}

double requested_error(const ToolSettings& settings, const TriangleMesh& mesh) {
    return settings.cover_error > 0.0 ? settings.cover_error : kDefaultCoverError * longest_side(mesh);
}

/// Spheres for a generated solid of revolution: a row, without a search for positions.
std::vector<Ball> cover_solid_of_revolution(const ToolSettings& settings, const TriangleMesh& mesh) {
    if (settings.shape == ToolShape::Sphere) {
        if (settings.spheres > 1) {
            refuse_tool("the sphere has exactly one sphere; for more, use a rod or a mesh file");
        }
        return make_row(settings, 1);
    }
    if (settings.spheres > 0) {
        return make_row(settings, settings.spheres);
    }
    // Refuse an error that even the largest number of spheres exceeds.
    const double max_error = requested_error(settings, mesh);
    const auto error_of = [&](std::size_t count) { return measure_cover(mesh, make_row(settings, count)); };
    const auto enough = [&](const CoverError& error) {
        return std::max(error.uncovered, error.protrusion) <= max_error;
    };
    const CoverError left = error_of(ToolSettings::kMaxSpheres);
    if (!enough(left)) {
        refuse_tool("a cover error of " + std::to_string(max_error) + " m needs more than " +
                    std::to_string(ToolSettings::kMaxSpheres) + " spheres; with that many, the mesh is up to " +
                    std::to_string(left.uncovered) + " m outside the spheres, and the spheres up to " +
                    std::to_string(left.protrusion) +
                    " m outside the mesh. Raise cover_error, or make the tool thicker");
    }
    // Bisection: the error does not grow with the number of spheres in a row.
    std::size_t too_few = 0;
    std::size_t count = ToolSettings::kMaxSpheres;
    while (count - too_few > 1) {
        const std::size_t middle = (count + too_few) / 2;
        (enough(error_of(middle)) ? count : too_few) = middle;
    }
    return make_row(settings, count);
}

std::vector<Ball> spheres_for(const ToolSettings& settings, const TriangleMesh& mesh) {
    if (settings.file.empty() && settings.shape != ToolShape::Hand) {
        return cover_solid_of_revolution(settings, mesh);
    }
    CoverSettings cover;
    cover.count = settings.spheres;
    // Default of the generated hand: the number of the thesis (section 5.5.1).
    if (settings.file.empty() && settings.spheres == 0 && settings.cover_error == 0.0) {
        cover.count = kHandSpheres;
    }
    cover.max_count = ToolSettings::kMaxSpheres;
    cover.radius = settings.radius;
    cover.error = requested_error(settings, mesh);
    return cover_with_spheres(mesh, cover);
}

/// Neighbours whose segment lies inside the mesh: the space between two fingers is not a gap of the cover.
Neighbours joined_inside(const TriangleMesh& mesh, const std::vector<Ball>& balls, const Neighbours& neighbours) {
    if (!mesh.closed) {
        return neighbours;
    }
    const TriangleGrid grid(mesh.vertices, mesh.triangles, kGridCell * longest_side(mesh));
    Neighbours joined;
    for (const auto& [a, b] : neighbours) {
        if (grid.first_crossing(balls[a].centre, balls[b].centre, 0.0) > 1.0) {
            joined.emplace_back(a, b);
        }
    }
    return joined;
}

std::vector<Vec3> centres_of(const std::vector<Ball>& balls) {
    std::vector<Vec3> centres;
    centres.reserve(balls.size());
    for (const Ball& ball : balls) {
        centres.push_back(ball.centre);
    }
    return centres;
}

/// Skeleton of the hand in the grip frame.
ToolSkeleton placed_skeleton(const ToolSettings& settings) {
    ToolSkeleton skeleton = make_hand_skeleton(settings.length);
    const Mat3 rotation = to_matrix(settings.grip.orientation);
    const auto put = [&](Vec3& p) { p = rotation * p + settings.grip.position; };
    for (ToolJoint& joint : skeleton.joints) {
        put(joint.position);
        joint.rotation = rotation * joint.rotation;
    }
    for (ToolBone& bone : skeleton.bones) {
        put(bone.from);
        put(bone.to);
    }
    return skeleton;
}

double sphere_volume(double radius) {
    return 4.0 / 3.0 * std::numbers::pi * radius * radius * radius;
}

/// m^3, per particle: the mesh's volume in proportion to the particles' masses. An open mesh has none, but spheres do.
std::vector<double> volumes_of(const TriangleMesh& mesh, const ParticleModel& particles,
                               const std::vector<Ball>& balls) {
    std::vector<double> volume;
    volume.reserve(balls.size());
    const double whole = std::abs(signed_volume(mesh));
    const double mass = std::accumulate(particles.mass.begin(), particles.mass.end(), 0.0);
    for (std::size_t i = 0; i < balls.size(); ++i) {
        volume.push_back(mesh.closed ? whole * particles.mass[i] / mass : sphere_volume(balls[i].radius));
    }
    return volume;
}

std::string name_of(const ToolSettings& settings) {
    if (!settings.file.empty()) {
        return std::filesystem::path(settings.file).stem().string();
    }
    switch (settings.shape) {
        case ToolShape::Hand:
            return "hand";
        case ToolShape::Rod:
            return "rod";
        case ToolShape::Probe:
            return "probe";
        case ToolShape::Sphere:
            break;
    }
    return "sphere";
}

}  // namespace

ToolModel one_sphere(double radius) {
    ToolModel tool;
    tool.body.name = "sphere";
    tool.body.particles.add(Vec3(0.0), 1.0, radius);
    tool.radius = {radius};
    tool.volume = {sphere_volume(radius)};
    return tool;
}

ToolModel make_tool(const ToolSettings& settings, const Progress& progress) {
    check(settings);
    const TriangleMesh mesh = mesh_of(settings);
    BuilderSettings builder;
    builder.neighbours = settings.neighbours;
    // Spheres, particles at their centres, and the net of neighbours in which there must be no gap.
    std::vector<Ball> balls = spheres_for(settings, mesh);
    report(progress, kCovered);
    PlacedBody placed = build_body_at(mesh, centres_of(balls), builder, part_of(progress, kCovered, kPlaced));
    const Neighbours net = joined_inside(mesh, balls, placed.neighbours);
    ToolModel tool;
    if (settings.close_gaps) {
        const std::size_t before = balls.size();
        // An added sphere may stand out as far as the existing ones do; an open mesh does not limit it.
        const CoverError error = measure_cover(mesh, balls);
        const RadiusLimit radius_limit = [&](const Vec3& p) {
            return mesh.closed ? depth_in(mesh, p) + std::max(error.uncovered, error.protrusion) : longest_side(mesh);
        };
        balls = close_gaps(balls, net, ToolSettings::kMaxSpheres, radius_limit);
        tool.added = balls.size() - before;
        if (tool.added > 0) {
            placed = build_body_at(mesh, centres_of(balls), builder);
        }
    }
    // Gap and cover error with all spheres. The net is that of the original ones: added ones cover it.
    tool.widest_gap = widest_gap(balls, net);
    const CoverError error = measure_cover(mesh, balls);
    tool.cover_error = std::max(error.uncovered, error.protrusion);
    for (const Ball& ball : balls) {
        tool.radius.push_back(ball.radius);
    }
    tool.volume = volumes_of(mesh, placed.body.particles, balls);
    tool.material = settings.material;
    // Body in the grip frame; the joints need the particles there.
    tool.body = std::move(placed.body);
    tool.body.name = name_of(settings);
    place(tool.body, settings.grip);
    if (can_close(settings)) {
        tool.joints = ToolJoints(placed_skeleton(settings), tool.body.particles.rest_position);
    }
    return tool;
}

}  // namespace haptic::sim
