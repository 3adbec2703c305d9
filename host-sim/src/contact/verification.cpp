// Includes nothing of the contact code but the record of the path: what judges must not share its mistakes.
#include "contact/verification.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>

namespace haptic::sim {

namespace {

constexpr double kInside = 1e-12;  // of the triangle's area: on the border counts as through
constexpr double kLine = 1e-22;    // square of height over length, below which a triangle is a line
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kRounding = 1e-12;  // of a coordinate: far above what interpolating it rounds
constexpr double kFlat = 1e-13;      // of the cube of the extent: the triangle never leaves the point's plane

using Corners = std::array<Vec3, 3>;

/// A triangle in motion, relative to the moving centre: corner k goes from[k] -> to[k].
struct Relative {
    Corners from;
    Corners to;
};

Corners at(const Relative& r, double s) {
    Corners x{};
    for (std::size_t k = 0; k < 3; ++k) {
        x[k] = (1.0 - s) * r.from[k] + s * r.to[k];
    }
    return x;
}

double triple(const Vec3& a, const Vec3& b, const Vec3& c) {
    return glm::dot(a, glm::cross(b, c));
}

/// Whether the origin, which is in the triangle's plane up to rounding, is inside the triangle.
bool origin_inside(const Corners& x) {
    const Vec3 n = glm::cross(x[1] - x[0], x[2] - x[0]);
    const double area2 = glm::dot(n, n);
    const double longest2 = std::max(glm::dot(x[1] - x[0], x[1] - x[0]), glm::dot(x[2] - x[0], x[2] - x[0]));
    if (area2 <= kLine * longest2 * longest2) {
        return false;  // a line is no surface
    }
    for (std::size_t k = 0; k < 3; ++k) {
        if (glm::dot(n, glm::cross(x[k], x[(k + 1) % 3])) < -kInside * area2) {
            return false;
        }
    }
    return true;
}

/// c0 + c1 s + c2 s^2 + c3 s^3, its roots in [0, 1] in rising order, by bisection between its extrema.
class Cubic {
  public:
    explicit Cubic(const Relative& r) {
        const Corners& p = r.from;
        Corners d{};
        for (std::size_t k = 0; k < 3; ++k) {
            d[k] = r.to[k] - r.from[k];
        }
        c_ = {triple(p[0], p[1], p[2]), triple(d[0], p[1], p[2]) + triple(p[0], d[1], p[2]) + triple(p[0], p[1], d[2]),
              triple(p[0], d[1], d[2]) + triple(d[0], p[1], d[2]) + triple(d[0], d[1], p[2]), triple(d[0], d[1], d[2])};
    }

    [[nodiscard]] bool vanishes(double extent) const {
        const double largest = std::max({std::abs(c_[0]), std::abs(c_[1]), std::abs(c_[2]), std::abs(c_[3])});
        return largest <= kFlat * extent * extent * extent;
    }

    [[nodiscard]] std::size_t roots(std::array<double, 4>& out) const {
        std::array<double, 4> knots{0.0, 1.0, 1.0, 1.0};
        std::size_t count = 1;
        for (const double e : extrema()) {
            if (e > 0.0 && e < 1.0) {
                knots[count++] = e;
            }
        }
        knots[count++] = 1.0;
        std::size_t found = 0;
        for (std::size_t k = 0; k + 1 < count; ++k) {
            double low = knots[k];
            double high = knots[k + 1];
            const double at_low = value(low);
            const double at_high = value(high);
            if (at_low == 0.0) {
                out[found++] = low;
            } else if (at_low * at_high < 0.0) {
                for (int n = 0; n < 60; ++n) {
                    const double middle = 0.5 * (low + high);
                    (value(middle) * at_low > 0.0 ? low : high) = middle;
                }
                out[found++] = 0.5 * (low + high);
            } else if (k + 2 == count && at_high == 0.0) {
                out[found++] = high;
            }
        }
        return found;
    }

  private:
    [[nodiscard]] double value(double s) const { return ((c_[3] * s + c_[2]) * s + c_[1]) * s + c_[0]; }

    /// Roots of the derivative in rising order; 2 where there is none.
    [[nodiscard]] std::array<double, 2> extrema() const {
        const double a = 3.0 * c_[3];
        const double b = c_[2];
        const double c = c_[1];
        const double discriminant = b * b - a * c;
        if (discriminant < 0.0) {
            return {2.0, 2.0};
        }
        const double q = -(b + std::copysign(std::sqrt(discriminant), b));
        const double one = a != 0.0 ? q / a : 2.0;
        const double two = q != 0.0 ? c / q : 2.0;
        return {std::min(one, two), std::max(one, two)};
    }

    std::array<double, 4> c_{};
};

/// A triangle that slides in its own plane: the origin comes into it where one of its edges passes over the origin.
bool slides_over_origin(const Relative& r, double& time) {
    const Vec3 n = glm::abs(glm::cross(r.from[1] - r.from[0], r.from[2] - r.from[0])) +
                   glm::abs(glm::cross(r.to[1] - r.to[0], r.to[2] - r.to[0]));
    const int drop = n.x >= n.y && n.x >= n.z ? 0 : (n.y >= n.z ? 1 : 2);
    const int u = (drop + 1) % 3;
    const int v = (drop + 2) % 3;
    double first = 2.0;
    if (origin_inside(r.from)) {
        first = 0.0;
    }
    for (std::size_t k = 0; k < 3; ++k) {
        const std::size_t j = (k + 1) % 3;
        const auto cross2 = [&](const Vec3& x, const Vec3& y) { return x[u] * y[v] - x[v] * y[u]; };
        const Vec3 dk = r.to[k] - r.from[k];
        const Vec3 dj = r.to[j] - r.from[j];
        const double c0 = cross2(r.from[k], r.from[j]);
        const double c1 = cross2(dk, r.from[j]) + cross2(r.from[k], dj);
        const double c2 = cross2(dk, dj);
        const double discriminant = c1 * c1 - 4.0 * c2 * c0;
        if (discriminant < 0.0) {
            continue;
        }
        const double q = -0.5 * (c1 + std::copysign(std::sqrt(discriminant), c1));
        for (const double s : {c2 != 0.0 ? q / c2 : 2.0, q != 0.0 ? c0 / q : 2.0}) {
            if (s >= 0.0 && s <= 1.0 && s < first && origin_inside(at(r, s))) {
                first = s;
            }
        }
    }
    time = first;
    return first <= 1.0;
}

/// First share of the piece at which the triangle holds the origin.
bool first_passage(const Relative& r, double& share) {
    double extent = 0.0;
    for (std::size_t k = 0; k < 3; ++k) {
        extent = std::max({extent, glm::length(r.from[k]), glm::length(r.to[k])});
    }
    const Cubic cubic(r);
    if (cubic.vanishes(extent)) {
        return slides_over_origin(r, share);
    }
    std::array<double, 4> roots{};
    const std::size_t count = cubic.roots(roots);
    for (std::size_t k = 0; k < count; ++k) {
        if (origin_inside(at(r, roots[k]))) {
            share = roots[k];
            return true;
        }
    }
    return false;
}

bool box_misses_origin(const Relative& r) {
    for (int axis = 0; axis < 3; ++axis) {
        bool below = true;
        bool above = true;
        for (std::size_t k = 0; k < 3; ++k) {
            below = below && r.from[k][axis] < 0.0 && r.to[k][axis] < 0.0;
            above = above && r.from[k][axis] > 0.0 && r.to[k][axis] > 0.0;
        }
        if (below || above) {
            return true;
        }
    }
    return false;
}

Triangle sorted(Triangle t) {
    std::sort(t.begin(), t.end());
    return t;
}

/// Adds what one triangle does to a path between a knot and the next. `first_of_piece` is where in `found` what this
/// piece crosses of the same surface begins.
void judge(std::span<const SurfaceMotion> surfaces, std::uint32_t object, std::uint32_t triangle,
           std::span<const PathKnot> path, std::uint32_t piece, std::size_t first_of_piece,
           std::vector<Crossing>& found) {
    const SurfaceMotion& motion = surfaces[object];
    const PathKnot& p = path[piece];
    const PathKnot& q = path[piece + 1];
    Relative r{};
    for (std::size_t k = 0; k < 3; ++k) {
        const Vec3& x0 = motion.start[motion.triangles[triangle][k]];
        const Vec3& x1 = motion.end[motion.triangles[triangle][k]];
        r.from[k] = (1.0 - p.time) * x0 + p.time * x1 - p.position;
        r.to[k] = (1.0 - q.time) * x0 + q.time * x1 - q.position;
    }
    double share = 0.0;
    if (box_misses_origin(r) || !first_passage(r, share)) {
        return;
    }
    const bool other_face = std::any_of(
        found.begin() + static_cast<std::ptrdiff_t>(first_of_piece), found.end(),
        [&](const Crossing& c) { return sorted(motion.triangles[c.triangle]) == sorted(motion.triangles[triangle]); });
    if (!other_face) {
        found.push_back({object, triangle, piece, p.time + share * (q.time - p.time),
                         p.position + share * (q.position - p.position)});
    }
}

/// Bounds of places, wide enough for whatever rounding does to places between them.
struct Extent {
    Vec3 low{kInfinity};
    Vec3 high{-kInfinity};

    void add(const Vec3& x) {
        low = glm::min(low, x);
        high = glm::max(high, x);
    }
    void add(const Extent& other) {
        low = glm::min(low, other.low);
        high = glm::max(high, other.high);
    }
    void widen() {
        const Vec3 rounding = kRounding * glm::max(glm::abs(low), glm::abs(high));
        low -= rounding;
        high += rounding;
    }
    [[nodiscard]] bool meets(const Extent& other) const {
        return low.x <= other.high.x && high.x >= other.low.x && low.y <= other.high.y && high.y >= other.low.y &&
               low.z <= other.high.z && high.z >= other.low.z;
    }
};

/// Of each path.
std::vector<Extent> extents_of(std::span<const std::span<const PathKnot>> paths) {
    std::vector<Extent> extents(paths.size());
    for (std::size_t k = 0; k < paths.size(); ++k) {
        for (const PathKnot& knot : paths[k]) {
            extents[k].add(knot.position);
        }
        extents[k].widen();
    }
    return extents;
}

/// A triangle's number, and where it is over the whole step.
struct Near {
    std::uint32_t triangle;
    Extent extent;
};

/// The triangles of a surface that come into an extent at some time of the step, in the order of their numbers.
void collect(const SurfaceMotion& motion, const Extent& of_all, std::vector<Near>& near) {
    std::vector<Extent> ways(motion.start.size());  // of the vertices
    for (std::size_t v = 0; v < ways.size(); ++v) {
        ways[v].add(motion.start[v]);
        ways[v].add(motion.end[v]);
        ways[v].widen();
    }
    near.clear();
    for (std::uint32_t triangle = 0; triangle < motion.triangles.size(); ++triangle) {
        Extent extent;
        for (const std::uint32_t vertex : motion.triangles[triangle]) {
            extent.add(ways[vertex]);
        }
        if (extent.meets(of_all)) {
            near.push_back({triangle, extent});
        }
    }
}

}  // namespace

std::vector<Crossing> find_crossings(std::span<const SurfaceMotion> surfaces, std::span<const PathKnot> path) {
    std::vector<Crossing> found;
    for (std::uint32_t object = 0; object < surfaces.size(); ++object) {
        for (std::uint32_t piece = 0; piece + 1 < path.size(); ++piece) {
            const std::size_t first_of_piece = found.size();
            for (std::uint32_t triangle = 0; triangle < surfaces[object].triangles.size(); ++triangle) {
                judge(surfaces, object, triangle, path, piece, first_of_piece, found);
            }
        }
    }
    return found;
}

std::vector<std::vector<Crossing>> find_crossings(std::span<const SurfaceMotion> surfaces,
                                                  std::span<const std::span<const PathKnot>> paths) {
    std::vector<std::vector<Crossing>> found(paths.size());
    const std::vector<Extent> extents = extents_of(paths);
    Extent of_all;
    for (const Extent& extent : extents) {
        of_all.add(extent);
    }
    std::vector<Near> near;
    for (std::uint32_t object = 0; object < surfaces.size(); ++object) {
        collect(surfaces[object], of_all, near);
        for (std::size_t k = 0; k < paths.size(); ++k) {
            std::vector<std::uint32_t> met;
            for (const Near& n : near) {
                if (n.extent.meets(extents[k])) {
                    met.push_back(n.triangle);
                }
            }
            for (std::uint32_t piece = 0; piece + 1 < paths[k].size() && !met.empty(); ++piece) {
                const std::size_t first_of_piece = found[k].size();
                for (const std::uint32_t triangle : met) {
                    judge(surfaces, object, triangle, paths[k], piece, first_of_piece, found[k]);
                }
            }
        }
    }
    return found;
}

double winding_number(std::span<const Vec3> vertices, std::span<const Triangle> triangles, const Vec3& point) {
    double angle = 0.0;
    for (const Triangle& t : triangles) {
        const Vec3 a = vertices[t[0]] - point;
        const Vec3 b = vertices[t[1]] - point;
        const Vec3 c = vertices[t[2]] - point;
        const double la = glm::length(a);
        const double lb = glm::length(b);
        const double lc = glm::length(c);
        const double below = la * lb * lc + glm::dot(a, b) * lc + glm::dot(b, c) * la + glm::dot(c, a) * lb;
        angle += 2.0 * std::atan2(triple(a, b, c), below);
    }
    return angle / (4.0 * 3.14159265358979323846);
}

}  // namespace haptic::sim
