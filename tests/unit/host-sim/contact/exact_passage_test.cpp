// Claim: as the radius vanishes, no passage of a moving triangle through a point is missed and none is invented.
//
// Corners are integers and so are motions. Whether the triangle passes through the origin is then decided without
// rounding: for translations by a rational time, for deformations by the signs of Bernstein coefficients, which are
// integers of at most 126 bits down to intervals of 2^-20.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>

#include "contact/oracle.hpp"
#include "contact/triangle_ccd.hpp"

namespace {

using haptic::Vec3;
using haptic::sim::MovingTriangle;
using haptic::sim::sphere_triangle_ccd;
using haptic::sim::TriangleTouch;
using haptic::sim::oracle::Random;

__extension__ using Int = __int128;
using IntVec = std::array<Int, 3>;
using IntCorners = std::array<IntVec, 3>;

IntVec minus(const IntVec& a, const IntVec& b) {
    return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}

IntVec cross(const IntVec& a, const IntVec& b) {
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

Int dot(const IntVec& a, const IntVec& b) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

int sign(Int x) {
    return static_cast<int>(x > 0) - static_cast<int>(x < 0);
}

bool is_zero(const IntVec& a) {
    return a[0] == 0 && a[1] == 0 && a[2] == 0;
}

IntVec draw(Random& random, std::uint32_t half) {
    const auto one = [&] { return static_cast<Int>(random.below(2 * half + 1)) - half; };
    const Int x = one();
    const Int y = one();
    return {x, y, one()};
}

struct Case {
    IntCorners start{};
    IntCorners end{};
};

MovingTriangle moving(const Case& c) {
    const auto vec = [](const IntVec& v) {
        return Vec3(static_cast<double>(v[0]), static_cast<double>(v[1]), static_cast<double>(v[2]));
    };
    return {{vec(c.start[0]), vec(c.start[1]), vec(c.start[2])}, {vec(c.end[0]), vec(c.end[1]), vec(c.end[2])}};
}

IntVec normal_of(const IntCorners& t) {
    return cross(minus(t[1], t[0]), minus(t[2], t[0]));
}

/// Signed area of the origin against the edge from corner k to the next, positive inward.
Int inward(const IntCorners& t, std::size_t k, const IntVec& normal) {
    return dot(normal, cross(t[k], t[(k + 1) % 3]));
}

bool holds_origin(const IntCorners& t, const IntVec& normal) {
    return inward(t, 0, normal) >= 0 && inward(t, 1, normal) >= 0 && inward(t, 2, normal) >= 0;
}

/// A triangle that slides in a plane through the origin: does the path of the origin relative to it meet it?
bool slides_over_origin(const Case& c, const IntVec& normal) {
    if (holds_origin(c.start, normal) || holds_origin(c.end, normal)) {
        return true;
    }
    const IntVec path = minus(c.start[0], c.end[0]);
    const auto side = [&](const IntVec& from, const IntVec& to, const IntVec& x) {
        return sign(dot(normal, cross(minus(to, from), minus(x, from))));
    };
    constexpr IntVec origin{0, 0, 0};
    for (std::size_t k = 0; k < 3; ++k) {
        const IntVec& p = c.start[k];
        const IntVec& q = c.start[(k + 1) % 3];
        const int path_sides = side(origin, path, p) * side(origin, path, q);
        const int edge_sides = side(p, q, origin) * side(p, q, path);
        // Collinear lines are left to the other two edges, which end in the same corners.
        if (path_sides <= 0 && edge_sides <= 0 && (path_sides < 0 || edge_sides < 0)) {
            return true;
        }
    }
    return false;
}

/// Does a translating triangle with a normal pass through the origin, borders included?
bool translation_passes(const Case& c) {
    const IntVec d = minus(c.end[0], c.start[0]);
    const IntVec n = normal_of(c.start);
    Int below = dot(n, d);
    Int above = -dot(n, c.start[0]);
    if (below == 0) {
        return above == 0 && slides_over_origin(c, n);
    }
    if (below < 0) {
        below = -below;
        above = -above;
    }
    if (above < 0 || above > below) {
        return false;
    }
    for (std::size_t k = 0; k < 3; ++k) {
        const IntVec& x = c.start[k];
        const IntVec& y = c.start[(k + 1) % 3];
        const Int still = dot(n, cross(x, y));
        const Int rate = dot(n, cross(x, d)) + dot(n, cross(d, y));
        if (still * below + rate * above < 0) {
            return false;
        }
    }
    return true;
}

/// Polynomial as integer Bernstein coefficients over an interval, up to an irrelevant positive factor.
template <std::size_t N>
using Bernstein = std::array<Int, N + 1>;

template <std::size_t N>
Bernstein<N> bernstein(const std::array<Int, N + 1>& power) {
    static_assert(N == 3 || N == 4);
    // Coefficient i is the sum of C(i, j) / C(N, j) power[j]; times 3 or 12 these are integers.
    constexpr std::array<std::array<Int, 5>, 5> choose{
        {{1, 0, 0, 0, 0}, {1, 1, 0, 0, 0}, {1, 2, 1, 0, 0}, {1, 3, 3, 1, 0}, {1, 4, 6, 4, 1}}};
    constexpr Int common = N == 3 ? 3 : 12;
    Bernstein<N> b{};
    for (std::size_t i = 0; i <= N; ++i) {
        for (std::size_t j = 0; j <= i; ++j) {
            b[i] += common / choose[N][j] * choose[i][j] * power[j];
        }
    }
    return b;
}

/// Halves an interval by de Casteljau's scheme without its divisions.
template <std::size_t N>
std::array<Bernstein<N>, 2> halves(Bernstein<N> b) {
    Bernstein<N> left{};
    Bernstein<N> right{};
    Int factor = Int{1} << N;
    for (std::size_t level = 0; level <= N; ++level) {
        left[level] = b[0] * factor;
        right[N - level] = b[N - level] * factor;
        for (std::size_t i = 0; i + level < N; ++i) {
            b[i] += b[i + 1];
        }
        factor /= 2;
    }
    return {left, right};
}

template <std::size_t Count>
bool all(const std::array<Int, Count>& b, int wanted) {
    return std::all_of(b.begin(), b.end(), [&](Int x) { return sign(x) == wanted; });
}

/// c0 + c1 t + c2 t^2 of vectors.
using VecQuadratic = std::array<IntVec, 3>;

VecQuadratic cross(const IntVec& x, const IntVec& dx, const IntVec& y, const IntVec& dy) {
    VecQuadratic c{cross(x, y), cross(x, dy), cross(dx, dy)};
    const IntVec other = cross(dx, y);
    for (std::size_t k = 0; k < 3; ++k) {
        c[1][k] += other[k];
    }
    return c;
}

/// Decides a deformation: a zero of `plane` at which no `edge` is negative.
struct Conditions {
    Bernstein<3> plane{};
    std::array<Bernstein<4>, 3> edge{};
};

Conditions conditions_of(const Case& c) {
    IntCorners by{};
    for (std::size_t k = 0; k < 3; ++k) {
        by[k] = minus(c.end[k], c.start[k]);
    }
    const VecQuadratic n =
        cross(minus(c.start[1], c.start[0]), minus(by[1], by[0]), minus(c.start[2], c.start[0]), minus(by[2], by[0]));
    Conditions conditions;
    const IntVec& a = c.start[0];
    conditions.plane = bernstein<3>(
        {dot(a, n[0]), dot(a, n[1]) + dot(by[0], n[0]), dot(a, n[2]) + dot(by[0], n[1]), dot(by[0], n[2])});
    for (std::size_t k = 0; k < 3; ++k) {
        const std::size_t next = (k + 1) % 3;
        const VecQuadratic e = cross(c.start[k], by[k], c.start[next], by[next]);
        std::array<Int, 5> power{};
        for (std::size_t i = 0; i < 3; ++i) {
            for (std::size_t j = 0; j < 3; ++j) {
                power[i + j] += dot(n[i], e[j]);
            }
        }
        conditions.edge[k] = bernstein<4>(power);
    }
    return conditions;
}

/// Whether the triangle passes through the origin; empty if 2^-20 of the step does not decide.
std::optional<bool> deformation_passes(const Conditions& c, int levels) {
    if (all(c.plane, 1) || all(c.plane, -1)) {
        return false;
    }
    bool inside = true;
    for (const Bernstein<4>& edge : c.edge) {
        if (all(edge, -1)) {
            return false;
        }
        inside = inside && all(edge, 1);
    }
    if (inside && sign(c.plane.front()) * sign(c.plane.back()) <= 0) {
        return true;
    }
    if (levels == 0) {
        return std::nullopt;
    }
    const auto plane = halves<3>(c.plane);
    const auto first = halves<4>(c.edge[0]);
    const auto second = halves<4>(c.edge[1]);
    const auto third = halves<4>(c.edge[2]);
    bool undecided = false;
    for (std::size_t half = 0; half < 2; ++half) {
        const auto passes = deformation_passes({plane[half], {first[half], second[half], third[half]}}, levels - 1);
        if (passes.value_or(false)) {
            return true;
        }
        undecided = undecided || !passes.has_value();
    }
    return undecided ? std::nullopt : std::optional(false);
}

struct Count {
    int cases = 0;
    int passing = 0;
    int missed = 0;
    int invented = 0;
    int evaluations = 0;
    int max_evaluations = 0;

    void add(const Case& c, bool passes, double radius) {
        const TriangleTouch touch = sphere_triangle_ccd(Vec3(0.0), radius, moving(c));
        ++cases;
        passing += passes ? 1 : 0;
        missed += passes && !touch.touches ? 1 : 0;
        invented += !passes && touch.touches ? 1 : 0;
        evaluations += touch.iterations;
        max_evaluations = std::max(max_evaluations, touch.iterations);
        const bool point = haptic::sim::point_passage(Vec3(0.0), moving(c)).passes;
        missed += passes && !point ? 1 : 0;
        invented += !passes && point ? 1 : 0;
    }
    void expect_exact() const {
        testing::Test::RecordProperty("cases", cases);
        testing::Test::RecordProperty("passing", passing);
        testing::Test::RecordProperty("mean_evaluations", std::to_string(evaluations / static_cast<double>(cases)));
        testing::Test::RecordProperty("most_evaluations", max_evaluations);
        EXPECT_EQ(missed, 0) << "of " << passing << " passages";
        EXPECT_EQ(invented, 0) << "of " << cases - passing;
        EXPECT_GT(passing, cases / 50);
        EXPECT_LT(passing, cases / 2);
        EXPECT_LT(max_evaluations, 200) << "bounded work";
    }
};

constexpr double kVanishing = 1e-9;  // of the coordinates' unit: below every non-zero distance here

TEST(ExactPassage, OfTranslationsOnASmallGridThatMeetBordersAndCornersAllTheTimeIsFoundAndNoOther) {
    Random random(51);
    Count count;
    int sliding = 0;
    while (count.cases < 40000) {
        Case c;
        const IntVec d = draw(random, 6);
        for (std::size_t k = 0; k < 3; ++k) {
            c.start[k] = draw(random, 4);
            for (std::size_t i = 0; i < 3; ++i) {
                c.end[k][i] = c.start[k][i] + d[i];
            }
        }
        const IntVec n = normal_of(c.start);
        if (is_zero(n)) {
            continue;
        }
        const bool passes = translation_passes(c);
        sliding += passes && dot(n, d) == 0 ? 1 : 0;
        count.add(c, passes, kVanishing);
    }
    EXPECT_GT(sliding, 20) << "in their own plane, where a cubic says nothing";
    count.expect_exact();
}

TEST(ExactPassage, OfDeformationsIsFoundAndNoOther) {
    Random random(52);
    Count count;
    int undecided = 0;
    for (int k = 0; k < 30000; ++k) {
        Case c;
        for (std::size_t i = 0; i < 3; ++i) {
            c.start[i] = draw(random, 100);
            c.end[i] = draw(random, 100);
        }
        const std::optional<bool> passes = deformation_passes(conditions_of(c), 20);
        if (!passes) {
            ++undecided;
            continue;
        }
        count.add(c, *passes, kVanishing);
    }
    EXPECT_LT(undecided, 30);
    count.expect_exact();
}

TEST(ExactPassage, TellsWhatItIsToTell) {
    // Test of the oracle itself: one known answer of each kind.
    const Case falling{{IntVec{-4, 5, -4}, {4, 5, -4}, {0, 5, 6}}, {IntVec{-4, -5, -4}, {4, -5, -4}, {0, -5, 6}}};
    EXPECT_TRUE(translation_passes(falling));
    EXPECT_EQ(deformation_passes(conditions_of(falling), 20), std::optional(true));
    Case beside = falling;
    for (IntCorners* corners : {&beside.start, &beside.end}) {
        for (IntVec& x : *corners) {
            x[0] += 9;
        }
    }
    EXPECT_FALSE(translation_passes(beside));
    EXPECT_EQ(deformation_passes(conditions_of(beside), 20), std::optional(false));
    const Case corner_first{{IntVec{1, 0, 0}, {3, 0, 1}, {3, 0, -1}}, {IntVec{0, 0, 0}, {2, 0, 1}, {2, 0, -1}}};
    EXPECT_TRUE(translation_passes(corner_first)) << "a corner arrives exactly at the end, in the triangle's plane";
    const Case short_of{{IntVec{2, 0, 0}, {4, 0, 1}, {4, 0, -1}}, {IntVec{1, 0, 0}, {3, 0, 1}, {3, 0, -1}}};
    EXPECT_FALSE(translation_passes(short_of));
    const Case turning{{IntVec{-9, 1, -1}, {9, 1, -1}, {0, 1, 9}}, {IntVec{-9, -1, -1}, {9, 1, -1}, {0, -1, 9}}};
    EXPECT_EQ(deformation_passes(conditions_of(turning), 20), std::optional(true));
}

}  // namespace
