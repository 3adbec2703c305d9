#include "haptic/sim/mesh_check.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <limits>
#include <optional>
#include <tuple>
#include <utility>

#include "haptic/numeric.hpp"
#include "mesh/mesh_topology.hpp"
#include "simd/aabb.hpp"
#include "verification/surface_crossings.hpp"

namespace haptic::sim {
namespace {

// Largest coordinate; squares of lengths stay far from overflow.
constexpr double kMaxCoordinate = 1e6;  // m
// Ratio of height to longest side below which corners count as collinear: a few roundings of 32 bits.
constexpr double kMinHeight = 1e-6;
// Ratio of volume to the cube of the box's diagonal below which nothing is enclosed.
constexpr double kMinVolume = 1e-12;
// Tests of pairs after which the search for crossings is given up. A mesh of triangles of similar size needs a few for
// each of them.
constexpr std::uint64_t kLeastTests = 2'000'000;
constexpr std::uint64_t kTestsPerTriangle = 50;

std::string counted(std::size_t count, const std::string& singular, const std::string& plural) {
    return std::to_string(count) + " " + (count == 1 ? singular : plural);
}

class Checker {
  public:
    Checker(std::span<const Vec3> vertices, std::span<const Triangle> triangles, const MeshCheckSettings& settings,
            const std::string& name)
        : given_vertices_(vertices), given_triangles_(triangles), settings_(settings), name_(name) {}

    CheckedMesh check() {
        report_.vertices_given = given_vertices_.size();
        report_.triangles_given = given_triangles_.size();
        refuse_too_large();
        refuse_non_finite_vertices();
        refuse_bad_indices();
        weld_and_collapse();
        remove_duplicates();
        remove_unused_vertices();
        measure_triangles();
        orient_and_close();
        find_crossings();
        describe();
        report_.vertices = mesh_.vertices.size();
        report_.triangles = mesh_.triangles.size();
        return {std::move(mesh_), std::move(report_)};
    }

  private:
    [[noreturn]] void refuse(const std::string& problem) const { throw MeshError(name_ + ": " + problem); }

    /// Names a triangle of the input.
    [[nodiscard]] std::string given(std::size_t triangle) const {
        const auto& [a, b, c] = given_triangles_[triangle];
        return "triangle " + std::to_string(triangle) + " (vertices " + std::to_string(a) + ", " + std::to_string(b) +
               ", " + std::to_string(c) + ")";
    }

    /// Names a kept triangle by its number in the input.
    [[nodiscard]] std::string kept(std::size_t triangle) const { return given(source_[triangle]); }

    void warn(const std::string& text) { report_.warnings.push_back(text); }

    void refuse_too_large() const {
        if (given_triangles_.empty()) {
            refuse("has no triangles; points and lines alone have no surface to touch");
        }
        if (given_triangles_.size() > settings_.max_triangles) {
            refuse("has " + std::to_string(given_triangles_.size()) + " triangles, more than the " +
                   std::to_string(settings_.max_triangles) + " allowed; simplify the mesh first");
        }
        if (given_vertices_.size() > settings_.max_vertices) {
            refuse("has " + std::to_string(given_vertices_.size()) + " vertices, more than the " +
                   std::to_string(settings_.max_vertices) + " allowed; simplify the mesh first");
        }
    }

    void refuse_non_finite_vertices() const {
        for (std::size_t i = 0; i < given_vertices_.size(); ++i) {
            const Vec3& v = given_vertices_[i];
            if (!haptic::is_finite(v)) {
                refuse("vertex " + std::to_string(i) + " has a coordinate that is not a finite number");
            }
            if (std::max({std::fabs(v.x), std::fabs(v.y), std::fabs(v.z)}) > kMaxCoordinate) {
                refuse("vertex " + std::to_string(i) + " is more than 1000 km away; is the scale right?");
            }
        }
    }

    void refuse_bad_indices() const {
        for (std::size_t t = 0; t < given_triangles_.size(); ++t) {
            if (*std::max_element(given_triangles_[t].begin(), given_triangles_[t].end()) >= given_vertices_.size()) {
                refuse(given(t) + " refers to a vertex that does not exist; the number of vertices is " +
                       std::to_string(given_vertices_.size()));
            }
        }
    }

    /// Merges vertices and removes the triangles that lose an edge by it.
    void weld_and_collapse() {
        Aabb box;
        for (const Triangle& triangle : given_triangles_) {
            for (const std::uint32_t i : triangle) {
                box.extend(given_vertices_[i]);
            }
        }
        report_.low = box.min;
        report_.high = box.max;
        diagonal_ = glm::length(box.size());
        const std::vector<std::uint32_t> representative = weld(given_vertices_, settings_.weld_tolerance * diagonal_);
        for (std::uint32_t i = 0; i < representative.size(); ++i) {
            report_.welded += representative[i] != i ? 1U : 0U;
        }
        std::optional<std::size_t> first;
        for (std::uint32_t t = 0; t < given_triangles_.size(); ++t) {
            Triangle welded{};
            std::transform(given_triangles_[t].begin(), given_triangles_[t].end(), welded.begin(),
                           [&](std::uint32_t i) { return representative[i]; });
            if (welded[0] == welded[1] || welded[1] == welded[2] || welded[2] == welded[0]) {
                ++report_.collapsed;
                first = first.value_or(t);
                continue;
            }
            mesh_.triangles.push_back(welded);
            source_.push_back(t);
        }
        if (first) {
            warn(counted(report_.collapsed, "triangle has", "triangles have") +
                 " two corners in the same position; removed; the first is " + given(*first));
        }
        if (mesh_.triangles.empty()) {
            refuse("has no triangle with an area; " + given(0) + " has two corners in the same position");
        }
    }

    /// Keeps the first of triangles with the same corners and winding. Opposite winding makes the other face of a
    /// double-faced sheet.
    void remove_duplicates() {
        // Sort by the set of corners, then by winding: even or odd permutation of the sorted corners.
        struct Key {
            Triangle corners;
            bool odd;
            std::uint32_t triangle;
        };
        std::vector<Key> keys;
        keys.reserve(mesh_.triangles.size());
        for (std::uint32_t t = 0; t < mesh_.triangles.size(); ++t) {
            const Triangle& given = mesh_.triangles[t];
            Triangle sorted = given;
            std::sort(sorted.begin(), sorted.end());
            const auto start = std::find(given.begin(), given.end(), sorted[0]);
            const auto second = start + 1 == given.end() ? given.begin() : start + 1;
            keys.push_back({sorted, *second != sorted[1], t});
        }
        std::sort(keys.begin(), keys.end(), [](const Key& a, const Key& b) {
            return std::tie(a.corners, a.odd, a.triangle) < std::tie(b.corners, b.odd, b.triangle);
        });
        // Equal neighbours are duplicates; those that differ only in winding are paired as twins.
        std::vector<std::uint8_t> is_duplicate(mesh_.triangles.size(), 0);
        std::vector<std::uint32_t> twin(mesh_.triangles.size(), kNone);
        const Key* last = nullptr;
        for (const Key& key : keys) {
            if (last != nullptr && key.corners == last->corners) {
                if (key.odd == last->odd) {
                    is_duplicate[key.triangle] = 1;
                    continue;
                }
                twin[key.triangle] = last->triangle;
                twin[last->triangle] = key.triangle;
            }
            last = &key;
        }
        remove_marked(is_duplicate, twin);
    }

    void remove_marked(const std::vector<std::uint8_t>& is_duplicate, const std::vector<std::uint32_t>& twin) {
        std::size_t kept_count = 0;
        std::optional<std::size_t> first;
        in_sheet_.clear();
        for (std::size_t t = 0; t < mesh_.triangles.size(); ++t) {
            if (is_duplicate[t] != 0) {
                ++report_.duplicates;
                first = first.value_or(source_[t]);
                continue;
            }
            const bool second_of_pair = twin[t] != kNone && twin[t] < t;
            report_.double_faced += second_of_pair ? 1 : 0;
            in_sheet_.push_back(second_of_pair ? 0 : 1);
            is_paired_.push_back(twin[t] != kNone ? 1 : 0);
            mesh_.triangles[kept_count] = mesh_.triangles[t];
            source_[kept_count] = source_[t];
            ++kept_count;
        }
        mesh_.triangles.resize(kept_count);
        source_.resize(kept_count);
        if (first) {
            warn(counted(report_.duplicates, "triangle has", "triangles have") +
                 " the same corners as an earlier one; removed; the first is " + given(*first));
        }
    }

    void remove_unused_vertices() {
        std::vector<std::uint32_t> new_index(given_vertices_.size(), kNone);
        for (const Triangle& triangle : mesh_.triangles) {
            for (const std::uint32_t i : triangle) {
                new_index[i] = 0;
            }
        }
        for (std::uint32_t i = 0; i < new_index.size(); ++i) {
            if (new_index[i] != kNone) {
                new_index[i] = static_cast<std::uint32_t>(mesh_.vertices.size());
                mesh_.vertices.push_back(given_vertices_[i]);
                source_vertex_.push_back(i);
            }
        }
        report_.unused = given_vertices_.size() - report_.welded - mesh_.vertices.size();
        for (Triangle& triangle : mesh_.triangles) {
            for (std::uint32_t& i : triangle) {
                i = new_index[i];
            }
        }
        if (report_.unused > 0) {
            warn(counted(report_.unused, "vertex belongs", "vertices belong") + " to no triangle; removed");
        }
    }

    [[nodiscard]] Vec3 twice_area(const Triangle& triangle) const {
        const Vec3& a = mesh_.vertices[triangle[0]];
        return glm::cross(mesh_.vertices[triangle[1]] - a, mesh_.vertices[triangle[2]] - a);
    }

    void measure_triangles() {
        std::optional<std::size_t> first;
        for (std::size_t t = 0; t < mesh_.triangles.size(); ++t) {
            const double area = glm::length(twice_area(mesh_.triangles[t]));
            double longest = 0.0;
            for (std::size_t i = 0; i < 3; ++i) {
                longest = std::max(longest, glm::length(mesh_.vertices[mesh_.triangles[t][(i + 1) % 3]] -
                                                        mesh_.vertices[mesh_.triangles[t][i]]));
            }
            report_.area += 0.5 * area;
            if (!(area > kMinHeight * longest * longest)) {
                ++report_.degenerate;
                first = first.value_or(t);
            }
        }
        if (!(report_.area > 0.0)) {
            refuse("no triangle has an area; the corners of " + kept(0) + " are on a line");
        }
        if (first) {
            warn(counted(report_.degenerate, "triangle has", "triangles have") +
                 " collinear corners; kept, because removal would separate the neighbours; the first is " +
                 kept(*first));
        }
    }

    void reverse(std::size_t triangle) { std::swap(mesh_.triangles[triangle][1], mesh_.triangles[triangle][2]); }

    void orient_and_close() {
        // Edges and vertices where the mesh is not a manifold.
        std::vector<detail::Side> sides = detail::sorted_sides(mesh_.triangles, in_sheet_);
        describe_edges(sides);
        const detail::Fans fans = detail::count_fans(mesh_.triangles, in_sheet_, sides, mesh_.vertices.size());
        report_.pinched_vertices = fans.pinched;
        if (fans.pinched > 0) {
            const Vec3& v = mesh_.vertices[fans.first];
            warn(counted(fans.pinched, "vertex joins", "vertices join") +
                 " parts that share no edge; the first is at (" + std::to_string(v.x) + ", " + std::to_string(v.y) +
                 ", " + std::to_string(v.z) + ") m");
        }
        report_.components = detail::count_parts(mesh_.triangles, mesh_.vertices.size());

        // Reverse the triangles that disagree with the majority of their part. Faces of sheets have both windings
        // already.
        const detail::Orientation orientation = detail::orient(mesh_.triangles.size(), sides);
        report_.orientable = orientation.orientable;
        if (!orientation.orientable) {
            warn("the surface has one side only, like a Möbius strip, and no inside");
        }
        std::optional<std::size_t> first;
        for (std::size_t t = 0; orientation.orientable && t < mesh_.triangles.size(); ++t) {
            if (orientation.flip[t] != 0 && is_paired_[t] == 0) {
                reverse(t);
                ++report_.flipped;
                first = first.value_or(t);
            }
        }
        if (first) {
            warn(counted(report_.flipped, "triangle was", "triangles were") +
                 " oriented against the neighbours and reversed; the first is " + kept(*first));
        }
        close();
    }

    void describe_edges(std::span<const detail::Side> sides) {
        std::optional<std::size_t> crowded;
        std::optional<std::size_t> boundary;
        detail::for_each_edge(sides, [&](std::span<const detail::Side> edge) {
            if (edge.size() == 1) {
                ++report_.boundary_edges;
                boundary = std::min<std::size_t>(boundary.value_or(edge[0].triangle), edge[0].triangle);
            } else if (edge.size() > 2) {
                ++report_.crowded_edges;
                crowded = std::min<std::size_t>(crowded.value_or(edge[2].triangle), edge[2].triangle);
            }
        });
        if (crowded) {
            warn(counted(report_.crowded_edges, "edge has", "edges have") +
                 " more than two triangles: not a manifold, but it can be touched; the first such triangle is " +
                 kept(*crowded));
        }
        if (boundary && report_.double_faced < mesh_.triangles.size() - report_.double_faced) {
            warn("the mesh is open: " + counted(report_.boundary_edges, "edge has", "edges have") +
                 " one triangle only, the first is " + kept(*boundary) + "; it has no inside");
        }
    }

    /// Determines whether the mesh is closed: every edge is traversed equally often in both directions, and the
    /// enclosed volume is not 0. The two faces of a sheet cancel and do not count.
    void close() {
        std::vector<std::uint8_t> counts(mesh_.triangles.size());
        std::transform(is_paired_.begin(), is_paired_.end(), counts.begin(),
                       [](std::uint8_t paired) { return static_cast<std::uint8_t>(1 - paired); });
        bool balanced = report_.orientable;
        detail::for_each_edge(detail::sorted_sides(mesh_.triangles, counts), [&](std::span<const detail::Side> edge) {
            std::ptrdiff_t surplus = 0;
            for (const detail::Side& side : edge) {
                surplus += side.forward ? 1 : -1;
            }
            balanced = balanced && surplus == 0;
        });
        if (!balanced) {
            return;
        }
        // Divergence theorem: sum of signed tetrahedra, relative to the middle for accuracy.
        const Vec3 middle = 0.5 * (report_.low + report_.high);
        double volume = 0.0;
        for (std::size_t t = 0; t < mesh_.triangles.size(); ++t) {
            if (counts[t] != 0) {
                volume +=
                    glm::dot(mesh_.vertices[mesh_.triangles[t][0]] - middle, twice_area(mesh_.triangles[t])) / 6.0;
            }
        }
        report_.closed = std::fabs(volume) > kMinVolume * diagonal_ * diagonal_ * diagonal_;
        mesh_.closed = report_.closed;
        if (!report_.closed) {
            return;
        }
        report_.volume = std::fabs(volume);
        if (volume < 0.0) {
            report_.turned = true;
            for (std::size_t t = 0; t < mesh_.triangles.size(); ++t) {
                if (counts[t] != 0) {
                    reverse(t);
                }
            }
            warn("the mesh was inside out; every triangle was reversed");
        }
    }

    /// Counts where the mesh passes through itself. What is closer than the welding tolerance is taken as touching.
    void find_crossings() {
        const CheckedSurface surface{mesh_.triangles, 0};
        SurfaceCrossings finder({&surface, 1}, mesh_.vertices);
        const double rounding = std::max(settings_.weld_tolerance * diagonal_, rounding_of(mesh_.vertices));
        const std::span<const SurfaceCrossing> found =
            finder.find(mesh_.vertices, rounding, kLeastTests + kTestsPerTriangle * mesh_.triangles.size());
        report_.crossings = found.size();
        report_.crossings_known = finder.complete();
        if (!finder.complete()) {
            warn("so many triangles overlap that the search for crossings was given up after " +
                 counted(found.size(), "edge", "edges"));
        }
        if (!found.empty()) {
            const SurfaceCrossing& first = found.front();
            const Vec3& at = first.position;
            const std::string from = std::to_string(source_vertex_[first.edge[0]]);
            const std::string what = first.edge[0] == first.edge[1] ? "at vertex " + from
                                                                    : "the edge from vertex " + from + " to " +
                                                                          std::to_string(source_vertex_[first.edge[1]]);
            warn("the mesh passes through itself: " + counted(found.size(), "edge pierces", "edges pierce") +
                 " a triangle; tolerated, and not kept apart; the first is " + what + ", through " +
                 kept(first.triangle) + " at (" + std::to_string(at.x) + ", " + std::to_string(at.y) + ", " +
                 std::to_string(at.z) + ") m");
        }
    }

    /// Adds the warnings about the mesh as a whole.
    void describe() {
        if (report_.components > 1) {
            warn("the mesh has " + std::to_string(report_.components) + " parts that share no vertex");
        }
    }

    static constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();

    std::span<const Vec3> given_vertices_;
    std::span<const Triangle> given_triangles_;
    const MeshCheckSettings& settings_;
    const std::string& name_;
    double diagonal_ = 0.0;  // m, of the box

    TriangleMesh mesh_;
    MeshReport report_;
    // Per triangle kept.
    std::vector<std::uint32_t> source_;    // number in the input
    std::vector<std::uint8_t> in_sheet_;   // 0: the second face of a pair
    std::vector<std::uint8_t> is_paired_;  // 1: one of a pair
    // Per vertex kept.
    std::vector<std::uint32_t> source_vertex_;  // number in the input
};

}  // namespace

void MeshCheckSettings::check() const {
    if (!(weld_tolerance >= 0.0) || weld_tolerance > kMaxWeldTolerance) {
        throw std::invalid_argument("mesh: weld_tolerance must be 0 to 0.01 of the diagonal");
    }
    if (max_triangles < 1 || max_triangles > 100'000'000 || max_vertices < 3 || max_vertices > 300'000'000) {
        throw std::invalid_argument("mesh: max_triangles must be 1 to 100 million, max_vertices 3 to 300 million");
    }
}

CheckedMesh check_mesh(std::span<const Vec3> vertices, std::span<const Triangle> triangles,
                       const MeshCheckSettings& settings, const std::string& name) {
    settings.check();
    return Checker(vertices, triangles, settings, name).check();
}

}  // namespace haptic::sim
