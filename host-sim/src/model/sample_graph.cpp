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

namespace haptic::sim {
namespace {

// Ways lead to the lattice's neighbours along edges and diagonals of faces, which are up to 1.41 away.
constexpr double kReach = 1.45;     // of the pitch
constexpr double kOnPlane = 1e-9;   // of the pitch: what lies in a triangle's plane does not cross it
constexpr double kAsideY = 0.0131;  // of the pitch
constexpr double kAsideZ = 0.0217;
constexpr double kLeastShare = 1e-6;  // of the mean: a degenerate triangle's pieces weigh something
constexpr std::size_t kMostPieces = 8'000'000;

std::uint64_t key_of_edge(std::uint32_t a, std::uint32_t b) {
    return (std::uint64_t{std::min(a, b)} << 32U) | std::max(a, b);
}

Vec3 double_area(std::span<const Vec3> p, const Triangle& t) {
    return glm::cross(p[t[1]] - p[t[0]], p[t[2]] - p[t[0]]);
}

/// Cuts triangles until no edge is longer than the pitch. Edges are cut in their middle, for all their triangles alike.
class Refinement {
  public:
    Refinement(const TriangleMesh& mesh, double pitch)
        : vertices(mesh.vertices), triangles(mesh.triangles), longest_(pitch) {
        while (cut()) {
        }
    }

    std::vector<Vec3> vertices;
    std::vector<Triangle> triangles;

  private:
    bool cut() {
        std::unordered_map<std::uint64_t, std::uint32_t> middles;
        std::vector<Triangle> smaller;
        smaller.reserve(triangles.size());
        const std::size_t before = vertices.size();
        for (const Triangle& t : triangles) {
            cut(t, middles, smaller);
        }
        triangles.swap(smaller);
        if (vertices.size() > kMostPieces) {
            throw std::invalid_argument(
                "model builder: the mesh is too thin and long for so fine a cut; ask for fewer particles");
        }
        return vertices.size() > before;
    }

    void cut(const Triangle& t, std::unordered_map<std::uint64_t, std::uint32_t>& middles, std::vector<Triangle>& out) {
        std::array<bool, 3> long_edge{};  // from corner k to the next
        std::size_t cuts = 0;
        std::size_t turn = 0;
        for (std::size_t k = 0; k < 3; ++k) {
            long_edge[k] = glm::length(vertices[t[(k + 1) % 3]] - vertices[t[k]]) > longest_;
            cuts += long_edge[k] ? std::size_t{1} : 0;
        }
        if (cuts == 0) {
            out.push_back(t);
            return;
        }
        // Turned so that the first edge is cut and, of two, the last is not.
        while (!long_edge[turn] || (cuts == 2 && long_edge[(turn + 2) % 3])) {
            ++turn;
        }
        const std::uint32_t a = t[turn];
        const std::uint32_t b = t[(turn + 1) % 3];
        const std::uint32_t c = t[(turn + 2) % 3];
        const std::uint32_t ab = middle(a, b, middles);
        if (cuts == 1) {
            out.insert(out.end(), {{a, ab, c}, {ab, b, c}});
            return;
        }
        const std::uint32_t bc = middle(b, c, middles);
        if (cuts == 2) {
            out.insert(out.end(), {{ab, b, bc}, {a, ab, bc}, {a, bc, c}});
            return;
        }
        const std::uint32_t ca = middle(c, a, middles);
        out.insert(out.end(), {{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}});
    }

    std::uint32_t middle(std::uint32_t a, std::uint32_t b, std::unordered_map<std::uint64_t, std::uint32_t>& middles) {
        const auto [place, fresh] = middles.try_emplace(key_of_edge(a, b), static_cast<std::uint32_t>(vertices.size()));
        if (fresh) {
            const Vec3 between = 0.5 * (vertices[std::min(a, b)] + vertices[std::max(a, b)]);
            vertices.push_back(between);
        }
        return place->second;
    }

    double longest_;
};

/// Points in cubes, found by the cubes' whole coordinates.
class PointHash {
  public:
    PointHash(const Vec3& low, double cell) : low_(low), cell_(cell) {}

    void add(const Vec3& p, std::uint32_t index) { cells_[key(cube(p))].push_back(index); }

    /// Those in the 27 cubes about p, in an order that depends on nothing but the points.
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

    /// The first point in the cube of p, or `otherwise`.
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
    /// 21 bits each: a body is far less than a million pitches wide.
    static std::uint64_t key(const Cube& c) {
        constexpr std::uint64_t mask = (std::uint64_t{1} << 21U) - 1;
        return ((static_cast<std::uint64_t>(c[0]) & mask) << 42U) | ((static_cast<std::uint64_t>(c[1]) & mask) << 21U) |
               (static_cast<std::uint64_t>(c[2]) & mask);
    }

    Vec3 low_;
    double cell_;
    std::unordered_map<std::uint64_t, std::vector<std::uint32_t>> cells_;
};

/// Length of the straight way between the corners opposite of the edge a-b, once its triangles are laid flat.
double across(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) {
    const Vec3 edge = b - a;
    const double length = glm::length(edge);
    if (!(length > 0.0)) {
        return glm::length(c - a) + glm::length(d - a);
    }
    const Vec3 along = edge / length;
    const double cx = glm::dot(c - a, along);
    const double dx = glm::dot(d - a, along);
    const double height = glm::length(c - a - cx * along) + glm::length(d - a - dx * along);
    return std::sqrt((cx - dx) * (cx - dx) + height * height);
}

class GraphMaker {
  public:
    GraphMaker(const TriangleMesh& mesh, double pitch, double bridge)
        : mesh_(mesh), pitch_(pitch), bridge_(bridge), refined_(mesh, pitch) {
        graph_.position = refined_.vertices;
        graph_.share.assign(graph_.size(), 0.0);
        low_ = *std::min_element(mesh.vertices.begin(), mesh.vertices.end(),
                                 [](const Vec3& p, const Vec3& q) { return p.x < q.x; });
        high_ = low_;
        for (const Vec3& p : mesh.vertices) {
            low_ = glm::min(low_, p);
            high_ = glm::max(high_, p);
        }
        share_out_area();
        if (mesh.closed) {
            const TriangleGrid grid(mesh.vertices, mesh.triangles, pitch);
            sink_shell(grid);
            fill(grid);
            join_along_surface();
            join_through_inside(grid);
        } else {
            join_along_surface();
        }
        bridge_parts();
        give_everything_a_share();
        sort_ways();
    }

    SampleGraph take() { return std::move(graph_); }

  private:
    void join(std::uint32_t a, std::uint32_t b, double length) {
        if (a != b) {
            from_.push_back({a, {b, length}});
            from_.push_back({b, {a, length}});
        }
    }
    void join(std::uint32_t a, std::uint32_t b) { join(a, b, glm::length(graph_.position[a] - graph_.position[b])); }

    void share_out_area() {
        for (const Triangle& t : refined_.triangles) {
            const double third = glm::length(double_area(refined_.vertices, t)) / 6.0;
            for (const std::uint32_t corner : t) {
                graph_.share[corner] += third;
            }
        }
    }

    /// Moves the pieces of the surface to the middle of a shell of half a pitch, or of the wall where that is thin, and
    /// makes their share that of the shell.
    void sink_shell(const TriangleGrid& grid) {
        std::vector<Vec3> normal(graph_.size(), Vec3(0.0));
        for (const Triangle& t : refined_.triangles) {
            const Vec3 area = double_area(refined_.vertices, t);
            for (const std::uint32_t corner : t) {
                normal[corner] += area;
            }
        }
        const double outward = signed_volume(mesh_) < 0.0 ? -1.0 : 1.0;
        for (std::size_t i = 0; i < normal.size(); ++i) {
            const double length = glm::length(normal[i]);
            if (!(length > 0.0)) {
                graph_.share[i] = 0.0;
                continue;
            }
            const Vec3 inward = (-outward / length) * normal[i];
            const Vec3 surface = graph_.position[i];
            const double wall = grid.first_crossing(surface, surface + pitch_ * inward, kOnPlane * pitch_);
            graph_.position[i] = surface + pitch_ * std::min(0.25, 0.5 * wall) * inward;
            graph_.share[i] *= 0.5 * pitch_ * std::min(1.0, wall);
        }
    }

    /// Adds the points of a cubic lattice that are inside, deeper than the shell.
    void fill(const TriangleGrid& grid) {
        const Vec3 size = high_ - low_;
        const auto rows = static_cast<std::size_t>(std::floor(size.y / pitch_)) + 1;
        const auto layers = static_cast<std::size_t>(std::floor(size.z / pitch_)) + 1;
        // Centred, but not quite: the lines through the lattice should not meet the edges of a symmetric mesh.
        const double y0 = 0.5 * (low_.y + high_.y) - (0.5 * static_cast<double>(rows - 1) + kAsideY) * pitch_;
        const double z0 = 0.5 * (low_.z + high_.z) - (0.5 * static_cast<double>(layers - 1) + kAsideZ) * pitch_;
        std::vector<std::vector<std::pair<double, int>>> crossings(rows * layers);
        for (const Triangle& t : mesh_.triangles) {
            cross_rows(t, y0, z0, rows, layers, crossings);
        }
        for (std::size_t layer = 0; layer < layers; ++layer) {
            for (std::size_t row = 0; row < rows; ++row) {
                fill_row(y0 + static_cast<double>(row) * pitch_, z0 + static_cast<double>(layer) * pitch_,
                         crossings[layer * rows + row], grid);
            }
        }
    }

    /// Which of an edge's sides the point (y, z) is on; the same number, with its sign turned, for both its triangles.
    double side(std::uint32_t a, std::uint32_t b, double y, double z) const {
        const Vec3& p = mesh_.vertices[std::min(a, b)];
        const Vec3& q = mesh_.vertices[std::max(a, b)];
        const double area = (q.y - p.y) * (z - p.z) - (q.z - p.z) * (y - p.y);
        return a < b ? area : -area;
    }

    /// Where the lines along x through the lattice pass the triangle, and from which side.
    void cross_rows(const Triangle& t, double y0, double z0, std::size_t rows, std::size_t layers,
                    std::vector<std::vector<std::pair<double, int>>>& crossings) const {
        const Vec3& a = mesh_.vertices[t[0]];
        const Vec3& b = mesh_.vertices[t[1]];
        const Vec3& c = mesh_.vertices[t[2]];
        const Vec3 low = glm::min(a, glm::min(b, c));
        const Vec3 high = glm::max(a, glm::max(b, c));
        const auto first = [&](double x, double origin) {
            return static_cast<std::size_t>(std::max(0.0, std::ceil((x - origin) / pitch_)));
        };
        for (std::size_t layer = first(low.z, z0); layer < layers; ++layer) {
            const double z = z0 + static_cast<double>(layer) * pitch_;
            if (z > high.z) {
                break;
            }
            for (std::size_t row = first(low.y, y0); row < rows; ++row) {
                const double y = y0 + static_cast<double>(row) * pitch_;
                if (y > high.y) {
                    break;
                }
                const double u = side(t[1], t[2], y, z);
                const double v = side(t[2], t[0], y, z);
                const double w = side(t[0], t[1], y, z);
                const bool front = u > 0.0 && v > 0.0 && w > 0.0;
                if (front || (u < 0.0 && v < 0.0 && w < 0.0)) {
                    const double x = (u * a.x + v * b.x + w * c.x) / (u + v + w);
                    crossings[layer * rows + row].emplace_back(x, front ? 1 : -1);
                }
            }
        }
    }

    void fill_row(double y, double z, std::vector<std::pair<double, int>>& row, const TriangleGrid& grid) {
        int sum = 0;
        for (const auto& [x, sign] : row) {
            sum += sign;
        }
        if (row.empty() || sum != 0) {
            return;  // a line through an edge may miss both its triangles: then nothing is known of this row
        }
        std::sort(row.begin(), row.end());
        const auto columns = static_cast<std::size_t>(std::floor((high_.x - low_.x) / pitch_)) + 1;
        const double x0 = 0.5 * (low_.x + high_.x) - 0.5 * static_cast<double>(columns - 1) * pitch_;
        int winding = 0;
        std::size_t next = 0;
        for (std::size_t k = 0; k < columns; ++k) {
            const Vec3 p(x0 + static_cast<double>(k) * pitch_, y, z);
            for (; next < row.size() && row[next].first < p.x; ++next) {
                winding += row[next].second;
            }
            if (winding != 0 && !grid.near(p, 0.5 * pitch_)) {
                graph_.position.push_back(p);
                graph_.share.push_back(pitch_ * pitch_ * pitch_);
            }
        }
    }

    void join_along_surface() {
        // Each edge with the corners opposite of it. Sorted, not hashed, so that the order is the edges' own.
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
        for (std::size_t i = 0; i < sides.size();) {
            const auto a = static_cast<std::uint32_t>(sides[i].edge >> 32U);
            const auto b = static_cast<std::uint32_t>(sides[i].edge);
            join(a, b);
            std::size_t end = i;
            while (end < sides.size() && sides[end].edge == sides[i].edge) {
                ++end;
            }
            for (std::size_t j = i + 1; j < end; ++j) {
                const std::uint32_t c = sides[j - 1].opposite;
                const std::uint32_t d = sides[j].opposite;
                join(c, d, across(graph_.position[a], graph_.position[b], graph_.position[c], graph_.position[d]));
            }
            i = end;
        }
    }

    [[nodiscard]] bool sees(std::uint32_t a, std::uint32_t b, const TriangleGrid& grid) const {
        return grid.first_crossing(graph_.position[a], graph_.position[b], kOnPlane * pitch_) > 1.0;
    }

    /// Straight ways that stay inside. Where the mesh is finer than the pitch, only one piece of each cube of half a
    /// pitch has ways of its own and the others have one to it, so that their number does not grow with the square.
    void join_through_inside(const TriangleGrid& grid) {
        PointHash cubes(low_, 0.5 * pitch_);
        PointHash hubs(low_, kReach * pitch_);
        const auto count = static_cast<std::uint32_t>(graph_.size());
        for (std::uint32_t i = 0; i < count; ++i) {
            const Vec3& p = graph_.position[i];
            const std::uint32_t hub = cubes.first_in_cube(p, i);
            if (hub != i) {
                if (sees(i, hub, grid)) {
                    join(i, hub);
                }
                continue;
            }
            cubes.add(p, i);
            hubs.visit(p, [&](std::uint32_t other) {
                if (glm::length(graph_.position[other] - p) <= kReach * pitch_ && sees(i, other, grid)) {
                    join(i, other);
                }
            });
            hubs.add(p, i);
        }
    }

    static std::uint32_t part_of(std::vector<std::uint32_t>& part, std::uint32_t i) {
        while (part[i] != i) {
            part[i] = part[part[i]];
            i = part[i];
        }
        return i;
    }
    static void unite(std::vector<std::uint32_t>& part, std::uint32_t a, std::uint32_t b) {
        a = part_of(part, a);
        b = part_of(part, b);
        part[std::max(a, b)] = std::min(a, b);
    }

    void bridge_parts() {
        const auto count = static_cast<std::uint32_t>(graph_.size());
        std::vector<std::uint32_t> part(count);
        for (std::uint32_t i = 0; i < count; ++i) {
            part[i] = i;
        }
        for (const auto& [from, way] : from_) {
            unite(part, from, way.to);
        }
        for (std::uint32_t i = 0; i < count; ++i) {
            part[i] = part_of(part, i);
        }
        if (std::all_of(part.begin(), part.end(), [](std::uint32_t p) { return p == 0; })) {
            return;
        }
        // Farther and farther, so that a part is held where it is nearest.
        double reach = std::min(2.0 * pitch_, bridge_);
        bool whole = bridge_ > 0.0 && bridge_parts(part, reach);
        while (!whole && reach < bridge_) {
            reach = std::min(2.0 * reach, bridge_);
            whole = bridge_parts(part, reach);
        }
        if (!whole) {
            refuse_part(part);
        }
    }

    /// Gives pieces of one part a way to the nearest one of another part, if it is hardly farther than the part's
    /// nearest is, and no farther than `reach`. `part` is each piece's part, and is brought up to date. True if there
    /// is one part only.
    bool bridge_parts(std::vector<std::uint32_t>& part, double reach) {
        PointHash cubes(low_, reach);
        for (std::uint32_t i = 0; i < graph_.size(); ++i) {
            cubes.add(graph_.position[i], i);
        }
        constexpr double none = std::numeric_limits<double>::infinity();
        std::vector<std::pair<double, std::uint32_t>> nearest(graph_.size(), {none, 0});
        std::vector<double> least(graph_.size(), none);  // per part
        for (std::uint32_t i = 0; i < graph_.size(); ++i) {
            cubes.visit(graph_.position[i], [&](std::uint32_t other) {
                const double distance = glm::length(graph_.position[other] - graph_.position[i]);
                if (part[other] != part[i] && distance <= reach) {
                    nearest[i] = std::min(nearest[i], {distance, other});
                }
            });
            least[part[i]] = std::min(least[part[i]], nearest[i].first);
        }
        std::vector<std::uint32_t> joined = part;
        for (std::uint32_t i = 0; i < graph_.size(); ++i) {
            if (nearest[i].first < none && nearest[i].first <= least[part[i]] + pitch_) {
                join(i, nearest[i].second);
                unite(joined, i, nearest[i].second);
            }
        }
        bool whole = true;
        for (std::uint32_t i = 0; i < graph_.size(); ++i) {
            part[i] = part_of(joined, i);
            whole = whole && part[i] == 0;
        }
        return whole;
    }

    [[noreturn]] void refuse_part(const std::vector<std::uint32_t>& part) const {
        const std::uint32_t left_over = *std::max_element(part.begin(), part.end());
        double gap = std::numeric_limits<double>::infinity();
        for (std::uint32_t i = 0; i < graph_.size(); ++i) {
            if (part[i] != left_over) {
                continue;
            }
            for (std::uint32_t j = 0; j < graph_.size(); ++j) {
                if (part[j] != left_over) {
                    gap = std::min(gap, glm::length(graph_.position[i] - graph_.position[j]));
                }
            }
        }
        throw std::invalid_argument("model builder: the part of the mesh that has vertex " + std::to_string(left_over) +
                                    " is " + std::to_string(gap) +
                                    " m away from the rest, and nothing holds it. Make it "
                                    "an object of its own, or set bridge to more than that, and particles will be "
                                    "linked through the air");
    }

    void give_everything_a_share() {
        double sum = 0.0;
        for (const double share : graph_.share) {
            sum += share;
        }
        const double least = kLeastShare * sum / static_cast<double>(graph_.size());
        for (double& share : graph_.share) {
            share = std::max(share, least);
        }
    }

    void sort_ways() {
        graph_.first_way.assign(graph_.size() + 1, 0);
        for (const auto& [from, way] : from_) {
            ++graph_.first_way[from + 1];
        }
        for (std::size_t i = 0; i < graph_.size(); ++i) {
            graph_.first_way[i + 1] += graph_.first_way[i];
        }
        graph_.ways.resize(from_.size());
        std::vector<std::size_t> next(graph_.first_way.begin(), graph_.first_way.end() - 1);
        for (const auto& [from, way] : from_) {
            graph_.ways[next[from]++] = way;
        }
    }

    const TriangleMesh& mesh_;
    double pitch_;
    double bridge_;
    Refinement refined_;
    Vec3 low_{0.0};
    Vec3 high_{0.0};
    SampleGraph graph_;
    std::vector<std::pair<std::uint32_t, Way>> from_;
};

}  // namespace

SampleGraph make_sample_graph(const TriangleMesh& mesh, double pitch, double bridge) {
    return GraphMaker(mesh, pitch, bridge).take();
}

double signed_volume(const TriangleMesh& mesh) {
    double sum = 0.0;
    for (const Triangle& t : mesh.triangles) {
        // From a corner of the mesh, so that a body far from the origin loses no digits.
        const Vec3 origin = mesh.vertices.front();
        sum += glm::dot(mesh.vertices[t[0]] - origin,
                        glm::cross(mesh.vertices[t[1]] - origin, mesh.vertices[t[2]] - origin));
    }
    return sum / 6.0;
}

double surface_area(const TriangleMesh& mesh) {
    double sum = 0.0;
    for (const Triangle& t : mesh.triangles) {
        sum += glm::length(double_area(mesh.vertices, t));
    }
    return 0.5 * sum;
}

}  // namespace haptic::sim
