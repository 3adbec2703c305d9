#include "contact/thesis/thesis_ccd.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <tuple>

#include "contact/contact_points.hpp"

namespace haptic::sim {

namespace {

constexpr double kRounding = 1e-15;  // of the cube of the coordinates: precision of the cubic
constexpr double kOnBorder = 1e-12;  // of the coordinates: a centre this near to the triangle is inside it
constexpr double kSideStep = 1e-3;   // of the radius: distance from the face at which the path passes at t_mu
constexpr int kMaxRefinements = 128;
constexpr double kNone = -1.0;

/// Cubic polynomial c[0] + c[1] t + c[2] t^2 + c[3] t^3.
using Cubic = std::array<double, 4>;

double value(const Cubic& c, double t) HAPTIC_RT {
    return ((c[3] * t + c[2]) * t + c[1]) * t + c[0];
}

double slope(const Cubic& c, double t) HAPTIC_RT {
    return (3.0 * c[3] * t + 2.0 * c[2]) * t + c[1];
}

/// Root between two times of opposite signs, to the last bit: Newton's method while it stays in the bracket, bisection
/// otherwise.
double refine(const Cubic& c, double low, double high) HAPTIC_RT {
    const bool rising = value(c, low) < 0.0;
    double t = 0.5 * (low + high);
    for (int k = 0; k < kMaxRefinements; ++k) {
        const double f = value(c, t);
        if (f == 0.0) {
            break;
        }
        // Shrink the bracket to the side of the root.
        ((f < 0.0) == rising ? low : high) = t;
        const double s = slope(c, t);
        double next = s != 0.0 ? t - f / s : low;
        if (!(next > low && next < high)) {
            next = 0.5 * (low + high);
        }
        if (next == t || !(next > low && next < high)) {
            break;
        }
        t = next;
    }
    return t;
}

/// Smallest root in (0, 1), or kNone. The extrema split the cubic into monotone pieces; an extremum within `noise` of
/// zero is a double root. A cubic that is entirely noise has no definable root.
double first_root(const Cubic& c, double noise) HAPTIC_RT {
    if (std::max({std::abs(c[0]), std::abs(c[1]), std::abs(c[2]), std::abs(c[3])}) <= noise) {
        return kNone;
    }
    // Extrema: roots of the derivative, without cancellation, in rising order.
    std::array<double, 4> cuts{0.0, 1.0, 1.0, 1.0};
    std::size_t count = 1;
    const double discriminant = c[2] * c[2] - 3.0 * c[3] * c[1];
    if (discriminant >= 0.0) {
        const double q = -(c[2] + std::copysign(std::sqrt(discriminant), c[2]));
        double first = c[3] != 0.0 ? q / (3.0 * c[3]) : kNone;
        double second = q != 0.0 ? c[1] / q : kNone;
        if (second < first) {
            std::swap(first, second);
        }
        for (const double t : {first, second}) {
            if (t > cuts[count - 1] && t < 1.0) {
                cuts[count++] = t;
            }
        }
    }
    cuts[count++] = 1.0;
    // First piece with a sign change, or a double root at its end.
    for (std::size_t k = 1; k < count; ++k) {
        const double before = value(c, cuts[k - 1]);
        const double after = value(c, cuts[k]);
        if ((before < 0.0 && after > 0.0) || (before > 0.0 && after < 0.0)) {
            const double root = refine(c, cuts[k - 1], cuts[k]);
            if (root > 0.0 && root < 1.0) {
                return root;
            }
        }
        if (k + 1 < count && std::abs(after) <= noise) {
            return cuts[k];
        }
    }
    return kNone;
}

double longest(const TriangleCorners& t) HAPTIC_RT {
    return std::sqrt(std::max({glm::dot(t.a, t.a), glm::dot(t.b, t.b), glm::dot(t.c, t.c)}));
}

Vec3 normal_of(const TriangleCorners& t) HAPTIC_RT {
    return glm::cross(t.b - t.a, t.c - t.a);
}

Vec3 unit(const Vec3& v) HAPTIC_RT {
    const double length = std::sqrt(glm::dot(v, v));
    return length > 0.0 ? v / length : Vec3(0.0);
}

/// Equation 4.5 with the centre at the origin: dot(a(t), n(t)), with n the cross product of two edges (equation 4.3).
Cubic coplanarity(const TriangleCorners& start, const TriangleCorners& motion) HAPTIC_RT {
    const Vec3 e = start.b - start.a;
    const Vec3 f = start.c - start.a;
    const Vec3 de = motion.b - motion.a;
    const Vec3 df = motion.c - motion.a;
    // n(t) = n0 + n1 t + n2 t^2.
    const Vec3 n0 = glm::cross(e, f);
    const Vec3 n1 = glm::cross(de, f) + glm::cross(e, df);
    const Vec3 n2 = glm::cross(de, df);
    return {glm::dot(start.a, n0), glm::dot(start.a, n1) + glm::dot(motion.a, n0),
            glm::dot(start.a, n2) + glm::dot(motion.a, n1), glm::dot(motion.a, n2)};
}

/// Earliest contact of one kind.
struct FirstContact {
    bool found = false;
    ThesisContact contact;
    std::uint32_t object = 0;
    std::uint32_t triangle = 0;

    /// Keeps the earlier of the present contact and `other`; of two at the same time, the one of the lower indices.
    void keep_earlier(const ThesisContact& other, std::uint32_t other_object, std::uint32_t other_triangle) noexcept {
        if (!found ||
            std::tuple{other.time, other_object, other_triangle} < std::tuple{contact.time, object, triangle}) {
            found = true;
            contact = other;
            object = other_object;
            triangle = other_triangle;
        }
    }
};

}  // namespace

ThesisContact thesis_triangle_ccd(const Vec3& center, double radius, const MovingTriangle& triangle) HAPTIC_RT {
    // Centre at the origin.
    const TriangleCorners start{triangle.start.a - center, triangle.start.b - center, triangle.start.c - center};
    const TriangleCorners motion{triangle.end.a - triangle.start.a, triangle.end.b - triangle.start.b,
                                 triangle.end.c - triangle.start.c};
    // Equations 4.6 to 4.8: F(triangle) is the first root of equation 4.5 in the step.
    const double extent = longest(start) + longest(motion);
    const Cubic cubic = coplanarity(start, motion);
    const double time = first_root(cubic, kRounding * extent * extent * extent);
    ThesisContact contact;
    if (time == kNone) {
        return contact;
    }
    const auto at = [&](double t) {
        return TriangleCorners{start.a + motion.a * t, start.b + motion.b * t, start.c + motion.c * t};
    };
    // Distance from the centre to the triangle at t_mu decides between the sets S and W.
    contact.time = time;
    contact.at = closest_point_on_triangle(Vec3(0.0), at(time));
    const double distance = std::sqrt(contact.at.squared_distance);
    if (contact.at.feature == Feature::Face || distance <= kOnBorder * extent) {
        // Equation 4.8, the set S: the centre is inside the triangle.
        contact.feature = Feature::Face;
        // There is no root before t_mu, so half-way there the cubic tells the side where the centre started.
        const double side = value(cubic, 0.5 * time) > 0.0 ? -1.0 : 1.0;
        contact.normal = unit(normal_of(at(1.0))) * side;
    } else if (distance < radius) {
        // Equation 4.11, the set W: the triangle is within the radius, so an edge or a vertex touches.
        contact.feature = contact.at.feature;
        contact.normal = contact.at.point * (-1.0 / distance);
    }
    return contact;
}

SecurePosition thesis_secure_position(std::span<const MovingSurface> surfaces, const Vec3& center, double radius,
                                      const ContactSettings& settings, ProxyPath* path) noexcept {
    // Lines 1 and 2: first face contact i, and first edge or vertex contact j.
    FirstContact face;
    FirstContact border;
    const Aabb box = aabb_of_segment(center, center, radius);
    for (std::uint32_t object = 0; object < surfaces.size(); ++object) {
        const SurfaceMotion& motion = surfaces[object].motion;
        surfaces[object].tree->query(box, [&](std::uint32_t triangle) {
            const ThesisContact found = thesis_triangle_ccd(center, radius * settings.shrink,
                                                            {corners_of(motion.start, motion.triangles[triangle]),
                                                             corners_of(motion.end, motion.triangles[triangle])});
            if (found.feature != Feature::None) {
                (found.feature == Feature::Face ? face : border).keep_earlier(found, object, triangle);
            }
        });
    }
    SecurePosition result;
    result.position = center;
    const auto append = [&](double time, const Vec3& position) {
        if (path != nullptr) {
            path->append(time, position);
        }
    };
    // Line 3: a face contact wins.
    if (face.found || border.found) {
        const FirstContact& first = face.found ? face : border;
        const ThesisContact& contact = first.contact;
        const SurfaceMotion& motion = surfaces[first.object].motion;
        result.touched = true;
        result.first_time = contact.time;
        result.first = {first.object, first.triangle, contact.feature, contact.at.weights};
        result.first_normal = contact.normal;
        result.advances = 1;
        // Line 4: the touched material point at t = 1, offset by the radius along the normal.
        if (face.found) {
            // At t_mu the path passes next to the face, on the centre's side.
            const TriangleCorners at_contact = corners_of(motion, first.triangle, contact.time);
            const double side =
                glm::dot(normal_of(corners_of(motion.end, motion.triangles[first.triangle])), contact.normal) < 0.0
                    ? -1.0
                    : 1.0;
            append(contact.time, center + unit(normal_of(at_contact)) * (side * kSideStep * radius));
            result.position = blend(corners_of(motion.end, motion.triangles[first.triangle]), contact.at.weights) +
                              contact.normal * radius;
        } else {
            // Line 7: out of the penetration, to the full radius from the closest point.
            result.position += contact.normal * (radius - std::sqrt(contact.at.squared_distance));
        }
    }
    append(1.0, result.position);
    return result;
}

}  // namespace haptic::sim
