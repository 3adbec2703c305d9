#include "haptic/series_springs.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <limits>
#include <random>
#include <vector>

namespace haptic {
namespace {

/// Particles around a grip, each with its own plane.
struct Tool {
    struct Particle {
        Vec3 offset;
        Vec3 normal;
        double plane;  // m, normal . x >= plane
    };
    std::vector<Particle> particles;

    [[nodiscard]] double rho() const {
        double squares = 0.0;
        for (const Particle& p : particles) {
            squares += glm::dot(p.offset, p.offset);
        }
        return gyration(squares, particles.size());
    }
    [[nodiscard]] std::vector<SpringRow> rows(const Pose& grip) const {
        std::vector<SpringRow> rows;
        for (const Particle& p : particles) {
            const Vec3 moment_arm = grip.orientation * p.offset;
            rows.push_back({moment_arm, p.normal, p.plane - glm::dot(p.normal, grip.position + moment_arm)});
        }
        return rows;
    }
};

class Random {
  public:
    explicit Random(std::uint64_t seed) : engine_(seed) {}
    double uniform(double least, double most) { return std::uniform_real_distribution<double>(least, most)(engine_); }
    Vec3 vector(double most) { return {uniform(-most, most), uniform(-most, most), uniform(-most, most)}; }
    Tool tool(int particles) {
        Tool tool;
        for (int i = 0; i < particles; ++i) {
            tool.particles.push_back({vector(0.05), glm::normalize(vector(1.0)), uniform(-0.05, 0.02)});
        }
        return tool;
    }

  private:
    std::mt19937_64 engine_;
};

/// A square plate of n x n particles, 60 mm wide, over the floor y = 0.
Tool plate(int n) {
    Tool tool;
    for (int i = 0; i < n * n; ++i) {
        const auto at = [n](int k) { return 0.06 * (k / (n - 1.0) - 0.5); };
        tool.particles.push_back({{at(i % n), 0.0, at(i / n)}, {0.0, 1.0, 0.0}, 0.0});
    }
    return tool;
}

Wrench wrench_at(const Tool& tool, const Pose& grip, double stiffness, double torque_stiffness,
                 double* stored = nullptr) {
    SeriesSprings springs;
    auto rows = tool.rows(grip);
    const Wrench wrench = springs.solve(rows, {stiffness, torque_stiffness, tool.rho()});
    if (stored != nullptr) {
        *stored = springs.stored_energy();
    }
    return wrench;
}

TEST(SeriesSprings, AreExactlySilentWhereNothingIsPressed) {
    SeriesSprings springs;
    Tool tool = plate(6);
    for (Tool::Particle& p : tool.particles) {
        p.plane = -1e-300;
    }
    auto rows = tool.rows({});
    const Wrench wrench = springs.solve(rows, {500.0, 500.0, tool.rho()});
    EXPECT_EQ(wrench.force, Vec3(0.0));
    EXPECT_EQ(wrench.torque, Vec3(0.0));
    EXPECT_EQ(springs.stored_energy(), 0.0);
    for (const SpringRow& row : rows) {
        EXPECT_EQ(row.push, 0.0);
    }
}

TEST(SeriesSprings, OfManyAtOneDepthComeNearToTheGripsOwnAndNeverExceedIt) {
    constexpr double k = 200.0;
    const Pose pressed{{0.0, -0.003, 0.0}, Quat(1.0, 0.0, 0.0, 0.0)};
    const Tool point{{{Vec3(0.0), {0.0, 1.0, 0.0}, 0.0}}};
    EXPECT_NEAR(wrench_at(point, pressed, k, k).force.y, k * 0.003 / 2.0, 1e-12);
    for (const int n : {2, 6, 8}) {
        const double m = n * n;
        const Wrench wrench = wrench_at(plate(n), pressed, k, k);
        EXPECT_NEAR(wrench.force.y, k * 0.003 * m / (1.0 + m), 1e-12);
        EXPECT_NEAR(glm::length(wrench.torque), 0.0, 1e-12);
    }
}

TEST(SeriesSprings, HardlyFeelHowFinelyATiltedToolIsSampled) {
    const Pose tilted{{0.0, -0.003, 0.0}, glm::angleAxis(0.2, Vec3(0.0, 0.0, 1.0))};
    const Wrench coarse = wrench_at(plate(4), tilted, 200.0, 200.0);
    const Wrench fine = wrench_at(plate(8), tilted, 200.0, 200.0);
    EXPECT_NEAR(fine.force.y / coarse.force.y, 1.0, 0.15);
    EXPECT_NEAR(fine.torque.z / coarse.torque.z, 1.0, 0.15);
}

TEST(SeriesSprings, FulfilTheConditionOfTheMinimum) {
    // The function is convex, so its unique minimum satisfies push = k [s - n (u + phi x r)]+, where k u and k_t rho^2
    // phi are the sums of the pushes and of their moments.
    Random random(1);
    int max_rounds = 0;
    SeriesSprings springs;
    for (int trial = 0; trial < 3000; ++trial) {
        const Tool tool = random.tool(1 + trial % static_cast<int>(kMaxSpringRows));
        auto rows = tool.rows({random.vector(0.02), glm::normalize(Quat(1.0, random.vector(0.5)))});
        const double k = random.uniform(1.0, 600.0);
        const double k_t = random.uniform(0.1, 600.0);
        (void)springs.solve(rows, {k, k_t, tool.rho()});
        max_rounds = std::max(max_rounds, springs.rounds());
        Vec3 force(0.0);
        Vec3 moment(0.0);
        for (const SpringRow& row : rows) {
            force += row.push * row.normal;
            moment += glm::cross(row.moment_arm, row.push * row.normal);
        }
        const Vec3 u = force / k;
        const Vec3 phi = moment / (k_t * tool.rho() * tool.rho());
        for (const SpringRow& row : rows) {
            const double remaining = row.depth - glm::dot(row.normal, u + glm::cross(phi, row.moment_arm));
            ASSERT_NEAR(row.push, k * std::max(remaining, 0.0), 1e-9 * k) << trial;
        }
    }
    EXPECT_LT(max_rounds, SeriesSprings::kMaxRounds);
    RecordProperty("most_rounds", max_rounds);
}

TEST(SeriesSprings, AreTheGradientOfWhatTheyHold) {
    Random random(2);
    for (int trial = 0; trial < 200; ++trial) {
        const Tool tool = random.tool(37);
        const Pose grip{random.vector(0.02), glm::normalize(Quat(1.0, random.vector(0.3)))};
        const Vec3 move = random.vector(1.0);
        const Vec3 turn = random.vector(10.0);
        const Wrench wrench = wrench_at(tool, grip, 300.0, 150.0);
        constexpr double h = 1e-7;
        double ends[2];
        for (const int side : {0, 1}) {
            const double part = side == 0 ? -h : h;
            const Pose there{grip.position + part * move,
                             glm::angleAxis(part * glm::length(turn), glm::normalize(turn)) * grip.orientation};
            (void)wrench_at(tool, there, 300.0, 150.0, &ends[side]);
        }
        const double slope = (ends[1] - ends[0]) / (2.0 * h);
        const double power = glm::dot(wrench.force, move) + glm::dot(wrench.torque, turn);
        ASSERT_NEAR(slope, -power, 1e-6 * (std::abs(power) + glm::length(wrench.force))) << trial;
    }
}

TEST(SeriesSprings, AreNeverStifferThanTheGripsOwn) {
    Random random(3);
    for (int trial = 0; trial < 500; ++trial) {
        const Tool tool = random.tool(37);
        const Pose grip{random.vector(0.02), glm::normalize(Quat(1.0, random.vector(0.3)))};
        const Vec3 move = random.vector(0.01);
        const Vec3 change = wrench_at(tool, {grip.position + move, grip.orientation}, 300.0, 300.0).force -
                            wrench_at(tool, grip, 300.0, 300.0).force;
        ASSERT_LE(glm::length(change), 300.0 * glm::length(move) * (1.0 + 1e-9));
    }
}

TEST(SeriesSprings, EndWhereverTheyBegin) {
    Random random(4);
    SeriesSprings warm;
    for (int trial = 0; trial < 300; ++trial) {
        const Tool tool = random.tool(64);
        auto rows = tool.rows({random.vector(0.02), glm::normalize(Quat(1.0, random.vector(0.3)))});
        const Wrench from_last = warm.solve(rows, {300.0, 300.0, tool.rho()});
        SeriesSprings cold;
        const Wrench from_none = cold.solve(rows, {300.0, 300.0, tool.rho()});
        ASSERT_NEAR(glm::length(from_last.force - from_none.force), 0.0, 1e-9);
        ASSERT_NEAR(glm::length(from_last.torque - from_none.torque), 0.0, 1e-9);
    }
}

TEST(SeriesSprings, RecoverFromWhateverComes) {
    Random random(5);
    const double wild[] = {0.0, 1e-300, 1e-9, 1.0, 1e9, 1e150, -1e150};
    SeriesSprings springs;
    for (int trial = 0; trial < 2000; ++trial) {
        std::vector<SpringRow> rows(static_cast<std::size_t>(trial) % (kMaxSpringRows + 20));
        const auto pick = [&] { return wild[static_cast<std::size_t>(random.uniform(0.0, 6.999))]; };
        for (SpringRow& row : rows) {
            row = {{pick(), 0.0, pick()}, glm::normalize(random.vector(1.0)), pick() * 1e-3};
        }
        (void)springs.solve(rows, {std::abs(pick()), std::abs(pick()), std::abs(pick())});
        EXPECT_LE(springs.rounds(), SeriesSprings::kMaxRounds);
    }
    // After any input, valid rows give the same result as with a new solver.
    auto rows = plate(6).rows({{0.0, -0.003, 0.0}, Quat(1.0, 0.0, 0.0, 0.0)});
    EXPECT_NEAR(springs.solve(rows, {200.0, 200.0, 0.03}).force.y, 200.0 * 0.003 * 36.0 / 37.0, 1e-9);
}

}  // namespace
}  // namespace haptic
