// Includes only the recorded path of the contact code, so that the check cannot share its mistakes. For the same
// reason it has its own box type.
#include "contact/verification.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>

namespace haptic::sim {

namespace {

constexpr double kBorderTolerance = 1e-12;  // of the triangle's squared area: on the border counts as inside
constexpr double kLineTolerance = 1e-22;    // squared height over length below which a triangle is a line
constexpr double kNoEdge = std::numeric_limits<double>::infinity();
constexpr double kInterpolationRounding = 1e-12;  // of a coordinate: far above the rounding of interpolation
constexpr double kCoplanarTolerance = 1e-13;  // of the cube of the extent: the triangle never leaves the point's plane

using Corners = std::array<Vec3, 3>;

/// Moving triangle in the frame of the moving centre: corner k moves from from[k] to to[k], so the centre is the
/// origin.
struct Relative {
    Corners from;
    Corners to;
};

/// Corners at fraction s of the piece, in [0, 1].
Corners corners_at(const Relative& r, double s) {
    Corners x{};
    for (std::size_t k = 0; k < 3; ++k) {
        x[k] = (1.0 - s) * r.from[k] + s * r.to[k];
    }
    return x;
}

double triple(const Vec3& a, const Vec3& b, const Vec3& c) {
    return glm::dot(a, glm::cross(b, c));
}

/// Whether the origin, which lies in the triangle's plane up to rounding, is inside the triangle.
bool origin_inside(const Corners& x) {
    const Vec3 n = glm::cross(x[1] - x[0], x[2] - x[0]);
    const double area2 = glm::dot(n, n);
    const double longest2 = std::max(glm::dot(x[1] - x[0], x[1] - x[0]), glm::dot(x[2] - x[0], x[2] - x[0]));
    if (area2 <= kLineTolerance * longest2 * longest2) {
        return false;  // degenerate: a line has no face to cross
    }
    // Inside: the origin is on the inner side of all three edges.
    for (std::size_t k = 0; k < 3; ++k) {
        if (glm::dot(n, glm::cross(x[k], x[(k + 1) % 3])) < -kBorderTolerance * area2) {
            return false;
        }
    }
    return true;
}

/// Coplanarity cubic c0 + c1 s + c2 s^2 + c3 s^3 = det(x0(s), x1(s), x2(s)) (Provot 1997), with its roots in [0, 1].
class Cubic {
  public:
    /// Coefficients by the multilinearity of the determinant.
    explicit Cubic(const Relative& r) {
        const Corners& p = r.from;
        Corners d{};
        for (std::size_t k = 0; k < 3; ++k) {
            d[k] = r.to[k] - r.from[k];
        }
        c_ = {triple(p[0], p[1], p[2]), triple(d[0], p[1], p[2]) + triple(p[0], d[1], p[2]) + triple(p[0], p[1], d[2]),
              triple(p[0], d[1], d[2]) + triple(d[0], p[1], d[2]) + triple(d[0], d[1], p[2]), triple(d[0], d[1], d[2])};
    }

    /// Whether all coefficients are rounding: the triangle moves in a plane through the origin.
    [[nodiscard]] bool vanishes(double extent) const {
        const double largest = std::max({std::abs(c_[0]), std::abs(c_[1]), std::abs(c_[2]), std::abs(c_[3])});
        return largest <= kCoplanarTolerance * extent * extent * extent;
    }

    /// Roots in [0, 1] in rising order, by bisection between the extrema. Returns their number.
    [[nodiscard]] std::size_t roots(std::array<double, 4>& out) const {
        // The extrema split [0, 1] into monotone pieces.
        std::array<double, 4> knots{0.0, 1.0, 1.0, 1.0};
        std::size_t count = 1;
        for (const double e : extrema()) {
            if (e > 0.0 && e < 1.0) {
                knots[count++] = e;
            }
        }
        knots[count++] = 1.0;
        std::size_t found = 0;
        // A root at the left end, a sign change, or a root at the right end of the last piece.
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

    /// Roots of the derivative in rising order, without cancellation; 2 where there is none.
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

/// First time at which a triangle that slides in its own plane contains the origin: at the start, or when one of its
/// edges passes over the origin.
bool slides_over_origin(const Relative& r, double& time) {
    // Project along the dominant axis of the normal.
    const Vec3 n = glm::abs(glm::cross(r.from[1] - r.from[0], r.from[2] - r.from[0])) +
                   glm::abs(glm::cross(r.to[1] - r.to[0], r.to[2] - r.to[0]));
    const int dropped_axis = n.x >= n.y && n.x >= n.z ? 0 : (n.y >= n.z ? 1 : 2);
    const int u = (dropped_axis + 1) % 3;
    const int v = (dropped_axis + 2) % 3;
    // Contained from the start.
    double first = 2.0;
    if (origin_inside(r.from)) {
        first = 0.0;
    }
    for (std::size_t k = 0; k < 3; ++k) {
        const std::size_t j = (k + 1) % 3;
        const auto cross2 = [&](const Vec3& x, const Vec3& y) { return x[u] * y[v] - x[v] * y[u]; };
        const Vec3 dk = r.to[k] - r.from[k];
        const Vec3 dj = r.to[j] - r.from[j];
        // Origin on the line through an edge: the quadratic cross(xk(s), xj(s)) = 0.
        const double c0 = cross2(r.from[k], r.from[j]);
        const double c1 = cross2(dk, r.from[j]) + cross2(r.from[k], dj);
        const double c2 = cross2(dk, dj);
        const double discriminant = c1 * c1 - 4.0 * c2 * c0;
        if (discriminant < 0.0) {
            continue;
        }
        // Both roots, without cancellation.
        const double q = -0.5 * (c1 + std::copysign(std::sqrt(discriminant), c1));
        for (const double s : {c2 != 0.0 ? q / c2 : 2.0, q != 0.0 ? c0 / q : 2.0}) {
            if (s >= 0.0 && s <= 1.0 && s < first && origin_inside(corners_at(r, s))) {
                first = s;
            }
        }
    }
    time = first;
    return first <= 1.0;
}

/// First fraction of the piece at which the triangle contains the origin.
bool first_passage(const Relative& r, double& fraction) {
    double extent = 0.0;
    for (std::size_t k = 0; k < 3; ++k) {
        extent = std::max({extent, glm::length(r.from[k]), glm::length(r.to[k])});
    }
    // Coplanarity is necessary; then the inside test at each root.
    const Cubic cubic(r);
    if (cubic.vanishes(extent)) {
        return slides_over_origin(r, fraction);
    }
    std::array<double, 4> roots{};
    const std::size_t count = cubic.roots(roots);
    for (std::size_t k = 0; k < count; ++k) {
        if (origin_inside(corners_at(r, roots[k]))) {
            fraction = roots[k];
            return true;
        }
    }
    return false;
}

/// Whether the box of the whole motion misses the origin.
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

/// Tests one triangle against one piece of a path and appends a crossing. `first_of_piece` is the index in `found` of
/// the first crossing of this piece with the same surface.
void check_triangle(std::span<const SurfaceMotion> surfaces, std::uint32_t object, std::uint32_t triangle,
                    std::span<const PathKnot> path, std::uint32_t piece, std::size_t first_of_piece,
                    std::vector<Crossing>& found) {
    const SurfaceMotion& motion = surfaces[object];
    const PathKnot& p = path[piece];
    const PathKnot& q = path[piece + 1];
    // Motion of the triangle over this piece, relative to the centre.
    Relative r{};
    for (std::size_t k = 0; k < 3; ++k) {
        const Vec3& x0 = motion.start[motion.triangles[triangle][k]];
        const Vec3& x1 = motion.end[motion.triangles[triangle][k]];
        r.from[k] = (1.0 - p.time) * x0 + p.time * x1 - p.position;
        r.to[k] = (1.0 - q.time) * x0 + q.time * x1 - q.position;
    }
    double fraction = 0.0;
    if (box_misses_origin(r) || !first_passage(r, fraction)) {
        return;
    }
    // Report both faces of a double-faced triangle once.
    const bool other_face = std::any_of(
        found.begin() + static_cast<std::ptrdiff_t>(first_of_piece), found.end(),
        [&](const Crossing& c) { return sorted(motion.triangles[c.triangle]) == sorted(motion.triangles[triangle]); });
    if (!other_face) {
        found.push_back({object, triangle, piece, p.time + fraction * (q.time - p.time),
                         p.position + fraction * (q.position - p.position)});
    }
}

/// Axis-aligned box, widened by more than the rounding of interpolation.
struct PathBounds {
    Vec3 low{kNoEdge};
    Vec3 high{-kNoEdge};

    void add(const Vec3& x) {
        low = glm::min(low, x);
        high = glm::max(high, x);
    }
    void add(const PathBounds& other) {
        low = glm::min(low, other.low);
        high = glm::max(high, other.high);
    }
    void widen() {
        const Vec3 rounding = kInterpolationRounding * glm::max(glm::abs(low), glm::abs(high));
        low -= rounding;
        high += rounding;
    }
    [[nodiscard]] bool meets(const PathBounds& other) const {
        return low.x <= other.high.x && high.x >= other.low.x && low.y <= other.high.y && high.y >= other.low.y &&
               low.z <= other.high.z && high.z >= other.low.z;
    }
};

/// Box of each path.
std::vector<PathBounds> bounds_of(std::span<const std::span<const PathKnot>> paths) {
    std::vector<PathBounds> path_bounds(paths.size());
    for (std::size_t k = 0; k < paths.size(); ++k) {
        for (const PathKnot& knot : paths[k]) {
            path_bounds[k].add(knot.position);
        }
        path_bounds[k].widen();
    }
    return path_bounds;
}

/// Triangle index and its box over the whole step.
struct SweptTriangle {
    std::uint32_t triangle;
    PathBounds bounds;
};

/// The sides of a box beyond which the path of a vertex is, as bits.
std::uint8_t beyond(const PathBounds& vertex, const PathBounds& box) {
    unsigned sides = 0;
    for (int axis = 0; axis < 3; ++axis) {
        sides |= static_cast<unsigned>(vertex.high[axis] < box.low[axis]) << (2 * axis);
        sides |= static_cast<unsigned>(vertex.low[axis] > box.high[axis]) << (2 * axis + 1);
    }
    return static_cast<std::uint8_t>(sides);
}

/// Path of a vertex over the step.
PathBounds swept(const SurfaceMotion& motion, std::size_t vertex) {
    PathBounds bounds;
    bounds.add(motion.start[vertex]);
    bounds.add(motion.end[vertex]);
    bounds.widen();
    return bounds;
}

/// Memory for collect_near().
struct NearTriangles {
    std::vector<std::uint8_t> beyond;  // per vertex
    std::vector<SweptTriangle> triangles;
};

/// Collects the triangles of a surface whose boxes overlap `all`, by rising index. A box misses another one if all
/// corners are beyond the same side of it.
void collect_near(const SurfaceMotion& motion, const PathBounds& all, NearTriangles& near) {
    near.triangles.clear();
    near.beyond.resize(motion.start.size());
    unsigned common = ~0u;
    for (std::size_t v = 0; v < motion.start.size(); ++v) {
        near.beyond[v] = beyond(swept(motion, v), all);
        common &= near.beyond[v];
    }
    // The whole surface is beyond a side.
    if (common != 0) {
        return;
    }
    for (std::uint32_t triangle = 0; triangle < motion.triangles.size(); ++triangle) {
        const auto& [a, b, c] = motion.triangles[triangle];
        if ((near.beyond[a] & near.beyond[b] & near.beyond[c]) == 0) {
            PathBounds bounds = swept(motion, a);
            bounds.add(swept(motion, b));
            bounds.add(swept(motion, c));
            near.triangles.push_back({triangle, bounds});
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
                check_triangle(surfaces, object, triangle, path, piece, first_of_piece, found);
            }
        }
    }
    return found;
}

std::vector<std::vector<Crossing>> find_crossings(std::span<const SurfaceMotion> surfaces,
                                                  std::span<const std::span<const PathKnot>> paths) {
    std::vector<std::vector<Crossing>> found(paths.size());
    const std::vector<PathBounds> path_bounds = bounds_of(paths);
    // Box of all paths, to discard most triangles at once.
    PathBounds all;
    for (const PathBounds& bounds : path_bounds) {
        all.add(bounds);
    }
    NearTriangles near;
    std::vector<std::uint32_t> near_path;
    for (std::uint32_t object = 0; object < surfaces.size(); ++object) {
        collect_near(surfaces[object], all, near);
        for (std::size_t k = 0; k < paths.size(); ++k) {
            // Triangles near this path.
            near_path.clear();
            for (const SweptTriangle& n : near.triangles) {
                if (n.bounds.meets(path_bounds[k])) {
                    near_path.push_back(n.triangle);
                }
            }
            // Exact test against each piece.
            for (std::uint32_t piece = 0; piece + 1 < paths[k].size() && !near_path.empty(); ++piece) {
                const std::size_t first_of_piece = found[k].size();
                for (const std::uint32_t triangle : near_path) {
                    check_triangle(surfaces, object, triangle, paths[k], piece, first_of_piece, found[k]);
                }
            }
        }
    }
    return found;
}

double winding_number(std::span<const Vec3> vertices, std::span<const Triangle> triangles, const Vec3& point) {
    double angle = 0.0;
    for (const Triangle& t : triangles) {
        // Solid angle: tan(omega / 2) = det(a, b, c) / denominator.
        const Vec3 a = vertices[t[0]] - point;
        const Vec3 b = vertices[t[1]] - point;
        const Vec3 c = vertices[t[2]] - point;
        const double la = glm::length(a);
        const double lb = glm::length(b);
        const double lc = glm::length(c);
        const double denominator = la * lb * lc + glm::dot(a, b) * lc + glm::dot(b, c) * la + glm::dot(c, a) * lb;
        angle += 2.0 * std::atan2(triple(a, b, c), denominator);
    }
    return angle / (4.0 * 3.14159265358979323846);
}

}  // namespace haptic::sim
