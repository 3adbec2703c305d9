// Points that move from a reference in all sorts of ways, and what is known of their distances.
#include "collision/deformation.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <numeric>
#include <random>
#include <span>
#include <utility>
#include <vector>

#include "haptic/types.hpp"
#include "simd/kernels.hpp"

namespace haptic::sim {
namespace {

constexpr double kSize = 0.02;      // m, of what the points are in
constexpr double kRounding = 1e-7;  // m, of floats of this size
const Vec3 kMiddle(0.05, -0.03, 0.02);

std::vector<FloatRow> rows_of(std::span<const Vec3> points) {
    std::vector<FloatRow> rows;
    for (const Vec3& x : points) {
        rows.push_back({{static_cast<float>(x.x), static_cast<float>(x.y), static_cast<float>(x.z), 0.0F}});
    }
    return rows;
}

/// Points in a box, m, off the origin.
std::vector<Vec3> points_in(const Vec3& size, std::uint32_t seed, std::size_t count = 40) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> uniform(-0.5, 0.5);
    std::vector<Vec3> points;
    for (std::size_t k = 0; k < count; ++k) {
        points.push_back(kMiddle + size * Vec3{uniform(random), uniform(random), uniform(random)});
    }
    return points;
}

/// Turned about an oblique axis, rad, stretched along x, and bent by this part of the square of x.
std::vector<Vec3> moved(std::vector<Vec3> points, double turn, double stretch, double bend) {
    const Quat rotation = glm::angleAxis(turn, glm::normalize(Vec3(1.0, 2.0, -0.5)));
    for (Vec3& x : points) {
        const Vec3 off = x - kMiddle;
        x = rotation * Vec3(stretch * off.x, off.y + bend * off.x * off.x / kSize, off.z) + Vec3(0.04, 0.0, -0.02);
    }
    return points;
}

/// Some points over steps. The map is fitted to the first `fitted` ones.
class Follower {
  public:
    explicit Follower(const std::vector<Vec3>& points, std::size_t lanes = kWidestLanes, std::size_t fitted = kAll)
        : kernels_(*find_kernels(&Kernels::deformation, lanes)), at_(rows_of(points)) {
        std::vector<std::uint32_t> all(points.size());
        std::iota(all.begin(), all.end(), 0U);
        residuals_.make_room(points.size());
        deformation_.refer_to(all, kFirst, std::min(fitted, all.size()), at_.data());
    }
    void measure(const std::vector<float>& distances, float limit) { deformation_.measure(distances, limit); }
    /// The least stretch.
    float step(const std::vector<Vec3>& to) {
        const std::vector<FloatRow> end = rows_of(to);
        const float stretch = deformation_.follow(kernels_, at_.data(), end.data(), residuals_);
        deformation_.advance();
        at_ = end;
        return stretch;
    }
    void skip(const std::vector<Vec3>& to) {
        deformation_.lose_track();
        at_ = rows_of(to);
    }
    [[nodiscard]] double residual(std::size_t point) const { return residuals_.of_point[point]; }
    [[nodiscard]] const ResidualExtremes& most() const { return residuals_.most; }
    [[nodiscard]] double most_of_all() const { return *std::ranges::max_element(residuals_.of_point); }
    [[nodiscard]] double rounding() const { return deformation_.rounding() + kRounding; }

    static constexpr std::size_t kFirst = 5;
    static constexpr std::size_t kAll = 1000;

  private:
    const DeformationKernels& kernels_;
    Deformation deformation_;
    Deformation::Residuals residuals_;
    std::vector<FloatRow> at_;
};

struct Bodies {
    const char* name;
    Vec3 size;
};

class FollowedPoints : public ::testing::TestWithParam<Bodies> {};

TEST_P(FollowedPoints, AreNeverNearerThanTheMapAndResidualsTell) {
    std::mt19937 random(7);
    std::uniform_real_distribution<double> uniform(-1.0, 1.0);
    int told = 0;
    for (std::uint32_t seed = 1; seed <= 20; ++seed) {
        const std::vector<Vec3> reference = points_in(GetParam().size, seed);
        Follower follower(reference, kWidestLanes, seed % 2 == 0 ? 20 : Follower::kAll);
        std::vector<Vec3> start = reference;
        for (int k = 0; k < 12; ++k) {
            std::vector<Vec3> end = moved(reference, 0.4 * (k + 1), 1.0 + 0.2 * uniform(random), 0.3 * uniform(random));
            for (Vec3& x : end) {
                x += 2e-4 * Vec3{uniform(random), uniform(random), uniform(random)};
            }
            const double stretch = follower.step(end);
            told += stretch > 0.5 ? 1 : 0;
            if (!(stretch > 0.0)) {
                start = end;
                continue;
            }
            for (std::size_t a = 0; a < reference.size(); ++a) {
                for (std::size_t b = 0; b < a; ++b) {
                    const double least = stretch * (glm::length(reference[a] - reference[b]) - follower.rounding()) -
                                         follower.residual(a) - follower.residual(b) - kRounding;
                    for (const double s : {0.0, 0.2, 0.5, 0.7, 1.0}) {
                        const Vec3 apart = (1.0 - s) * (start[a] - start[b]) + s * (end[a] - end[b]);
                        ASSERT_GE(glm::length(apart), least) << k << " " << a << " " << b << " " << s;
                    }
                }
            }
            start = end;
        }
    }
    EXPECT_GT(told, 60);
}

INSTANTIATE_TEST_SUITE_P(Shapes, FollowedPoints,
                         ::testing::Values(Bodies{"Block", Vec3(kSize)}, Bodies{"Plate", {kSize, kSize, 1e-4}},
                                           Bodies{"Plane", {kSize, 0.0, kSize}},
                                           Bodies{"Rod", {kSize, 0.1 * kSize, 0.1 * kSize}}),
                         [](const auto& of) { return of.param.name; });

TEST(Deformation, OfWhatTurnsAsAWholeLeavesNothing) {
    const std::vector<Vec3> reference = points_in(Vec3(kSize), 3);
    Follower follower(reference);
    for (int k = 1; k <= 100; ++k) {
        const double stretch = follower.step(moved(reference, 0.1 * k, 1.0, 0.0));
        ASSERT_GT(stretch, 0.99) << k;
        ASSERT_LT(follower.most_of_all(), follower.rounding()) << k;
    }
}

TEST(Deformation, ATurnBringsPointsNearerInTheMiddleOfTheirPaths) {
    const std::vector<Vec3> reference = points_in(Vec3(kSize), 3);
    for (const double turn : {0.1, 0.5, 1.0, 1.4}) {
        Follower follower(reference);
        const double stretch = follower.step(moved(reference, turn, 1.0, 0.0));
        // Exact across the axis; the norm of the change of a map is wider than that by the root of 2.
        EXPECT_LE(stretch, std::cos(0.5 * turn)) << turn;
        EXPECT_GT(stretch, std::sqrt(std::cos(turn)) - 1e-3) << turn;
    }
}

TEST(Deformation, LosesTrackAndFindsIt) {
    // As if it had followed: where points are is known.
    const std::vector<Vec3> reference = points_in(Vec3(kSize), 3);
    Follower always(reference);
    Follower sometimes(reference);
    for (int k = 1; k <= 9; ++k) {
        const std::vector<Vec3> to = moved(reference, 0.4 * k, 1.0, 0.02 * k);
        const float stretch = always.step(to);
        if (k % 3 != 0) {
            sometimes.skip(to);
            continue;
        }
        EXPECT_NEAR(sometimes.step(to), stretch, 1e-5) << k;
        EXPECT_NEAR(sometimes.most_of_all(), always.most_of_all(), kRounding) << k;
    }
}

TEST(Deformation, OfWhatIsStretchedAsAWholeLeavesNothing) {
    const std::vector<Vec3> reference = points_in(Vec3(kSize), 4);
    Follower follower(reference);
    EXPECT_GT(follower.step(moved(reference, 0.0, 0.9, 0.0)), 0.85);
    EXPECT_LT(follower.most_of_all(), 3e-4 * kSize);
    const float stretch = follower.step(moved(reference, 0.0, 0.8, 0.0));
    EXPECT_LE(stretch, 0.8F);
    EXPECT_GT(stretch, 0.7F);
}

TEST(Deformation, TellsNothingOfWhatHasShrunkToAPointOrTurnsAround) {
    const std::vector<Vec3> reference = points_in(Vec3(kSize), 5);
    Follower shrunk(reference);
    EXPECT_FALSE(shrunk.step(std::vector<Vec3>(reference.size(), Vec3(0.01))) > 0.0F);
    Follower turned(reference);
    EXPECT_FALSE(turned.step(moved(reference, 3.1, 1.0, 0.0)) > 0.0F);
    // Nor of points that all lie in one.
    Follower point(std::vector<Vec3>(20, Vec3(0.03)));
    EXPECT_FALSE(point.step(std::vector<Vec3>(20, Vec3(0.04))) > 0.0F);
}

TEST(Deformation, BendingLeavesMoreTheFartherPointsAreFromTheMiddle) {
    std::vector<Vec3> line;
    for (int k = 0; k < 48; ++k) {
        line.push_back(kMiddle + Vec3(kSize * (k - 23.5) / 47.0, (k % 2) * 1e-4, (k % 3) * 1e-4));
    }
    Follower follower(line);
    EXPECT_GT(follower.step(moved(line, 0.0, 1.0, 0.2)), 0.8);
    // Of a parabola the best line leaves a third of its height in the middle, and two thirds at the ends.
    const double height = 0.2 * 0.25 * kSize;
    EXPECT_NEAR(follower.residual(24), height / 3.0, 0.06 * height);
    EXPECT_NEAR(follower.residual(0), 2.0 * height / 3.0, 0.06 * height);
}

TEST(Deformation, BendingLeavesLittleOfPointsThatAloneAreFitted) {
    // The inner third of a line before the rest of it.
    std::vector<Vec3> line;
    for (const auto& [from, to] : {std::pair(16, 32), std::pair(0, 16), std::pair(32, 48)}) {
        for (int k = from; k < to; ++k) {
            line.push_back(kMiddle + Vec3(kSize * (k - 23.5) / 47.0, (k % 2) * 1e-4, (k % 3) * 1e-4));
        }
    }
    const std::vector<Vec3> bent = moved(line, 0.0, 1.0, 0.2);
    const double height = 0.2 * 0.25 * kSize;
    for (const std::size_t fitted : {std::size_t{16}, line.size()}) {
        Follower follower(line, kWidestLanes, fitted);
        EXPECT_GT(follower.step(bent), 0.8);
        double inner = 0.0;
        for (std::size_t k = 0; k < 16; ++k) {
            inner = std::max(inner, follower.residual(k));
        }
        // A third of the length leaves a ninth of the height; the ends, then, nearly all of it.
        const bool of_all = fitted == line.size();
        EXPECT_NEAR(inner, (of_all ? 1.0 / 3.0 : 2.0 / 27.0) * height, 0.06 * height) << fitted;
        EXPECT_NEAR(follower.residual(16), (of_all ? 2.0 / 3.0 : 26.0 / 27.0) * height, 0.06 * height) << fitted;
    }
}

TEST(Deformation, TellsTheExtremesOfResidualsAndWhatTheyLeave) {
    const std::vector<Vec3> reference = points_in(Vec3(kSize), 6);
    std::vector<float> distances;
    for (std::size_t k = 0; k < reference.size(); ++k) {
        distances.push_back(0.0005F * static_cast<float>(k % 16));
    }
    constexpr float kLimit = 0.003F;
    Follower follower(reference);
    follower.measure(distances, kLimit);
    const float stretch = follower.step(moved(reference, 0.3, 1.1, 0.2));
    double near = 0.0;
    double left = 1.0;
    for (std::size_t k = 0; k < reference.size(); ++k) {
        near = distances[k] <= kLimit ? std::max(near, follower.residual(k)) : near;
        left = std::min(left, stretch * distances[k] - follower.residual(k));
    }
    EXPECT_NEAR(follower.most().of_near, near, 1e-9);
    EXPECT_NEAR(follower.most().left, left, follower.rounding());
    EXPECT_LE(follower.most().left, left + kRounding);
    // The first ones are told apart with the rest of their group.
    double first = 0.0;
    for (std::size_t k = 0; k < kPointsInGroup; ++k) {
        first = std::max(first, follower.residual(k));
    }
    EXPECT_NEAR(follower.most().of_first, first, 1e-9);
}

TEST(Deformation, HasTheSameBitsWithAnyNumberOfLanes) {
    const std::vector<Vec3> reference = points_in(Vec3(kSize), 8, 93);
    const auto numbers = [&](std::size_t lanes) {
        Follower follower(reference, lanes, 50);
        std::vector<float> distances;
        for (std::size_t p = 0; p < reference.size(); ++p) {
            distances.push_back(0.0003F * static_cast<float>(p % 23));
        }
        follower.measure(distances, 0.003F);
        std::vector<double> all;
        for (int k = 1; k <= 5; ++k) {
            all.push_back(follower.step(moved(reference, 0.2 * k, 1.0 + 0.02 * k, 0.05 * k)));
            for (std::size_t p = 0; p < reference.size(); ++p) {
                all.push_back(follower.residual(p));
            }
            all.insert(all.end(), {follower.most().of_first, follower.most().of_near, follower.most().left});
        }
        return all;
    };
    const std::vector<double> expected = numbers(1);
    for (const std::size_t lanes : lanes_of(&Kernels::deformation)) {
        EXPECT_EQ(numbers(lanes), expected) << lanes;
    }
}

}  // namespace
}  // namespace haptic::sim
