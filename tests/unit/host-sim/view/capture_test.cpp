// Captured descriptions, snapshots and samples match the simulation.
#include "view/capture.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <string>

#include "haptic/sim/scene.hpp"
#include "haptic/sim/simulation.hpp"
#include "tool/tool_proxies.hpp"
#include "view/live_parameters.hpp"

namespace haptic::sim::view {
namespace {

class Capture : public testing::TestWithParam<const char*> {
  protected:
    void run_until_touched() {
        for (int k = 0; k < 400 && !result.in_contact; ++k) {
            result = simulation.step(simulation.scripted_input(time_ns));
            time_ns += nanoseconds(result.step);
        }
        ASSERT_TRUE(result.in_contact);
    }

    Simulation simulation{read_scene(open_scene(GetParam()), GetParam())};
    StepResult result;
    std::int64_t time_ns = 0;
};

TEST_P(Capture, DescribesEveryPartOfTheScene) {
    const SceneDescription scene = describe(simulation);
    EXPECT_EQ(scene.name, GetParam());
    EXPECT_EQ(scene.text, simulation.scene().description);
    EXPECT_EQ(scene.scenes.size(), built_in_scenes().size());
    std::size_t vertices = 0;
    std::size_t triangles = 0;
    std::size_t particles = 0;
    for (const BodyDescription& body : scene.bodies) {
        EXPECT_EQ(body.first_vertex, vertices);
        EXPECT_EQ(body.first_particle, particles);
        for (const Triangle& triangle : body.triangles) {
            for (const std::uint32_t corner : triangle) {
                ASSERT_LT(corner, body.vertices);
            }
        }
        vertices += body.vertices;
        triangles += body.triangles.size();
        particles += body.particles;
    }
    EXPECT_EQ(vertices, simulation.vertices().size());
    EXPECT_EQ(triangles, simulation.mesh().triangles.size());
    EXPECT_EQ(particles, simulation.model().size());
    EXPECT_EQ(scene.semi_axes.size(), particles);
    EXPECT_EQ(scene.groups.size(), simulation.model().groups.size());
    EXPECT_EQ(scene.tool_vertices, simulation.tool().mesh().vertices.size());
    EXPECT_EQ(scene.proxy_radii.size(), simulation.tool().particles().size());
    EXPECT_EQ(scene.ground_height.has_value(), simulation.scene().collisions.ground);
}

TEST_P(Capture, CapturesTheCurrentStateOfTheSimulation) {
    run_until_touched();
    SceneSnapshot moment;
    make_room(simulation, moment);
    capture(simulation, result, moment);
    EXPECT_EQ(moment.step, simulation.steps());
    EXPECT_NEAR(moment.time, static_cast<double>(simulation.steps()) * simulation.scene().solver.step, 1e-12);
    EXPECT_EQ(moment.vertices, simulation.vertices());
    EXPECT_EQ(moment.particles, simulation.model().position);
    EXPECT_EQ(moment.orientations, simulation.model().orientation);
    EXPECT_EQ(moment.tool_vertices, simulation.tool().vertices());
    EXPECT_EQ(moment.force, result.force);
    EXPECT_EQ(moment.hand_torque, result.hand_torque);
    EXPECT_EQ(moment.tool.position, result.proxy);
    EXPECT_EQ(moment.hip.position, result.hip);
    EXPECT_EQ(moment.depth, result.depth);
    EXPECT_TRUE(moment.in_contact);
    ASSERT_EQ(moment.proxies.size(), simulation.tool().particles().size());
    std::size_t touching = 0;
    for (std::size_t i = 0; i < moment.proxies.size(); ++i) {
        EXPECT_EQ(moment.proxies[i].position, simulation.tool().particles()[i].position);
        EXPECT_EQ(moment.proxies[i].radius, simulation.tool().particles()[i].radius);
        touching += moment.proxies[i].touches ? 1u : 0u;
    }
    EXPECT_EQ(touching, result.collided);
}

TEST_P(Capture, CapturesThePlanesSentToTheHapticLoop) {
    run_until_touched();
    SceneSnapshot moment;
    capture(simulation, result, moment);
    const ContactFrame& frame = simulation.frame();
    const Workspace& workspace = simulation.workspace();
    std::size_t next = 0;
    for (std::uint32_t i = 0; i < frame.proxy_count; ++i) {
        for (std::uint32_t p = 0; p < frame.proxies[i].plane_count; ++p, ++next) {
            ASSERT_LT(next, moment.planes.size());
            const PlaneView& shown = moment.planes[next];
            EXPECT_EQ(shown.proxy, i);
            // A point of the plane, mapped to the device, lies on the plane that was sent.
            const Vec3 point = workspace.to_device(shown.offset * shown.normal);
            const ContactPlane& sent = frame.proxies[i].planes[p];
            EXPECT_NEAR(glm::dot(to_vec3(sent.normal), point), sent.offset, 1e-12);
            EXPECT_NEAR(shown.velocity * workspace.settings().scale, sent.velocity, 1e-12);
        }
    }
    EXPECT_EQ(next, moment.planes.size());
    EXPECT_GT(next, 0u);
}

TEST_P(Capture, SamplesTheResultOfAStep) {
    run_until_touched();
    result.times.ccd_ns = 1500;
    const StepSample sample = sample_of(result);
    EXPECT_EQ(sample.time, result.time);
    EXPECT_FLOAT_EQ(sample.force, static_cast<float>(glm::length(result.hand_force)));
    EXPECT_FLOAT_EQ(sample.depth, static_cast<float>(result.depth));
    EXPECT_FLOAT_EQ(sample.ccd_us, 1.5F);
}

TEST_P(Capture, CapturesTheForcesOfTheContacts) {
    run_until_touched();
    SceneSnapshot moment;
    capture(simulation, result, moment);
    double fastest = 0.0;  // m/s
    for (const PlaneView& plane : moment.planes) {
        fastest = std::max(fastest, std::abs(plane.velocity));
    }
    const double motion = 1e-3 + fastest * simulation.scene().solver.step;
    Vec3 sum(0.0);
    for (const ForceView& pressed : moment.forces) {
        ASSERT_GT(pressed.force, 0.0);
        ASSERT_LT(pressed.body, simulation.bodies().size());
        sum += pressed.force * pressed.normal;
        // The point is on the surface that the sphere touches, as far as that moves within a step.
        const ProxyView& proxy = moment.proxies[pressed.proxy];
        EXPECT_LT(glm::length(pressed.point - proxy.position), 1.5 * proxy.radius + motion);
    }
    // Without friction, and without a device that is owed something, the normal forces are the whole force.
    if (simulation.scene().contact.static_friction == 0.0) {
        EXPECT_GT(glm::length(sum), 0.0);
        EXPECT_LT(glm::length(sum - moment.force), 1e-9 * glm::length(sum));
    } else {
        EXPECT_GT(glm::dot(sum, moment.force), 0.0);
    }
}

INSTANTIATE_TEST_SUITE_P(Scenes, Capture, testing::Values("cloth-drop", "four-fish", "curtain-hand", "fish-grab"),
                         [](const auto& scene) {
                             std::string name(scene.param);
                             std::erase(name, '-');
                             return name;
                         });

Simulation simulation_of(const std::string& name) {
    return Simulation(read_scene(open_scene(name), name));
}

TEST(LiveParametersTest, MatchTheSceneAndStayWithinTheRangesOfItsFile) {
    const Simulation sphere = simulation_of("cloth-drop");
    const Simulation hand = simulation_of("curtain-hand");
    const auto has = [](const Simulation& simulation, const std::string& key) {
        const LiveParameters all(simulation);
        for (const ParameterDescription& one : all.descriptions()) {
            if (one.key == key) {
                return true;
            }
        }
        return false;
    };
    EXPECT_TRUE(has(sphere, "proxy.radius"));
    EXPECT_FALSE(has(hand, "proxy.radius"));  // its spheres have their own
    EXPECT_FALSE(has(sphere, "coupling.torque_stiffness"));
    for (const Simulation* simulation : {&sphere, &hand}) {
        const LiveParameters all(*simulation);
        ASSERT_LE(all.descriptions().size(), kMaxParameters);
        const auto values = all.values(simulation->settings());
        for (std::size_t k = 0; k < all.descriptions().size(); ++k) {
            const ParameterDescription& one = all.descriptions()[k];
            EXPECT_LE(one.min, values[k]) << one.key;
            EXPECT_GE(one.max, values[k]) << one.key;
            EXPECT_TRUE(!one.logarithmic || one.min > 0.0) << one.key;
            EXPECT_FALSE(one.label.empty()) << one.key;
            for (const double end : {one.min, one.max}) {
                const LiveSettings changed = all.with(simulation->settings(), k, end);
                EXPECT_NO_THROW(check(changed)) << one.key;
                EXPECT_NEAR(all.values(changed)[k], end, 1e-9 * std::fabs(end)) << one.key;
                // The value in a recording reads back to the same bits.
                EXPECT_EQ(assigned(simulation->settings(), all.assignment(changed, k)), changed) << one.key;
            }
        }
    }
}

TEST(LiveParametersTest, RateIsOneOverTheStep) {
    const Simulation simulation = simulation_of("cloth-drop");
    const LiveParameters all(simulation);
    for (std::size_t k = 0; k < all.descriptions().size(); ++k) {
        if (all.descriptions()[k].key == "solver.step") {
            EXPECT_EQ(all.values(simulation.settings())[k], 100.0);
            EXPECT_EQ(all.with(simulation.settings(), k, 500.0).step, 0.002);
            EXPECT_EQ(all.assignment(all.with(simulation.settings(), k, 500.0), k), "solver.step=0.002");
        }
    }
}

}  // namespace
}  // namespace haptic::sim::view
