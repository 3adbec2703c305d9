#include "haptic/sim/tool_joints.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <numbers>
#include <stdexcept>
#include <string>
#include <vector>

#include "contact/verification.hpp"
#include "haptic/sim/tool_model.hpp"
#include "tool/hand_mesh.hpp"
#include "tool/tool_proxies.hpp"

namespace haptic::sim {
namespace {

using testing::HasSubstr;

constexpr double kRight = std::numbers::pi / 2.0;

/// Two bones of 1 m along x on a root, with hinges about z that rotate by 90 degrees; the second completes at curl 0.5.
ToolSkeleton arm() {
    return {{{}, {0, {1.0, 0.0, 0.0}, {0.0, 0.0, 2.0}}, {1, {2.0, 0.0, 0.0}, {0.0, 0.0, 2.0}, 0.5}},
            {{0, {0.0, 0.0, 0.0}, 0.1, {1.0, 0.0, 0.0}, 0.1},
             {1, {1.0, 0.0, 0.0}, 0.1, {2.0, 0.0, 0.0}, 0.1},
             {2, {2.0, 0.0, 0.0}, 0.1, {3.0, 0.0, 0.0}, 0.1}}};
}

struct Closed {
    std::vector<Vec3> positions;
    std::vector<Quat> rotations;
};

Closed close(ToolJoints& joints, std::size_t count, double curl) {
    Closed closed{std::vector<Vec3>(count), std::vector<Quat>(count)};
    joints.apply_curl(curl, closed.positions, closed.rotations);
    return closed;
}

TEST(ToolJoints, EachBoneRotatesAboutItsJointAndFollowsItsParent) {
    const std::vector<Vec3> positions{{0.5, 0.2, 0.0}, {1.5, 0.1, 0.0}, {3.0, 0.0, 0.3}};
    ToolJoints joints(arm(), positions);
    for (std::uint32_t k = 0; k < 3; ++k) {
        EXPECT_EQ(joints.joint_of(k), k);
    }
    for (const double curl : {0.0, 0.3, 0.5, 0.8, 1.0}) {
        const Closed closed = close(joints, positions.size(), curl);
        // The tangent of half the angle is proportional to the curl.
        const double first = 2.0 * std::atan(curl);
        const double second = 2.0 * std::atan(std::min(1.0, 2.0 * curl));
        const auto about_z = [](double angle) { return glm::angleAxis(angle, Vec3(0.0, 0.0, 1.0)); };
        const Vec3 elbow = Vec3(1.0, 0.0, 0.0) + about_z(first) * Vec3(1.0, 0.0, 0.0);
        EXPECT_EQ(closed.positions[0], positions[0]);
        EXPECT_NEAR(glm::length(closed.positions[1] - Vec3(1.0, 0.0, 0.0) - about_z(first) * Vec3(0.5, 0.1, 0.0)), 0.0,
                    1e-14);
        EXPECT_NEAR(glm::length(closed.positions[2] - elbow - about_z(first + second) * Vec3(1.0, 0.0, 0.3)), 0.0,
                    1e-14);
        EXPECT_NEAR(std::abs(glm::dot(closed.rotations[2], about_z(first + second))), 1.0, 1e-14);
    }
    const Closed whole = close(joints, positions.size(), 1.0);
    EXPECT_NEAR(2.0 * std::acos(std::abs(whole.rotations[1].w)), kRight, 1e-12);
}

TEST(ToolJoints, DoNotDependOnEarlierCurls) {
    const std::vector<Vec3> positions{{0.5, 0.2, 0.0}, {1.5, 0.1, 0.0}, {3.0, 0.0, 0.3}};
    ToolJoints once(arm(), positions);
    ToolJoints often(arm(), positions);
    for (const double curl : {1.0, 0.2, 0.7}) {
        (void)close(often, positions.size(), curl);
    }
    EXPECT_EQ(close(often, 3, 0.4).positions, close(once, 3, 0.4).positions);
    EXPECT_EQ(close(often, 3, 0.0).positions, positions);
}

TEST(ToolJoints, RejectAnInconsistentSkeleton) {
    const auto refusal = [](const ToolSkeleton& skeleton) -> std::string {
        try {
            const ToolJoints joints(skeleton, std::vector<Vec3>{});
        } catch (const std::invalid_argument& error) {
            return error.what();
        }
        return "taken";
    };
    EXPECT_EQ(refusal(arm()), "taken");
    EXPECT_THAT(refusal({}), HasSubstr("needs at least one joint"));
    ToolSkeleton wrong = arm();
    wrong.joints[1].parent = 2;
    EXPECT_THAT(refusal(wrong), HasSubstr("joint 1 has parent 2"));
    wrong = arm();
    wrong.bones[0].joint = 3;
    EXPECT_THAT(refusal(wrong), HasSubstr("a bone refers to joint 3"));
    wrong = arm();
    wrong.joints[2].full_curl = 0.0;
    EXPECT_THAT(refusal(wrong), HasSubstr("joint 2: full_curl"));
}

ToolSettings settings_of(ToolShape shape, double curl = 0.0) {
    ToolSettings settings;
    settings.shape = shape;
    settings.curl = curl;
    return settings;
}

const ToolModel& jointed_hand() {
    static const ToolModel tool = make_tool(settings_of(ToolShape::Hand));
    return tool;
}

ToolProxies closed_hand(double curl) {
    return {
        jointed_hand(), {.contact = {}, .reach = 0.0, .step = 0.01, .springs = {.stiffness = 2000.0}}, Pose{}, curl};
}

/// m^3, volume of a closed mesh by the divergence theorem.
double volume_of(const std::vector<Vec3>& vertices, const std::vector<Triangle>& triangles) {
    double six = 0.0;
    for (const auto& [a, b, c] : triangles) {
        six += glm::dot(vertices[a], glm::cross(vertices[b], vertices[c]));
    }
    return six / 6.0;
}

TEST(ClosingHand, KeepsItsPalmAndBringsFingersAndThumbTogether) {
    ASSERT_EQ(jointed_hand().joints.joints(), 16u);
    const ToolProxies flat = closed_hand(0.0);
    const ToolProxies half = closed_hand(0.5);
    // Fingertip: the particle farthest from the wrist on each finger's last bone, joints 3, 6, 9, 12 and 15.
    const auto tip = [&](const ToolProxies& tool, std::uint32_t joint) {
        Vec3 found(0.0);
        double farthest = 1.0;
        for (std::size_t i = 0; i < jointed_hand().radius.size(); ++i) {
            const double z = flat.particles()[i].rest_offset.z;
            if (jointed_hand().joints.joint_of(i) == joint && z < farthest) {
                farthest = z;
                found = tool.particles()[i].rest_offset;
            }
        }
        EXPECT_LT(farthest, 1.0) << joint;
        return found;
    };
    for (std::size_t i = 0; i < jointed_hand().radius.size(); ++i) {
        if (jointed_hand().joints.joint_of(i) == 0) {
            EXPECT_EQ(half.particles()[i].rest_offset, flat.particles()[i].rest_offset) << i;
        }
    }
    const Vec3 index = tip(half, 3);
    const Vec3 middle = tip(half, 6);
    const Vec3 thumb = tip(half, 15);
    EXPECT_GT(glm::length(tip(flat, 15) - tip(flat, 6)), 0.07);  // m
    EXPECT_LT(glm::length(thumb - middle), 0.04);
    EXPECT_LT(std::max({index.y, middle.y, thumb.y}), -0.03) << "not below the palm";
    const ToolProxies fist = closed_hand(1.0);
    EXPECT_GT(tip(fist, 6).z, tip(half, 6).z);  // back toward the wrist
}

TEST(ClosingHand, KeepsItsSkinAndNearlyItsVolume) {
    const std::vector<Vec3> flat = closed_hand(0.0).vertices();
    const std::vector<Triangle>& triangles = jointed_hand().body.mesh.triangles;
    double error = 0.0;
    for (std::size_t v = 0; v < flat.size(); ++v) {
        error = std::max(error, glm::length(flat[v] - jointed_hand().body.mesh.vertices[v]));
    }
    EXPECT_LT(error, 1e-15);
    const double volume = volume_of(flat, triangles);
    // Linear blend skinning loses volume at bent joints.
    EXPECT_NEAR(volume_of(closed_hand(0.5).vertices(), triangles) / volume, 1.0, 0.05);
    EXPECT_NEAR(volume_of(closed_hand(1.0).vertices(), triangles) / volume, 1.0, 0.1);
}

TEST(ClosingHand, IsNotStoppedByItselfAndKeepsItsShapeInFreeSpace) {
    ToolProxies tool = closed_hand(0.0);
    for (int k = 1; k <= 50; ++k) {
        tool.set_goals({{0.001 * k, 0.0, 0.0}, Quat(1.0, 0.0, 0.0, 0.0)}, 0.02 * k);
        tool.collect({});
        EXPECT_TRUE(tool.find_secure_positions());
        tool.pop_out();
        tool.find_equilibrium();
        EXPECT_TRUE(tool.in_shape()) << k;
        EXPECT_LT(glm::length(tool.pose().position - tool.hip().position), 1e-15);
        for (const ToolProxy& p : tool.particles()) {
            ASSERT_LT(glm::length(p.position - p.goal), 1e-6 * p.radius);
            ASSERT_FALSE(p.in_contact());
        }
    }
    EXPECT_EQ(tool.curl(), 1.0);
    const std::vector<Vec3> goals = tool.goal_vertices();
    const std::vector<Vec3> vertices = tool.vertices();
    for (std::size_t v = 0; v < goals.size(); ++v) {
        ASSERT_LT(glm::length(goals[v] - vertices[v]), 1e-7);  // m
    }
}

TEST(ClosingHand, StopsOnASheetBetweenItsFingersWithoutPassingIt) {
    // A vertical sheet across the hand, between thumb and fingers.
    const std::vector<Vec3> sheet{{-0.3, -0.2, -0.05}, {-0.3, -0.03, -0.05}, {0.3, -0.03, -0.05}, {0.3, -0.2, -0.05}};
    const std::vector<Triangle> triangles{{0, 1, 2}, {0, 2, 3}};
    SweptTree tree(sheet, triangles);
    const SurfaceMotion motion{sheet, sheet, triangles};
    tree.refit(motion);
    const std::vector<MovingSurface> surfaces{{motion, &tree}};
    const std::vector<SurfaceMotion> moved{motion};
    ToolProxies tool = closed_hand(0.15);
    tool.keep_paths(true);
    for (int k = 0; k <= 20; ++k) {  // closed in 0.1 s
        tool.set_goals({}, 0.15 + 0.0425 * k);
        tool.collect(surfaces);
        EXPECT_TRUE(tool.find_secure_positions());
        tool.pop_out();
        tool.find_equilibrium();
        for (std::size_t i = 0; i < tool.particles().size(); ++i) {
            ASSERT_TRUE(tool.path(i).complete() && find_crossings(moved, tool.path(i).knots()).empty())
                << k << ' ' << i;
        }
    }
    int stopped = 0;
    for (const ToolProxy& p : tool.particles()) {
        stopped += p.in_contact() ? 1 : 0;
        // The sheet's edge may press in any direction across it.
        if (p.in_contact() && p.contacts.plane[0].touched.feature == Feature::Face) {
            EXPECT_LT(p.contacts.plane[0].normal.z, -0.99);
            EXPECT_GT(glm::length(p.constrained_goal - p.goal), 0.01);
        }
    }
    EXPECT_GE(stopped, 3);
}

TEST(ClosingHand, IsTheOnlyToolThatCanClose) {
    EXPECT_THROW((void)make_tool(settings_of(ToolShape::Rod, 0.5)), std::invalid_argument);
    EXPECT_THROW((void)make_tool(settings_of(ToolShape::Hand, 1.5)), std::invalid_argument);
    EXPECT_TRUE(make_tool(settings_of(ToolShape::Rod)).joints.empty());
}

}  // namespace
}  // namespace haptic::sim
