#include "haptic/anderson_acceleration.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cstddef>
#include <span>

#include "contact_tools.hpp"

namespace haptic {
namespace {

using contact_tools::Random;

constexpr Eigen::Index kSize = 30;

std::span<double> elements(Eigen::VectorXd& vector) {
    return {vector.data(), static_cast<std::size_t>(vector.size())};
}

/// g(x) = x + (b - W x), whose fixed point solves W x = b. W is the identity but for a few slow directions.
struct Iteration {
    Eigen::MatrixXd w = Eigen::MatrixXd::Identity(kSize, kSize);
    Eigen::VectorXd b = Eigen::VectorXd::Ones(kSize);
    Eigen::VectorXd x = Eigen::VectorXd::Zero(kSize);
    Eigen::VectorXd deficit = b;  // b - W x, the image that follows x
    AndersonAcceleration acceleration{kSize};

    Iteration(int slow_directions, Random& random) {
        Eigen::MatrixXd directions(kSize, slow_directions);
        for (double& element : directions.reshaped()) {
            element = random.normal();
        }
        const Eigen::MatrixXd orthonormal = Eigen::HouseholderQR<Eigen::MatrixXd>(directions).householderQ() *
                                            Eigen::MatrixXd::Identity(kSize, slow_directions);
        for (int i = 0; i < slow_directions; ++i) {
            w -= (0.99 - 0.01 * i) * orthonormal.col(i) * orthonormal.col(i).transpose();
        }
    }
    void apply(bool accelerate) {
        Eigen::VectorXd change = deficit;
        x += change;
        deficit = b - w * x;
        if (accelerate) {
            acceleration.extrapolate(elements(change), elements(x), elements(deficit));
        }
    }
    [[nodiscard]] double error() const { return (b - w * x).norm() / b.norm(); }
};

TEST(AndersonAcceleration, FindsTheFixedPointInAboutAsManyIterationsAsThereAreSlowDirections) {
    Random random(1);
    Iteration accelerated(4, random);
    Iteration plain = accelerated;
    for (int i = 0; i < 8; ++i) {
        accelerated.apply(true);
        plain.apply(false);
    }
    EXPECT_LE(accelerated.error(), 1e-8);
    EXPECT_GE(plain.error(), 0.1);
}

TEST(AndersonAcceleration, KeepsTheImageOfWhatItExtrapolates) {
    Random random(2);
    Iteration iteration(12, random);
    for (int i = 0; i < 15; ++i) {
        iteration.apply(true);
        EXPECT_LE((iteration.deficit - (iteration.b - iteration.w * iteration.x)).norm(), 1e-10 * iteration.x.norm());
    }
}

TEST(AndersonAcceleration, ForgetsAtRestartAndUndoesTheLastExtrapolation) {
    Random random(3);
    Iteration iteration(4, random);
    iteration.apply(true);
    iteration.apply(true);
    // After a restart there is nothing to extrapolate from.
    iteration.acceleration.restart();
    Iteration plain = iteration;
    iteration.apply(true);
    plain.apply(false);
    EXPECT_EQ(iteration.x, plain.x);
    // undo() restores what extrapolate() was given.
    plain = iteration;
    iteration.apply(true);
    plain.apply(false);
    EXPECT_NE(iteration.x, plain.x);
    iteration.acceleration.undo(elements(iteration.x), elements(iteration.deficit));
    EXPECT_EQ(iteration.x, plain.x);
    EXPECT_EQ(iteration.deficit, plain.deficit);
}

TEST(AndersonAcceleration, StaysFiniteAtTheFixedPoint) {
    Random random(4);
    Iteration iteration(2, random);
    for (int i = 0; i < 200; ++i) {
        iteration.apply(true);
        ASSERT_TRUE(iteration.x.allFinite());
    }
    EXPECT_LE(iteration.error(), 1e-12);
}

}  // namespace
}  // namespace haptic
