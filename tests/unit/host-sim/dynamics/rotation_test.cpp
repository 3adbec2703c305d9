#include "dynamics/rotation.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/matrix.hpp>
#include <random>

namespace haptic::sim {
namespace {

double size(const Mat3& m) {
    return std::sqrt(glm::dot(m[0], m[0]) + glm::dot(m[1], m[1]) + glm::dot(m[2], m[2]));
}

void expect_proper(const Quat& q) {
    const Mat3 r = to_matrix(q);
    EXPECT_NEAR(glm::determinant(r), 1.0, 1e-12);
    EXPECT_NEAR(size(r * glm::transpose(r) - Mat3(1.0)), 0.0, 1e-12);
}

class RotationTest : public ::testing::Test {
  protected:
    double uniform() { return std::uniform_real_distribution<double>(-1.0, 1.0)(random_); }
    Vec3 vector() { return {uniform(), uniform(), uniform()}; }
    Quat rotation() { return glm::normalize(Quat(uniform(), uniform(), uniform(), uniform())); }

    std::mt19937 random_{7};
};

TEST_F(RotationTest, MatrixRotatesVectorsLikeTheQuaternion) {
    for (int i = 0; i < 100; ++i) {
        const Quat q = rotation();
        const Vec3 v = vector();
        EXPECT_NEAR(glm::length(to_matrix(q) * v - q * v), 0.0, 1e-14);
    }
}

TEST_F(RotationTest, TurnBetweenInvertsTurned) {
    for (int i = 0; i < 100; ++i) {
        const Quat q = rotation();
        const Vec3 turn = 3.0 * vector();
        EXPECT_NEAR(glm::length(rotation_between(q, turned(q, turn)) - turn), 0.0, 1e-13);
        // q and -q are the same orientation.
        EXPECT_NEAR(glm::length(rotation_between(q, -turned(q, turn)) - turn), 0.0, 1e-13);
    }
}

TEST_F(RotationTest, TurnedMatchesTheExponentialToThirdOrder) {
    const Vec3 turn(0.0, 0.02, 0.0);
    const Quat exact = glm::angleAxis(0.02, Vec3(0.0, 1.0, 0.0));
    const Quat q = turned(Quat(1.0, 0.0, 0.0, 0.0), turn);
    EXPECT_LT(std::abs(glm::dot(q, exact) - 1.0), 1e-12);
    EXPECT_TRUE(std::isfinite(rotation_between(Quat(1, 0, 0, 0), Quat(0, 1, 0, 0)).x));  // half a turn
}

TEST_F(RotationTest, FindsTheRotationOfAStretchedMatrix) {
    for (int i = 0; i < 100; ++i) {
        const Quat truth = rotation();
        const Mat3 half = Mat3(vector(), vector(), vector());
        const Mat3 stretch = half * glm::transpose(half) + Mat3(0.3);  // symmetric, positive definite
        const Quat guess = turned(truth, 0.5 * glm::normalize(vector()));
        const Quat found = extract_rotation(to_matrix(truth) * stretch, guess, 200);
        EXPECT_NEAR(std::abs(glm::dot(found, truth)), 1.0, 1e-12);
    }
}

TEST_F(RotationTest, DoesNotDependOnUnits) {
    const Mat3 a(vector(), vector(), vector());
    const Quat guess = rotation();
    const Quat in_metres = extract_rotation(a, guess, 5);
    const Quat in_nanometres = extract_rotation(a * 1e-18, guess, 5);
    EXPECT_NEAR(std::abs(glm::dot(in_metres, in_nanometres)), 1.0, 1e-12);
}

TEST_F(RotationTest, IsProperAndFiniteForSingularAndInvertedMatrices) {
    for (int i = 0; i < 100; ++i) {
        const Vec3 u = vector();
        const Vec3 v = vector();
        const Mat3 inverted = to_matrix(rotation()) * Mat3(1, 0, 0, 0, 1, 0, 0, 0, -1);
        const Mat3 flat = glm::outerProduct(u, v) + glm::outerProduct(vector(), vector());
        const Mat3 line = glm::outerProduct(u, v);
        for (const Mat3& a : {inverted, flat, line, Mat3(0.0), Mat3(-1.0)}) {
            expect_proper(extract_rotation(a, rotation(), 20));
        }
    }
}

TEST_F(RotationTest, FindsTheRotationOfAFlatMatrix) {
    // Two directions determine the third.
    for (int i = 0; i < 100; ++i) {
        const Quat truth = rotation();
        const Vec3 u = vector();
        const Vec3 v = glm::cross(u, vector());
        const Mat3 flat = glm::outerProduct(u, u) + glm::outerProduct(v, v) / glm::dot(v, v);
        const Quat guess = turned(truth, 0.5 * glm::normalize(vector()));
        const Quat found = extract_rotation(to_matrix(truth) * flat, guess, 2000);
        EXPECT_NEAR(std::abs(glm::dot(found, truth)), 1.0, 1e-9) << i;
    }
}

TEST_F(RotationTest, FlipsAnInvertedMatrixAlongItsWeakestDirectionFromAnyGuess) {
    // For A = R diag(a, b, -c) with a > b > c, the rotation that maximises tr(R^T A) is R.
    for (int i = 0; i < 100; ++i) {
        const Quat truth = rotation();
        const Mat3 basis = to_matrix(rotation());
        const Mat3 stretch = basis * Mat3(3, 0, 0, 0, 2, 0, 0, 0, -1) * glm::transpose(basis);
        const Quat found = extract_rotation(to_matrix(truth) * stretch, rotation(), 500);
        EXPECT_NEAR(std::abs(glm::dot(found, truth)), 1.0, 1e-9) << i;
    }
}

TEST_F(RotationTest, KeepsTheGuessWhereTheMatrixIsUndetermined) {
    const Quat guess = rotation();
    const Quat of_nothing = extract_rotation(Mat3(0.0), guess, 5);
    EXPECT_EQ(of_nothing.w, guess.w);
    EXPECT_EQ(of_nothing.x, guess.x);
    // Collinear points along x, not rotated: every rotation about x fits, so the guess does.
    const Quat about_line = glm::angleAxis(0.7, Vec3(1.0, 0.0, 0.0));
    const Quat found = extract_rotation(Mat3(1, 0, 0, 0, 0, 0, 0, 0, 0), about_line, 50);
    EXPECT_NEAR(std::abs(glm::dot(found, about_line)), 1.0, 1e-12);
}

TEST_F(RotationTest, InertiaSolutionHasTheMomentum) {
    for (int i = 0; i < 100; ++i) {
        Mat3 scatter(0.0);
        const Vec3 rate = vector();
        Vec3 momentum(0.0);
        for (int k = 0; k < 5; ++k) {
            const Vec3 p = vector();
            scatter += glm::outerProduct(p, p);
            momentum += glm::cross(p, glm::cross(rate, p));
        }
        EXPECT_NEAR(glm::length(solve_inertia(scatter, momentum) - rate), 0.0, 1e-11);
    }
}

TEST_F(RotationTest, InertiaSolutionOfCollinearPointsHasTheMomentumAndIsBounded) {
    for (int i = 0; i < 100; ++i) {
        const Vec3 line = glm::normalize(vector());
        Mat3 scatter(0.0);
        Vec3 momentum(0.0);
        for (int k = 0; k < 4; ++k) {
            const Vec3 p = uniform() * line;
            scatter += glm::outerProduct(p, p);
            momentum += glm::cross(p, vector());
        }
        const Vec3 x = solve_inertia(scatter, momentum);
        EXPECT_TRUE(std::isfinite(glm::length(x)));
        // Compare the points' velocities: the component of x along the line moves no point.
        const Vec3 across = x - glm::dot(x, line) * line;
        const double trace = scatter[0][0] + scatter[1][1] + scatter[2][2];
        EXPECT_NEAR(glm::length(trace * across - momentum), 0.0, 1e-9);
    }
    EXPECT_EQ(solve_inertia(Mat3(0.0), Vec3(1.0)), Vec3(0.0));
}

}  // namespace
}  // namespace haptic::sim
