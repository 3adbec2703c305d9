// Bodies wait for their surfaces: whatever crushes them, their particles do not leave them behind, and what waits keeps
// its momenta and gains no energy.
#include "scene/waiting_bodies.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <glm/geometric.hpp>
#include <limits>
#include <ostream>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "collision/surface_paths.hpp"
#include "haptic/sim/simulation.hpp"
#include "haptic/sim/skin.hpp"
#include "scene/assembly.hpp"
#include "scene/hostile_hand.hpp"
#include "scene_with.hpp"

namespace haptic::sim {
namespace {

constexpr double kEdge = 0.00875;  // m, about the mean of a fish

/// Four fish after a step that moved each particle by some way of its own.
class FourFish {
  public:
    FourFish() : assembly(test::scene_with("four-fish")), before(assembly.model) {
        std::mt19937 random(5);
        std::normal_distribution<double> number(0.0, 1.0);
        const auto vector = [&](double scale) { return scale * Vec3{number(random), number(random), number(random)}; };
        for (std::size_t b = 0; b < assembly.bodies.size(); ++b) {
            const Vec3 common = vector(0.5);
            each_particle(b, [&](std::size_t i) {
                assembly.model.velocity[i] = common + vector(0.5);
                assembly.model.position[i] += 0.01 * assembly.model.velocity[i];
            });
        }
    }
    struct Sums {
        Vec3 linear{0.0};   // kg m/s
        Vec3 angular{0.0};  // kg m^2/s, about the origin
        double energy = 0.0;
    };
    [[nodiscard]] Sums sums(std::span<const std::size_t> bodies) const {
        Sums sums;
        const ParticleModel& model = assembly.model;
        for (const std::size_t b : bodies) {
            each_particle(b, [&](std::size_t i) {
                sums.linear += model.mass[i] * model.velocity[i];
                sums.angular += model.mass[i] * glm::cross(model.position[i], model.velocity[i]);
                sums.energy += 0.5 * model.mass[i] * glm::dot(model.velocity[i], model.velocity[i]);
            });
        }
        return sums;
    }
    [[nodiscard]] double mass(std::size_t body) const {
        double mass = 0.0;
        each_particle(body, [&](std::size_t i) { mass += assembly.model.mass[i]; });
        return mass;
    }
    template <class Visit>
    void each_particle(std::size_t body, const Visit& visit) const {
        const Skinner::Part part = assembly.part(body);
        for (std::size_t i = part.first_particle; i < part.first_particle + part.particles; ++i) {
            visit(i);
        }
    }

    Assembly assembly;
    ParticlePlaces before;
};

void expect_same_momenta(const FourFish::Sums& now, const FourFish::Sums& before) {
    for (int k = 0; k < 3; ++k) {
        EXPECT_NEAR(now.linear[k], before.linear[k], 1e-12);
        EXPECT_NEAR(now.angular[k], before.angular[k], 1e-12);
    }
    EXPECT_LT(now.energy, before.energy);
}

const WaitingBodies::Surroundings kStep{.step = 0.01};  // without a floor
const std::vector<std::uint8_t> kAll(4, 1);
// The first three touch one another in a row, the last is elsewhere.
const std::vector<Bounds> kRow = {{{0.0, 0.0, 0.0}, {1.0, 1.0, 1.0}},
                                  {{0.9, 0.0, 0.0}, {1.9, 1.0, 1.0}},
                                  {{1.8, 0.0, 0.0}, {2.8, 1.0, 1.0}},
                                  {{9.0, 0.0, 0.0}, {9.9, 1.0, 1.0}}};

TEST(WaitingBodies, WaitTogetherWithWhatTheyMayHaveMet) {
    FourFish fish;
    WaitingBodies waiting(fish.assembly, 0.01 / kEdge);
    waiting.begin_step(std::vector<double>{0.0, 0.0, 0.02, 0.0});
    // The third lagged as far before.
    EXPECT_FALSE(waiting.find(std::vector<double>{0.01, 0.0, 0.02, 0.0}, kAll, kRow));
    ASSERT_TRUE(waiting.find(std::vector<double>{0.0, 0.011, 0.0, 0.0}, kAll, kRow));
    const std::uint32_t none = WaitingBodies::kNone;
    EXPECT_TRUE(std::ranges::equal(waiting.group_of(), std::vector<std::uint32_t>{1, 1, 1, none}));
    // Without boxes they are alone.
    ASSERT_TRUE(waiting.find(std::vector<double>{0.0, 0.011, 0.0, 0.0}, kAll, {}));
    EXPECT_TRUE(std::ranges::equal(waiting.group_of(), std::vector<std::uint32_t>{none, 1, none, none}));
    // What may not wait unites nothing.
    ASSERT_TRUE(waiting.find(std::vector<double>{0.0, 0.011, 0.0, 0.011}, std::vector<std::uint8_t>{1, 1, 0, 1}, kRow));
    EXPECT_TRUE(std::ranges::equal(waiting.group_of(), std::vector<std::uint32_t>{1, 1, none, 3}));
    EXPECT_FALSE(waiting.find(std::vector<double>{0.0, 0.011, 0.0, 0.0}, std::vector<std::uint8_t>{1, 0, 1, 1}, kRow));
}

TEST(WaitingBodies, GoTheMeanOfTheirWaysAsOneRigidBody) {
    FourFish fish;
    WaitingBodies waiting(fish.assembly, 0.01 / kEdge);
    ASSERT_TRUE(waiting.find(std::vector<double>{0.0, 0.011, 0.0, 0.0}, kAll, kRow));
    const std::vector<std::size_t> united = {0, 1, 2};
    const std::vector<std::size_t> other = {3};
    const FourFish::Sums before = fish.sums(united);
    const FourFish::Sums before_of_other = fish.sums(other);
    const RigidMotion motion = waiting.let_wait(1, fish.before, kStep, fish.assembly);
    expect_same_momenta(fish.sums(united), before);
    for (const std::size_t b : united) {
        fish.each_particle(b, [&](std::size_t i) {
            EXPECT_LT(glm::length(fish.assembly.model.position[i] - motion(fish.before.position[i])), 1e-15);
            EXPECT_EQ(fish.assembly.model.angular_velocity[i], fish.assembly.model.angular_velocity[0]);
        });
    }
    EXPECT_EQ(fish.sums(other).angular, before_of_other.angular);
    // The least energy that a body with these momenta can have.
    const double energy = fish.sums(united).energy;
    (void)waiting.let_wait(1, fish.before, kStep, fish.assembly);
    EXPECT_NEAR(fish.sums(united).energy, energy, 1e-5 * energy);
}

TEST(WaitingBodies, TurnAsTheirParticlesDoInTheMean) {
    FourFish fish;
    WaitingBodies waiting(fish.assembly, 0.01 / kEdge);
    ASSERT_TRUE(waiting.find(std::vector<double>{0.0, 0.0, 0.0, 0.011}, kAll, kRow));
    const RigidMotion asked(Vec3(0.1, 0.2, 0.3), Vec3(0.03, -0.02, 0.01), Vec3(0.004, 0.003, 0.002));
    fish.each_particle(3, [&](std::size_t i) { fish.assembly.model.position[i] = asked(fish.before.position[i]); });
    const RigidMotion motion = waiting.let_wait(3, fish.before, kStep, fish.assembly);
    fish.each_particle(3, [&](std::size_t i) {
        // To the second order of the turn.
        EXPECT_LT(glm::length(motion(fish.before.position[i]) - asked(fish.before.position[i])), 1e-4);
        EXPECT_EQ(fish.assembly.model.orientation[i], motion(fish.before.orientation[i]));
    });
}

TEST(WaitingBodies, LoseWhatWouldTurnThemTooFar) {
    FourFish fish;
    WaitingBodies waiting(fish.assembly, 0.01 / kEdge);
    ASSERT_TRUE(waiting.find(std::vector<double>{0.0, 0.0, 0.0, 0.011}, kAll, kRow));
    const std::vector<std::size_t> fourth = {3};
    const Vec3 linear = fish.sums(fourth).linear;
    // By a quarter of a radian in a step.
    (void)waiting.let_wait(3, fish.before, {.step = 25.0}, fish.assembly);
    EXPECT_NEAR(glm::length(fish.assembly.model.angular_velocity[fish.assembly.part(3).first_particle]), 0.01, 1e-15);
    EXPECT_LT(glm::length(fish.sums(fourth).linear - linear), 1e-12);
}

TEST(WaitingBodies, DoNotGoBelowTheFloor) {
    FourFish fish;
    WaitingBodies waiting(fish.assembly, 0.01 / kEdge);
    ASSERT_TRUE(waiting.find(std::vector<double>{0.0, 0.0, 0.0, 0.011}, kAll, kRow));
    fish.each_particle(3, [&](std::size_t i) {
        fish.assembly.model.position[i] = fish.before.position[i] - Vec3(0.0, 0.1, 0.0);
        fish.assembly.model.velocity[i] = Vec3(0.0, -10.0, 0.0);
    });
    std::vector<Vec3> vertices = fish.assembly.mesh.vertices;
    const Skinner::Part part = fish.assembly.part(3);
    const std::span<const Vec3> own = std::span(vertices).subspan(part.first_vertex, part.vertices);
    const auto lowest = [&](const auto& height) { return height(*std::ranges::min_element(own, {}, height)); };
    // It hangs 2 mm above the floor, and touches it with one end: there it stays, while the rest sinks on.
    fish.assembly.floor[3] = lowest([](const Vec3& p) { return p.y; }) - 0.002;
    const RigidMotion motion =
        waiting.let_wait(3, fish.before, {.step = 0.01, .vertices = vertices, .friction = 0.5}, fish.assembly);
    EXPECT_NEAR(lowest([&](const Vec3& p) { return motion(p).y; }), fish.assembly.floor[3], 1e-12);
    EXPECT_LT(motion.way().y, -0.002);
    // Its velocities lead it no farther down there.
    const std::vector<std::size_t> fourth = {3};
    EXPECT_GT(fish.sums(fourth).linear.y, -10.0 * 0.5 * fish.mass(3));
}

TEST(WaitingBodies, ThenGoAShareOfTheirMotionUntilTheyNeedNotWait) {
    FourFish fish;
    WaitingBodies waiting(fish.assembly, 0.01 / kEdge);
    const std::vector<double> lags = {0.0, 0.0, 0.0, 0.011};
    ASSERT_TRUE(waiting.find(lags, kAll, kRow));
    const double share = waiting.share(3);
    EXPECT_EQ(waiting.share(0), 1.0);
    EXPECT_LT(share, 0.5);
    // What it does not go is its own motion.
    const std::vector<std::size_t> fourth = {3};
    const FourFish::Sums before = fish.sums(fourth);
    const ParticleModel asked = fish.assembly.model;
    waiting.slow(3, fish.before, 0.01, fish.assembly);
    expect_same_momenta(fish.sums(fourth), before);
    const ParticleModel slowed = fish.assembly.model;
    // What it would go if it had to wait.
    fish.assembly.model = asked;
    const RigidMotion mean = waiting.let_wait(3, fish.before, kStep, fish.assembly);
    fish.each_particle(3, [&](std::size_t i) {
        const Vec3 alike = mean(fish.before.position[i]);
        EXPECT_LT(glm::length(slowed.position[i] - alike - share * (asked.position[i] - alike)), 1e-15);
    });
    fish.assembly.model = slowed;
    // As long as it has to wait it goes less, but always some.
    for (int k = 0; k < 20; ++k) {
        (void)waiting.find(lags, kAll, kRow);
    }
    EXPECT_GT(waiting.share(3), 0.01);
    EXPECT_LT(waiting.share(3), 0.02);
    for (int k = 0; k < 20; ++k) {
        EXPECT_FALSE(waiting.find(std::vector<double>(4, 0.0), kAll, kRow));
    }
    EXPECT_EQ(waiting.share(3), 1.0);
}

TEST(WaitingBodies, GoWithWhatIsPinnedOfThem) {
    FourFish fish;
    fish.assembly.model.pinned[fish.assembly.part(3).first_particle] = 1;
    WaitingBodies waiting(fish.assembly, 0.01 / kEdge);
    ASSERT_TRUE(waiting.find(std::vector<double>{0.0, 0.0, 0.0, 0.011}, kAll, kRow));
    const std::size_t pinned = fish.assembly.part(3).first_particle;
    const Vec3 led = fish.assembly.model.position[pinned];
    const Vec3 velocity = fish.assembly.model.velocity[pinned];
    const Vec3 way = waiting.let_wait(3, fish.before, kStep, fish.assembly).way();
    EXPECT_LT(glm::length(way - (led - fish.before.position[pinned])), 1e-15);
    // The others go with it.
    EXPECT_EQ(fish.assembly.model.position[pinned], led);
    fish.each_particle(3, [&](std::size_t i) {
        EXPECT_LT(glm::length(fish.assembly.model.position[i] - fish.before.position[i] - way), 1e-15);
        EXPECT_LT(glm::length(fish.assembly.model.velocity[i] - velocity), 1e-15);
    });
}

struct Crush {
    std::string scene;
    double step = 0.01;  // s
    std::uint64_t seed = 1;
};

void PrintTo(const Crush& crush, std::ostream* out) {
    *out << crush.scene << " at " << crush.step << " s, seed " << crush.seed;
}

/// A scene in which a hostile hand crushes solids, in steps.
class Crushing {
  public:
    explicit Crushing(const Crush& crush)
        : scene_(test::scene_with(crush.scene, {"solver.step=" + std::to_string(crush.step)})),
          at_rest_(scene_),
          skinner_(at_rest_.mesh.vertices, at_rest_.model, at_rest_.skin),
          skin_(at_rest_.mesh.vertices.size()),
          simulation_(scene_),
          hand_(crush.seed, 5.0, 15.0, simulation_.proxy()) {
        simulation_.set_verification(true);
        finest_ = std::numeric_limits<double>::max();
        for (const SceneBody& body : at_rest_.bodies) {
            const SolidSurface surface{.triangles = body.mesh.triangles,
                                       .first_vertex = body.first_vertex,
                                       .vertices = body.mesh.vertices.size()};
            finest_ = std::min(finest_, mean_edge_of(surface, at_rest_.mesh.vertices));
        }
    }
    [[nodiscard]] double time() const { return simulation_.time(); }
    /// The hand crushes.
    StepResult crush() {
        position_ = hand_.advance(scene_.solver.step, simulation_.vertices());
        return step(hand_.curl());
    }
    /// It opens and rises by 0.15 m, at 1 m/s.
    StepResult leave() {
        const double rise = std::min(scene_.solver.step, 0.15 - risen_);
        position_.y += rise;
        risen_ += rise;
        return step(0.0);
    }
    [[nodiscard]] const ParticleModel& model() const { return simulation_.model(); }
    /// Mean edges of the finest surface, by which one lags at most.
    [[nodiscard]] double lag() {
        double most = 0.0;
        skinner_.skin_vertices(simulation_.model(), skin_);
        for (std::size_t v = 0; v < skin_.size(); ++v) {
            skin_[v].y = std::max(skin_[v].y, scene_.collisions.ground_height);  // which flattens skins
            most = std::max(most, glm::length(skin_[v] - simulation_.vertices()[v]));
        }
        return most / finest_;
    }

  private:
    StepResult step(double curl) {
        StepInput input;
        input.time_ns = nanoseconds(simulation_.time());
        input.device = simulation_.workspace().to_device(Pose{position_, hand_.orientation()});
        input.curl = curl;
        return simulation_.step(input);
    }

    Scene scene_;
    Assembly at_rest_;
    Skinner skinner_;
    std::vector<Vec3> skin_;  // m
    Simulation simulation_;
    HostileHand hand_;
    Vec3 position_{0.0};   // m, of the hand
    double risen_ = 0.0;   // m
    double finest_ = 0.0;  // m
};

class Crushed : public testing::TestWithParam<Crush> {};

TEST_P(Crushed, SurfacesStayNearTheirSkinsAndNeverCross) {
    Crushing crushing(GetParam());
    double most = 0.0;
    while (crushing.time() < 4.0) {
        const StepResult result = crushing.crush();
        ASSERT_EQ(result.surfaces.solids + result.crossings, 0U) << "at " << crushing.time() << " s";
        most = std::max(most, crushing.lag());
    }
    // Without waiting it is 15 to 90 edges.
    EXPECT_LT(most, 4.1);
    EXPECT_GT(most, 2.0);
}

// With seeds for which no body is alone long enough that it need not wait.
INSTANTIATE_TEST_SUITE_P(AllSteps, Crushed,
                         testing::Values(Crush{"fish-grab", 0.01, 3}, Crush{"fish-grab", 0.0333, 4},
                                         Crush{"four-fish", 0.02, 2}, Crush{"organ-lift", 0.0333, 3}));

/// The hand crushes for 5 s, more than an edge deep in the end, and leaves until a time, s.
void crush_and_leave(Crushing& crushing, double until) {
    double most = 0.0;
    while (crushing.time() < 5.0) {
        crushing.crush();
        most = std::max(most, crushing.lag());
    }
    ASSERT_GT(most, 1.0) << "the hand has crushed nothing";
    while (crushing.time() < until) {
        const StepResult result = crushing.leave();
        ASSERT_EQ(result.surfaces.solids + result.crossings, 0U) << "at " << crushing.time() << " s";
    }
}

TEST(Crushed, ALoneSurfaceIsWhereItsSkinIsOnceTheHandHasLeft) {
    // The surface of the fish would stay knotted, the organ folded through itself, for ever, and the last two round the
    // tool.
    for (const Crush& crush : {Crush{"fish-grab", 0.01, 2}, Crush{"organ-lift", 0.02, 13},
                               Crush{"organ-lift", 0.02, 17}, Crush{"organ-lift", 0.02, 12}}) {
        Crushing crushing(crush);
        crush_and_leave(crushing, 11.0);
        EXPECT_LT(crushing.lag(), 1e-6) << crush.scene << " " << crush.seed;
    }
}

TEST(Crushed, AHeapComesToRestOnTheGroundAndIsNotEntangled) {
    // It would stand on an end, with surfaces that lag by four edges, and slide for ever.
    for (const Crush& crush : {Crush{"four-fish", 0.02, 1}, Crush{"four-fish", 0.0333, 5}}) {
        Crushing crushing(crush);
        crush_and_leave(crushing, 11.0);
        EXPECT_LT(crushing.lag(), 0.25) << crush.scene;
        EXPECT_LT(kinetic_energy(crushing.model()), 1e-4) << crush.scene;
    }
}

}  // namespace
}  // namespace haptic::sim
