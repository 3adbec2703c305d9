// Coupling bound: whatever the compliance, the hand feels no more than the springs of the coupling; a tool that has
// them keeps its compliance.
#include "rendering/coupling_bound.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <memory>
#include <span>
#include <vector>

#include "random.hpp"
#include "rendering/tool_contact.hpp"

namespace haptic {
namespace {

using rt::test::Random;

constexpr double kStiffness = 400.0;  // N/m
// m: displacements of the hand. All planes pass through their proxies at the identity pose, so that the problem is the
// same at every size, and moment arms change by nothing in comparison.
constexpr double kTiny = 1e-8;

/// `count` particles within a few cm, each with one plane through it, and tangents if asked for.
ContactFrame touching_tool(Random& random, std::size_t count, bool tangents) {
    ContactFrame frame{};
    frame.step_ns = kNanosecondsPerSecond;
    frame.stiffness = kStiffness;
    frame.torque_stiffness = kStiffness * random.uniform(0.3, 3.0);
    frame.static_friction = frame.dynamic_friction = tangents ? 50.0 : 0.0;
    frame.proxy_count = static_cast<std::uint32_t>(count);
    const Vec3 side = 0.02 * random.normal();
    // Half of the tools lie on one floor, the others touch on all sides.
    const bool floor = random.uniform(0.0, 1.0) < 0.5;
    for (ProxyContact& proxy : std::span(frame.proxies).first(count)) {
        const Vec3 offset = side + 0.02 * random.normal();
        const Vec3 n = floor ? Vec3(0.0, 1.0, 0.0) : random.direction();
        store(offset, proxy.rest_offset);
        store(offset, proxy.position);
        proxy.plane_count = 1;
        store(n, proxy.planes[0].normal);
        proxy.planes[0].offset = glm::dot(n, offset);
        proxy.in_contact = tangents ? std::uint32_t{HAPTIC_PROXY_TANGENTS} : 0U;
    }
    return frame;
}

std::vector<FrameRow> rows_of(const ContactFrame& frame) {
    std::vector<FrameRow> rows;
    for (std::uint16_t i = 0; i < frame.proxy_count; ++i) {
        const ProxyContact& proxy = frame.proxies[i];
        const Vec3 n = to_vec3(proxy.planes[0].normal);
        rows.push_back({n, i, false});
        if ((proxy.in_contact & HAPTIC_PROXY_TANGENTS) != 0) {
            for (const Vec3& tangent : contact_tangents(n)) {
                rows.push_back({tangent, i, true});
            }
        }
    }
    return rows;
}

/// k W of a rigid tool, D S^-1 D^T k with the 6 x 6 stiffness S of its springs: k / N at each particle for the force of
/// a translation, k_t / N for that of a rotation about the centre.
Eigen::MatrixXd rigid_compliance(const ContactFrame& frame) {
    const double k_t = frame.torque_stiffness;
    const double n = frame.proxy_count;
    Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();
    Vec3 centre(0.0);
    for (std::size_t i = 0; i < frame.proxy_count; ++i) {
        centre += to_vec3(frame.proxies[i].rest_offset) / n;
    }
    const auto arm_of = [&](std::size_t i) {
        const Vec3 r = to_vec3(frame.proxies[i].rest_offset) - centre;
        return Eigen::Vector3d(r.x, r.y, r.z);
    };
    for (std::size_t i = 0; i < frame.proxy_count; ++i) {
        const Eigen::Vector3d r = arm_of(i);
        inertia += k_t / n * (r.squaredNorm() * Eigen::Matrix3d::Identity() - r * r.transpose());
    }
    const std::vector<FrameRow> rows = rows_of(frame);
    Eigen::MatrixXd directions(rows.size(), 3);
    Eigen::MatrixXd moments(rows.size(), 3);
    for (std::size_t r = 0; r < rows.size(); ++r) {
        const auto at = static_cast<Eigen::Index>(r);
        const Vec3 d = rows[r].direction;
        directions.row(at) << d.x, d.y, d.z;
        moments.row(at) = arm_of(rows[r].proxy).cross(Eigen::Vector3d(d.x, d.y, d.z)).transpose();
    }
    // A tool of one or two particles turns freely about some axis.
    const Eigen::MatrixXd turning =
        frame.stiffness * moments * inertia.completeOrthogonalDecomposition().pseudoInverse() * moments.transpose();
    return directions * directions.transpose() + turning;
}

void send(ContactFrame& frame, const Eigen::MatrixXd& compliance, double share) {
    frame.compliance_rows = static_cast<std::uint32_t>(compliance.rows());
    for (Eigen::Index r = 0; r < compliance.rows(); ++r) {
        for (Eigen::Index s = 0; s <= r; ++s) {
            frame.compliance[compliance_index(static_cast<std::size_t>(r), static_cast<std::size_t>(s))] =
                static_cast<float>((r == s ? 1.0 : 1.0 - share) * compliance(r, s));
        }
    }
}

Eigen::MatrixXd random_positive(Random& random, Eigen::Index rows, Eigen::Index rank) {
    Eigen::MatrixXd factor(rows, rank);
    for (double& element : factor.reshaped()) {
        element = random.uniform(-1.0, 1.0);
    }
    return factor * factor.transpose();
}

/// Wrenches at rest at two poses, one after the other.
std::array<Wrench, 2> wrenches(const ContactFrame& frame, const std::array<Pose, 2>& poses, bool& springs_added) {
    const auto tool = std::make_unique<ToolContact>();
    tool->load(frame);
    std::array<Wrench, 2> felt;
    for (std::size_t i = 0; i < 2; ++i) {
        // The tick in which a proxy begins to touch has no friction.
        for (int tick = 0; tick < (i == 0 ? 2 : 1); ++tick) {
            felt[i] = tool->render(frame, frame.stiffness, {poses[i], poses[i], 1e-3}, 0).wrench;
        }
    }
    springs_added = tool->springs_added();
    return felt;
}

Vec3 torque_about(const Wrench& wrench, const Vec3& centre) {
    return wrench.torque - glm::cross(centre, wrench.force);
}

enum class Mistake { MetresPerNewton, OwnSprings, NoEnergy };

/// Compliance that find_defect() lets pass and that no tool with these springs has.
Eigen::MatrixXd mistaken(Random& random, const ContactFrame& frame, Mistake mistake) {
    const Eigen::MatrixXd rigid = rigid_compliance(frame);
    const Eigen::Index rows = rigid.rows();
    if (mistake == Mistake::MetresPerNewton) {
        return rigid / frame.stiffness;
    }
    if (mistake == Mistake::OwnSprings) {
        // Each contact on a spring k of its own: every element of the diagonal is 1.
        return Eigen::MatrixXd::Identity(rows, rows) * 1.0;
    }
    // Symmetric, with elements as large as the diagonal allows: indefinite.
    Eigen::MatrixXd any = 0.3 * random_positive(random, rows, rows);
    for (Eigen::Index r = 0; r < rows; ++r) {
        for (Eigen::Index s = 0; s < r; ++s) {
            any(r, s) = any(s, r) = 0.99 * random.uniform(-1.0, 1.0) * std::sqrt(any(r, r) * any(s, s));
        }
    }
    return any;
}

class HostileCompliance : public testing::TestWithParam<Mistake> {};

TEST_P(HostileCompliance, IsFeltNoStifferThanTheSpringsToTheHand) {
    Random random(11);
    double largest_raw = 0.0;
    int added = 0;
    for (int trial = 0; trial < 400; ++trial) {
        ContactFrame frame = touching_tool(random, 2 + static_cast<std::size_t>(trial) % 36, trial % 3 == 0);
        const Eigen::MatrixXd compliance = mistaken(random, frame, GetParam());
        send(frame, compliance, 0.0);
        ASSERT_EQ(find_defect(frame), FrameDefect::None);
        // Two poses near one another, both in contact.
        const Vec3 into = kTiny * random.normal();
        const Vec3 on = 0.3 * kTiny * random.normal();
        bool springs_added = false;
        const auto moved =
            wrenches(frame, {Pose{into, Quat(1, 0, 0, 0)}, Pose{into + on, Quat(1, 0, 0, 0)}}, springs_added);
        added += springs_added ? 1 : 0;
        const double stiffness = glm::length(moved[1].force - moved[0].force) / glm::length(on);
        ASSERT_LE(stiffness, frame.stiffness * (1.0 + CouplingBound::kTranslationExcess) * (1.0 + 1e-3)) << trial;
        // Rotation about the centre, which the grip follows so that the centre stays.
        Vec3 centre(0.0);
        double squares = 0.0;
        for (const ProxyContact& proxy : std::span(frame.proxies).first(frame.proxy_count)) {
            centre += to_vec3(proxy.rest_offset) / static_cast<double>(frame.proxy_count);
        }
        for (const ProxyContact& proxy : std::span(frame.proxies).first(frame.proxy_count)) {
            const Vec3 r = to_vec3(proxy.rest_offset) - centre;
            squares += glm::dot(r, r) / static_cast<double>(frame.proxy_count);
        }
        const double angle = 0.3 * kTiny / std::sqrt(squares);
        const Quat turn = glm::angleAxis(angle, random.direction());
        const Pose first{into, Quat(1, 0, 0, 0)};
        const Pose turned{into + centre - turn * centre, turn};
        const auto rotated = wrenches(frame, {first, turned}, springs_added);
        const double rotational =
            glm::length(torque_about(rotated[1], centre) - torque_about(rotated[0], centre)) / angle;
        ASSERT_LE(rotational, frame.torque_stiffness * squares * (1.0 + CouplingBound::kRotationExcess) * (1.0 + 1e-3))
            << trial;
        // Without the bound it would be stiffer: all rows together, D^T W^-1 D.
        if (GetParam() != Mistake::NoEnergy) {
            const std::vector<FrameRow> rows = rows_of(frame);
            Eigen::MatrixXd directions(rows.size(), 3);
            for (std::size_t r = 0; r < rows.size(); ++r) {
                const Vec3 d = rows[r].direction;
                directions.row(static_cast<Eigen::Index>(r)) << d.x, d.y, d.z;
            }
            const Eigen::Matrix3d raw =
                directions.transpose() * compliance.completeOrthogonalDecomposition().pseudoInverse() * directions;
            largest_raw = std::max(largest_raw, raw.norm());
        }
    }
    EXPECT_GT(added, 200);
    if (GetParam() != Mistake::NoEnergy) {
        EXPECT_GT(largest_raw, 20.0) << "of k: the frames are no attack";
    }
}

INSTANTIATE_TEST_SUITE_P(Mistakes, HostileCompliance,
                         testing::Values(Mistake::MetresPerNewton, Mistake::OwnSprings, Mistake::NoEnergy));

/// A matrix and its bound, with a force on every row.
struct Verified {
    bool changed = false;
    bool springs_added = false;
    double largest_change = 0.0;
};
Verified verify(const ContactFrame& frame) {
    const std::vector<FrameRow> rows = rows_of(frame);
    ComplianceMatrix matrix;
    matrix.resize(rows.size());
    for (std::size_t r = 0; r < rows.size(); ++r) {
        for (std::size_t s = 0; s <= r; ++s) {
            matrix.set(r, s, frame.compliance[compliance_index(r, s)]);
        }
    }
    CouplingBound bound;
    bound.load(frame, rows, Quat(1, 0, 0, 0));
    Verified result;
    result.changed = bound.enforce(matrix, std::vector<double>(rows.size(), 1.0));
    result.springs_added = bound.springs_added();
    for (std::size_t r = 0; r < rows.size(); ++r) {
        for (std::size_t s = 0; s <= r; ++s) {
            result.largest_change =
                std::max(result.largest_change, std::fabs(matrix(r, s) - frame.compliance[compliance_index(r, s)]));
        }
    }
    return result;
}

TEST(CouplingBound, LeavesEveryToolWithTheSpringsAsItIs) {
    Random random(12);
    for (int trial = 0; trial < 200; ++trial) {
        ContactFrame frame = touching_tool(random, 1 + static_cast<std::size_t>(trial) % 40, trial % 3 == 0);
        const Eigen::MatrixXd rigid = rigid_compliance(frame);
        // Rigid, or with an elasticity of its own, of any rank.
        const double elasticity = trial % 2 == 0 ? 0.0 : random.uniform(0.0, 1.0);
        send(frame, rigid + elasticity * random_positive(random, rigid.rows(), 1 + trial % 50), kSurfaceShare);
        const Verified with_share = verify(frame);
        ASSERT_FALSE(with_share.changed) << trial;
        ASSERT_EQ(with_share.largest_change, 0.0);
        // Without the share of a surface its rows depend on one another: the diagonal gets this share, nothing else
        // changes.
        send(frame, rigid, 0.0);
        const Verified singular = verify(frame);
        ASSERT_FALSE(singular.springs_added) << trial;
        ASSERT_LE(singular.largest_change, 1.001 * kSurfaceShare * rigid.diagonal().maxCoeff());
    }
}

TEST(CouplingBound, OfRotationIsThatOfARigidToolAtItsStiffestAxisOrMore) {
    // Largest eigenvalue of the 6 x 6 stiffness about the grip, without its translation: with k_t below k as well,
    // where the centre's offset from the grip turns with the translational springs.
    Random random(13);
    for (int trial = 0; trial < 200; ++trial) {
        const ContactFrame frame = touching_tool(random, 1 + static_cast<std::size_t>(trial) % 30, false);
        const double n = frame.proxy_count;
        Eigen::Matrix3d own = Eigen::Matrix3d::Zero();
        Eigen::Vector3d centre = Eigen::Vector3d::Zero();
        for (std::size_t i = 0; i < frame.proxy_count; ++i) {
            const Vec3 o = to_vec3(frame.proxies[i].rest_offset);
            const Eigen::Vector3d r(o.x, o.y, o.z);
            own += frame.torque_stiffness / n * (r.squaredNorm() * Eigen::Matrix3d::Identity() - r * r.transpose());
            centre += r / n;
        }
        own += (frame.stiffness - frame.torque_stiffness) *
               (centre.squaredNorm() * Eigen::Matrix3d::Identity() - centre * centre.transpose());
        const double stiffest = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(own).eigenvalues()[2];
        ASSERT_LE(stiffest, rotational_stiffness_bound(frame) * (1.0 + 1e-12)) << trial;
        ASSERT_GE(stiffest, 0.5 * rotational_stiffness_bound(frame)) << trial;
    }
}

}  // namespace
}  // namespace haptic
