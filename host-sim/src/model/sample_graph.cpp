#include "model/sample_graph.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <stdexcept>
#include <string>
#include <unordered_map>
#include <utility>

#include "generators/triangle_grid.hpp"
#include "mesh/mesh_measures.hpp"
#include "mesh/mesh_topology.hpp"
#include "mesh/refinement.hpp"
#include "simd/aabb.hpp"

namespace haptic::sim {
namespace {

// Graph edges reach the lattice neighbours along cube edges and face diagonals, up to 1.41 pitches.
constexpr double kReach = 1.45;    // of the pitch
constexpr double kOnPlane = 1e-9;  // of the pitch: a segment that starts in a triangle's plane does not cross it
constexpr double kLatticeOffsetY = 0.0131;  // of the pitch, offset of the lattice, see add_lattice()
constexpr double kLatticeOffsetZ = 0.0217;
constexpr double kMinShare = 1e-6;  // of the mean, so that samples of degenerate triangles have a mass
constexpr std::size_t kMaxSamples = 8'000'000;

std::uint64_t key_of_edge(std::uint32_t a, std::uint32_t b) {
    return (std::uint64_t{std::min(a, b)} << 32U) | std::max(a, b);
}

Vec3 double_area(std::span<const Vec3> p, const Triangle& t) {
    return glm::cross(p[t[1]] - p[t[0]], p[t[2]] - p[t[0]]);
}

/// Uniform hash grid of points.
class PointHash {
  public:
    PointHash(const Vec3& low, double cell) : low_(low), cell_(cell) {}

    void add(const Vec3& p, std::uint32_t index) { cells_[key(cube(p))].push_back(index); }

    /// Visits the points in the 27 cells about p, in an order that depends on the points only.
    template <typename Visitor>
    void visit(const Vec3& p, Visitor&& visitor) const {
        const auto [x, y, z] = cube(p);
        for (std::int64_t dz = -1; dz <= 1; ++dz) {
            for (std::int64_t dy = -1; dy <= 1; ++dy) {
                for (std::int64_t dx = -1; dx <= 1; ++dx) {
                    const auto found = cells_.find(key({x + dx, y + dy, z + dz}));
                    if (found != cells_.end()) {
                        for (const std::uint32_t index : found->second) {
                            visitor(index);
                        }
                    }
                }
            }
        }
    }

    /// The first point in the cell of p, or `otherwise`.
    [[nodiscard]] std::uint32_t first_in_cube(const Vec3& p, std::uint32_t otherwise) const {
        const auto found = cells_.find(key(cube(p)));
        return found == cells_.end() ? otherwise : found->second.front();
    }

  private:
    using Cube = std::array<std::int64_t, 3>;
    [[nodiscard]] Cube cube(const Vec3& p) const {
        const Vec3 c = glm::floor((p - low_) / cell_);
        return {static_cast<std::int64_t>(c.x), static_cast<std::int64_t>(c.y), static_cast<std::int64_t>(c.z)};
    }
    /// 21 bits per axis: a body is far less than a million pitches wide.
    static std::uint64_t key(const Cube& c) {
        constexpr std::uint64_t mask = (std::uint64_t{1} << 21U) - 1;
        return ((static_cast<std::uint64_t>(c[0]) & mask) << 42U) | ((static_cast<std::uint64_t>(c[1]) & mask) << 21U) |
               (static_cast<std::uint64_t>(c[2]) & mask);
    }

    Vec3 low_;
    double cell_;
    std::unordered_map<std::uint64_t, std::vector<std::uint32_t>> cells_;
};

/// Distance between c and d, the corners opposite the edge ab, after unfolding both triangles into a plane.
double unfolded_distance(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) {
    const Vec3 edge = b - a;
    const double length = glm::length(edge);
    // Degenerate edge: the path through its single point.
    if (!(length > 0.0)) {
        return glm::length(c - a) + glm::length(d - a);
    }
    // Unfolded: positions of c and d along the edge, and the sum of their heights above it.
    const Vec3 along = edge / length;
    const double cx = glm::dot(c - a, along);
    const double dx = glm::dot(d - a, along);
    const double height = glm::length(c - a - cx * along) + glm::length(d - a - dx * along);
    return std::sqrt((cx - dx) * (cx - dx) + height * height);
}

class GraphMaker {
  public:
    GraphMaker(const TriangleMesh& mesh, double pitch, double bridge)
        : mesh_(mesh), pitch_(pitch), bridge_(bridge), refined_(refined(mesh, pitch, kMaxSamples)) {
        // A long thin mesh needs too many samples at this pitch.
        if (refined_.vertices.size() > kMaxSamples) {
            throw std::invalid_argument(
                "model builder: the mesh is too thin and long for sampling this fine; request fewer particles");
        }
        // Surface samples, each with its share of the area.
        graph_.position = refined_.vertices;
        graph_.share.assign(graph_.size(), 0.0);
        box_ = aabb_of(mesh.vertices);
        distribute_area();
        // Closed mesh: turn the surface into a shell with volume and fill the inside.
        if (mesh.closed) {
            const TriangleGrid grid(mesh.vertices, mesh.triangles, pitch);
            move_to_shell(grid);
            add_lattice(grid);
            add_surface_edges();
            add_inner_edges(grid);
        } else {
            add_surface_edges();
        }
        // Connect separate parts, and bring the result into its final order.
        bridge_parts();
        enforce_min_share();
        sort_edges();
    }

    SampleGraph take() { return std::move(graph_); }

  private:
    void add_edge(std::uint32_t a, std::uint32_t b, double length) {
        if (a != b) {
            directed_edges_.push_back({a, {b, length}});
            directed_edges_.push_back({b, {a, length}});
        }
    }
    void add_edge(std::uint32_t a, std::uint32_t b) {
        add_edge(a, b, glm::length(graph_.position[a] - graph_.position[b]));
    }

    void distribute_area() {
        for (const Triangle& t : refined_.triangles) {
            // A third of the triangle's area for each corner.
            const double third = glm::length(double_area(refined_.vertices, t)) / 6.0;
            for (const std::uint32_t corner : t) {
                graph_.share[corner] += third;
            }
        }
    }

    /// Moves the surface samples to the middle of a shell half a pitch thick, or of the wall where it is thinner, and
    /// makes their share the shell's volume.
    void move_to_shell(const TriangleGrid& grid) {
        // Area-weighted vertex normals.
        std::vector<Vec3> normal(graph_.size(), Vec3(0.0));
        for (const Triangle& t : refined_.triangles) {
            const Vec3 area = double_area(refined_.vertices, t);
            for (const std::uint32_t corner : t) {
                normal[corner] += area;
            }
        }
        const double outward = signed_volume(mesh_) < 0.0 ? -1.0 : 1.0;
        for (std::size_t i = 0; i < normal.size(); ++i) {
            // A vertex of degenerate triangles has no normal: it stays and has no volume.
            const double length = glm::length(normal[i]);
            if (!(length > 0.0)) {
                graph_.share[i] = 0.0;
                continue;
            }
            // wall: distance to the opposite side in pitches, more than 1 if it is farther.
            const Vec3 inward = (-outward / length) * normal[i];
            const Vec3 surface = graph_.position[i];
            const double wall = grid.first_crossing(surface, surface + pitch_ * inward, kOnPlane * pitch_);
            // Depth 1/4 pitch, or half of a thinner wall; volume = area times the thickness of the shell.
            graph_.position[i] = surface + pitch_ * std::min(0.25, 0.5 * wall) * inward;
            graph_.share[i] *= 0.5 * pitch_ * std::min(1.0, wall);
        }
    }

    /// Adds the points of a cubic lattice that are inside, below the shell. Scan conversion: each lattice row along x
    /// counts the crossings of the surface.
    void add_lattice(const TriangleGrid& grid) {
        // Rows along x at lattice positions in y and z, centred in the box.
        const Vec3 size = box_.size();
        const auto rows = static_cast<std::size_t>(std::floor(size.y / pitch_)) + 1;
        const auto layers = static_cast<std::size_t>(std::floor(size.z / pitch_)) + 1;
        // Slightly off centre, so that rows of the lattice do not meet the edges of a symmetric mesh.
        const double y0 =
            0.5 * (box_.min.y + box_.max.y) - (0.5 * static_cast<double>(rows - 1) + kLatticeOffsetY) * pitch_;
        const double z0 =
            0.5 * (box_.min.z + box_.max.z) - (0.5 * static_cast<double>(layers - 1) + kLatticeOffsetZ) * pitch_;
        // Crossings of each row with the surface, triangle by triangle.
        std::vector<std::vector<std::pair<double, int>>> crossings(rows * layers);
        for (const Triangle& t : mesh_.triangles) {
            add_crossings(t, y0, z0, rows, layers, crossings);
        }
        // The winding number along a row tells which of its points are inside.
        for (std::size_t layer = 0; layer < layers; ++layer) {
            for (std::size_t row = 0; row < rows; ++row) {
                add_row(y0 + static_cast<double>(row) * pitch_, z0 + static_cast<double>(layer) * pitch_,
                        crossings[layer * rows + row], grid);
            }
        }
    }

    /// Signed double area of the edge ab and the point (y, z), seen along x. Exactly opposite for the two triangles of
    /// the edge, because the vertices are taken in the order of their indices.
    double side(std::uint32_t a, std::uint32_t b, double y, double z) const {
        const Vec3& p = mesh_.vertices[std::min(a, b)];
        const Vec3& q = mesh_.vertices[std::max(a, b)];
        const double area = (q.y - p.y) * (z - p.z) - (q.z - p.z) * (y - p.y);
        return a < b ? area : -area;
    }

    /// Adds the crossings of the triangle with the lattice rows along x: position and sign of the winding.
    void add_crossings(const Triangle& t, double y0, double z0, std::size_t rows, std::size_t layers,
                       std::vector<std::vector<std::pair<double, int>>>& crossings) const {
        const Vec3& a = mesh_.vertices[t[0]];
        const Vec3& b = mesh_.vertices[t[1]];
        const Vec3& c = mesh_.vertices[t[2]];
        const Aabb box = aabb_of(a, b, c);
        // First lattice row or layer at or after a coordinate.
        const auto first = [&](double x, double origin) {
            return static_cast<std::size_t>(std::max(0.0, std::ceil((x - origin) / pitch_)));
        };
        // Rows that pass the triangle's box in y and z.
        for (std::size_t layer = first(box.min.z, z0); layer < layers; ++layer) {
            const double z = z0 + static_cast<double>(layer) * pitch_;
            if (z > box.max.z) {
                break;
            }
            for (std::size_t row = first(box.min.y, y0); row < rows; ++row) {
                const double y = y0 + static_cast<double>(row) * pitch_;
                if (y > box.max.y) {
                    break;
                }
                // Barycentric coordinates in the y-z plane; all of one sign means inside.
                const double u = side(t[1], t[2], y, z);
                const double v = side(t[2], t[0], y, z);
                const double w = side(t[0], t[1], y, z);
                const bool front = u > 0.0 && v > 0.0 && w > 0.0;
                if (front || (u < 0.0 && v < 0.0 && w < 0.0)) {
                    // Crossing x by interpolation; the sign says whether the row enters or leaves.
                    const double x = (u * a.x + v * b.x + w * c.x) / (u + v + w);
                    crossings[layer * rows + row].emplace_back(x, front ? 1 : -1);
                }
            }
        }
    }

    /// Adds the lattice points of one row that have a winding number other than 0.
    void add_row(double y, double z, std::vector<std::pair<double, int>>& row, const TriangleGrid& grid) {
        // A row that starts and ends outside has a total winding of 0.
        int sum = 0;
        for (const auto& [x, sign] : row) {
            sum += sign;
        }
        if (row.empty() || sum != 0) {
            return;  // a row through an edge may miss both its triangles: nothing is known then
        }
        // Walk along the row with the winding number of the surface crossed so far.
        std::sort(row.begin(), row.end());
        const auto columns = static_cast<std::size_t>(std::floor((box_.max.x - box_.min.x) / pitch_)) + 1;
        const double x0 = 0.5 * (box_.min.x + box_.max.x) - 0.5 * static_cast<double>(columns - 1) * pitch_;
        int winding = 0;
        std::size_t next = 0;
        for (std::size_t k = 0; k < columns; ++k) {
            const Vec3 p(x0 + static_cast<double>(k) * pitch_, y, z);
            for (; next < row.size() && row[next].first < p.x; ++next) {
                winding += row[next].second;
            }
            // Inside and below the shell: a full cube of volume.
            if (winding != 0 && !grid.near(p, 0.5 * pitch_)) {
                graph_.position.push_back(p);
                graph_.share.push_back(pitch_ * pitch_ * pitch_);
            }
        }
    }

    /// Joins the ends of each mesh edge, and the corners opposite it across the unfolded triangles.
    void add_surface_edges() {
        // Each edge with its opposite corners. Sorted, not hashed, so that the order depends on the edges only.
        struct Side {
            std::uint64_t edge;
            std::uint32_t opposite;
        };
        std::vector<Side> sides;
        sides.reserve(3 * refined_.triangles.size());
        for (const Triangle& t : refined_.triangles) {
            for (std::size_t k = 0; k < 3; ++k) {
                sides.push_back({key_of_edge(t[k], t[(k + 1) % 3]), t[(k + 2) % 3]});
            }
        }
        std::sort(sides.begin(), sides.end(), [](const Side& p, const Side& q) {
            return p.edge != q.edge ? p.edge < q.edge : p.opposite < q.opposite;
        });
        // One pass over the groups of equal edges.
        for (std::size_t i = 0; i < sides.size();) {
            const auto a = static_cast<std::uint32_t>(sides[i].edge >> 32U);
            const auto b = static_cast<std::uint32_t>(sides[i].edge);
            add_edge(a, b);
            // Triangles of this edge; more than two where the mesh is not a manifold.
            std::size_t end = i;
            while (end < sides.size() && sides[end].edge == sides[i].edge) {
                ++end;
            }
            // Edges across shorten paths that would otherwise zigzag along the triangles.
            for (std::size_t j = i + 1; j < end; ++j) {
                const std::uint32_t c = sides[j - 1].opposite;
                const std::uint32_t d = sides[j].opposite;
                add_edge(
                    c, d,
                    unfolded_distance(graph_.position[a], graph_.position[b], graph_.position[c], graph_.position[d]));
            }
            i = end;
        }
    }

    [[nodiscard]] bool has_clear_path(std::uint32_t a, std::uint32_t b, const TriangleGrid& grid) const {
        return grid.first_crossing(graph_.position[a], graph_.position[b], kOnPlane * pitch_) > 1.0;
    }

    /// Adds straight edges through the inside. Where the mesh is finer than the pitch, only one sample (hub) of each
    /// cube of half a pitch has such edges and the others one to it, so that their number does not grow with the
    /// square.
    void add_inner_edges(const TriangleGrid& grid) {
        PointHash cubes(box_.min, 0.5 * pitch_);
        PointHash hubs(box_.min, kReach * pitch_);
        const auto count = static_cast<std::uint32_t>(graph_.size());
        for (std::uint32_t i = 0; i < count; ++i) {
            // The hub of a cube is its first sample. Every other sample gets one edge, to its hub.
            const Vec3& p = graph_.position[i];
            const std::uint32_t hub = cubes.first_in_cube(p, i);
            if (hub != i) {
                if (has_clear_path(i, hub, grid)) {
                    add_edge(i, hub);
                }
                continue;
            }
            // A hub gets an edge to each hub in reach if the segment stays inside the body.
            cubes.add(p, i);
            hubs.visit(p, [&](std::uint32_t other) {
                if (glm::length(graph_.position[other] - p) <= kReach * pitch_ && has_clear_path(i, other, grid)) {
                    add_edge(i, other);
                }
            });
            hubs.add(p, i);
        }
    }

    /// Joins parts of the graph that are not connected, within bridge_.
    void bridge_parts() {
        const auto count = static_cast<std::uint32_t>(graph_.size());
        // Connected components of the graph so far; part 0 contains the first vertex.
        detail::DisjointSets parts(count);
        for (const auto& [from, edge] : directed_edges_) {
            parts.unite(from, edge.to);
        }
        std::vector<std::uint32_t> part(count);
        for (std::uint32_t i = 0; i < count; ++i) {
            part[i] = parts.find(i);
        }
        if (std::all_of(part.begin(), part.end(), [](std::uint32_t p) { return p == 0; })) {
            return;
        }
        // Double the reach step by step, so that a part is joined where it is nearest.
        double reach = std::min(2.0 * pitch_, bridge_);
        bool connected = bridge_ > 0.0 && bridge_parts(part, reach);
        while (!connected && reach < bridge_) {
            reach = std::min(2.0 * reach, bridge_);
            connected = bridge_parts(part, reach);
        }
        if (!connected) {
            refuse_part(part);
        }
    }

    /// Joins samples to the nearest sample of another part, within `reach` and if at most a pitch farther than the
    /// part's smallest such distance. Updates `part`, the part of each sample. True if one part remains.
    bool bridge_parts(std::vector<std::uint32_t>& part, double reach) {
        // Cells of the size of the reach, so that the 27 cells about a sample contain all in reach.
        PointHash cubes(box_.min, reach);
        for (std::uint32_t i = 0; i < graph_.size(); ++i) {
            cubes.add(graph_.position[i], i);
        }
        constexpr double none = std::numeric_limits<double>::infinity();
        // Nearest sample of another part for each sample, and the smallest such distance of each part.
        std::vector<std::pair<double, std::uint32_t>> nearest(graph_.size(), {none, 0});
        std::vector<double> min_distance(graph_.size(), none);  // per part
        for (std::uint32_t i = 0; i < graph_.size(); ++i) {
            cubes.visit(graph_.position[i], [&](std::uint32_t other) {
                const double distance = glm::length(graph_.position[other] - graph_.position[i]);
                if (part[other] != part[i] && distance <= reach) {
                    nearest[i] = std::min(nearest[i], {distance, other});
                }
            });
            min_distance[part[i]] = std::min(min_distance[part[i]], nearest[i].first);
        }
        // Add the edges that are within a pitch of the part's shortest, and merge the parts.
        detail::DisjointSets joined(part.size());
        for (std::uint32_t i = 0; i < part.size(); ++i) {
            joined.unite(i, part[i]);
        }
        for (std::uint32_t i = 0; i < graph_.size(); ++i) {
            if (nearest[i].first < none && nearest[i].first <= min_distance[part[i]] + pitch_) {
                add_edge(i, nearest[i].second);
                joined.unite(i, nearest[i].second);
            }
        }
        // Relabel the parts; one remains if all samples are in part 0.
        bool connected = true;
        for (std::uint32_t i = 0; i < graph_.size(); ++i) {
            part[i] = joined.find(i);
            connected = connected && part[i] == 0;
        }
        return connected;
    }

    [[noreturn]] void refuse_part(const std::vector<std::uint32_t>& part) const {
        // Gap of one unconnected part, by comparing all pairs: only for the message.
        const std::uint32_t remaining = *std::max_element(part.begin(), part.end());
        double gap = std::numeric_limits<double>::infinity();
        for (std::uint32_t i = 0; i < graph_.size(); ++i) {
            if (part[i] != remaining) {
                continue;
            }
            for (std::uint32_t j = 0; j < graph_.size(); ++j) {
                if (part[j] != remaining) {
                    gap = std::min(gap, glm::length(graph_.position[i] - graph_.position[j]));
                }
            }
        }
        throw std::invalid_argument("model builder: the part of the mesh with vertex " + std::to_string(remaining) +
                                    " is " + std::to_string(gap) +
                                    " m away from the rest and not connected to it. Make it an object of its own, or "
                                    "set bridge to more than that distance to link particles through the air");
    }

    void enforce_min_share() {
        // Each sample gets at least a tiny part of the mean share.
        double sum = 0.0;
        for (const double share : graph_.share) {
            sum += share;
        }
        const double min_share = kMinShare * sum / static_cast<double>(graph_.size());
        for (double& share : graph_.share) {
            share = std::max(share, min_share);
        }
    }

    /// Sorts the edges by their origin (counting sort).
    void sort_edges() {
        // Histogram of the origins, then prefix sums.
        graph_.first_edge.assign(graph_.size() + 1, 0);
        for (const auto& [from, edge] : directed_edges_) {
            ++graph_.first_edge[from + 1];
        }
        for (std::size_t i = 0; i < graph_.size(); ++i) {
            graph_.first_edge[i + 1] += graph_.first_edge[i];
        }
        // Stable: the edges of a sample keep the order in which they were added.
        graph_.edges.resize(directed_edges_.size());
        std::vector<std::size_t> next(graph_.first_edge.begin(), graph_.first_edge.end() - 1);
        for (const auto& [from, edge] : directed_edges_) {
            graph_.edges[next[from]++] = edge;
        }
    }

    const TriangleMesh& mesh_;
    double pitch_;
    double bridge_;
    TriangleMesh refined_;
    Aabb box_;
    SampleGraph graph_;
    std::vector<std::pair<std::uint32_t, Edge>> directed_edges_;
};

}  // namespace

SampleGraph make_sample_graph(const TriangleMesh& mesh, double pitch, double bridge) {
    return GraphMaker(mesh, pitch, bridge).take();
}

}  // namespace haptic::sim
