// Bodies sleep once they have come to rest, cost nothing then, and wake before anything may touch them.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <glm/geometric.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "dynamics/model_bodies.hpp"
#include "haptic/sim/simulation.hpp"
#include "scene_with.hpp"

namespace haptic::sim {
namespace {

const std::string kNoHand = "hand.times=[0.0]";
const std::string kElsewhere = "hand.positions=[5.0,0.4,0.0]";
const std::string kFree = "model.regions=[{low=[-1.0,-1.0,-1.0],high=[1.0,1.0,1.0],fixed=false}]";

template <class Visit>
void step_until(Simulation& simulation, double time, const Visit& visit) {
    while (simulation.time() < time) {
        visit(simulation.step(simulation.scripted_input(nanoseconds(simulation.time()))));
    }
}

/// The number of bodies that sleep at that time.
std::size_t asleep_at(Simulation& simulation, double time) {
    std::size_t asleep = 0;
    step_until(simulation, time, [&](const StepResult& result) { asleep = result.asleep; });
    return asleep;
}

/// A block and a hand that is at these positions, m, at these times, s.
Simulation block_and_hand(const std::string& times, const std::string& positions,
                          const std::string& sleep_after = "0.5") {
    return Simulation(test::scene_with("gel-block", {"hand.times=[" + times + "]", "hand.positions=[" + positions + "]",
                                                     "hand.repeat=false", "solver.sleep_after=" + sleep_after}));
}

/// m/s, the largest speed of a body's particles.
double fastest_of(const ParticleModel& model, const ParticleRange& body) {
    double speed = 0.0;
    for (std::uint32_t i = body.begin; i < body.end; ++i) {
        speed = std::max(speed, glm::length(model.velocity[i]));
    }
    return speed;
}

TEST(SleepingBodies, StayWhereTheyAreUntilTheToolComes) {
    // Down into the block at the third second, and away.
    Simulation simulation =
        block_and_hand("0.0,3.0,3.1,3.3,3.4", "0.5,0.1,0.0, 0.5,0.1,0.0, 0.0,0.012,0.0, 0.0,0.012,0.0, 0.5,0.1,0.0");
    ASSERT_EQ(asleep_at(simulation, 2.0), 1U);
    const ParticleModel then = simulation.model();
    EXPECT_EQ(asleep_at(simulation, 2.9), 1U);
    EXPECT_EQ(simulation.model().position, then.position);
    EXPECT_EQ(simulation.model().velocity, std::vector<Vec3>(then.size(), Vec3(0.0)));
    std::size_t in_contact = 0;
    step_until(simulation, 3.3, [&](const StepResult& result) {
        in_contact += result.in_contact ? 1 : 0;
        EXPECT_TRUE(!result.in_contact || result.asleep == 0);
    });
    EXPECT_GT(in_contact, 20U);
    EXPECT_EQ(asleep_at(simulation, 6.0), 1U);
}

TEST(SleepingBodies, TakeTheirShapeFirst) {
    // Into the block for a second, and away faster than its surface follows.
    Simulation simulation =
        block_and_hand("0.0,1.0,1.1,2.2,2.205", "0.0,0.1,0.0, 0.0,0.1,0.0, 0.0,0.017,0.0, 0.0,0.017,0.0, 0.5,0.1,0.0");
    ASSERT_EQ(asleep_at(simulation, 0.9), 1U);
    const std::vector<Vec3> rest = simulation.model().position;
    const auto off = [&] {
        double most = 0.0;
        for (std::size_t i = 0; i < rest.size(); ++i) {
            most = std::max(most, glm::length(simulation.model().position[i] - rest[i]));
        }
        return most;
    };
    EXPECT_EQ(asleep_at(simulation, 2.2), 0U);
    const double pressed = off();
    EXPECT_GT(pressed, 3e-5);
    EXPECT_EQ(asleep_at(simulation, 5.0), 1U);
    EXPECT_LT(off(), 0.2 * pressed);
}

TEST(SleepingBodies, FeelTheSameToTheToolAsOthers) {
    const auto impulse = [](const std::string& sleep_after) {
        Simulation simulation =
            block_and_hand("0.0,1.5,1.6,1.9", "0.0,0.1,0.0, 0.0,0.1,0.0, 0.0,0.012,0.0, 0.0,0.012,0.0", sleep_after);
        Vec3 sum(0.0);
        step_until(simulation, 1.9, [&](const StepResult& result) { sum += result.step * result.force; });
        return glm::length(sum);
    };
    const double awake = impulse("0");
    EXPECT_GT(awake, 0.01);
    EXPECT_NEAR(impulse("0.5"), awake, 1e-3 * awake);
}

TEST(SleepingBodies, WakeForABodyThatFallsOnThem) {
    // Gravity of a sixth, so that the first one lies long before the second one comes.
    Simulation simulation(test::scene_with("gel-block", {kNoHand, kElsewhere, kFree, "solver.gravity=[0.0,-1.6,0.0]",
                                                         "collisions.ground=true", "collisions.ground_height=-0.05",
                                                         "model.copies=[{position=[0.0,0.0,0.0]},"
                                                         "{position=[0.02,5.0,0.0]}]"}));
    simulation.set_verification(true);
    std::size_t slept = 0;
    double speed = 0.0;
    const ParticleRange first = bodies_of(simulation.model()).front();
    step_until(simulation, 3.5, [&](const StepResult& result) {
        slept += result.asleep == 1 ? 1 : 0;
        EXPECT_EQ(result.surfaces.solids + result.surfaces.others, 0U) << "t = " << result.time;
        if (slept > 0) {
            speed = std::max(speed, fastest_of(simulation.model(), first));
        }
    });
    EXPECT_GT(slept, 20U);
    EXPECT_GT(speed, 0.1);
}

TEST(SleepingBodies, WakeForWhatAScriptLeadsAtThemInOneStep) {
    // A plate that has stood 40 mm above the block comes down by 48 mm in one step.
    Simulation simulation(
        test::scene_with("gel-block", {kNoHand, kElsewhere, "solver.step=0.01",
                                       "objects=[{generator=\"block\",size=[0.1,0.01,0.1],cells=8,particles_count=60,"
                                       "offset=[0.0,0.045,0.0],material={name=\"gelatin 10 %\"},"
                                       "regions=[{low=[-1.0,-1.0,-1.0],high=[1.0,1.0,1.0],motion_times=[0.0,3.0,3.01],"
                                       "motion_offsets=[0.0,0.0,0.0, 0.0,0.0,0.0, 0.0,-0.048,0.0]}]}]"}));
    simulation.set_verification(true);
    const ParticleRange block = bodies_of(simulation.model()).front();
    EXPECT_EQ(asleep_at(simulation, 2.995), 1U);
    double speed = 0.0;
    step_until(simulation, 3.3, [&](const StepResult& result) {
        EXPECT_EQ(result.surfaces.solids + result.surfaces.others, 0U) << "t = " << result.time;
        speed = std::max(speed, fastest_of(simulation.model(), block));
    });
    EXPECT_GT(speed, 0.1);
}

TEST(SleepingBodies, AreNoneWithoutTheSetting) {
    Simulation simulation(test::scene_with("gel-block", {kNoHand, kElsewhere, "solver.sleep_after=0"}));
    EXPECT_EQ(asleep_at(simulation, 3.0), 0U);
}

TEST(SleepingBodies, AreNotThoseThatNothingHolds) {
    Simulation simulation(test::scene_with(
        "gel-block", {kNoHand, kElsewhere, kFree, "solver.gravity=[0.0,0.0,0.0]", "model.velocity=[1e-5,0.0,0.0]"}));
    EXPECT_EQ(asleep_at(simulation, 3.0), 0U);
    const ParticleModel& model = simulation.model();
    double mass = 0.0;
    for (const double m : model.mass) {
        mass += m;
    }
    EXPECT_NEAR(linear_momentum(model).x / mass, 1e-5, 1e-14);
}

TEST(SleepingBodies, AreNotThoseThatFallSlowly) {
    // 0.125 mm in half a second.
    Simulation simulation(
        test::scene_with("gel-block", {kNoHand, kElsewhere, kFree, "solver.gravity=[0.0,-0.001,0.0]"}));
    EXPECT_EQ(asleep_at(simulation, 3.0), 0U);
    const ParticleModel& model = simulation.model();
    for (const Vec3& velocity : model.velocity) {
        EXPECT_LT(velocity.y, -0.0025);
    }
}

TEST(SleepingBodies, MustStayInPlaceForAWhile) {
    EXPECT_THROW(Simulation(test::scene_with("gel-block", {"solver.sleep_after=0.1"})), std::invalid_argument);
}

TEST(SleepingBodies, AreSheetsToo) {
    Simulation simulation(test::scene_with("cloth-drop", {kNoHand, kElsewhere, "model.height=-1.3"}));
    EXPECT_EQ(asleep_at(simulation, 20.0), 1U);
}

}  // namespace
}  // namespace haptic::sim
