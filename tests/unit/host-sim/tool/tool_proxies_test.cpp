#include "tool/tool_proxies.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "contact/verification.hpp"
#include "few_spheres.hpp"

namespace haptic::sim {
namespace {

using ::testing::HasSubstr;

constexpr double kProxyRadius = 0.02;  // m
constexpr double kStep = 0.01;         // s
constexpr Quat kLevel(1.0, 0.0, 0.0, 0.0);

/// A fixed square in a plane of constant y.
struct Sheet {
    explicit Sheet(double half, double height = 0.0, const Vec3& shift = Vec3(0.0))
        : vertices{Vec3{-half, height, -half} + shift, Vec3{-half, height, half} + shift,
                   Vec3{half, height, half} + shift, Vec3{half, height, -half} + shift} {
        tree.refit({vertices, vertices, triangles});
    }
    [[nodiscard]] MovingSurface surface() const { return {{vertices, vertices, triangles}, &tree}; }

    std::vector<Vec3> vertices;
    std::vector<Triangle> triangles{{0, 1, 2}, {0, 2, 3}};
    SweptTree tree{vertices, triangles};
};

void step(ToolProxies& tool, std::span<const MovingSurface> surfaces, const Pose& hip) {
    tool.set_goals(hip);
    tool.collect(surfaces);
    EXPECT_TRUE(tool.find_secure_positions());
    tool.pop_out();
    tool.find_equilibrium();
    tool.collect_speculative_planes(kStep);
}

ToolProxies::Settings proxy_settings(double friction = 0.0) {
    ToolProxies::Settings all;
    all.reach = 0.01;
    all.step = kStep;
    all.contact.static_friction = all.contact.dynamic_friction = friction;
    return all;
}

bool crossed(const ToolProxies& tool, const Sheet& sheet) {
    const std::array<SurfaceMotion, 1> moved{SurfaceMotion{sheet.vertices, sheet.vertices, sheet.triangles}};
    for (std::size_t i = 0; i < tool.particles().size(); ++i) {
        if (!tool.path(i).complete() || !find_crossings(moved, tool.path(i).knots()).empty()) {
            return true;
        }
    }
    return false;
}

TEST(ToolProxies, RejectsInvalidToolsWithAReason) {
    const auto refusal = [](const ToolModel& model) -> std::string {
        try {
            const ToolProxies tool(model, proxy_settings(), {});
        } catch (const std::invalid_argument& error) {
            return error.what();
        }
        return "taken";
    };
    EXPECT_THAT(refusal(ToolModel{}), HasSubstr("has 0 particles"));
    EXPECT_THAT(refusal(test::square_of_spheres(9, 0.1, kProxyRadius)), HasSubstr("has 81 particles"));
    EXPECT_THAT(refusal(test::loose_spheres({Vec3(0.0)}, 0.0)), HasSubstr("must be positive"));
    ToolModel model = test::loose_spheres({Vec3(0.0), Vec3(1.0)}, kProxyRadius);
    model.radius.pop_back();
    EXPECT_THAT(refusal(model), HasSubstr("1 radii"));
    EXPECT_EQ(refusal(one_sphere(kProxyRadius)), "taken");
}

TEST(ToolProxies, BendsAroundAnEdgeAndLeavesNoSphereInside) {
    // A narrow sheet stops the middle of a row of spheres while the hand moves on.
    const Sheet sheet(0.05);
    const std::array<MovingSurface, 1> surfaces{sheet.surface()};
    ToolProxies tool(test::square_of_spheres(5, 0.06, kProxyRadius, {.young_modulus = 3e3}), proxy_settings(),
                     {{0.0, 0.1, 0.0}, kLevel});
    tool.keep_paths(true);
    for (int i = 0; i < 60; ++i) {
        step(tool, surfaces, {{0.0, 0.1 - 0.005 * i, 0.0}, kLevel});
        EXPECT_FALSE(crossed(tool, sheet)) << i;
        EXPECT_GE(tool.particles()[12].position.y, 0.998 * kProxyRadius) << i;
    }
    // Where the row loses its balance and slides down both edges, the equilibrium is far for some steps; it is reached
    // when the hand stands still.
    for (int i = 0; i < 5; ++i) {
        step(tool, surfaces, {{0.0, 0.1 - 0.005 * 59, 0.0}, kLevel});
    }
    EXPECT_EQ(tool.effort().equilibrium_error, 0.0);
    const std::span<const ToolProxy> particles = tool.particles();
    EXPECT_TRUE(particles[12].in_contact());
    EXPECT_FALSE(particles[0].in_contact());
    // Bent: the neighbours of the middle one are held back, the corners lag less.
    EXPECT_GT(particles[11].position.y - particles[11].goal.y, 0.01);
    EXPECT_LT(particles[11].position.y, particles[12].position.y);
    EXPECT_LT(particles[0].position.y, particles[11].position.y);
}

TEST(ToolProxies, HasNoMemoryOfEarlierStepsInFreeSpace) {
    // Whatever its path, the tool is at the hip in its rest shape: no inertia.
    const std::array<MovingSurface, 0> nothing{};
    const ToolModel model = test::square_of_spheres(4, 0.06, kProxyRadius);
    ToolProxies straight(model, proxy_settings(), {});
    ToolProxies wild(model, proxy_settings(), {});
    const Pose last{{1.0, 2.0, 3.0}, glm::angleAxis(2.0, glm::normalize(Vec3(1, 2, 3)))};
    for (int i = 0; i < 10; ++i) {
        step(wild, nothing, {{0.3 * i, -0.7 * i, 5.0}, glm::angleAxis(0.9 * i, Vec3(0, 1, 0))});
    }
    step(straight, nothing, last);
    step(wild, nothing, last);
    for (std::size_t i = 0; i < model.radius.size(); ++i) {
        EXPECT_LT(glm::length(straight.particles()[i].position - wild.particles()[i].position), 1e-12);
        EXPECT_LT(glm::length(wild.particles()[i].position - wild.particles()[i].goal), 1e-12);
    }
    EXPECT_TRUE(wild.in_shape());
    EXPECT_LT(glm::length(wild.pose().position - last.position), 1e-12);
}

TEST(ToolProxies, EqualsTheSphereOfChapterFourWithASingleParticle) {
    // A particle at an offset from the grip moves like a single sphere whose device is at that offset.
    const Sheet sheet(1.0);
    const std::array<MovingSurface, 1> surfaces{sheet.surface()};
    const Vec3 offset(0.1, -0.05, 0.02);
    ToolProxies alone(one_sphere(kProxyRadius), proxy_settings(0.4), {offset + Vec3(0.0, 0.2, 0.0), kLevel});
    ToolProxies away(test::loose_spheres({offset}, kProxyRadius), proxy_settings(0.4), {{0.0, 0.2, 0.0}, kLevel});
    for (int i = 0; i < 50; ++i) {
        const Vec3 device(0.01 * i, 0.2 - 0.01 * i, 0.0);
        step(alone, surfaces, {device + offset, kLevel});
        step(away, surfaces, {device, kLevel});
        EXPECT_LT(glm::length(alone.particles()[0].position - away.particles()[0].position), 1e-12) << i;
        EXPECT_EQ(alone.particles()[0].in_contact(), away.particles()[0].in_contact()) << i;
        EXPECT_LT(glm::length(away.pose().position - (away.particles()[0].position - offset)), 1e-12) << i;
    }
    EXPECT_TRUE(away.particles()[0].in_contact());
}

TEST(ToolProxies, ContactDoesNotFlickerWhileTheToolRests) {
    // Pressed at a tilt: the spheres that the others lift off are not in contact, in every step alike.
    const Sheet sheet(1.0);
    const std::array<MovingSurface, 1> surfaces{sheet.surface()};
    const Pose hip{{0.0, 0.0, 0.0}, glm::angleAxis(0.25, glm::normalize(Vec3(1, 0, 0.3)))};
    ToolProxies tool(test::square_of_spheres(5, 0.05, kProxyRadius), proxy_settings(), {{0.0, 0.3, 0.0}, kLevel});
    for (int k = 0; k < 4; ++k) {
        step(tool, surfaces, hip);
    }
    std::vector<Vec3> force;
    std::size_t lifted = 0;
    for (std::size_t i = 0; i < tool.particles().size(); ++i) {
        force.push_back(tool.force_on(i));
        const ToolProxy& p = tool.particles()[i];
        EXPECT_EQ(p.in_contact(), p.position.y < 1.000001 * kProxyRadius) << i;
        lifted += p.goal.y < kProxyRadius && !p.in_contact() ? 1u : 0u;
    }
    EXPECT_GT(lifted, 0u);
    for (int k = 0; k < 50; ++k) {
        step(tool, surfaces, hip);
        for (std::size_t i = 0; i < tool.particles().size(); ++i) {
            EXPECT_EQ(tool.particles()[i].in_contact(), force[i].y > 0.0) << k;
            EXPECT_LT(glm::length(tool.force_on(i) - force[i]), 1e-9) << k;  // N
        }
    }
}

TEST(ToolProxies, FrictionHoldsTouchingSpheresUntilTheHandPullsHarderThanItPresses) {
    const Sheet sheet(1.0);
    const std::array<MovingSurface, 1> surfaces{sheet.surface()};
    ToolProxies tool(test::square_of_spheres(4, 0.05, kProxyRadius), proxy_settings(1.0), {{0.0, 0.1, 0.0}, kLevel});
    for (int i = 0; i <= 10; ++i) {
        step(tool, surfaces, {{0.0, 0.1 - 0.009 * i, 0.0}, kLevel});  // 1 cm into it
    }
    std::vector<Vec3> stuck;
    for (const ToolProxy& p : tool.particles()) {
        EXPECT_TRUE(p.sticks());
        stuck.push_back(p.position);
    }
    for (int i = 0; i < 100; ++i) {
        step(tool, surfaces, {{0.00005 * i, 0.01, 0.0}, glm::angleAxis(0.0002 * i, Vec3(0, 1, 0))});
    }
    for (std::size_t i = 0; i < stuck.size(); ++i) {
        EXPECT_LT(glm::length(tool.particles()[i].position - stuck[i]), 1e-6) << i;  // does not creep
    }
    for (int i = 0; i < 40; ++i) {
        step(tool, surfaces, {{0.005 + 0.001 * i, 0.01, 0.0}, kLevel});
    }
    for (std::size_t i = 0; i < stuck.size(); ++i) {
        EXPECT_GT(tool.particles()[i].position.x - stuck[i].x, 0.02) << "until the hand pulls harder than it presses";
        EXPECT_FALSE(tool.particles()[i].sticks());
    }
}

}  // namespace
}  // namespace haptic::sim
