#include "tool/contact_coupling.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <utility>
#include <vector>

#include "haptic/sim/skin.hpp"
#include "simd/projection.hpp"
#include "tool/tool_proxies.hpp"

namespace haptic::sim {
namespace {

constexpr double kToolRadius = 0.02;  // m, of the tool's sphere
constexpr Quat kLevelTool(1.0, 0.0, 0.0, 0.0);

/// Passes the solver's calls on to a coupling and measures its force of the last sub-step.
class Measured final : public SolverContacts {
  public:
    Measured(ContactCoupling& coupling, const ParticleModel& model) : coupling_(coupling), model_(model) {}
    void begin(const ParticleModel& start, ElasticBodies& elastic, const MovingParticles& now, double h) override {
        coupling_.begin(start, elastic, now, h);
    }
    void project(const ParticleModel& start, const MovingParticles& now, double h) override {
        coupling_.project(start, now, h);
    }
    void finish(const ParticleModel& start, const MovingParticles& now, double h) override {
        // m dx / h^2 of what the coupling adds to the displacements by contacts.
        const Vec3 before = impulse_of(now);
        coupling_.finish(start, now, h);
        force_ = -(impulse_of(now) - before) / (h * h);
    }
    /// N, on the tool.
    [[nodiscard]] const Vec3& force() const { return force_; }

  private:
    [[nodiscard]] Vec3 impulse_of(const MovingParticles& now) const {
        Vec3 sum(0.0);
        for (std::size_t i = 0; i < model_.size(); ++i) {
            sum += model_.mass[i] * Vec3(now.pushed[i].number[0], now.pushed[i].number[1], now.pushed[i].number[2]);
        }
        return sum;
    }

    ContactCoupling& coupling_;
    const ParticleModel& model_;
    Vec3 force_{0.0};
};

/// A horizontal triangle whose corners stand on springs above fixed particles, and a spherical tool above its centre.
/// Without gravity the corners rest at y = 0.
class SprungTriangle : public ::testing::Test {
  protected:
    struct Settings {
        double spring = 300.0;  // N/m, of one corner
        double mass = 0.002;    // kg, of one corner
        double step = 0.01;     // s
        int substeps = 1;
        int iterations = 5;
        double drag = 20.0;  // 1/s
        CouplingSettings coupling{.stiffness = 500.0};
        double friction = 0.0;
    };

    void build(const Settings& with) {
        settings = with;
        model = {};
        mesh = {};
        for (int k = 0; k < 3; ++k) {
            // Corners of an equilateral triangle, 0.1 m about the origin.
            const std::array<Vec3, 3> corner{Vec3{0.1, 0.0, 0.0}, Vec3{-0.05, 0.0, -0.0866}, Vec3{-0.05, 0.0, 0.0866}};
            model.add(corner[static_cast<std::size_t>(k)], with.mass, 0.005);
            mesh.vertices.push_back(model.position.back());
        }
        mesh.triangles = {{0, 1, 2}};
        for (std::uint32_t k = 0; k < 3; ++k) {
            model.add(model.position[k] - Vec3(0.0, 0.1, 0.0), 1.0, 0.005);
            model.pinned[3 + k] = 1;
            model.links.push_back({k, 3 + k, 0.1, 1.0, 1.0 / with.spring});
        }
        start = end = mesh.vertices;
        bodies = {{"triangle", 0, 0, mesh}};
        masks.clear();
        masks.emplace_back(mesh, skin_of_particles(3), model.size(), 1e-6);
        tree = std::make_unique<SweptTree>(mesh.vertices, mesh.triangles);
        solver = std::make_unique<ParticleSolver>(model, SolverSettings{.step = with.step,
                                                                        .substeps = with.substeps,
                                                                        .iterations = with.iterations,
                                                                        .gravity = Vec3(0.0),
                                                                        .drag = with.drag});
        ToolProxies::Settings tool_settings;
        tool_settings.reach = 0.01;
        tool_settings.step = with.step;
        tool_settings.springs = {with.coupling.stiffness, 0.0};
        tool_settings.contact.static_friction = tool_settings.contact.dynamic_friction = with.friction;
        tool = std::make_unique<ToolProxies>(one_sphere(kToolRadius), tool_settings, Pose{{0.0, 0.1, 0.0}, kLevelTool});
        coupling = std::make_unique<ContactCoupling>(model);
        measured = std::make_unique<Measured>(*coupling, model);
    }

    /// Lets the triangle fly freely, without springs, at `speed` (m/s) upward.
    void release(double speed) {
        model.links.clear();
        solver = std::make_unique<ParticleSolver>(model, SolverSettings{.step = settings.step,
                                                                        .substeps = settings.substeps,
                                                                        .iterations = settings.iterations,
                                                                        .gravity = Vec3(0.0)});
        for (int k = 0; k < 3; ++k) {
            model.velocity[static_cast<std::size_t>(k)] = {0.0, speed, 0.0};
        }
    }

    /// m, of the goal behind the plane of the triangle, whose three corners weigh the same.
    [[nodiscard]] double depth_of(const Vec3& goal) const { return mean_of(model.position).y + kToolRadius - goal.y; }
    [[nodiscard]] static Vec3 mean_of(const std::vector<Vec3>& values) {
        return (values[0] + values[1] + values[2]) / 3.0;
    }

    /// A step with the sphere's goal at `goal`.
    CoupledForce step(const Vec3& goal) {
        tree->refit({start, end, mesh.triangles});
        const std::array<MovingSurface, 1> surfaces{MovingSurface{{start, end, mesh.triangles}, tree.get()}};
        tool->set_goals({goal, kLevelTool});
        tool->collect(surfaces);
        EXPECT_TRUE(tool->find_secure_positions());
        tool->pop_out();
        tool->find_equilibrium();
        tool->collect_speculative_planes(settings.step);
        ContactSettings contact;
        contact.static_friction = contact.dynamic_friction = settings.friction;
        coupling->begin_step(*tool,
                             {.coupling = settings.coupling,
                              .contact = contact,
                              .gain = 1.0,
                              .owed_force = owed_force,
                              .length = settings.step},
                             {.bodies = bodies, .masks = masks}, model);
        solver->step(model, {}, {coupling->is_active() ? measured.get() : nullptr});
        coupling->end_step(model);
        start = end;
        std::copy_n(model.position.begin(), 3, end.begin());
        return coupling->force();
    }

    Settings settings;
    Vec3 owed_force{0.0};  // N
    ParticleModel model;
    TriangleMesh mesh;
    std::vector<Vec3> start;
    std::vector<Vec3> end;
    std::vector<SceneBody> bodies;
    std::vector<PressureMask> masks;
    std::unique_ptr<SweptTree> tree;
    std::unique_ptr<ParticleSolver> solver;
    std::unique_ptr<ToolProxies> tool;
    std::unique_ptr<ContactCoupling> coupling;
    std::unique_ptr<Measured> measured;
};

TEST_F(SprungTriangle, AStillHandFeelsItsSpringInSeriesWithTheBody) {
    // Each corner takes a third of the force: the surface's spring is three corners' springs.
    constexpr double kDepth = 0.015;
    for (const double stiffness : {50.0, 500.0, 2000.0, 50000.0}) {
        for (const int substeps : {1, 5, 20}) {
            // As many passes as it takes to solve the body's own springs exactly.
            build({.substeps = substeps, .iterations = 300, .coupling = {.stiffness = stiffness}});
            const double expected = kDepth / (1.0 / stiffness + 1.0 / (3.0 * settings.spring));
            for (int i = 0; i < 400; ++i) {
                const CoupledForce made = step({0.0, kToolRadius - kDepth * std::min(1.0, i / 20.0), 0.0});
                if (i >= 300) {
                    ASSERT_NEAR(made.force.y, expected, 1e-4 * expected)
                        << stiffness << " N/m, " << substeps << " sub-steps, step " << i;
                }
            }
        }
    }
}

TEST_F(SprungTriangle, HasNoStepAtWhichAStiffSpringDivergesOnALightBody) {
    // k h^2 / m = 250 for the lightest; an explicit spring diverges beyond 4. No drag, so that nothing else damps it.
    for (const double mass : {0.0002, 0.002}) {
        build({.spring = 10.0,
               .mass = mass,
               .step = 0.01,
               .iterations = 1,
               .drag = 0.0,
               .coupling = {.stiffness = 2000.0}});
        // In series with the body's three springs it would make 0.44 N at most; one pass makes these softer.
        double sum = 0.0;
        for (int i = 0; i < 1000; ++i) {
            const double depth = 0.01 + 0.005 * std::sin(0.3 * i);
            const CoupledForce made = step({0.0, kToolRadius - depth, 0.0});
            ASSERT_GE(made.force.y, 0.0) << i;
            ASSERT_LT(made.force.y, 2.0) << "more than four times that, step " << i;
            sum += i < 100 ? 0.0 : made.force.y;
        }
        EXPECT_GT(sum / 900.0, 0.01) << "the body was not touched";
    }
}

TEST_F(SprungTriangle, TheBodyReceivesTheOppositeImpulse) {
    // The springs' forces are internal to corners and fixed particles; without them only the coupling changes momentum.
    build({.substeps = 3,
           .iterations = 3,
           .drag = 0.0,
           .coupling = {.stiffness = 500.0, .hunt_crossley_damping = 2.0},
           .friction = 0.5});
    release(0.0);
    int pressed = 0;
    for (int i = 0; i < 12; ++i) {
        const Vec3 before = linear_momentum(model);
        const CoupledForce made = step({0.001 * i, kToolRadius - 0.001 * i * i, 0.0});
        const Vec3 gained = linear_momentum(model) - before;
        EXPECT_LT(glm::length(gained + settings.step * made.force), 1e-15) << i;  // kg m/s
        pressed += made.force.y > 0.0 ? 1 : 0;
    }
    EXPECT_GT(pressed, 5);
}

TEST_F(SprungTriangle, ReportsNoMoreWorkThanTheBodyHasLost) {
    // A free body changes its kinetic energy by the coupling alone. An implicit sub-step of the impulse J takes from
    // the body up to |J|^2 / 2 m more than it gives to the tool, m the mass of a corner. With what is owed, and with
    // friction.
    for (const double owed : {0.0, 0.5, -0.3}) {
        build({.step = 0.002,
               .substeps = 10,
               .iterations = 3,
               .drag = 0.0,
               .coupling = {.stiffness = 500.0, .hunt_crossley_damping = 1.0},
               .friction = 0.5});
        release(0.3);
        owed_force = {0.0, owed, 0.0};
        double given = 0.0;
        double largest = 0.0;
        for (int i = 0; i < 60; ++i) {
            // The hand moves aside, so that friction does work too.
            const double before = kinetic_energy(model);
            const double force = glm::length(step({0.0005 * i, kToolRadius + 0.002, 0.0}).force);
            const double impulse = settings.step * (force + 2.0 * std::fabs(owed));
            const double lost = before - kinetic_energy(model);
            // At most all of J in one sub-step.
            ASSERT_LE(coupling->work(), lost + 1e-12) << owed << " N, step " << i;
            ASSERT_GE(coupling->work(), lost - impulse * impulse / (2.0 * settings.mass) - 1e-12)
                << owed << " N, " << i;
            given += coupling->work();
            largest = std::max(largest, std::fabs(given));
        }
        EXPECT_GT(largest, 0.1 * 0.5 * 3.0 * settings.mass * 0.3 * 0.3)
            << "the body must meet the hand, or this proves nothing";
    }
}

TEST_F(SprungTriangle, ReportsTheWorkOfADrivenSurface) {
    // Nothing can stop a driven surface: it does l times its way, l = k b, on a still hand.
    build({.substeps = 50, .drag = 0.0});
    std::fill(model.pinned.begin(), model.pinned.end(), std::uint8_t{1});
    release(0.0);
    constexpr double kSpeed = 0.1;  // m/s
    const Vec3 goal(0.0, kToolRadius + 0.001, 0.0);
    double work = 0.0;
    double begin =
        -1.0;  // m, depth at which it begins to push: a plane that is reached within a step pushes in the next
    for (int i = 0; i < 10; ++i) {
        for (std::size_t k = 0; k < 3; ++k) {
            model.velocity[k] = {0.0, kSpeed, 0.0};
        }
        const double depth = depth_of(goal);
        const double force = step(goal).force.y;
        begin = begin < 0.0 && force > 0.0 ? depth : begin;
        work += coupling->work();
    }
    const double depth = depth_of(goal);
    ASSERT_NEAR(depth, 0.009, 1e-9);
    ASSERT_GE(begin, 0.0);
    ASSERT_LE(begin, 0.001 + 1e-9);
    // Each force is that at the end of its sub-step: the sum exceeds the integral by at most one sub-step's work.
    const double gained = 0.5 * 500.0 * (depth * depth - begin * begin);
    EXPECT_GE(work, gained * (1.0 - 1e-6));
    EXPECT_LE(work, gained + 500.0 * depth * kSpeed * settings.step / settings.substeps);
}

TEST_F(SprungTriangle, FrictionReachesItsConeAndNoFurther) {
    // A body that cannot move: the force is that of the springs alone.
    build({.friction = 0.4});
    std::fill(model.pinned.begin(), model.pinned.end(), std::uint8_t{1});
    constexpr double kDepth = 0.004;
    (void)step({0.0, kToolRadius + 0.001, 0.0});
    (void)step({0.0, kToolRadius - kDepth, 0.0});
    for (int i = 1; i < 30; ++i) {
        const double aside = 0.0002 * i;
        const CoupledForce made = step({aside, kToolRadius - kDepth, 0.0});
        EXPECT_NEAR(made.force.y, 500.0 * kDepth, 1e-9) << i;
        EXPECT_NEAR(made.force.x, -500.0 * std::min(aside, 0.4 * kDepth), 0.01 * 500.0 * 0.4 * kDepth) << i;
    }
}

TEST_F(SprungTriangle, DampingTakesEnergyFromABodyThatMeetsTheHand) {
    // The body flies against a still hand and comes back: without damping with its speed, with damping slower.
    const auto rebound = [&](double damping) {
        build({.step = 0.001,
               .substeps = 8,
               .iterations = 1,
               .drag = 0.0,
               .coupling = {.stiffness = 500.0, .hunt_crossley_damping = damping}});
        release(1.0);
        for (int i = 0; i < 60; ++i) {
            (void)step({0.0, kToolRadius + 0.005, 0.0});
        }
        return -model.velocity[0].y;
    };
    const double undamped = rebound(0.0);
    EXPECT_NEAR(undamped, 1.0, 0.05);  // implicit Euler loses a little
    const double damped = rebound(1.0);
    EXPECT_LT(damped, 0.9 * undamped);
    EXPECT_GT(damped, 0.0);
}

TEST_F(SprungTriangle, DampingInParallelWithTheSpringsHasItsRateOfDecay) {
    // A body of mass m between springs of its own, K, and the coupling, k, that never loses contact:
    //     m y'' = -K y - k (y + p) - tau k y',   y + p the depth.   It decays at the rate tau k / 2 m.
    constexpr double kMass = 0.02;     // kg, of one corner
    constexpr double kSpring = 200.0;  // N/m, of one corner
    constexpr double kPressed = 0.01;  // m, p
    constexpr double kStiffness = 500.0;
    const double rest = -kStiffness * kPressed / (kStiffness + 3.0 * kSpring);
    const double frequency = std::sqrt((kStiffness + 3.0 * kSpring) / (3.0 * kMass));  // 1/s
    // 1/s, of the amplitude of y - rest, from position and velocity at both ends of 0.2 s.
    const auto decay = [&](double damping_time) {
        build({.spring = kSpring,
               .mass = kMass,
               .step = 0.002,
               .substeps = 20,
               .iterations = 1,
               .drag = 0.0,
               .coupling = {.stiffness = kStiffness, .damping_time = damping_time}});
        for (std::size_t k = 0; k < 3; ++k) {
            model.position[k].y = start[k].y = end[k].y = 0.5 * rest;
        }
        const auto amplitude = [&] {
            return std::hypot(mean_of(model.position).y - rest, mean_of(model.velocity).y / frequency);
        };
        (void)step({0.0, kToolRadius - kPressed, 0.0});
        const double before = amplitude();
        for (int i = 0; i < 100; ++i) {
            (void)step({0.0, kToolRadius - kPressed, 0.0});
        }
        return std::log(before / amplitude()) / 0.2;
    };
    const double numerical = decay(0.0);
    EXPECT_LT(numerical, 1.0);  // 1/s, of implicit Euler: half of frequency^2 times the sub-step is 0.92
    for (const double damping_time : {0.001, 0.003}) {
        const double expected = damping_time * kStiffness / (2.0 * 3.0 * kMass);
        EXPECT_NEAR(decay(damping_time) - numerical, expected, 0.05 * expected) << damping_time << " s";
    }
}

TEST_F(SprungTriangle, ASpringWithTheMeanLeadMakesTheForceOfTheStep) {
    // One sub-step: k (b + lead) at its end.
    for (const auto& [damping, damping_time] : {std::pair{0.0, 0.0}, {0.7, 0.0}, {5.0, 0.0}, {0.0, 0.005}}) {
        build({.mass = 0.02,
               .drag = 0.0,
               .coupling = {.stiffness = 500.0, .hunt_crossley_damping = damping, .damping_time = damping_time}});
        int pressed = 0;
        for (int i = 0; i < 60; ++i) {
            const Vec3 goal(0.0, kToolRadius + 0.002 - 0.01 * std::sin(0.3 * i), 0.0);
            const double force = step(goal).force.y;
            const Lead& lead = coupling->lead(0);
            const double way = depth_of(goal);
            const double depth = (force > 0.0 ? way : std::max(0.0, way)) + lead.end.y;
            // The solver keeps a share of 1e-7 of the compliance for each row.
            EXPECT_NEAR(500.0 * depth, force, 1e-6 * (1.0 + force))
                << damping << " s/m, " << damping_time << " s, step " << i;
            EXPECT_TRUE(damping > 0.0 || damping_time > 0.0 || lead.end == Vec3(0.0)) << i;
            pressed += force > 0.1 ? 1 : 0;
        }
        EXPECT_GT(pressed, 15);
    }
}

TEST_F(SprungTriangle, ASurfaceThatRecedesTooFastToPushLeadsBackToTheGoal) {
    // c v = 2.5 takes the whole force; the goal stays behind the surface for three steps of 5 mm.
    build({.mass = 0.2, .drag = 0.0, .coupling = {.stiffness = 500.0, .hunt_crossley_damping = 5.0}});
    const Vec3 goal(0.0, kToolRadius - 0.018, 0.0);
    std::fill(model.pinned.begin(), model.pinned.end(), std::uint8_t{1});
    ASSERT_NEAR((step(goal), step(goal).force.y), 500.0 * 0.018, 1e-5);
    std::fill_n(model.pinned.begin(), 3, std::uint8_t{0});
    release(-0.5);
    for (int i = 0; i < 3; ++i) {
        EXPECT_EQ(step(goal).force, Vec3(0.0)) << i;
        EXPECT_GT(depth_of(goal), 0.002) << i;
        EXPECT_NEAR(depth_of(goal) + coupling->lead(0).end.y, 0.0, 1e-12) << i;
    }
}

TEST_F(SprungTriangle, LeadsByTheMeansOfThisStepAndTheLast) {
    // An approach against a still hand, with sub-steps: the lead is c b v at the speeds between both ends of the step.
    constexpr double kDamping = 0.7;  // s/m
    build(
        {.mass = 0.2, .substeps = 4, .drag = 0.0, .coupling = {.stiffness = 500.0, .hunt_crossley_damping = kDamping}});
    release(0.3);
    const Vec3 goal(0.0, kToolRadius + 0.006, 0.0);
    Vec3 last(0.0);
    int compared = 0;
    for (int i = 0; i < 25; ++i) {
        const double depth_before = depth_of(goal);
        const double speed_before = mean_of(model.velocity).y;
        (void)step(goal);
        const Lead& lead = coupling->lead(0);
        EXPECT_EQ(lead.start, last) << i;
        if (depth_before > 0.0 && depth_of(goal) > 0.0) {
            const double before = kDamping * depth_before * speed_before;
            const double after = kDamping * depth_of(goal) * mean_of(model.velocity).y;
            EXPECT_GE(lead.end.y, std::min(before, after) - 1e-4) << i;
            EXPECT_LE(lead.end.y, std::max(before, after) + 1e-4) << i;
            ++compared;
        }
        last = lead.end;
    }
    EXPECT_GT(compared, 5);
}

TEST_F(SprungTriangle, DoesNothingWhileTheToolIsUncoupledOrFar) {
    build({});
    EXPECT_EQ(step({0.0, 0.1, 0.0}).force, Vec3(0.0));
    EXPECT_FALSE(coupling->is_active());
    settings.coupling.stiffness = 0.0;
    EXPECT_EQ(step({0.0, 0.0, 0.0}).force, Vec3(0.0));
    EXPECT_FALSE(coupling->is_active());
}

}  // namespace
}  // namespace haptic::sim
