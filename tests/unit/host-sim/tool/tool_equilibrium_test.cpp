// Equilibrium of a tool among planes, against solutions found in other ways.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <optional>
#include <random>
#include <vector>

#include "few_spheres.hpp"
#include "haptic/sim/scene.hpp"
#include "haptic/sim/simulation.hpp"
#include "tool/tool_proxies.hpp"

namespace haptic::sim {
namespace {

constexpr double kSphereRadius = 0.02;  // m
constexpr double kStiffness = 50.0;     // N/m

/// A floor y = 0 and a wall x = kWall, seen from x < kWall.
struct Corner {
    static constexpr double kWall = 0.12;
    std::vector<Vec3> vertices{{-2, 0, -2},     {-2, 0, 2},     {2, 0, 2},     {2, 0, -2},
                               {kWall, -2, -2}, {kWall, -2, 2}, {kWall, 2, 2}, {kWall, 2, -2}};
    std::vector<Triangle> triangles{{0, 1, 2}, {0, 2, 3}, {4, 5, 6}, {4, 6, 7}};
    SweptTree tree{vertices, triangles};
    Corner() { tree.refit({vertices, vertices, triangles}); }
    [[nodiscard]] MovingSurface surface() const { return {{vertices, vertices, triangles}, &tree}; }
};

/// Half-spaces of the corner for the centre of a sphere: n . x >= offset.
constexpr std::array<HalfSpace, 2> kPlanes{{{{0, 1, 0}, kSphereRadius}, {{-1, 0, 0}, kSphereRadius - Corner::kWall}}};

ToolProxies::Settings spring_settings(double torque_stiffness, double friction = 0.0) {
    ToolProxies::Settings all;
    all.reach = 0.01;
    all.contact.static_friction = all.contact.dynamic_friction = friction;
    all.springs = {kStiffness, torque_stiffness};
    return all;
}

void step(ToolProxies& tool, const Corner& corner, const Pose& hip) {
    const std::array<MovingSurface, 1> surfaces{corner.surface()};
    tool.set_goals(hip);
    tool.collect(surfaces);
    EXPECT_TRUE(tool.find_secure_positions());
    tool.pop_out();
    tool.find_equilibrium();
}

/// N: sum over the spheres.
Vec3 force_of(const ToolProxies& tool) {
    Vec3 sum(0.0);
    for (std::size_t i = 0; i < tool.particles().size(); ++i) {
        sum += tool.force_on(i);
    }
    return sum;
}

Eigen::Vector3d eigen(const Vec3& v) {
    return {v.x, v.y, v.z};
}

/// Minimises the energy of the springs over the poses of a rigid tool: Newton's method over the six motions q, each
/// step by trying every set of at most five active planes. Returns force, and torque about the hip.
class RigidOracle {
  public:
    RigidOracle(const ToolProxies& tool, double torque_stiffness)
        : hip_(tool.hip().position), torque_stiffness_(torque_stiffness) {
        for (const ToolProxy& p : tool.particles()) {
            goal_.push_back(p.goal);
        }
        position_ = goal_;
    }

    Wrench solve() {
        for (int k = 0; k < 30; ++k) {
            linearise();
            if (!try_set(best_set_)) {
                for (std::uint32_t set = 0; set < 1u << (2 * goal_.size()); ++set) {
                    if (std::popcount(set) <= 5 && try_set(set)) {
                        break;
                    }
                }
            }
            // Move by q: a rotation about the hip, then a translation.
            const Vec3 turn(q_[3], q_[4], q_[5]);
            const double angle = glm::length(turn);
            const Quat rotation = angle > 0.0 ? glm::angleAxis(angle, turn / angle) : Quat(1, 0, 0, 0);
            for (Vec3& x : position_) {
                x = hip_ + rotation * (x - hip_) + Vec3(q_[0], q_[1], q_[2]);
            }
        }
        Wrench sum;
        for (std::size_t r = 0; r < rows_.size(); ++r) {
            const Vec3 force = push_[static_cast<Eigen::Index>(r)] * kPlanes[rows_[r] % 2].normal;
            sum.force += force;
            sum.torque += glm::cross(position_[rows_[r] / 2] - hip_, force);
        }
        return sum;
    }

  private:
    using Vector6 = Eigen::Matrix<double, 6, 1>;
    using Matrix6 = Eigen::Matrix<double, 6, 6>;

    /// Energy 1/2 q^T H q + c^T q about the present positions.
    void linearise() {
        const double count = static_cast<double>(goal_.size());
        motion_.resize(goal_.size());
        Eigen::Matrix<double, 3, 6> mean = Eigen::Matrix<double, 3, 6>::Zero();
        Eigen::Vector3d pull = Eigen::Vector3d::Zero();
        Matrix6 h = Matrix6::Zero();
        gradient_.setZero();
        for (std::size_t i = 0; i < goal_.size(); ++i) {
            const Vec3 r = position_[i] - hip_;
            motion_[i] << 1, 0, 0, 0, r.z, -r.y, 0, 1, 0, -r.z, 0, r.x, 0, 0, 1, r.y, -r.x, 0;
            h += torque_stiffness_ / count * motion_[i].transpose() * motion_[i];
            gradient_ += torque_stiffness_ / count * motion_[i].transpose() * eigen(position_[i] - goal_[i]);
            mean += motion_[i] / count;
            pull += eigen(position_[i] - goal_[i]) / count;
        }
        h += (kStiffness - torque_stiffness_) * mean.transpose() * mean;
        gradient_ += (kStiffness - torque_stiffness_) * mean.transpose() * pull;
        inverse_.compute(h);
    }

    /// Takes the solution with these active rows (two per sphere) if it is that of all rows.
    bool try_set(std::uint32_t set) {
        rows_.clear();
        for (std::size_t r = 0; r < 2 * goal_.size(); ++r) {
            if ((set >> r & 1u) != 0) {
                rows_.push_back(r);
            }
        }
        const auto size = static_cast<Eigen::Index>(rows_.size());
        Eigen::MatrixXd a(size, 6);
        Eigen::VectorXd b(size);
        for (Eigen::Index k = 0; k < size; ++k) {
            const std::size_t row = rows_[static_cast<std::size_t>(k)];
            a.row(k) = eigen(kPlanes[row % 2].normal).transpose() * motion_[row / 2];
            b[k] = depth(row);
        }
        push_ = Eigen::VectorXd::Zero(size);
        if (size > 0) {
            const Eigen::FullPivLU<Eigen::MatrixXd> w(a * inverse_.solve(a.transpose()));
            if (!w.isInvertible()) {
                return false;
            }
            push_ = w.solve(b + a * inverse_.solve(gradient_));
        }
        q_ = inverse_.solve(a.transpose() * push_ - gradient_);
        bool optimal = size == 0 || push_.minCoeff() >= 0.0;
        for (std::size_t r = 0; r < 2 * goal_.size(); ++r) {
            optimal = optimal && eigen(kPlanes[r % 2].normal).dot(motion_[r / 2] * q_) >= depth(r) - 1e-12;
        }
        best_set_ = set;
        return optimal;
    }

    [[nodiscard]] double depth(std::size_t row) const {
        return kPlanes[row % 2].offset - glm::dot(kPlanes[row % 2].normal, position_[row / 2]);
    }

    Vec3 hip_;
    double torque_stiffness_;
    std::vector<Vec3> goal_;
    std::vector<Vec3> position_;
    std::vector<Eigen::Matrix<double, 3, 6>> motion_;
    Vector6 gradient_;
    Eigen::LDLT<Matrix6> inverse_;
    std::uint32_t best_set_ = 0;
    std::vector<std::size_t> rows_;
    Eigen::VectorXd push_;
    Vector6 q_;
};

TEST(ToolEquilibrium, OfARigidToolMinimisesTheSpringsOverItsPoses) {
    const Corner corner;
    std::mt19937 random(1);
    std::uniform_real_distribution<double> uniform(-1.0, 1.0);
    int torques = 0;
    for (int trial = 0; trial < 12; ++trial) {
        const double torque_stiffness = trial % 2 == 0 ? kStiffness : 80.0;
        ToolProxies tool(test::square_of_spheres(3, 0.05, kSphereRadius, {.rigid = true}),
                         spring_settings(torque_stiffness), {{-0.1, 0.2, 0.0}, Quat(1, 0, 0, 0)});
        const Pose hip{{0.06 + 0.03 * uniform(random), 0.01 + 0.01 * uniform(random), 0.0},
                       glm::angleAxis(0.3 * uniform(random),
                                      glm::normalize(Vec3{uniform(random), uniform(random), uniform(random)}))};
        // A hand that stands still: a far jump takes a few steps.
        for (int k = 0; k < 4; ++k) {
            step(tool, corner, hip);
        }
        const Wrench expected = RigidOracle(tool, torque_stiffness).solve();
        Wrench actual;
        for (std::size_t i = 0; i < tool.particles().size(); ++i) {
            actual.force += tool.force_on(i);
            actual.torque += glm::cross(tool.particles()[i].position - hip.position, tool.force_on(i));
        }
        EXPECT_EQ(tool.effort().equilibrium_error, 0.0) << trial;
        EXPECT_LT(glm::length(actual.force - expected.force), 1e-6 * glm::length(expected.force)) << trial;
        EXPECT_LT(glm::length(actual.torque - expected.torque), 1e-6 * glm::length(expected.force) * 0.1) << trial;
        torques += glm::length(expected.torque) > 1e-3 ? 1 : 0;
    }
    EXPECT_GT(torques, 6);
}

TEST(ToolEquilibrium, OfALimpToolIsOneSpringPerSphere) {
    const Corner corner;
    ToolProxies tool(test::square_of_spheres(4, 0.05, kSphereRadius, {.young_modulus = 0.0}), spring_settings(0.0),
                     {{-0.1, 0.2, 0.0}, Quat(1, 0, 0, 0)});
    for (int k = 0; k < 20; ++k) {
        step(tool, corner, {{0.05, 0.05 - 0.003 * k, 0.0}, glm::angleAxis(0.02 * k, Vec3(0, 0, 1))});
        for (std::size_t i = 0; i < 16; ++i) {
            Vec3 expected(0.0);
            for (const HalfSpace& plane : kPlanes) {
                const double depth = plane.offset - glm::dot(plane.normal, tool.particles()[i].goal);
                expected += std::max(0.0, kStiffness / 16.0 * depth) * plane.normal;
            }
            EXPECT_LT(glm::length(tool.force_on(i) - expected), 1e-9) << k << ' ' << i;
        }
    }
}

TEST(ToolEquilibrium, BalancesPushesAndTouchesForAnyMaterial) {
    const Corner corner;
    for (const double young : {1e3, 1e5, 1e7}) {
        ToolProxies tool(test::square_of_spheres(4, 0.05, kSphereRadius, {.young_modulus = young}),
                         spring_settings(70.0), {{-0.1, 0.2, 0.0}, Quat(1, 0, 0, 0)});
        const Pose hip{{0.05, 0.01, 0.0}, glm::angleAxis(0.2, glm::normalize(Vec3(1, 2, 3)))};
        for (int k = 0; k < 4; ++k) {
            step(tool, corner, hip);
        }
        const std::size_t n = tool.particles().size();
        double largest = 0.0;
        for (std::size_t i = 0; i < n; ++i) {
            largest = std::max(largest, glm::length(tool.force_on(i)));
        }
        ASSERT_GT(largest, 0.01);
        // The material has no resultant: k times the mean displacement is the sum of the forces.
        Vec3 mean(0.0);
        Vec3 sum(0.0);
        for (std::size_t i = 0; i < n; ++i) {
            mean += (tool.particles()[i].position - tool.particles()[i].goal) / static_cast<double>(n);
            sum += tool.force_on(i);
        }
        EXPECT_LT(glm::length(kStiffness * mean - sum), 1e-5 * glm::length(sum)) << young;
        for (std::size_t i = 0; i < n; ++i) {
            const ToolProxy& p = tool.particles()[i];
            for (const HalfSpace& plane : kPlanes) {
                const double gap = glm::dot(plane.normal, p.position) - plane.offset;
                const double push = glm::dot(plane.normal, tool.force_on(i));
                EXPECT_GT(gap, -2e-6 * kSphereRadius);
                EXPECT_GE(push, -1e-9 * largest);
                EXPECT_TRUE(push < 1e-9 * largest || gap < 2e-6 * kSphereRadius) << push << ' ' << gap;
            }
        }
    }
}

TEST(ToolEquilibrium, FollowsASurfaceThatYieldsWithinTwoRounds) {
    // The floor sinks by a quarter of the radius a step, far out of the contacts' reach; the hand presses, tilted.
    ToolProxies tool(test::square_of_spheres(4, 0.05, kSphereRadius, {.young_modulus = 1e5}), spring_settings(70.0),
                     {{-0.3, 0.2, 0.0}, Quat(1, 0, 0, 0)});
    const Pose hip{{-0.3, -0.2, 0.0}, glm::angleAxis(0.2, glm::normalize(Vec3(1, 2, 3)))};
    Corner corner;
    for (int k = 0; k < 12; ++k) {
        const std::vector<Vec3> start = corner.vertices;
        for (std::size_t v = 0; v < 4; ++v) {
            corner.vertices[v].y -= 0.25 * kSphereRadius;
        }
        const SurfaceMotion motion{start, corner.vertices, corner.triangles};
        corner.tree.refit(motion);
        const std::array<MovingSurface, 1> surfaces{MovingSurface{motion, &corner.tree}};
        tool.set_goals(hip);
        tool.collect(surfaces);
        EXPECT_TRUE(tool.find_secure_positions());
        tool.pop_out();
        tool.find_equilibrium();
        // After some steps in which it finds the floor.
        if (k >= 6) {
            EXPECT_LE(tool.effort().rounds, 2) << k;
            EXPECT_EQ(tool.effort().equilibrium_error, 0.0) << k;
            EXPECT_FALSE(tool.rows().empty()) << k;
            for (const ToolProxy& p : tool.particles()) {
                EXPECT_GT(p.position.y - corner.vertices[0].y, kSphereRadius - 2e-6 * kSphereRadius) << k;
            }
        }
    }
}

TEST(ToolEquilibrium, FrictionHoldsUpToItsCoefficientAndSlidesWithIt) {
    const Corner corner;
    constexpr double mu = 0.4;
    for (const ToolMaterial& material : {ToolMaterial{.young_modulus = 0.0}, ToolMaterial{.rigid = true}}) {
        ToolProxies tool(test::square_of_spheres(2, 0.05, kSphereRadius, material), spring_settings(0.0, mu),
                         {{-0.3, 0.05, 0.0}, Quat(1, 0, 0, 0)});
        step(tool, corner, {{-0.3, kSphereRadius, 0.0}, Quat(1, 0, 0, 0)});
        step(tool, corner, {{-0.3, kSphereRadius - 0.01, 0.0}, Quat(1, 0, 0, 0)});
        // 3 mm aside: within the cone of 4 mm.
        step(tool, corner, {{-0.297, kSphereRadius - 0.01, 0.0}, Quat(1, 0, 0, 0)});
        Vec3 force = force_of(tool);
        EXPECT_NEAR(force.y, kStiffness * 0.01, 1e-5);
        EXPECT_NEAR(force.x, -kStiffness * 0.003, 1e-5);
        EXPECT_TRUE(std::any_of(tool.particles().begin(), tool.particles().end(),
                                [](const ToolProxy& p) { return p.sticks(); }));
        // 30 mm: it slides.
        step(tool, corner, {{-0.27, kSphereRadius - 0.01, 0.0}, Quat(1, 0, 0, 0)});
        force = force_of(tool);
        EXPECT_NEAR(force.x / force.y, -mu, 1e-6);
        for (const ToolProxy& p : tool.particles()) {
            EXPECT_FALSE(p.sticks());
        }
    }
}

TEST(ToolEquilibrium, ItsSpheresRollAsTheHandTurnsUnlessTheToolIsLimp) {
    // A row along x turns about itself: in place, and while the hand moves as the spheres roll.
    const Corner corner;
    constexpr double kTurn = 0.02;  // rad a step
    constexpr int kSteps = 10;
    for (const bool limp : {false, true}) {
        for (const bool follows : {false, true}) {
            ToolModel row = test::loose_spheres({{-0.05, 0, 0}, {0, 0, 0}, {0.05, 0, 0}}, kSphereRadius);
            row.material = {.young_modulus = 0.0, .rigid = !limp};
            ToolProxies tool(row, spring_settings(0.0, 2.0), {{-0.3, 0.05, 0.0}, Quat(1, 0, 0, 0)});
            step(tool, corner, {{-0.3, kSphereRadius, 0.0}, Quat(1, 0, 0, 0)});
            const double rolls = kSphereRadius * std::sin(kTurn);  // m a step
            for (int k = 0; k <= kSteps; ++k) {
                step(tool, corner,
                     {{-0.3, kSphereRadius - 0.01, follows ? k * rolls : 0.0},
                      glm::angleAxis(k * kTurn, Vec3(1, 0, 0))});
            }
            const double pulls = kSteps * rolls * ((limp ? 0.0 : 1.0) - (follows ? 1.0 : 0.0));
            EXPECT_NEAR(force_of(tool).z, kStiffness * pulls, 1e-5) << limp << follows;
            EXPECT_NEAR(force_of(tool).y, kStiffness * 0.01, 1e-5) << limp << follows;
        }
    }
}

TEST(ToolEquilibrium, ARigidToolThatSticksTurnsAboutThePointThatTouches) {
    // A row that stands aslant on one end, and is pressed down: two springs of its motion and one of its rotation.
    const Corner corner;
    ToolModel row = test::loose_spheres({{-0.05, 0, 0}, {0, 0, 0}, {0.05, 0, 0}}, kSphereRadius);
    row.material = {.rigid = true};
    constexpr double kAngle = 1.0;   // rad
    constexpr double kDepth = 1e-3;  // m
    const Quat aslant = glm::angleAxis(-kAngle, Vec3(0, 0, 1));
    const Vec3 end = aslant * Vec3(0.05, 0.0, 0.0);
    ToolProxies tool(row, spring_settings(0.0, 5.0), {{-0.3, 0.2, 0.0}, aslant});
    for (const double height : {1e-4, 0.0, -0.5 * kDepth, -kDepth, -kDepth, -kDepth}) {
        step(tool, corner, {Vec3(-0.3, kSphereRadius + height, 0.0) - Vec3(0.0, end.y, 0.0), aslant});
    }
    const Vec3 lever = end - Vec3(0.0, kSphereRadius, 0.0);
    const double turns = kStiffness * 2.0 * 0.05 * 0.05 / 3.0;  // N m/rad
    const double xx = 1.0 / kStiffness + lever.y * lever.y / turns;
    const double yy = 1.0 / kStiffness + lever.x * lever.x / turns;
    const double xy = -lever.x * lever.y / turns;
    const Vec3 expected = kDepth / (xx * yy - xy * xy) * Vec3(-xy, xx, 0.0);
    const Vec3 force = force_of(tool);
    EXPECT_LT(glm::length(force - expected), 0.02 * glm::length(expected));
}

/// Largest stretch of the tool in the script of rod-gap: distance of its end spheres over that in the rest shape.
double stretch_in_rod_gap(const std::string& material) {
    Config config = open_scene("rod-gap");
    config.set(material);
    Simulation simulation(read_scene(config, "rod-gap"));
    double largest = 0.0;
    for (int k = 0; k < 400; ++k) {
        (void)simulation.step(simulation.scripted_input(10'000'000 * std::int64_t{k}));
        const std::span<const ToolProxy> row = simulation.tool().particles();
        for (std::size_t a = 0; a < row.size(); ++a) {
            for (std::size_t b = 0; b < a; ++b) {
                const double rest = glm::length(row[a].rest_offset - row[b].rest_offset);
                largest = std::max(largest, glm::length(row[a].position - row[b].position) / rest);
            }
        }
    }
    return largest - 1.0;
}

TEST(ToolEquilibrium, AStiffRodDoesNotStretchOverTheRodOfRodGap) {
    EXPECT_LT(stretch_in_rod_gap("tool.material.rigid=true"), 0.01);
    EXPECT_LT(stretch_in_rod_gap("tool.material.young_modulus=1e8"), 0.01);
}

TEST(ToolEquilibrium, ForceOnThePlaneGrowsWithTheModulus) {
    double last = 0.0;
    for (const char* const young : {"0", "1e3", "1e5", "1e8"}) {
        Config config = open_scene("plane-slide");
        config.set(std::string("tool.material.young_modulus=") + young);
        Simulation simulation(read_scene(config, "plane-slide"));
        double largest = 0.0;
        for (int k = 0; k < 100; ++k) {
            largest =
                std::max(largest, simulation.step(simulation.scripted_input(20'000'000 * std::int64_t{k})).force.y);
        }
        EXPECT_GT(largest, 1.02 * last) << young;
        last = largest;
    }
}

}  // namespace
}  // namespace haptic::sim
