#include <haptic/sim/model_builder.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <span>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "model/sample_distances.hpp"
#include "model/sample_graph.hpp"

namespace haptic::sim {
namespace {

constexpr double kPiecesAcross = 2.5;  // pieces between a particle and the next
constexpr std::size_t kLeastPieces = 1500;
constexpr std::size_t kLeastPiecesEach = 8;
constexpr int kRelaxations = 24;
// Ways follow the edges of pieces and are up to a tenth longer than the body's own shortest way.
constexpr double kDetour = 1.1;
// Beyond those needed, as the order along ways and that of max(straight distance, way / kDetour) differ.
constexpr std::size_t kSpareSources = 4;
constexpr std::size_t kSkinSources = SkinVertex::kMost + 1 + kSpareSources;
// Ellipsoids as large as their cells would leave the corners between cells bare. So much larger, those of the fish
// cover 99 % of its volume and 94 % of the vertices of its skin.
constexpr double kSwell = 1.2;
// No semi-axis is shorter than this part of the longest: a sheet's particles are lentils, not discs.
constexpr double kFlattest = 0.25;

[[noreturn]] void refuse(const std::string& why) {
    throw std::invalid_argument("model builder: " + why);
}

void check(const BuilderSettings& s) {
    if (s.particles > BuilderSettings::kMostParticles) {
        refuse(std::to_string(s.particles) + " particles are more than the " +
               std::to_string(BuilderSettings::kMostParticles) + " that are possible");
    }
    if (s.neighbours < 1 || s.neighbours > BuilderSettings::kMostNeighbours) {
        refuse("neighbours must be 1 to " + std::to_string(BuilderSettings::kMostNeighbours));
    }
    if (!(s.mass > 0.0) || !std::isfinite(s.mass) || !(s.bridge >= 0.0) || !std::isfinite(s.bridge)) {
        refuse("mass must be positive, and bridge at least 0");
    }
}

void check(const TriangleMesh& mesh) {
    std::vector<bool> used(mesh.vertices.size(), false);
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
        for (const std::uint32_t corner : mesh.triangles[t]) {
            if (corner >= mesh.vertices.size()) {
                refuse("triangle " + std::to_string(t) + " has the vertex " + std::to_string(corner) + " of " +
                       std::to_string(mesh.vertices.size()));
            }
            used[corner] = true;
        }
    }
    for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
        const Vec3& p = mesh.vertices[i];
        if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z)) {
            refuse("vertex " + std::to_string(i) + " is not finite");
        }
        if (!used[i]) {
            refuse("no triangle has vertex " + std::to_string(i) + ": leave it out");
        }
    }
    if (!(surface_area(mesh) > 0.0)) {
        refuse("the mesh has no area");
    }
}

/// By Newton's method from above; that of the mathematical library differs between machines.
double cube_root(double x) {
    if (!(x > 0.0)) {
        return 0.0;
    }
    double root = 1.0 + x;
    double next = (2.0 * root + x / (root * root)) / 3.0;
    while (next < root) {
        root = next;
        next = (2.0 * root + x / (root * root)) / 3.0;
    }
    return root;
}

/// About how far apart that many particles are, m.
double spacing_of(const TriangleMesh& mesh, std::size_t particles) {
    const double count = static_cast<double>(particles);
    Vec3 low = mesh.vertices.front();
    Vec3 high = low;
    for (const Vec3& p : mesh.vertices) {
        low = glm::min(low, p);
        high = glm::max(high, p);
    }
    const bool two_walls = mesh.closed || mesh.double_faced;
    const double as_sheet = std::sqrt(surface_area(mesh) / (two_walls ? 2.0 : 1.0) / count);
    const double as_rod = glm::length(high - low) / count;
    const double as_solid = mesh.closed ? cube_root(std::abs(signed_volume(mesh)) / count) : 0.0;
    return std::max({as_sheet, as_rod, as_solid});
}

/// Cut finely enough that there is a choice of pieces for each particle.
SampleGraph cut(const TriangleMesh& mesh, std::size_t particles, double bridge) {
    const std::size_t least = std::max(kLeastPieces, kLeastPiecesEach * particles);
    const double spacing = spacing_of(mesh, particles);
    double pitch = spacing / kPiecesAcross;
    for (;; pitch *= 0.7) {
        SampleGraph graph = make_sample_graph(mesh, pitch, bridge > 0.0 ? bridge : spacing);
        if (graph.size() >= least) {
            return graph;
        }
    }
}

/// The part of the body that is nearer to a particle than to any other.
struct Cell {
    double share = 0.0;
    Vec3 centroid{0.0};    // m
    Mat3 covariance{0.0};  // m^2, about the centroid
};

std::vector<Cell> cells_of(const SampleGraph& graph, const std::vector<std::vector<Source>>& nearest,
                           std::size_t count) {
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
    for (std::size_t i = 0; i < graph.size(); ++i) {
        Cell& cell = cells[nearest[i].front().index];
        const Vec3 arm = graph.position[i] - cell.centroid;
        const Vec3 weighted = (graph.share[i] / cell.share) * arm;
        cell.covariance += Mat3(weighted * arm.x, weighted * arm.y, weighted * arm.z);
    }
    return cells;
}

/// Turns a symmetric matrix into a diagonal one, by rotations that are gathered in `axes` (Jacobi 1846).
void diagonalise(Mat3& m, Mat3& axes) {
    constexpr int sweeps = 12;  // quadratic convergence: six are enough for doubles
    axes = Mat3(1.0);
    for (int sweep = 0; sweep < sweeps; ++sweep) {
        for (int pair = 0; pair < 3; ++pair) {
            const int p = pair / 2;           // 0, 0, 1
            const int q = pair == 0 ? 1 : 2;  // 1, 2, 2
            if (m[p][q] == 0.0) {
                continue;
            }
            const double theta = (m[q][q] - m[p][p]) / (2.0 * m[p][q]);
            const double tangent = (theta < 0.0 ? -1.0 : 1.0) / (std::abs(theta) + std::sqrt(theta * theta + 1.0));
            const double cosine = 1.0 / std::sqrt(tangent * tangent + 1.0);
            Mat3 turn(1.0);
            turn[p][p] = turn[q][q] = cosine;
            turn[q][p] = cosine * tangent;
            turn[p][q] = -cosine * tangent;
            m = glm::transpose(turn) * m * turn;
            m[p][q] = m[q][p] = 0.0;
            axes = axes * turn;
        }
    }
}

/// Gives particle i the ellipsoid that has the second moments of its cell, and the ball that has its inertia.
void shape_particle(ParticleModel& model, std::size_t i, const Cell& cell, double least_radius) {
    Mat3 moments = cell.covariance;
    Mat3 axes(1.0);
    diagonalise(moments, axes);
    // A solid ellipsoid with semi-axis a has the variance a^2 / 5 along it.
    Vec3 semi(0.0);
    for (int k = 0; k < 3; ++k) {
        semi[k] = kSwell * std::sqrt(5.0 * std::max(0.0, moments[k][k]));
    }
    const double longest = std::max({semi.x, semi.y, semi.z, least_radius});
    for (int k = 0; k < 3; ++k) {
        semi[k] = std::max(semi[k], kFlattest * longest);
    }
    model.semi_axes[i] = semi;
    model.axes[i] = glm::normalize(glm::quat_cast(axes));
    const double trace = moments[0][0] + moments[1][1] + moments[2][2];
    model.radius[i] = std::max(std::sqrt(5.0 / 3.0 * std::max(0.0, trace)), least_radius);
}

std::uint32_t part_of(std::vector<std::uint32_t>& part, std::uint32_t i) {
    while (part[i] != i) {
        part[i] = part[part[i]];
        i = part[i];
    }
    return i;
}

/// Adds members until all groups hang together. Cells that touch are candidates, the nearest pair comes first.
void join_groups(ParticleModel& model, const SampleGraph& graph, const std::vector<std::vector<Source>>& nearest) {
    std::vector<std::uint32_t> part(model.size());
    for (std::uint32_t i = 0; i < part.size(); ++i) {
        part[i] = i;
    }
    const auto unite = [&](std::uint32_t a, std::uint32_t b) {
        a = part_of(part, a);
        b = part_of(part, b);
        part[std::max(a, b)] = std::min(a, b);
        return a != b;
    };
    for (const Group& group : model.groups) {
        for (const std::uint32_t member : group.members) {
            (void)unite(group.centre, member);
        }
    }
    std::vector<std::tuple<double, std::uint32_t, std::uint32_t>> touching;
    for (std::uint32_t i = 0; i < graph.size(); ++i) {
        for (const Way& way : graph.ways_from(i)) {
            const std::uint32_t a = nearest[i].front().index;
            const std::uint32_t b = nearest[way.to].front().index;
            if (a < b && part_of(part, a) != part_of(part, b)) {
                touching.emplace_back(glm::length(model.rest_position[b] - model.rest_position[a]), a, b);
            }
        }
    }
    std::sort(touching.begin(), touching.end());
    for (const auto& [distance, a, b] : touching) {
        if (unite(a, b)) {
            model.groups[a].members.push_back(b);
            model.groups[b].members.push_back(a);
        }
    }
}

void make_groups(ParticleModel& model, const SampleGraph& graph, const std::vector<std::vector<Source>>& nearest,
                 std::span<const Site> sites, const BuilderSettings& settings) {
    for (std::uint32_t i = 0; i < model.size(); ++i) {
        std::vector<Source> others;
        for (const Source& source : nearest[sites[i].piece]) {
            if (source.index != i) {
                const double straight = glm::length(model.rest_position[source.index] - model.rest_position[i]);
                others.push_back({std::max(straight, source.distance / kDetour), source.index});
            }
        }
        std::sort(others.begin(), others.end(), nearer);
        Group group{i, {i}, settings.group_stiffness};
        for (std::size_t k = 0; k < std::min(settings.neighbours, others.size()); ++k) {
            group.members.push_back(others[k].index);
        }
        model.groups.push_back(std::move(group));
    }
    join_groups(model, graph, nearest);
    for (Group& group : model.groups) {
        std::sort(group.members.begin(), group.members.end());
    }
}

void make_links(ParticleModel& model, double stiffness) {
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

/// The particles that may carry each vertex, nearest first.
std::vector<std::vector<Source>> carriers_of(const TriangleMesh& mesh, const ParticleModel& model,
                                             const std::vector<std::vector<Source>>& nearest) {
    std::vector<std::vector<Source>> carriers(mesh.vertices.size());
    for (std::size_t j = 0; j < carriers.size(); ++j) {
        for (const Source& source : std::span(nearest[j]).first(std::min(kSkinSources, nearest[j].size()))) {
            const double straight = glm::length(mesh.vertices[j] - model.rest_position[source.index]);
            carriers[j].push_back({std::max(straight, source.distance / kDetour), source.index});
        }
        std::sort(carriers[j].begin(), carriers[j].end(), nearer);
    }
    return carriers;
}

Skin weigh(const std::vector<std::vector<Source>>& carriers) {
    // With so few particles that there is no fifth, one distance for all vertices serves: beyond that of all of them.
    double beyond_all = 0.0;
    for (const std::vector<Source>& of_vertex : carriers) {
        beyond_all = std::max(beyond_all, 1.25 * of_vertex.back().distance);
    }
    Skin skin(carriers.size());
    for (std::size_t j = 0; j < skin.size(); ++j) {
        const std::vector<Source>& of_vertex = carriers[j];
        const bool has_fifth = of_vertex.size() > SkinVertex::kMost;
        const double zero_at = has_fifth ? of_vertex[SkinVertex::kMost].distance : beyond_all;
        const std::size_t count = std::min(SkinVertex::kMost, of_vertex.size());
        skin[j].particle.fill(of_vertex.front().index);
        double sum = 0.0;
        for (std::size_t k = 0; k < count; ++k) {
            const double part = zero_at > 0.0 ? 1.0 - of_vertex[k].distance / zero_at : 0.0;
            skin[j].particle[k] = of_vertex[k].index;
            skin[j].weight[k] = part * part;
            sum += skin[j].weight[k];
        }
        for (double& weight : skin[j].weight) {
            weight = sum > 0.0 ? weight / sum : 0.0;
        }
        if (!(sum > 0.0)) {
            skin[j].weight[0] = 1.0;  // five particles at one distance, or a vertex where its only one is
        }
    }
    return skin;
}

/// Pairs of particles whose cells touch.
std::vector<std::pair<std::uint32_t, std::uint32_t>> neighbours_of(const SampleGraph& graph,
                                                                   const std::vector<std::vector<Source>>& nearest) {
    std::vector<std::pair<std::uint32_t, std::uint32_t>> pairs;
    for (std::uint32_t i = 0; i < graph.size(); ++i) {
        for (const Way& way : graph.ways_from(i)) {
            const std::uint32_t a = nearest[i].front().index;
            const std::uint32_t b = nearest[way.to].front().index;
            if (a < b) {
                pairs.emplace_back(a, b);
            }
        }
    }
    std::sort(pairs.begin(), pairs.end());
    pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
    return pairs;
}

/// A particle that shares its only piece with others has no part of the body. It gets the half of that piece.
void fill_empty(std::vector<Cell>& cells, const SampleGraph& graph, std::span<const Site> sites) {
    for (std::size_t i = 0; i < cells.size(); ++i) {
        if (!(cells[i].share > 0.0)) {
            cells[i] = {0.5 * graph.share[sites[i].piece], sites[i].position, Mat3(0.0)};
        }
    }
}

/// Particles at the sites, with all that belongs to them.
PlacedBody assemble(const TriangleMesh& mesh, const SampleGraph& graph, std::span<const Site> sites,
                    const BuilderSettings& settings, bool on_vertices) {
    const std::size_t count = sites.size();
    const std::size_t wanted = std::max(settings.neighbours + 1 + kSpareSources, kSkinSources);
    const std::vector<std::vector<Source>> nearest = nearest_sources(graph, sites, std::min(wanted, count));
    std::vector<Cell> cells = cells_of(graph, nearest, count);
    fill_empty(cells, graph, sites);
    double whole = 0.0;
    for (const Cell& cell : cells) {
        whole += cell.share;
    }
    PlacedBody placed;
    DeformableBody& body = placed.body;
    body.mesh = mesh;
    const double least_radius = 0.1 * spacing_of(mesh, count);
    for (std::size_t i = 0; i < count; ++i) {
        body.particles.add(sites[i].position, settings.mass * cells[i].share / whole, 0.0);
        shape_particle(body.particles, i, cells[i], least_radius);
    }
    make_groups(body.particles, graph, nearest, sites, settings);
    if (settings.link_stiffness > 0.0) {
        make_links(body.particles, settings.link_stiffness);
    }
    body.skin = on_vertices ? skin_of_particles(count) : weigh(carriers_of(mesh, body.particles, nearest));
    placed.neighbours = neighbours_of(graph, nearest);
    return placed;
}

}  // namespace

DeformableBody build_body(const TriangleMesh& mesh, const BuilderSettings& settings) {
    check(settings);
    check(mesh);
    const bool on_vertices = settings.particles == 0;
    const std::size_t count = on_vertices ? mesh.vertices.size() : settings.particles;
    if (count > BuilderSettings::kMostParticles) {
        refuse("a particle for each of the " + std::to_string(count) + " vertices is more than the " +
               std::to_string(BuilderSettings::kMostParticles) + " that are possible; say how many instead");
    }
    const SampleGraph graph = cut(mesh, count, settings.bridge);
    std::vector<Site> sites;
    if (on_vertices) {
        for (std::uint32_t i = 0; i < count; ++i) {
            sites.push_back({mesh.vertices[i], i});
        }
    } else {
        sites = spread_evenly(graph, count);
        relax(graph, sites, kRelaxations);
    }
    return assemble(mesh, graph, sites, settings, on_vertices).body;
}

PlacedBody build_body_at(const TriangleMesh& mesh, std::span<const Vec3> places, const BuilderSettings& settings) {
    check(settings);
    check(mesh);
    if (places.empty()) {
        refuse("without a place there is no particle");
    }
    const SampleGraph graph = cut(mesh, places.size(), settings.bridge);
    return assemble(mesh, graph, sites_at(graph, places), settings, false);
}

Skin build_skin(const TriangleMesh& mesh, const ParticleModel& particles, double bridge) {
    check(mesh);
    if (particles.size() == 0) {
        refuse("without particles there is no skin");
    }
    const SampleGraph graph = cut(mesh, particles.size(), bridge);
    const std::vector<Site> sites = sites_at(graph, particles.rest_position);
    const std::size_t count = std::min(kSkinSources, particles.size());
    return weigh(carriers_of(mesh, particles, nearest_sources(graph, sites, count)));
}

}  // namespace haptic::sim
