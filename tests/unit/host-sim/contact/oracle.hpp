// Oracle: brute-force answers for the tests of the contact code. Shares only the types of mesh and path with it.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <random>
#include <span>
#include <vector>

#include "contact/triangle_ccd.hpp"
#include "haptic/sim/mesh.hpp"
#include "haptic/types.hpp"

namespace haptic::sim::oracle {

using Corners = std::array<Vec3, 3>;

struct Query {
    Vec3 center{0.0};
    double radius = 1.0;
    Corners start{};
    Corners end{};
};

/// The triangle of a query.
inline MovingTriangle moving(const Query& q) {
    return {{q.start[0], q.start[1], q.start[2]}, {q.end[0], q.end[1], q.end[2]}};
}

/// Random numbers that are the same with every standard library; the distributions of std:: are not.
class Random {
  public:
    explicit Random(std::uint64_t seed) : engine_(seed) {}
    double uniform(double low, double high) {
        return low + (high - low) * static_cast<double>(engine_() >> 11) * 0x1.0p-53;
    }
    std::uint32_t below(std::uint32_t n) { return static_cast<std::uint32_t>(engine_() % n); }
    Vec3 in_cube(double half) { return {uniform(-half, half), uniform(-half, half), uniform(-half, half)}; }
    Vec3 direction() {
        for (;;) {
            const Vec3 v = in_cube(1.0);
            const double l = glm::length(v);
            if (l > 0.1 && l < 1.0) {
                return v / l;
            }
        }
    }

  private:
    std::mt19937_64 engine_;
};

inline double segment_distance(const Vec3& p, const Vec3& a, const Vec3& b) {
    const Vec3 e = b - a;
    const double ee = glm::dot(e, e);
    const double s = ee > 0.0 ? std::clamp(glm::dot(p - a, e) / ee, 0.0, 1.0) : 0.0;
    return glm::length(p - (a + s * e));
}

/// Distance to a triangle: the minimum of its three edges, and of its plane if the foot is inside.
inline double distance(const Vec3& p, const Corners& t) {
    double d =
        std::min({segment_distance(p, t[0], t[1]), segment_distance(p, t[1], t[2]), segment_distance(p, t[2], t[0])});
    const Vec3 n = glm::cross(t[1] - t[0], t[2] - t[0]);
    const double nn = glm::dot(n, n);
    if (nn > 0.0) {
        const double height = glm::dot(n, p - t[0]) / std::sqrt(nn);
        const Vec3 foot = p - n * (height / std::sqrt(nn));
        bool inside = true;
        for (std::size_t k = 0; k < 3; ++k) {
            inside = inside && glm::dot(n, glm::cross(t[k] - foot, t[(k + 1) % 3] - foot)) >= 0.0;
        }
        if (inside) {
            d = std::min(d, std::abs(height));
        }
    }
    return d;
}

inline Corners at(const Query& q, double t) {
    Corners x{};
    for (std::size_t k = 0; k < 3; ++k) {
        x[k] = q.start[k] + t * (q.end[k] - q.start[k]);
    }
    return x;
}

struct Answer {
    double min_distance = 1e300;  // m, minimum distance found at any time
    bool touches = false;         // at some sampled time the distance is within the radius
    double first_time = 2.0;      // first such time, by bisection; never before the true one
};

/// Samples the distance at `samples` + 1 times and refines each local minimum by golden-section search.
inline Answer sample(const Query& q, int samples) {
    const auto d = [&](double t) { return distance(q.center, at(q, t)); };
    Answer answer;
    double before_time = 0.0;
    const auto record = [&](double t, double value) {
        answer.min_distance = std::min(answer.min_distance, value);
        if (value <= q.radius && !answer.touches) {
            answer.touches = true;
            double low = before_time;
            double high = t;
            for (int k = 0; k < 60 && d(low) > q.radius; ++k) {
                const double middle = 0.5 * (low + high);
                (d(middle) > q.radius ? low : high) = middle;
            }
            answer.first_time = d(low) > q.radius ? high : low;
        }
        if (!answer.touches) {
            before_time = t;
        }
    };
    std::vector<double> value(static_cast<std::size_t>(samples) + 1);
    for (int k = 0; k <= samples; ++k) {
        value[static_cast<std::size_t>(k)] = d(static_cast<double>(k) / samples);
    }
    for (int k = 0; k <= samples; ++k) {
        const auto i = static_cast<std::size_t>(k);
        const bool minimum = (k == 0 || value[i] <= value[i - 1]) && (k == samples || value[i] <= value[i + 1]);
        if (minimum && !answer.touches) {
            double low = std::max(0, k - 1) / static_cast<double>(samples);
            double high = std::min(samples, k + 1) / static_cast<double>(samples);
            constexpr double kGolden = 0.6180339887498949;
            for (int n = 0; n < 60; ++n) {
                const double m1 = high - kGolden * (high - low);
                const double m2 = low + kGolden * (high - low);
                if (d(m1) < d(m2)) {
                    high = m2;
                } else {
                    low = m1;
                }
            }
            const double t = 0.5 * (low + high);
            if (t < static_cast<double>(k) / samples) {
                record(t, d(t));
                record(static_cast<double>(k) / samples, value[i]);
            } else {
                record(static_cast<double>(k) / samples, value[i]);
                record(t, d(t));
            }
        } else {
            record(static_cast<double>(k) / samples, value[i]);
        }
    }
    return answer;
}

enum class Motion { Translating, Deforming, Rotating, Slow, EdgeOn, Sliver };

/// A random query about a sphere of radius 1 (times `scale`): triangles of about its size that move about 5 radii.
inline Query random_query(Random& random, Motion motion, double scale) {
    Query q;
    q.radius = 1.0;
    const Vec3 middle = random.direction() * random.uniform(0.5, 3.0);
    for (std::size_t k = 0; k < 3; ++k) {
        q.start[k] = middle + random.in_cube(1.5);
        q.end[k] = q.start[k];
    }
    const Vec3 travel = -middle * random.uniform(0.2, 3.0) + random.in_cube(1.5);
    if (motion == Motion::Sliver) {
        q.start[2] = q.start[0] + (q.start[1] - q.start[0]) * random.uniform(-0.2, 1.2) +
                     random.in_cube(random.below(2) == 0 ? 0.0 : 1e-9);
        for (std::size_t k = 0; k < 3; ++k) {
            q.end[k] = q.start[k] + travel;
        }
    } else if (motion == Motion::Translating || motion == Motion::Slow) {
        const double share = motion == Motion::Slow ? 0.1 : 1.0;
        for (std::size_t k = 0; k < 3; ++k) {
            q.end[k] = q.start[k] + travel * share;
        }
    } else if (motion == Motion::Deforming) {
        for (std::size_t k = 0; k < 3; ++k) {
            q.end[k] = q.start[k] + travel + random.in_cube(2.0);
        }
    } else if (motion == Motion::Rotating) {
        const Vec3 axis = random.direction();
        const double angle = random.uniform(-2.5, 2.5);
        for (std::size_t k = 0; k < 3; ++k) {
            const Vec3 x = q.start[k] - middle;
            q.end[k] = middle + travel + x * std::cos(angle) + glm::cross(axis, x) * std::sin(angle) +
                       axis * (glm::dot(axis, x) * (1.0 - std::cos(angle)));
        }
    } else {
        const Vec3 n = glm::normalize(glm::cross(q.start[1] - q.start[0], q.start[2] - q.start[0]));
        const Vec3 along = travel - n * glm::dot(travel, n);
        for (std::size_t k = 0; k < 3; ++k) {
            q.end[k] = q.start[k] + along;
        }
    }
    q.radius *= scale;
    for (std::size_t k = 0; k < 3; ++k) {
        q.start[k] *= scale;
        q.end[k] *= scale;
    }
    return q;
}

}  // namespace haptic::sim::oracle
