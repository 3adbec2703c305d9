#include "tool/tool_elasticity.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>
#include <numeric>
#include <random>
#include <span>
#include <vector>

#include "haptic/sim/tool_model.hpp"

namespace haptic::sim {
namespace {

using Matrix = Eigen::MatrixXd;
using Vector = Eigen::VectorXd;

constexpr double kPi = std::numbers::pi;

/// A tool made by hand, with the memory that ToolElasticity::Shape refers to.
struct Body {
    std::vector<Vec3> offset;
    std::vector<double> volume;
    std::vector<double> radius;
    std::vector<Group> groups;

    [[nodiscard]] ToolElasticity::Shape shape() const { return {offset, volume, radius, groups}; }
};

/// A row of spheres along z that stands for a round rod of their radius, in groups of five.
Body rod(std::size_t count, double spacing, double radius) {
    Body body;
    for (std::size_t i = 0; i < count; ++i) {
        body.offset.emplace_back(0.0, 0.0, spacing * (static_cast<double>(i) - 0.5 * static_cast<double>(count - 1)));
        body.volume.push_back(kPi * radius * radius * spacing);
        body.radius.push_back(radius);
        Group group{static_cast<std::uint32_t>(i), {}};
        const std::size_t first = std::min(i < 2 ? 0 : i - 2, count - 5);
        for (std::size_t a = first; a < first + 5; ++a) {
            group.members.push_back(static_cast<std::uint32_t>(a));
        }
        body.groups.push_back(group);
    }
    return body;
}

/// A box of spheres, each grouped with its neighbours.
Body box(int nx, int ny, int nz, double spacing, double jitter, unsigned seed) {
    Body body;
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> noise(-jitter, jitter);
    const auto index = [&](int x, int y, int z) { return static_cast<std::uint32_t>((z * ny + y) * nx + x); };
    for (int z = 0; z < nz; ++z) {
        for (int y = 0; y < ny; ++y) {
            for (int x = 0; x < nx; ++x) {
                body.offset.push_back(spacing *
                                      Vec3{x + noise(random), y + noise(random), z - 0.3 * nz + noise(random)});
                body.volume.push_back(spacing * spacing * spacing);
                body.radius.push_back(0.5 * spacing);
                Group group{index(x, y, z), {}};
                for (int c = std::max(z - 1, 0); c <= std::min(z + 1, nz - 1); ++c) {
                    for (int b = std::max(y - 1, 0); b <= std::min(y + 1, ny - 1); ++b) {
                        for (int a = std::max(x - 1, 0); a <= std::min(x + 1, nx - 1); ++a) {
                            group.members.push_back(index(a, b, c));
                        }
                    }
                }
                body.groups.push_back(group);
            }
        }
    }
    return body;
}

Matrix assembled(std::size_t count, const auto& block) {
    const auto n = static_cast<Eigen::Index>(count);
    Matrix m(3 * n, 3 * n);
    for (Eigen::Index i = 0; i < n; ++i) {
        for (Eigen::Index j = 0; j < n; ++j) {
            const Mat3 b = block(static_cast<std::size_t>(i), static_cast<std::size_t>(j));
            for (int r = 0; r < 3; ++r) {
                for (int c = 0; c < 3; ++c) {
                    m(3 * i + r, 3 * j + c) = b[c][r];
                }
            }
        }
    }
    return m;
}

Matrix compliance_of(const ToolElasticity& tool) {
    return assembled(tool.count(), [&](std::size_t i, std::size_t j) { return tool.compliance(i, j); });
}

Matrix stiffness_of(const ToolElasticity& tool) {
    return assembled(tool.count(), [&](std::size_t i, std::size_t j) { return tool.stiffness(i, j); });
}

/// (k_t / N) 1 + (k - k_t) / N^2 1 1^T, for three axes.
Matrix springs_of(std::size_t count, double k, double k_t) {
    const double n = static_cast<double>(count);
    return assembled(
        count, [&](std::size_t i, std::size_t j) { return Mat3((i == j ? k_t / n : 0.0) + (k - k_t) / (n * n)); });
}

/// Rigid motions, linear in the angle.
Matrix rigid_motions(const Body& body) {
    Matrix g(3 * static_cast<Eigen::Index>(body.offset.size()), 6);
    for (std::size_t i = 0; i < body.offset.size(); ++i) {
        const Vec3& r = body.offset[i];
        Eigen::Matrix3d cross;
        cross << 0.0, r.z, -r.y, -r.z, 0.0, r.x, r.y, -r.x, 0.0;
        g.middleRows<3>(3 * static_cast<Eigen::Index>(i)) << Eigen::Matrix3d::Identity(), cross;
    }
    return g;
}

/// Largest entry of the difference over the largest of `expected`.
double relative(const Matrix& actual, const Matrix& expected) {
    return (actual - expected).cwiseAbs().maxCoeff() / expected.cwiseAbs().maxCoeff();
}

TEST(ToolElasticity, StiffnessHasExactlyTheRigidMotionsAsNullSpace) {
    for (const Body& body : {box(3, 3, 3, 0.02, 0.2, 1), box(5, 1, 4, 0.02, 0.0, 2), box(4, 4, 1, 0.02, 0.1, 3)}) {
        const ToolElasticity tool(body.shape(), {.young_modulus = 1e5, .poisson_ratio = 0.4}, {20.0, 30.0});
        const Matrix k = stiffness_of(tool);
        const Matrix g = rigid_motions(body);
        EXPECT_LT((k * g).cwiseAbs().maxCoeff(), 1e-12 * k.cwiseAbs().maxCoeff());
        // Symmetric, no negative eigenvalue, and only six that are 0.
        EXPECT_LT((k - k.transpose()).cwiseAbs().maxCoeff(), 1e-12 * k.cwiseAbs().maxCoeff());
        const Vector eigenvalues = Eigen::SelfAdjointEigenSolver<Matrix>(k).eigenvalues();
        EXPECT_LT(std::abs(eigenvalues[5]), 1e-10 * eigenvalues.tail<1>()[0]);
        EXPECT_GT(eigenvalues[6], 1e-4 * eigenvalues.tail<1>()[0]);
    }
}

TEST(ToolElasticity, ComplianceInvertsMaterialAndSprings) {
    for (const double young : {1e2, 1e5, 1e8}) {
        const Body body = box(3, 2, 4, 0.02, 0.2, 4);
        const ToolElasticity tool(body.shape(), {.young_modulus = young}, {20.0, 35.0});
        const Matrix a = stiffness_of(tool) + springs_of(body.offset.size(), 20.0, 35.0);
        const Matrix product = a * compliance_of(tool);
        // Rounding grows with the condition number.
        EXPECT_LT((product - Matrix::Identity(a.rows(), a.cols())).cwiseAbs().maxCoeff(), 1e-14 * young + 1e-10);
    }
}

TEST(ToolElasticity, LimpToolIsIndependentSprings) {
    const Body body = box(3, 3, 1, 0.02, 0.2, 5);
    const ToolElasticity tool(body.shape(), {.young_modulus = 0.0}, {20.0, 0.0});
    EXPECT_TRUE(tool.independent());
    for (std::size_t i = 0; i < tool.count(); ++i) {
        for (std::size_t j = 0; j < tool.count(); ++j) {
            EXPECT_EQ(tool.compliance(i, j), Mat3(i == j ? 9.0 / 20.0 : 0.0));
        }
    }
    // With a torque stiffness of its own the springs share their mean.
    const ToolElasticity other(body.shape(), {.young_modulus = 0.0}, {20.0, 50.0});
    EXPECT_FALSE(other.independent());
    EXPECT_LT(relative(compliance_of(other), springs_of(9, 20.0, 50.0).inverse()), 1e-13);
}

TEST(ToolElasticity, RigidToolMovesRigidlyAndStiffMaterialApproachesIt) {
    for (const Body& body : {box(3, 3, 3, 0.02, 0.2, 6), rod(9, 0.01, 0.01)}) {
        const ToolElasticity tool(body.shape(), {.rigid = true}, {20.0, 30.0});
        // Least squares over the six motions, by a decomposition of its own.
        const Matrix g = rigid_motions(body);
        const Matrix s = springs_of(body.offset.size(), 20.0, 30.0);
        const Matrix root = s.llt().matrixL().transpose();
        const Matrix exact =
            g * (root * g).completeOrthogonalDecomposition().pseudoInverse() * root.transpose().inverse();
        EXPECT_LT(relative(compliance_of(tool), exact), 1e-10);
        const ToolElasticity stiff(body.shape(), {.young_modulus = ToolMaterial::kMaxYoungModulus}, {20.0, 30.0});
        EXPECT_LT(relative(compliance_of(stiff), exact), 1e-5);
    }
}

TEST(ToolElasticity, TurnsByMomentsOnItsSpheresAsByForcesWithTheSameMoment) {
    using Push = ToolElasticity::Push;
    const Body body = box(3, 3, 2, 0.02, 0.2, 7);
    for (const ToolMaterial& material : {ToolMaterial{.young_modulus = 1e5}, ToolMaterial{.rigid = true}}) {
        const ToolElasticity tool(body.shape(), material, {20.0, 30.0});
        const std::size_t count = tool.count();
        // Forces m J^-1 x o_i, about the mean.
        Vec3 mean(0.0);
        for (const Vec3& o : body.offset) {
            mean += o / static_cast<double>(count);
        }
        Mat3 inertia(0.0);
        for (const Vec3& o : body.offset) {
            inertia += Mat3(glm::dot(o - mean, o - mean)) - glm::outerProduct(o - mean, o - mean);
        }
        const Vec3 moment(0.01, -0.02, 0.03);
        const Vec3 axis = glm::inverse(inertia) * moment;
        const Push none{.particle = 0, .direction = Vec3(0.0), .moment = moment};
        for (std::size_t i = 0; i < count; ++i) {
            Vec3 moved(0.0);
            for (std::size_t j = 0; j < count; ++j) {
                moved += tool.compliance(i, j) * glm::cross(axis, body.offset[j] - mean);
            }
            EXPECT_LT(glm::length(tool.displacement(i, none) - moved), 1e-10 * glm::length(moved));
            EXPECT_LT(glm::length(tool.turned(i, tool.turn(none)) - moved), 1e-10 * glm::length(moved));
        }
        const Push a{.particle = 2, .direction = Vec3(0, 0, 1), .moment = {0.01, 0.0, 0.0}};
        const Push b{.particle = 7, .direction = Vec3(0.6, 0.8, 0), .moment = {0.0, 0.004, 0.003}};
        EXPECT_NEAR(tool.compliance(a, b), tool.compliance(b, a), 1e-12 * tool.compliance(a, a));
        EXPECT_LT(std::abs(tool.compliance(a, b)), std::sqrt(tool.compliance(a, a) * tool.compliance(b, b)));
    }
}

TEST(ToolElasticity, OneSphereIsTheSpringWhateverItsMaterial) {
    const Body body{{Vec3(0.1, 0.2, 0.3)}, {1e-5}, {0.01}, {}};
    for (const ToolMaterial& material :
         {ToolMaterial{.young_modulus = 0.0}, ToolMaterial{}, ToolMaterial{.rigid = true}}) {
        const ToolElasticity tool(body.shape(), material, {20.0, 0.0});
        EXPECT_NEAR(tool.compliance(0, 0)[0][0], 1.0 / 20.0, 1e-16);
        EXPECT_NEAR(tool.compliance(0, 0)[1][0], 0.0, 1e-16);
    }
}

/// Force (N) per relative displacement of rows under a unit force pair, in a body held by weak springs.
TEST(ToolElasticity, RodStretchesAndBendsAsItsModulusSays) {
    constexpr double young = 1e6;    // Pa
    constexpr double radius = 0.01;  // m
    constexpr double spacing = 0.01;
    constexpr std::size_t count = 41;
    const Body body = rod(count, spacing, radius);
    // Springs that are weak against the rod: it is free.
    const ToolElasticity tool(body.shape(), {.young_modulus = young, .poisson_ratio = 0.3}, {1e-3, 0.0});
    const double length = spacing * static_cast<double>(count - 1);
    const double area = kPi * radius * radius;
    const double moment = kPi / 4.0 * radius * radius * radius * radius;
    // Tension: 1 N at both ends, dL = F L / (E A).
    const std::size_t last = count - 1;
    const double stretch = (tool.compliance(last, last) - tool.compliance(last, 0) - tool.compliance(0, last) +
                            tool.compliance(0, 0))[2][2];
    EXPECT_NEAR(stretch / (length / (young * area)), 1.0, 0.1);
    // Three-point bending: 1 N up in the middle, 1/2 N down at each end, w = F L^3 / (48 E I).
    const std::size_t middle = last / 2;
    const auto c = [&](std::size_t i, std::size_t j) { return tool.compliance(i, j)[0][0]; };
    const double sag =
        c(middle, middle) - c(middle, 0) - c(middle, last) + 0.25 * (c(0, 0) + c(last, last) + 2.0 * c(0, last));
    EXPECT_NEAR(sag / (length * length * length / (48.0 * young * moment)), 1.0, 0.1);
    RecordProperty("tension", std::to_string(stretch / (length / (young * area))));
    RecordProperty("bending", std::to_string(sag / (length * length * length / (48.0 * young * moment))));
}

TEST(ToolElasticity, CubeUnderUniformTensionHasModulusAndPoissonRatio) {
    constexpr double young = 1e5;
    constexpr double nu = 0.3;
    const Body body = box(6, 6, 6, 0.01, 0.0, 7);
    const ToolElasticity tool(body.shape(), {.young_modulus = young, .poisson_ratio = nu}, {1e-3, 0.0});
    // The energy of a uniform strain is exact: e = diag(1, -nu, -nu) stores E / 2 per volume.
    const Matrix k = stiffness_of(tool);
    Vector u(k.rows());
    double volume = 0.0;
    for (std::size_t i = 0; i < body.offset.size(); ++i) {
        const Vec3& r = body.offset[i];
        u.segment<3>(3 * static_cast<Eigen::Index>(i)) << r.x, -nu * r.y, -nu * r.z;
        volume += body.volume[i];
    }
    EXPECT_NEAR(0.5 * u.dot(k * u) / (0.5 * young * volume), 1.0, 1e-9);
}

TEST(ToolElasticity, ResidualIsWhatLeastSquaresLeavesOver) {
    // Without Poisson's ratio, groups of all members in a row, a sheet and a solid, each slightly out of shape.
    for (const auto& [nx, ny, nz] : {std::array{1, 1, 7}, {4, 3, 1}, {3, 3, 2}}) {
        Body body = box(nx, ny, nz, 0.02, 0.05, 9);
        const auto count = static_cast<Eigen::Index>(body.offset.size());
        body.groups.resize(1);
        body.groups[0].members.resize(body.offset.size());
        std::iota(body.groups[0].members.begin(), body.groups[0].members.end(), 0u);
        const ToolElasticity tool(body.shape(), {.young_modulus = 1e5, .poisson_ratio = 0.0}, {});
        const Matrix k = stiffness_of(tool);
        // Columns: rigid motions, and strains in the directions that carry any.
        Eigen::Matrix3Xd q(3, count);
        for (Eigen::Index a = 0; a < count; ++a) {
            const Vec3& o = body.offset[static_cast<std::size_t>(a)];
            q.col(a) << o.x, o.y, o.z;
        }
        q.colwise() -= q.rowwise().mean().eval();
        const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> moments(q * q.transpose());
        std::vector<Eigen::Vector3d> directions;
        for (int axis = 0; axis < 3; ++axis) {
            if (moments.eigenvalues()[axis] > ToolElasticity::kFlat * moments.eigenvalues()[2]) {
                directions.emplace_back(moments.eigenvectors().col(axis));
            }
        }
        Matrix smooth = rigid_motions(body);
        for (const Eigen::Vector3d& s : directions) {
            for (const Eigen::Vector3d& t : directions) {
                smooth.conservativeResize(Eigen::NoChange, smooth.cols() + 1);
                for (Eigen::Index a = 0; a < count; ++a) {
                    smooth.block<3, 1>(3 * a, smooth.cols() - 1) =
                        (s * t.transpose() + t * s.transpose()) * q.col(a) / 0.02;
                }
            }
        }
        // A displacement with nothing to project away: K scales it by the residual's stiffness, the same for all.
        const auto projector = smooth.completeOrthogonalDecomposition();
        std::mt19937 random(10);
        std::normal_distribution<double> normal;
        double stiffness = 0.0;
        for (int trial = 0; trial < 4; ++trial) {
            const Vector u = Vector::NullaryExpr(3 * count, [&](Eigen::Index) { return normal(random); });
            const Vector residual = u - smooth * projector.solve(u);
            ASSERT_GT(residual.norm(), 0.1);
            stiffness = trial == 0 ? residual.dot(k * residual) / residual.squaredNorm() : stiffness;
            EXPECT_GT(stiffness, 0.0);
            EXPECT_LT((k * residual - stiffness * residual).norm(), 1e-10 * k.norm() * residual.norm()) << nx;
        }
    }
}

TEST(ToolElasticity, FollowsSpringsWhoseEndsMoveLinearly) {
    const Mat3 gradient(0.1, -0.2, 0.05, 0.3, -0.1, 0.2, -0.15, 0.25, 0.4);
    for (const ToolMaterial& material :
         {ToolMaterial{.young_modulus = 0.0}, ToolMaterial{.young_modulus = 1e3}, ToolMaterial{.rigid = true}}) {
        const Body body = box(3, 2, 4, 0.02, 0.2, 12);
        ToolElasticity tool(body.shape(), material, {20.0, 35.0});
        for (const double stiffness : {20.0, 50.0}) {
            tool.set_springs({stiffness, 35.0});
            std::vector<Vec3> u(tool.count());
            tool.follow_springs(gradient, u);
            Vector v(3 * static_cast<Eigen::Index>(tool.count()));
            for (std::size_t i = 0; i < tool.count(); ++i) {
                const Vec3 end = gradient * body.offset[i];
                v.segment<3>(3 * static_cast<Eigen::Index>(i)) << end.x, end.y, end.z;
            }
            const Vector expected = compliance_of(tool) * springs_of(tool.count(), stiffness, 35.0) * v;
            for (std::size_t i = 0; i < tool.count(); ++i) {
                const auto at = expected.segment<3>(3 * static_cast<Eigen::Index>(i));
                EXPECT_LT(glm::length(u[i] - Vec3(at[0], at[1], at[2])), 1e-11 * v.norm()) << i;
            }
        }
    }
}

TEST(ToolElasticity, TurnsWithItsRestShape) {
    Body body = box(3, 2, 4, 0.02, 0.2, 8);
    const ToolMaterial material{.young_modulus = 1e5};
    const ToolElasticity::Springs springs{20.0, 30.0};
    const Matrix before = compliance_of(ToolElasticity(body.shape(), material, springs));
    // A turn of the rest shape by 120 degrees about (1, 1, 1) permutes the axes.
    for (Vec3& r : body.offset) {
        r = Vec3(r.z, r.x, r.y);
    }
    const Matrix after = compliance_of(ToolElasticity(body.shape(), material, springs));
    double worst = 0.0;
    for (Eigen::Index i = 0; i < before.rows(); ++i) {
        for (Eigen::Index j = 0; j < before.cols(); ++j) {
            const auto turned = [](Eigen::Index at) { return at - at % 3 + (at + 1) % 3; };
            worst = std::max(worst, std::abs(after(turned(i), turned(j)) - before(i, j)));
        }
    }
    EXPECT_LT(worst, 1e-11 * before.cwiseAbs().maxCoeff());
}

/// The generated hand.
class Hand {
  public:
    Hand() : tool_(make_tool(settings())), rotation_(tool_.radius.size()) {}
    /// m, tool frame: rest offsets at a curl.
    std::vector<Vec3> offset(double curl) {
        std::vector<Vec3> offset(tool_.radius.size());
        tool_.joints.apply_curl(curl, offset, rotation_);
        return offset;
    }
    ToolElasticity elasticity(double curl, double young_modulus, const ToolElasticity::Springs& springs) {
        const std::vector<Vec3> rest = offset(curl);
        return {
            {rest, tool_.volume, tool_.radius, tool_.body.particles.groups}, {.young_modulus = young_modulus}, springs};
    }

  private:
    static ToolSettings settings() {
        ToolSettings settings;
        settings.shape = ToolShape::Hand;
        return settings;
    }

    ToolModel tool_;
    std::vector<Quat> rotation_;
};

TEST(ToolElasticity, OfAClosingHandIsThatOfItsShape) {
    constexpr double kSteps = static_cast<double>(ToolElasticity::kShapes - 1);
    Hand hand;
    for (const double young_modulus : {1e3, 1e5, 1e8}) {
        ToolElasticity tool = hand.elasticity(0.0, young_modulus, {750.0, 0.0});
        tool.tabulate(
            [&](double curl, std::span<Vec3> offset) { std::ranges::copy(hand.offset(curl), offset.begin()); });
        for (const ToolElasticity::Springs& springs :
             {ToolElasticity::Springs{750.0, 0.0}, ToolElasticity::Springs{200.0, 90.0}}) {
            tool.set_springs(springs);
            for (const double curl : {0.0, 0.25, 0.3, 0.37, 0.999, 1.0}) {
                const std::vector<Vec3> offset = hand.offset(curl);
                tool.set_curl(curl, offset);
                const Matrix exact = compliance_of(hand.elasticity(curl, young_modulus, springs));
                const double error = (compliance_of(tool) - exact).cwiseAbs().maxCoeff();
                // Exact in the table, and to 0.1 % beside it, but where a group becomes flat between two shapes: its
                // stiffness jumps there, and the table has the way from one to the other.
                const double before = std::min(std::floor(curl * kSteps), kSteps - 1.0) / kSteps;
                const Matrix jump = compliance_of(hand.elasticity(before + 1.0 / kSteps, young_modulus, springs)) -
                                    compliance_of(hand.elasticity(before, young_modulus, springs));
                const double bound = curl == 0.3 ? jump.cwiseAbs().maxCoeff() : 1e-3 * exact.cwiseAbs().maxCoeff();
                const bool in_table = std::fmod(curl * kSteps, 1.0) == 0.0;
                EXPECT_LT(error, in_table ? 1e-12 * exact.cwiseAbs().maxCoeff() : bound) << curl;
                // Where the springs' ends move like a rigid body, the hand follows like one.
                std::vector<Vec3> u(tool.count());
                const Mat3 turn(0.0, 0.2, -0.1, -0.2, 0.0, 0.3, 0.1, -0.3, 0.0);
                tool.follow_springs(turn, u);
                for (std::size_t i = 0; i < u.size(); ++i) {
                    EXPECT_LT(glm::length(u[i] - turn * offset[i]), 1e-14) << i;
                }
            }
        }
    }
}

}  // namespace
}  // namespace haptic::sim
