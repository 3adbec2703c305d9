// Claim: the hand of fish-grab holds the fish by friction, whatever the hand does with it, and a hand at rest feels a
// force at rest. The scene's script picks the fish up; then the test moves the hand, with the fingers as they are. The
// oracle is the place of the fish in the palm, from its particles.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <numbers>
#include <numeric>
#include <vector>

#include "haptic/config.hpp"
#include "haptic/sim/scene.hpp"
#include "haptic/sim/simulation.hpp"
#include "haptic/types.hpp"
#include "soak_length.hpp"
#include "tool/tool_proxies.hpp"

namespace haptic::sim {
namespace {

constexpr double kPickedUp = 2.3;  // s of the script: lifted and carried aside, palm down

class Grasp : public ::testing::Test {
  protected:
    Grasp() : simulation_(read_scene(open_scene("fish-grab"), "fish-grab")) {
        StepInput input;
        while (simulation_.time() < kPickedUp) {
            input = simulation_.scripted_input(nanoseconds(simulation_.time()));
            (void)simulation_.step(input);
        }
        held_ = simulation_.workspace().to_scene(input.device);
        curl_ = input.curl;
        at_start_ = in_palm();
    }

    /// Moves the hand for that long; `path` gives its pose in the scene at a time (s) since now.
    void move(double duration_s, const std::function<Pose(double)>& path) {
        forces_.clear();
        largest_shift_ = 0.0;
        const double begin = simulation_.time();
        while (simulation_.time() - begin < duration_s) {
            StepInput input;
            input.time_ns = nanoseconds(simulation_.time());
            input.device = simulation_.workspace().to_device(path(simulation_.time() - begin));
            input.curl = curl_;
            forces_.push_back(glm::length(simulation_.step(input).force));
            largest_shift_ = std::max(largest_shift_, glm::length(in_palm() - at_start_));
        }
    }
    [[nodiscard]] Pose shifted(const Vec3& by) const { return {held_.position + by, held_.orientation}; }

    /// m: mean of the fish's particles in the frame of the hand.
    [[nodiscard]] Vec3 in_palm() const {
        Vec3 sum(0.0);
        for (const Vec3& p : simulation_.model().position) {
            sum += p;
        }
        const Pose& hand = simulation_.tool().hip();
        return glm::conjugate(hand.orientation) *
               (sum / static_cast<double>(simulation_.model().size()) - hand.position);
    }

    [[nodiscard]] double mean_force() const {
        return std::accumulate(forces_.begin(), forces_.end(), 0.0) / static_cast<double>(forces_.size());
    }
    /// Largest difference of the forces from a value, and their rms difference from their mean.
    [[nodiscard]] double largest_difference(double from) const {
        double largest = 0.0;
        for (const double force : forces_) {
            largest = std::max(largest, std::abs(force - from));
        }
        return largest;
    }
    [[nodiscard]] double noise() const {
        const double mean = mean_force();
        double sum = 0.0;
        for (const double force : forces_) {
            sum += (force - mean) * (force - mean);
        }
        return std::sqrt(sum / static_cast<double>(forces_.size()));
    }

    Simulation simulation_;
    Pose held_;
    std::optional<double> curl_;
    Vec3 at_start_{0.0};
    std::vector<double> forces_;  // N, scene, of each step of the last move
    double largest_shift_ = 0.0;  // m, of the fish in the palm during the last move
};

TEST_F(Grasp, AStillHandFeelsTheWeightAndNothingElse) {
    const Pose still = shifted(Vec3(0.0));
    move(1.0, [&](double) { return still; });
    move(2.0, [&](double) { return still; });
    double mass = 0.0;
    for (const double m : simulation_.model().mass) {
        mass += m;
    }
    EXPECT_NEAR(mean_force(), 9.81 * mass, 0.001 * 9.81 * mass);
    EXPECT_LT(noise(), 0.01 * mean_force());
}

TEST_F(Grasp, TheForceSettlesWithinHalfASecondAfterAStop) {
    // As fast as the script carries the fish aside: 80 mm in 0.4 s.
    const auto stop = [&](double t) { return shifted(Vec3(-0.08 * std::min(t / 0.4, 1.0), 0.0, 0.0)); };
    const Pose stopped = stop(0.4);
    move(0.4, stop);
    move(0.5, [&](double) { return stopped; });
    const double swung = largest_difference(mean_force());
    move(1.0, [&](double) { return stopped; });
    EXPECT_GT(swung, 0.2 * mean_force()) << "the stop is not felt at all";
    EXPECT_LT(largest_difference(mean_force()), 0.05 * mean_force());
}

TEST_F(Grasp, HoldsWhenShaken) {
    // 2 Hz, 40 mm to either side, in each direction: up to 6.3 m/s^2. Springs and flesh yield by 17 mm.
    for (const Vec3& way : {Vec3(0.04, 0.0, 0.0), Vec3(0.0, 0.04, 0.0), Vec3(0.0, 0.0, 0.04)}) {
        move(2.0, [&](double t) { return shifted(std::sin(4.0 * std::numbers::pi * t) * way); });
        EXPECT_LT(largest_shift_, 0.02) << way.x << ' ' << way.y << ' ' << way.z;
    }
}

TEST_F(Grasp, HoldsWhileTheHandRollsPalmUpAndBack) {
    // About the length of the hand, in 3 s up and back. The springs of the grasp let the fish sag by 10 to 14 mm to
    // each side, and its spheres roll with it; were they held at their centres, they would slip until it is lost.
    const auto roll = [&](double t) {
        const double way = t < 1.5 ? t / 1.5 : 2.0 - t / 1.5;
        const double part = way * way * (3.0 - 2.0 * way);
        const Quat turn = glm::normalize(Quat(1.0 - part, 0.0, 0.0, -part));  // by half a turn at part = 1
        return Pose{held_.position, turn * held_.orientation};
    };
    const int rolls = test::soak_length(HAPTIC_ROLLS);
    for (int k = 0; k < rolls; ++k) {
        move(3.0, roll);
        ASSERT_LT(largest_shift_, 0.02) << "roll " << k;
    }
}

}  // namespace
}  // namespace haptic::sim
