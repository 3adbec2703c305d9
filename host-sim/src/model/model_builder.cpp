#include "haptic/sim/model_builder.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <span>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "dynamics/rotation.hpp"
#include "haptic/numeric.hpp"
#include "mesh/mesh_measures.hpp"
#include "mesh/mesh_topology.hpp"
#include "model/sample_distances.hpp"
#include "model/sample_graph.hpp"
#include "simd/aabb.hpp"

namespace haptic::sim {
namespace {

constexpr double kSamplesPerSpacing = 2.5;  // samples between neighbouring particles
constexpr std::size_t kMinSamples = 1500;
constexpr std::size_t kMinSamplesEach = 8;
constexpr int kRelaxations = 24;
// Shares of the time of build_body() after which samples, spread sites and relaxed sites are there.
constexpr double kSampled = 0.05;
constexpr double kSpread = 0.1;
constexpr double kRelaxed = 0.5;
// Paths along graph edges are up to a tenth longer than the shortest path in the body.
constexpr double kDetour = 1.1;
// Extra candidates, because the order by path length differs from that by max(straight distance, path / kDetour).
constexpr std::size_t kSpareSources = 4;
constexpr std::size_t kSkinSources = SkinVertex::kMax + 1 + kSpareSources;
// Ellipsoids with the size of their cells would leave the corners between cells uncovered. With this scale those of the
// fish cover 99 % of its volume and 94 % of its vertices.
constexpr double kEllipsoidScale = 1.2;
// Smallest ratio of a semi-axis to the longest, so that particles of a sheet are not flat.
constexpr int kSweeps = 12;  // that diagonalise moments
constexpr double kMinAxisRatio = 0.25;

[[noreturn]] void refuse(const std::string& why) {
    throw std::invalid_argument("model builder: " + why);
}

void check(const BuilderSettings& s) {
    if (s.particles > BuilderSettings::kMaxParticles) {
        refuse(std::to_string(s.particles) + " particles are more than the maximum of " +
               std::to_string(BuilderSettings::kMaxParticles));
    }
    if (s.neighbours < 1 || s.neighbours > BuilderSettings::kMaxNeighbours) {
        refuse("neighbours must be 1 to " + std::to_string(BuilderSettings::kMaxNeighbours));
    }
    if (!(s.mass > 0.0) || !std::isfinite(s.mass) || !(s.bridge >= 0.0) || !std::isfinite(s.bridge)) {
        refuse("mass must be positive, and bridge at least 0");
    }
}

void check(const TriangleMesh& mesh) {
    // Every index exists; every vertex is finite and belongs to a triangle.
    std::vector<bool> used(mesh.vertices.size(), false);
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
        for (const std::uint32_t corner : mesh.triangles[t]) {
            if (corner >= mesh.vertices.size()) {
                refuse("triangle " + std::to_string(t) + " refers to vertex " + std::to_string(corner) +
                       ", but the mesh has " + std::to_string(mesh.vertices.size()) + " vertices");
            }
            used[corner] = true;
        }
    }
    for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
        const Vec3& p = mesh.vertices[i];
        if (!haptic::is_finite(p)) {
            refuse("vertex " + std::to_string(i) + " is not finite");
        }
        if (!used[i]) {
            refuse("vertex " + std::to_string(i) + " belongs to no triangle: remove it");
        }
    }
    if (!(surface_area(mesh) > 0.0)) {
        refuse("the mesh has no area");
    }
}

/// Newton's method from above, because the function of the mathematical library differs between machines.
double cube_root(double x) {
    if (!(x > 0.0)) {
        return 0.0;
    }
    // 1 + x is above the root. The iterates fall until rounding stops them.
    double root = 1.0 + x;
    double next = (2.0 * root + x / (root * root)) / 3.0;
    while (next < root) {
        root = next;
        next = (2.0 * root + x / (root * root)) / 3.0;
    }
    return root;
}

/// Approximate spacing of that many particles, m: the largest of the estimates for a sheet, a rod and a solid.
double spacing_of(const TriangleMesh& mesh, std::size_t particles) {
    // A sheet has A / n of area per particle, a rod L / n of length, a solid V / n of volume.
    const double count = static_cast<double>(particles);
    const bool two_walls = mesh.closed || mesh.double_faced;
    const double as_sheet = std::sqrt(surface_area(mesh) / (two_walls ? 2.0 : 1.0) / count);
    const double as_rod = glm::length(aabb_of(mesh.vertices).size()) / count;
    const double as_solid = mesh.closed ? cube_root(std::abs(signed_volume(mesh)) / count) : 0.0;
    return std::max({as_sheet, as_rod, as_solid});
}

/// Refines the sampling until there are enough samples to choose from for each particle.
SampleGraph sample_finely(const TriangleMesh& mesh, std::size_t particles, double bridge) {
    const std::size_t min_samples = std::max(kMinSamples, kMinSamplesEach * particles);
    const double spacing = spacing_of(mesh, particles);
    double pitch = spacing / kSamplesPerSpacing;
    for (;; pitch *= 0.7) {
        SampleGraph graph = make_sample_graph(mesh, pitch, bridge > 0.0 ? bridge : spacing);
        if (graph.size() >= min_samples) {
            return graph;
        }
    }
}

/// The part of the body nearest to a particle (its Voronoi cell along edges).
struct Cell {
    double share = 0.0;
    Vec3 centroid{0.0};    // m
    Mat3 covariance{0.0};  // m^2, about the centroid
};

std::vector<Cell> cells_of(const SampleGraph& graph, const std::vector<std::vector<Source>>& nearest,
                           std::size_t count) {
    // Each sample belongs to the particle nearest along edges. Share and centroid of the cells.
    std::vector<Cell> cells(count);
    for (std::size_t i = 0; i < graph.size(); ++i) {
        Cell& cell = cells[nearest[i].front().index];
        cell.share += graph.share[i];
        cell.centroid += graph.share[i] * graph.position[i];
    }
    for (Cell& cell : cells) {
        if (cell.share > 0.0) {
            cell.centroid /= cell.share;
        }
    }
    // Covariance about the centroid, weighted by share.
    for (std::size_t i = 0; i < graph.size(); ++i) {
        Cell& cell = cells[nearest[i].front().index];
        const Vec3 offset = graph.position[i] - cell.centroid;
        const Vec3 weighted = (graph.share[i] / cell.share) * offset;
        cell.covariance += Mat3(weighted * offset.x, weighted * offset.y, weighted * offset.z);
    }
    return cells;
}

/// Gives particle i the ellipsoid with the second moments of its cell, and the radius of the ball with the same
/// inertia.
void shape_particle(ParticleModel& model, std::size_t i, const Cell& cell, double min_radius) {
    // Principal axes and variances of the cell.
    Mat3 moments = cell.covariance;
    Mat3 axes(1.0);
    diagonalise(moments, axes, kSweeps);
    // The variance of a solid ellipsoid along a semi-axis a is a^2 / 5.
    Vec3 semi(0.0);
    for (int k = 0; k < 3; ++k) {
        semi[k] = kEllipsoidScale * std::sqrt(5.0 * std::max(0.0, moments[k][k]));
    }
    // Limit the flatness: sheets have no thickness of their own.
    const double longest = std::max({semi.x, semi.y, semi.z, min_radius});
    for (int k = 0; k < 3; ++k) {
        semi[k] = std::max(semi[k], kMinAxisRatio * longest);
    }
    model.semi_axes[i] = semi;
    model.axes[i] = glm::normalize(glm::quat_cast(axes));
    // Ball of the same inertia: r^2 / 5 = trace / 3.
    const double trace = moments[0][0] + moments[1][1] + moments[2][2];
    model.radius[i] = std::max(std::sqrt(5.0 / 3.0 * std::max(0.0, trace)), min_radius);
}

/// Adds members until the groups connect all particles (Kruskal): pairs of particles with touching cells, nearest
/// first.
void join_groups(ParticleModel& model, const SampleGraph& graph, const std::vector<std::vector<Source>>& nearest) {
    // Particles that groups connect already.
    detail::DisjointSets parts(model.size());
    for (const Group& group : model.groups) {
        for (const std::uint32_t member : group.members) {
            parts.unite(group.centre, member);
        }
    }
    // Candidate pairs: particles in different components whose cells touch.
    std::vector<std::tuple<double, std::uint32_t, std::uint32_t>> touching;
    for (std::uint32_t i = 0; i < graph.size(); ++i) {
        for (const Edge& edge : graph.edges_from(i)) {
            const std::uint32_t a = nearest[i].front().index;
            const std::uint32_t b = nearest[edge.to].front().index;
            if (a < b && parts.find(a) != parts.find(b)) {
                touching.emplace_back(glm::length(model.rest_position[b] - model.rest_position[a]), a, b);
            }
        }
    }
    // Shortest first; a pair that an earlier one has connected is skipped.
    std::sort(touching.begin(), touching.end());
    for (const auto& [distance, a, b] : touching) {
        if (parts.find(a) != parts.find(b)) {
            parts.unite(a, b);
            model.groups[a].members.push_back(b);
            model.groups[b].members.push_back(a);
        }
    }
}

void make_groups(ParticleModel& model, const SampleGraph& graph, const std::vector<std::vector<Source>>& nearest,
                 std::span<const Site> sites, const BuilderSettings& settings) {
    // The nearest others by the larger of straight distance and path / kDetour, since path lengths are overestimated.
    for (std::uint32_t i = 0; i < model.size(); ++i) {
        std::vector<Source> others;
        for (const Source& source : nearest[sites[i].sample]) {
            if (source.index != i) {
                const double straight = glm::length(model.rest_position[source.index] - model.rest_position[i]);
                others.push_back({std::max(straight, source.distance / kDetour), source.index});
            }
        }
        std::sort(others.begin(), others.end(), nearer);
        // The particle itself and its nearest neighbours.
        Group group{i, {i}, settings.group_stiffness};
        for (std::size_t k = 0; k < std::min(settings.neighbours, others.size()); ++k) {
            group.members.push_back(others[k].index);
        }
        model.groups.push_back(std::move(group));
    }
    // Nearest neighbours alone may leave the body in several pieces.
    join_groups(model, graph, nearest);
    // Ascending members, independent of the distances.
    for (Group& group : model.groups) {
        std::sort(group.members.begin(), group.members.end());
    }
}

void make_links(ParticleModel& model, double stiffness) {
    // Pairs of a centre and a member. Two groups may name the same pair, so remove duplicates.
    std::vector<std::pair<std::uint32_t, std::uint32_t>> pairs;
    for (const Group& group : model.groups) {
        for (const std::uint32_t member : group.members) {
            if (member != group.centre) {
                pairs.emplace_back(std::min(member, group.centre), std::max(member, group.centre));
            }
        }
    }
    std::sort(pairs.begin(), pairs.end());
    pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
    for (const auto& [a, b] : pairs) {
        model.links.push_back({a, b, glm::length(model.rest_position[b] - model.rest_position[a]), stiffness});
    }
}

/// Candidate particles for moving each vertex, nearest first.
std::vector<std::vector<Source>> candidates_of(const TriangleMesh& mesh, const ParticleModel& model,
                                               const std::vector<std::vector<Source>>& nearest) {
    std::vector<std::vector<Source>> candidates(mesh.vertices.size());
    for (std::size_t j = 0; j < candidates.size(); ++j) {
        for (const Source& source : std::span(nearest[j]).first(std::min(kSkinSources, nearest[j].size()))) {
            const double straight = glm::length(mesh.vertices[j] - model.rest_position[source.index]);
            candidates[j].push_back({std::max(straight, source.distance / kDetour), source.index});
        }
        std::sort(candidates[j].begin(), candidates[j].end(), nearer);
    }
    return candidates;
}

Skin make_weights(const std::vector<std::vector<Source>>& candidates) {
    // With fewer than five particles, one distance beyond all of them replaces d5 for all vertices.
    double fallback = 0.0;
    for (const std::vector<Source>& of_vertex : candidates) {
        fallback = std::max(fallback, 1.25 * of_vertex.back().distance);
    }
    Skin skin(candidates.size());
    for (std::size_t j = 0; j < skin.size(); ++j) {
        const std::vector<Source>& of_vertex = candidates[j];
        const bool has_fifth = of_vertex.size() > SkinVertex::kMax;
        const double cutoff = has_fifth ? of_vertex[SkinVertex::kMax].distance : fallback;
        const std::size_t count = std::min(SkinVertex::kMax, of_vertex.size());
        // Unused slots repeat the nearest particle with weight 0.
        skin[j].particle.fill(of_vertex.front().index);
        double sum = 0.0;
        for (std::size_t k = 0; k < count; ++k) {
            // (1 - d / d5)^2
            const double part = cutoff > 0.0 ? 1.0 - of_vertex[k].distance / cutoff : 0.0;
            skin[j].particle[k] = of_vertex[k].index;
            skin[j].weight[k] = part * part;
            sum += skin[j].weight[k];
        }
        // Weights sum to 1.
        for (double& weight : skin[j].weight) {
            weight = sum > 0.0 ? weight / sum : 0.0;
        }
        if (!(sum > 0.0)) {
            skin[j].weight[0] = 1.0;  // all five at the same distance, or a vertex at its only particle
        }
    }
    return skin;
}

/// Pairs of particles whose cells touch.
std::vector<std::pair<std::uint32_t, std::uint32_t>> neighbours_of(const SampleGraph& graph,
                                                                   const std::vector<std::vector<Source>>& nearest) {
    std::vector<std::pair<std::uint32_t, std::uint32_t>> pairs;
    // A graph edge whose ends are in different cells.
    for (std::uint32_t i = 0; i < graph.size(); ++i) {
        for (const Edge& edge : graph.edges_from(i)) {
            const std::uint32_t a = nearest[i].front().index;
            const std::uint32_t b = nearest[edge.to].front().index;
            if (a < b) {
                pairs.emplace_back(a, b);
            }
        }
    }
    std::sort(pairs.begin(), pairs.end());
    pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
    return pairs;
}

/// Gives a particle whose only sample belongs to another particle half of that sample.
void fill_empty(std::vector<Cell>& cells, const SampleGraph& graph, std::span<const Site> sites) {
    for (std::size_t i = 0; i < cells.size(); ++i) {
        if (!(cells[i].share > 0.0)) {
            cells[i] = {0.5 * graph.share[sites[i].sample], sites[i].position, Mat3(0.0)};
        }
    }
}

/// Makes the particles at the sites, their groups, links and skin.
PlacedBody assemble(const TriangleMesh& mesh, const SampleGraph& graph, std::span<const Site> sites,
                    const BuilderSettings& settings, bool on_vertices, const Progress& progress) {
    const std::size_t count = sites.size();
    // Nearest particles of every sample: enough for cells, groups and skin.
    const std::size_t sources = std::max(settings.neighbours + 1 + kSpareSources, kSkinSources);
    const std::vector<std::vector<Source>> nearest = nearest_sources(graph, sites, std::min(sources, count), progress);
    std::vector<Cell> cells = cells_of(graph, nearest, count);
    fill_empty(cells, graph, sites);
    // Mass is distributed in proportion to the cells' shares.
    double total = 0.0;
    for (const Cell& cell : cells) {
        total += cell.share;
    }
    PlacedBody placed;
    DeformableBody& body = placed.body;
    body.mesh = mesh;
    // Particles at the sites, with the mass and second moments of their cells.
    const double min_radius = 0.1 * spacing_of(mesh, count);
    for (std::size_t i = 0; i < count; ++i) {
        body.particles.add(sites[i].position, settings.mass * cells[i].share / total, 0.0);
        shape_particle(body.particles, i, cells[i], min_radius);
    }
    // Constraints, then the skin that moves the mesh with the particles.
    make_groups(body.particles, graph, nearest, sites, settings);
    if (settings.link_stiffness > 0.0) {
        make_links(body.particles, settings.link_stiffness);
    }
    body.skin = on_vertices ? skin_of_particles(count) : make_weights(candidates_of(mesh, body.particles, nearest));
    placed.neighbours = neighbours_of(graph, nearest);
    return placed;
}

}  // namespace

DeformableBody build_body(const TriangleMesh& mesh, const BuilderSettings& settings, const Progress& progress) {
    check(settings);
    check(mesh);
    const bool on_vertices = settings.particles == 0;
    const std::size_t count = on_vertices ? mesh.vertices.size() : settings.particles;
    if (count > BuilderSettings::kMaxParticles) {
        refuse("a particle at each of the " + std::to_string(count) + " vertices exceeds the maximum of " +
               std::to_string(BuilderSettings::kMaxParticles) + "; set the number of particles instead");
    }
    // Sample the body and choose the sites: the vertices, or evenly spread samples, relaxed.
    const SampleGraph graph = sample_finely(mesh, count, settings.bridge);
    std::vector<Site> sites;
    if (on_vertices) {
        for (std::uint32_t i = 0; i < count; ++i) {
            sites.push_back({mesh.vertices[i], i});
        }
    } else {
        sites = spread_evenly(graph, count, part_of(progress, kSampled, kSpread));
        relax(graph, sites, kRelaxations, part_of(progress, kSpread, kRelaxed));
    }
    return assemble(mesh, graph, sites, settings, on_vertices,
                    part_of(progress, on_vertices ? kSampled : kRelaxed, 1.0))
        .body;
}

PlacedBody build_body_at(const TriangleMesh& mesh, std::span<const Vec3> positions, const BuilderSettings& settings,
                         const Progress& progress) {
    check(settings);
    check(mesh);
    if (positions.empty()) {
        refuse("needs at least one position");
    }
    const SampleGraph graph = sample_finely(mesh, positions.size(), settings.bridge);
    return assemble(mesh, graph, sites_at(graph, positions), settings, false, part_of(progress, kSampled, 1.0));
}

Skin build_skin(const TriangleMesh& mesh, const ParticleModel& particles, double bridge, const Progress& progress) {
    check(mesh);
    if (particles.size() == 0) {
        refuse("needs at least one particle for a skin");
    }
    const SampleGraph graph = sample_finely(mesh, particles.size(), bridge);
    const std::vector<Site> sites = sites_at(graph, particles.rest_position);
    const std::size_t count = std::min(kSkinSources, particles.size());
    return make_weights(
        candidates_of(mesh, particles, nearest_sources(graph, sites, count, part_of(progress, kSampled, 1.0))));
}

}  // namespace haptic::sim
