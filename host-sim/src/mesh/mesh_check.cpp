#include <haptic/sim/mesh_check.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <optional>
#include <tuple>
#include <utility>

#include "mesh/mesh_topology.hpp"

namespace haptic::sim {
namespace {

// Beyond this no scene is meant, and squares of lengths stay far from overflow.
constexpr double kFarthest = 1e6;  // m
// Height of a triangle by its longest side, below which its corners are on a line: some roundings of 32 bits.
constexpr double kLeastHeight = 1e-6;
// Volume by the cube of the box's diagonal, below which nothing is enclosed.
constexpr double kLeastVolume = 1e-12;

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
        refuse_what_is_too_large();
        refuse_what_is_no_number();
        refuse_what_is_no_index();
        weld_and_collapse();
        leave_out_duplicates();
        leave_out_unused();
        measure_triangles();
        orient_and_close();
        describe();
        report_.vertices = mesh_.vertices.size();
        report_.triangles = mesh_.triangles.size();
        return {std::move(mesh_), std::move(report_)};
    }

  private:
    [[noreturn]] void refuse(const std::string& problem) const { throw MeshError(name_ + ": " + problem); }

    /// A triangle as it was given.
    [[nodiscard]] std::string given(std::size_t triangle) const {
        const auto& [a, b, c] = given_triangles_[triangle];
        return "triangle " + std::to_string(triangle) + " (vertices " + std::to_string(a) + ", " + std::to_string(b) +
               ", " + std::to_string(c) + ")";
    }

    /// One that was kept, as it was given.
    [[nodiscard]] std::string kept(std::size_t triangle) const { return given(source_[triangle]); }

    void warn(const std::string& text) { report_.warnings.push_back(text); }

    void refuse_what_is_too_large() const {
        if (given_triangles_.empty()) {
            refuse("has no triangles; points and lines alone cannot be felt");
        }
        if (given_triangles_.size() > settings_.most_triangles) {
            refuse("has " + std::to_string(given_triangles_.size()) + " triangles, more than the " +
                   std::to_string(settings_.most_triangles) + " that are allowed; simplify it first");
        }
        if (given_vertices_.size() > settings_.most_vertices) {
            refuse("has " + std::to_string(given_vertices_.size()) + " vertices, more than the " +
                   std::to_string(settings_.most_vertices) + " that are allowed; simplify it first");
        }
    }

    void refuse_what_is_no_number() const {
        for (std::size_t i = 0; i < given_vertices_.size(); ++i) {
            const Vec3& v = given_vertices_[i];
            if (!std::isfinite(v.x) || !std::isfinite(v.y) || !std::isfinite(v.z)) {
                refuse("vertex " + std::to_string(i) + " has a coordinate that is no finite number");
            }
            if (std::max({std::fabs(v.x), std::fabs(v.y), std::fabs(v.z)}) > kFarthest) {
                refuse("vertex " + std::to_string(i) + " is more than 1000 km away; is the scale right?");
            }
        }
    }

    void refuse_what_is_no_index() const {
        for (std::size_t t = 0; t < given_triangles_.size(); ++t) {
            if (*std::max_element(given_triangles_[t].begin(), given_triangles_[t].end()) >= given_vertices_.size()) {
                refuse(given(t) + " has a vertex that is not there; there are " +
                       std::to_string(given_vertices_.size()));
            }
        }
    }

    /// Merges vertices, and leaves out the triangles that have an edge less by it.
    void weld_and_collapse() {
        Vec3 low(std::numeric_limits<double>::infinity());
        Vec3 high(-std::numeric_limits<double>::infinity());
        for (const Triangle& triangle : given_triangles_) {
            for (const std::uint32_t i : triangle) {
                low = glm::min(low, given_vertices_[i]);
                high = glm::max(high, given_vertices_[i]);
            }
        }
        report_.low = low;
        report_.high = high;
        diagonal_ = glm::length(high - low);
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
                 " two corners at one place and is left out; the first is " + given(*first));
        }
        if (mesh_.triangles.empty()) {
            refuse("has no triangle with an area; " + given(0) + " has two corners at one place");
        }
    }

    /// Of triangles with the same corners in the same sense, the first stays. Those in the opposite sense are the other
    /// face of a double-faced sheet.
    void leave_out_duplicates() {
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
        keep_those_without(is_duplicate, twin);
    }

    void keep_those_without(const std::vector<std::uint8_t>& is_duplicate, const std::vector<std::uint32_t>& twin) {
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
                 " the corners of one before and is left out; the first is " + given(*first));
        }
    }

    void leave_out_unused() {
        std::vector<std::uint32_t> place(given_vertices_.size(), kNone);
        for (const Triangle& triangle : mesh_.triangles) {
            for (const std::uint32_t i : triangle) {
                place[i] = 0;
            }
        }
        for (std::uint32_t i = 0; i < place.size(); ++i) {
            if (place[i] != kNone) {
                place[i] = static_cast<std::uint32_t>(mesh_.vertices.size());
                mesh_.vertices.push_back(given_vertices_[i]);
            }
        }
        report_.unused = given_vertices_.size() - report_.welded - mesh_.vertices.size();
        for (Triangle& triangle : mesh_.triangles) {
            for (std::uint32_t& i : triangle) {
                i = place[i];
            }
        }
        if (report_.unused > 0) {
            warn(counted(report_.unused, "vertex belongs", "vertices belong") + " to no triangle and is left out");
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
            if (!(area > kLeastHeight * longest * longest)) {
                ++report_.degenerate;
                first = first.value_or(t);
            }
        }
        if (!(report_.area > 0.0)) {
            refuse("no triangle has an area; the corners of " + kept(0) + " are on a line");
        }
        if (first) {
            warn(counted(report_.degenerate, "triangle has", "triangles have") +
                 " its corners on a line; it is kept, because its neighbours would not meet without it; the first is " +
                 kept(*first));
        }
    }

    void turn_over(std::size_t triangle) { std::swap(mesh_.triangles[triangle][1], mesh_.triangles[triangle][2]); }

    void orient_and_close() {
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

        const detail::Orientation orientation = detail::orient(mesh_.triangles.size(), sides);
        report_.orientable = orientation.orientable;
        if (!orientation.orientable) {
            warn("the surface has one side only, like a Möbius strip: it has no inside");
        }
        std::optional<std::size_t> first;
        for (std::size_t t = 0; orientation.orientable && t < mesh_.triangles.size(); ++t) {
            if (orientation.flip[t] != 0 && is_paired_[t] == 0) {
                turn_over(t);
                ++report_.flipped;
                first = first.value_or(t);
            }
        }
        if (first) {
            warn(counted(report_.flipped, "triangle looks", "triangles look") +
                 " to another side than its neighbours and is turned over; the first is " + kept(*first));
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
                 " more than two triangles: no surface, but it can be felt; the first such triangle is " +
                 kept(*crowded));
        }
        if (boundary && report_.double_faced < mesh_.triangles.size() - report_.double_faced) {
            warn("it is open: " + counted(report_.boundary_edges, "edge has", "edges have") +
                 " one triangle only, the first is " + kept(*boundary) + "; it has no inside");
        }
    }

    /// Closed: every edge is gone through as often one way as the other, and something is enclosed. The two faces of a
    /// sheet cancel and are left out.
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
        const Vec3 middle = 0.5 * (report_.low + report_.high);
        double volume = 0.0;
        for (std::size_t t = 0; t < mesh_.triangles.size(); ++t) {
            if (counts[t] != 0) {
                volume +=
                    glm::dot(mesh_.vertices[mesh_.triangles[t][0]] - middle, twice_area(mesh_.triangles[t])) / 6.0;
            }
        }
        report_.closed = std::fabs(volume) > kLeastVolume * diagonal_ * diagonal_ * diagonal_;
        mesh_.closed = report_.closed;
        if (!report_.closed) {
            return;
        }
        report_.volume = std::fabs(volume);
        if (volume < 0.0) {
            report_.turned = true;
            for (std::size_t t = 0; t < mesh_.triangles.size(); ++t) {
                if (counts[t] != 0) {
                    turn_over(t);
                }
            }
            warn("it was inside out: every triangle is turned over");
        }
    }

    /// What needs no naming of elements.
    void describe() {
        if (report_.components > 1) {
            warn("it has " + std::to_string(report_.components) + " parts that share no vertex");
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
    std::vector<std::uint32_t> source_;    // its number as it was given
    std::vector<std::uint8_t> in_sheet_;   // 0: the second face of a pair
    std::vector<std::uint8_t> is_paired_;  // 1: it is one of a pair
};

}  // namespace

void MeshCheckSettings::check() const {
    if (!(weld_tolerance >= 0.0) || weld_tolerance > 0.01) {
        throw std::invalid_argument("mesh: weld_tolerance must be 0 to 0.01 of the diagonal");
    }
    if (most_triangles < 1 || most_triangles > 100'000'000 || most_vertices < 3 || most_vertices > 300'000'000) {
        throw std::invalid_argument("mesh: at most 100 million triangles and 300 million vertices can be allowed");
    }
}

CheckedMesh check_mesh(std::span<const Vec3> vertices, std::span<const Triangle> triangles,
                       const MeshCheckSettings& settings, const std::string& name) {
    settings.check();
    return Checker(vertices, triangles, settings, name).check();
}

}  // namespace haptic::sim
