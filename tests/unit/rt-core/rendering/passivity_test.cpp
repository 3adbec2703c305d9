#include "rendering/passivity.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <deque>
#include <limits>
#include <numbers>

#include "random.hpp"

namespace haptic::rt {
namespace {

using test::Random;

constexpr double kPeriod_s = 1e-3;
constexpr double kDamping = 0.3;    // N s/m, of the default settings
constexpr double kPassive = 600.0;  // N/m, 2 b / T
constexpr double kFloor_j = -1e-4;  // J, below which the observer must never be
const Vec3 kUp{0.0, 1.0, 0.0};

PassivitySettings with(PassivityControl control) {
    PassivitySettings settings;
    settings.control = control;
    return settings;
}

/// Request of a grip at depth d in a resting wall of stiffness k; d < 0: outside.
PassivityRequest wall(double k, double d) {
    const double depth = std::max(0.0, d);
    return {.wrench = {k * depth * kUp, Vec3(0.0)}, .stored = 0.5 * k * depth * depth};
}

PassivityMotion moved_up(double by, double held_force) {
    return {.displacement = by * kUp,
            .elapsed_s = kPeriod_s,
            .held = {held_force * kUp, Vec3(0.0)},
            .requested = held_force != 0.0};
}

TEST(AffordableShare, IsTheLargestThatTheBudgetCanEnd) {
    Random random(1);
    for (int i = 0; i < 100'000; ++i) {
        const double power = std::max(0.0, random.uniform(-1.0, 5.0));
        const double acceleration_power = std::pow(10.0, random.uniform(-6.0, 4.0));
        const double ramp_s = std::pow(10.0, random.uniform(-5.0, 0.0));
        const double budget = std::pow(10.0, random.uniform(-8.0, -1.0));
        const double share = affordable_share(power, acceleration_power, kPeriod_s, ramp_s, budget);
        ASSERT_GT(share, 0.0);
        ASSERT_LE(share, 1.0);
        // Oracle: integrates the wrench, held for a period and then falling linearly to zero in share * ramp_s.
        const auto cost = [&](double part) {
            const double h = part * (kPeriod_s + 0.5 * part * ramp_s);
            return power * h + 0.5 * acceleration_power * h * h;
        };
        ASSERT_LE(cost(share), budget * (1.0 + 1e-9));
        if (share < 1.0) {
            ASSERT_GT(cost(share * (1.0 + 1e-6)), budget);
        }
    }
}

TEST(AffordableShare, IsZeroWithoutABudgetAndOneForAZeroWrench) {
    EXPECT_EQ(affordable_share(1.0, 1.0, kPeriod_s, 0.01, 0.0), 0.0);
    EXPECT_EQ(affordable_share(1.0, 1.0, kPeriod_s, 0.01, -1.0), 0.0);
    EXPECT_EQ(affordable_share(0.0, 0.0, kPeriod_s, 0.0, 1e-9), 1.0);
}

TEST(PassiveStiffness, IsThatOfAbbottAndOkamura) {
    EXPECT_DOUBLE_EQ(passive_stiffness(0.3, 0.0, 1.7e-5, 1e-3, 0.0), 600.0);
    EXPECT_DOUBLE_EQ(passive_stiffness(0.3, 0.004, 1.6e-5, 1e-3, 0.0), 500.0);
    EXPECT_DOUBLE_EQ(passive_stiffness(0.3, 1.0, 1.6e-5, 1e-3, 0.0), 600.0);
    EXPECT_DOUBLE_EQ(passive_stiffness(0.3, 0.0, 1.7e-5, 1e-3, 0.02), 0.6 / 0.041);
}

TEST(PassivityObserver, HasTheExactEnergyOfASampledSpring) {
    // E = K d^2 / 2 + (b / T - K / 2) sum dx^2, for any motion within the wall.
    PassivitySettings settings = with(PassivityControl::Observe);
    settings.store = 1.0;  // more than is taken in here
    for (const double k : {50.0, 300.0, 600.0, 2000.0}) {
        Passivity passivity(settings, {});
        Random random(7);
        double depth = 0.0;
        double force = 0.0;
        double squares = 0.0;
        for (int i = 0; i < 5000; ++i) {
            const double next = i == 0 ? 1e-6 : std::clamp(depth + random.uniform(-3e-4, 3e-4), 1e-6, 0.01);
            passivity.apply(moved_up(depth - next, force), wall(k, next));
            squares += (next - depth) * (next - depth);
            depth = next;
            force = k * depth;
            const double expected = 0.5 * k * depth * depth + (kDamping / kPeriod_s - 0.5 * k) * squares;
            if (expected > 0.5 * k * depth * depth + settings.store) {
                break;
            }
            ASSERT_NEAR(passivity.energy(), expected, 1e-12);
        }
    }
}

/// Smallest observed energy of random strokes in and out of a resting wall.
double min_energy_of_strokes(double k, std::uint64_t seed) {
    Passivity passivity(with(PassivityControl::Observe), {});
    Random random(seed);
    double depth = -1e-3;
    double force = 0.0;
    double least = 0.0;
    double speed = 0.0;
    for (int i = 0; i < 20'000; ++i) {
        speed += random.uniform(-1.0, 1.0) * 0.02 - 0.02 * speed - 2.0 * (depth - 5e-4);
        const double next = depth + speed * kPeriod_s;
        passivity.apply(moved_up(depth - next, force), wall(k, next));
        depth = next;
        force = k * std::max(0.0, depth);
        least = std::min(least, passivity.energy());
    }
    return least;
}

TEST(PassivityObserver, ObservesNoGeneratedEnergyUpToThePassiveStiffness) {
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
        for (const double k : {10.0, 100.0, 300.0, kPassive}) {
            ASSERT_GE(min_energy_of_strokes(k, seed), -1e-12) << k << " N/m, seed " << seed;
        }
    }
}

TEST(PassivityObserver, ObservesGeneratedEnergyBeyondThatStiffness) {
    int seen = 0;
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
        seen += min_energy_of_strokes(2.0 * kPassive, seed) < kFloor_j ? 1 : 0;
    }
    EXPECT_EQ(seen, 20);
}

TEST(PassivityObserver, CountsRotationLikeTranslation) {
    PassivitySettings settings = with(PassivityControl::Observe);
    settings.store = 1.0;
    Passivity passivity(settings, {});
    const double k = 0.05;  // N m/rad
    double angle = 0.0;
    double torque = 0.0;
    double squares = 0.0;
    Random random(3);
    for (int i = 0; i < 2000; ++i) {
        const double next = std::clamp(angle + random.uniform(-2e-3, 2e-3), 1e-6, 0.2);
        PassivityMotion motion;
        motion.rotation = (angle - next) * kUp;
        motion.elapsed_s = kPeriod_s;
        motion.held.torque = torque * kUp;
        motion.requested = torque != 0.0;
        passivity.apply(motion, {.wrench = {Vec3(0.0), k * next * kUp}, .stored = 0.5 * k * next * next});
        squares += (next - angle) * (next - angle);
        angle = next;
        torque = k * angle;
        const double expected = 0.5 * k * angle * angle + (settings.rotational_damping / kPeriod_s - 0.5 * k) * squares;
        ASSERT_NEAR(passivity.energy(), expected, 1e-12);
        ASSERT_EQ(passivity.rotation_energy(), passivity.energy());
        ASSERT_EQ(passivity.translation_energy(), 0.0);
    }
}

TEST(PassivityObserver, CreditsTheWorkOfAnAnnouncedSurface) {
    // A surface of 300 N/m rises at 0.1 m/s under a grip that yields at 0.06 m/s: E stays that of the spring.
    Passivity passivity(with(PassivityControl::Observe), {});
    const double k = 300.0;
    double force = 0.0;
    double depth = 0.0;
    for (int i = 0; i < 100; ++i) {
        const double given_way = i == 0 ? 0.0 : 6e-5;
        depth += i == 0 ? 0.0 : 1e-4 - given_way;
        PassivityRequest request = wall(k, depth);
        request.surface_power = 0.1 * k * depth;
        passivity.apply(moved_up(given_way, force), request);
        force = k * depth;
        // The sampled spring gives half a tick's force times the grip's displacement more than an ideal one.
        ASSERT_GE(passivity.energy(), 0.5 * k * depth * depth - 1e-12) << i;
    }
    EXPECT_GT(depth, 3e-3);
}

TEST(PassivityObserver, GivesBackNoMoreThanAFrameLeavesInTheSprings) {
    // The hand presses 2 mm into 300 N/m; then a frame moves the wall back by 1 mm, and the next one in by 2 mm.
    PassivitySettings settings = with(PassivityControl::Observe);
    settings.store = 0.0;
    settings.damping = 0.0;
    Passivity passivity(settings, {});
    const double k = 300.0;
    const auto energy = [k](double depth) { return 0.5 * k * depth * depth; };
    double depth = 1e-9;
    passivity.apply(moved_up(0.0, 0.0), wall(k, depth));
    while (depth < 2e-3) {
        passivity.apply(moved_up(-1e-6, k * (depth + 0.5e-6)), wall(k, depth + 1e-6));
        depth += 1e-6;
    }
    ASSERT_NEAR(passivity.energy(), energy(depth), 1e-9);
    passivity.apply(moved_up(0.0, k * depth), wall(k, depth - 1e-3));
    EXPECT_NEAR(passivity.energy(), energy(depth - 1e-3), 1e-9);
    passivity.apply(moved_up(0.0, k * depth), wall(k, depth + 1e-3));
    EXPECT_NEAR(passivity.energy(), energy(depth - 1e-3), 1e-9) << "the hand has not given what the springs gained";
}

TEST(Passivity, LeavesFreeMotionExactlyZeroInSpiteOfADebt) {
    Passivity passivity(with(PassivityControl::Bound), {});
    for (int i = 0; i < 100; ++i) {
        passivity.apply(moved_up(1e-3, 5.0), wall(2000.0, 5e-3));
    }
    ASSERT_LT(passivity.energy(), -0.1);
    for (const PassivityControl control : {PassivityControl::Bound, PassivityControl::Damp}) {
        Passivity free(with(control), {});
        Random random(5);
        for (int i = 0; i < 1000; ++i) {
            PassivityMotion motion;
            motion.displacement = 1e-3 * random.normal();
            motion.rotation = 1e-2 * random.normal();
            motion.elapsed_s = kPeriod_s;
            if (i < 100) {
                motion.held.force = 100.0 * motion.displacement;  // a debt
                motion.requested = true;
            }
            const Passivity::Result result = free.apply(motion, {});
            ASSERT_EQ(result.wrench.force, Vec3(0.0));
            ASSERT_EQ(result.wrench.torque, Vec3(0.0));
            ASSERT_FALSE(result.acted);
        }
    }
    const Passivity::Result result = passivity.apply(moved_up(1e-3, 0.0), {});
    EXPECT_EQ(result.wrench.force, Vec3(0.0));
    EXPECT_FALSE(result.acted);
}

TEST(Passivity, DoesNotSpendInOneContactWhatAnEarlierOneStored) {
    Passivity passivity(with(PassivityControl::Bound), {});
    for (int i = 1; i <= 100; ++i) {  // 1 cm into a wall that then vanishes
        passivity.apply(moved_up(-1e-4, 1e-2 * i), wall(100.0, 1e-4 * i));
    }
    EXPECT_GT(passivity.energy(), 1e-3);
    passivity.apply(moved_up(0.0, 0.0), {});
    EXPECT_EQ(passivity.energy(), 0.0);
}

TEST(Passivity, StoresNoMoreThanTheSpringsEnergyAndTheAllowance) {
    const PassivitySettings settings = with(PassivityControl::Bound);
    Passivity passivity(settings, {});
    for (int i = 0; i < 1000; ++i) {  // rubbing against friction: 5 N against the motion over a metre
        passivity.apply(moved_up(-1e-3, 5.0), wall(500.0, 4e-3));
        ASSERT_LE(passivity.energy(), 0.5 * 500.0 * 16e-6 + settings.store);
    }
    EXPECT_EQ(passivity.energy(), 0.5 * 500.0 * 16e-6 + settings.store);
}

TEST(Passivity, LeavesAnIdealContactUnchangedBitForBit) {
    // A tap at 0.2 m/s on walls up to half the passive stiffness, whose energy leak the damping credit covers.
    for (const double k : {20.0, 100.0, 300.0}) {
        Passivity passivity(with(PassivityControl::Bound), {});
        double depth = -1e-3;
        double force = 0.0;
        const double omega = std::sqrt(k / 0.1);
        const double last = std::numbers::pi / omega;
        for (double t = -0.005; t < last + 0.01; t += kPeriod_s) {
            const double next =
                t < 0.0 || t > last ? -std::fabs(0.2 * (t < 0.0 ? t : t - last)) : 0.2 / omega * std::sin(omega * t);
            const PassivityRequest request = wall(k, next);
            const Passivity::Result result = passivity.apply(moved_up(depth - next, force), request);
            ASSERT_FALSE(result.acted) << k << " N/m at " << t << " s";
            ASSERT_EQ(result.wrench.force, request.wrench.force);
            depth = next;
            force = request.wrench.force.y;
        }
    }
}

TEST(Passivity, LetsAnAnnouncedSurfacePushARestingHand) {
    // 300 N/m against a hand of 400 N/m, quasi-static, with and without the announcement.
    std::array<double, 2> reached{};
    for (const bool announced : {false, true}) {
        Passivity passivity(with(PassivityControl::Bound), {});
        double force = 0.0;
        double grip = 0.0;
        for (int i = 1; i <= 200; ++i) {
            const double surface = 1e-4 * i;  // m, rising at 0.1 m/s
            const double next = force / 400.0;
            PassivityRequest request = wall(300.0, surface - next);
            request.surface_power = announced ? 0.1 * request.wrench.force.y : 0.0;
            const Passivity::Result result = passivity.apply(moved_up(next - grip, force), request);
            grip = next;
            force = result.wrench.force.y;
        }
        reached[announced ? 1 : 0] = force;
    }
    EXPECT_NEAR(reached[1], 0.02 / (1.0 / 300.0 + 1.0 / 400.0), 0.05);
    EXPECT_LT(reached[0], 0.7 * reached[1]);
}

/// m, peak-to-peak motion over the next ticks; tick() returns the position after it.
template <class Tick>
double peak_to_peak(int ticks, const Tick& tick) {
    double high = -1.0;
    double low = 1.0;
    for (int i = 0; i < ticks; ++i) {
        const double position = tick();
        high = std::max(high, position);
        low = std::min(low, position);
    }
    return high - low;
}

/// Grip of 0.1 kg and 0.3 N s/m pressed by an undamped hand against a wall whose force is `delay` ticks late.
class DelayedWall {
  public:
    DelayedWall(PassivityControl control, double k, int delay, double hand)
        : passivity_(with(control), {}),
          limiter_({}),
          past_(static_cast<std::size_t>(delay) + 1, kStart),
          k_(k),
          hand_(hand) {}

    void run(int ticks) {
        for (int i = 0; i < ticks; ++i) {
            tick();
        }
    }
    /// m, peak-to-peak motion over the next ticks.
    double amplitude(int ticks) {
        return peak_to_peak(ticks, [this] {
            tick();
            return y_;
        });
    }
    [[nodiscard]] double min_energy() const { return least_; }

  private:
    static constexpr double kStart = 0.005;
    static constexpr double kMass = 0.1;
    static constexpr double kCount = 4e-6;  // m, resolution

    void tick() {
        const double measured = std::round(y_ / kCount) * kCount;
        past_.push_back(measured);
        past_.pop_front();
        const PassivityMotion motion = moved_up(measured - last_, force_);
        last_ = measured;
        const Passivity::Result result = passivity_.apply(motion, wall(k_, -past_.front()));
        force_ = limiter_.apply(result.wrench, 1'000'000).wrench.force.y;
        least_ = std::min(least_, passivity_.energy());
        for (int i = 0; i < 50; ++i) {
            const double goal = std::max(-0.01, kStart - 0.15 * time_s_);
            v_ += 2e-5 / kMass * (force_ - kDamping * v_ + hand_ * (goal - y_));
            y_ += 2e-5 * v_;
            time_s_ += 2e-5;
        }
    }

    Passivity passivity_;
    WrenchLimiter limiter_;
    std::deque<double> past_;
    double k_;
    double hand_;
    double y_ = kStart;
    double v_ = 0.0;
    double last_ = kStart;
    double force_ = 0.0;
    double least_ = 0.0;
    double time_s_ = 0.0;
};

TEST(Passivity, KeepsVibrationFromGrowingForAnyStiffnessAndDelay) {
    for (const double hand : {100.0, 400.0}) {
        for (const double k : {10.0, 30.0, 100.0, 300.0, 600.0, 1000.0, 2000.0}) {
            for (const int delay : {0, 1, 2, 5, 10, 20}) {
                DelayedWall wall(PassivityControl::Bound, k, delay, hand);
                wall.run(300);
                const double first = wall.amplitude(500);
                wall.run(3200);
                const double last = wall.amplitude(500);
                EXPECT_LT(last, std::max(first, 2e-4)) << k << " N/m, " << delay << " ticks, hand " << hand;
                EXPECT_GE(wall.min_energy(), kFloor_j) << k << " N/m, " << delay << " ticks, hand " << hand;
            }
        }
    }
}

TEST(Passivity, WithoutItThatVibrationGrows) {
    DelayedWall wall(PassivityControl::Observe, 300.0, 5, 100.0);
    wall.run(300);
    const double first = wall.amplitude(500);
    wall.run(700);
    EXPECT_GT(wall.amplitude(500), 2.0 * first);
    EXPECT_LT(wall.min_energy(), 100.0 * kFloor_j);
}

/// Says how the frames of a body tell of its motion.
enum class Report : std::uint8_t { Velocity, Work };

/// A body on a spring of its own, computed in steps of 33 ms that answer the pose at their beginning and arrive 30 ms
/// late, and the grip of a compliant hand on it. Its surface pushes upwards with 600 N/m.
class SlowBody {
  public:
    SlowBody(Report report, double mass, double spring)
        : passivity_(with(PassivityControl::Bound), {}), report_(report), mass_(mass), spring_(spring) {}

    void run(int ticks) {
        for (int i = 0; i < ticks; ++i) {
            tick();
        }
    }
    /// m, peak-to-peak motion of the grip over the next ticks.
    double amplitude(int ticks) {
        return peak_to_peak(ticks, [this] {
            tick();
            return grip_;
        });
    }
    /// J, largest energy that the grip has received, beyond that which the body had when it began.
    [[nodiscard]] double generated() const { return most_received_ - 0.5 * spring_ * kRest * kRest; }

  private:
    static constexpr double kStiffness = 600.0;
    static constexpr double kMass = 0.1;         // kg, grip
    static constexpr double kRest = 0.01;        // m, at which the body's spring has no force
    static constexpr double kBodyDamping = 0.1;  // N s/m
    static constexpr double kHand = 400.0;       // N/m
    static constexpr double kHandDamping = 1.0;  // N s/m
    static constexpr int kStep = 33;             // ticks
    static constexpr int kDelay = 30;            // ticks

    struct Frame {
        double offset = 0.0;
        double velocity = 0.0;
        double work = 0.0;  // J, sum
        int tick = 0;
    };

    /// The body until the end of a step, with the grip where it is now.
    void step() {
        Frame frame{.offset = body_, .tick = tick_};
        for (int i = 0; i < kStep * 10; ++i) {
            const double h = 1e-4;
            const double force = kStiffness * std::max(0.0, body_ - grip_);
            const double before = body_speed_;
            body_speed_ += h / mass_ * (-force - spring_ * (body_ - kRest) - kBodyDamping * body_speed_);
            const double way = 0.5 * h * (before + body_speed_);
            body_ += way;
            body_work_ += force * way;
        }
        frame.velocity = (body_ - frame.offset) / (kStep * kPeriod_s);
        frame.work = body_work_;
        sent_.push_back(frame);
    }

    void tick() {
        if (tick_ % kStep == 0) {
            step();
        }
        bool arrived = false;
        double work = 0.0;
        while (!sent_.empty() && sent_.front().tick + kDelay <= tick_) {
            work += sent_.front().work - frame_.work;
            frame_ = sent_.front();
            sent_.pop_front();
            arrived = true;
        }
        // Planes are extrapolated for one and a half steps.
        const int age = tick_ - frame_.tick;
        const bool moves = age <= kStep * 3 / 2;
        const double surface = frame_.offset + frame_.velocity * std::min(age, kStep * 3 / 2) * kPeriod_s;
        PassivityRequest request = wall(kStiffness, surface - grip_);
        if (report_ == Report::Work) {
            request.reported = arrived;
            request.body_work = work;
        } else if (moves) {
            request.surface_power = frame_.velocity * request.wrench.force.y;
        }
        const Passivity::Result result = passivity_.apply(moved_up(grip_ - last_, force_), request);
        last_ = grip_;
        force_ = result.wrench.force.y;
        for (int i = 0; i < 50; ++i) {
            speed_ += 2e-5 / kMass * (force_ - (kDamping + kHandDamping) * speed_ - kHand * grip_);
            grip_ += 2e-5 * speed_;
            received_ += (force_ - kDamping * speed_) * 2e-5 * speed_;
        }
        most_received_ = std::max(most_received_, received_);
        ++tick_;
    }

    Passivity passivity_;
    std::deque<Frame> sent_;
    Frame frame_;
    Report report_;
    double mass_;    // kg
    double spring_;  // N/m
    int tick_ = 0;
    double body_ = 0.0;
    double body_speed_ = 0.0;
    double body_work_ = 0.0;
    double grip_ = 0.0;
    double last_ = 0.0;
    double speed_ = 0.0;
    double force_ = 0.0;
    double received_ = 0.0;
    double most_received_ = 0.0;
};

TEST(Passivity, HoldsABodyThatAnswersAnOldPoseToTheWorkThatItReports) {
    struct Case {
        double mass;    // kg
        double spring;  // N/m
    };
    for (const auto& [mass, spring] : {Case{0.01, 300.0}, {0.05, 30.0}, {0.05, 100.0}, {0.2, 100.0}}) {
        // Velocities alone announce what the body has not done, and the hand never comes to rest.
        SlowBody announced(Report::Velocity, mass, spring);
        announced.run(6000);
        EXPECT_GT(announced.amplitude(1000), 1e-3) << mass << " kg: nothing to hold";
        SlowBody reported(Report::Work, mass, spring);
        reported.run(6000);
        EXPECT_LT(reported.amplitude(1000), 2e-4) << mass << " kg, " << spring << " N/m";
        // Neither the allowance nor what the tick's sampling gives away are the body's.
        EXPECT_LT(reported.generated(), 5e-4) << mass << " kg, " << spring << " N/m";
    }
}

TEST(Passivity, LetsABodyThatReportsItsWorkPushARestingHand) {
    // A driven surface rises at 0.1 m/s against a hand of 400 N/m, in steps that take the grip for resting, which do
    // the work int k (s - x) ds. The hand feels it as it would feel an ideal spring, at any length of the step.
    for (const int step : {1, 10, 33}) {
        Passivity passivity(with(PassivityControl::Bound), {});
        const double k = 300.0;
        double force = 0.0;
        double grip = 0.0;
        int limited = 0;
        for (int i = 0; i < 198; ++i) {
            const double surface = 1e-4 * i;
            const double next = force / 400.0;
            PassivityRequest request = wall(k, surface - next);
            if (i % step == 0) {
                const double depth = std::max(0.0, surface - next);
                const double later = depth + 1e-4 * step;
                request.reported = true;
                request.body_work = 0.5 * k * (later * later - depth * depth);
            }
            const Passivity::Result result = passivity.apply(moved_up(next - grip, force), request);
            grip = next;
            force = result.wrench.force.y;
            limited += result.acted ? 1 : 0;
        }
        EXPECT_EQ(limited, 0) << step << " ticks";
        EXPECT_NEAR(force, 0.0197 / (1.0 / k + 1.0 / 400.0), 0.05) << step << " ticks";
    }
}

TEST(Passivity, BrakesAJumpByItsMeanVelocityOnly) {
    // No budget: gamma is 0, and the brake acts alone. A reading that jumps by 1 mm in a tick is no hand at 1 m/s.
    PassivitySettings settings = with(PassivityControl::Bound);
    settings.allowance = 0.0;
    settings.damping = 0.0;
    Passivity passivity(settings, {});
    const double most = settings.brake * 1e-3 / (kPeriod_s + 10e-3);  // N
    const Passivity::Result jump = passivity.apply(moved_up(1e-3, 0.0), wall(300.0, 1e-3));
    EXPECT_EQ(jump.scale, 0.0);
    EXPECT_LE(-jump.wrench.force.y, most * (1.0 + 1e-12));
    EXPECT_GT(-jump.wrench.force.y, 0.9 * most) << "the brake must act, or this proves nothing";
    for (int i = 0; i < 50; ++i) {
        const Passivity::Result rest = passivity.apply(moved_up(0.0, 0.0), wall(300.0, 1e-3));
        ASSERT_LE(-rest.wrench.force.y, most * std::pow(10.0 / 11.0, i + 1) * (1.0 + 1e-9)) << i;
    }
}

TEST(Passivity, DampingPaysADebtBackAndNoMore) {
    PassivitySettings settings = with(PassivityControl::Damp);
    settings.damping = 0.0;
    Passivity passivity(settings, {});
    passivity.apply(moved_up(1e-4, 1.0), wall(100.0, 0.01));  // 0.1 mJ given without having been taken
    ASSERT_LT(passivity.energy(), 0.0);
    const double requested = 1.0;
    const Passivity::Result fast = passivity.apply(moved_up(1e-3, 1e-9), wall(100.0, 0.01));
    const double debt = -passivity.energy();
    EXPECT_GT(debt, 0.0);
    EXPECT_NEAR((requested - fast.wrench.force.y) * 1e-3, debt, 1e-12);
    Passivity slow(settings, {});
    slow.apply(moved_up(1e-4, 1.0), wall(100.0, 0.01));
    const Passivity::Result limited = slow.apply(moved_up(1e-5, 1e-9), wall(100.0, 0.01));
    EXPECT_NEAR(requested - limited.wrench.force.y, settings.max_damping * 1e-5 / kPeriod_s, 1e-9);
}

TEST(Passivity, GivesZeroForNonFiniteInput) {
    const double nan = std::numeric_limits<double>::quiet_NaN();
    Passivity passivity(with(PassivityControl::Bound), {});
    PassivityRequest request = wall(100.0, 0.01);
    request.stored = nan;
    EXPECT_EQ(passivity.apply(moved_up(0.0, 0.0), request).wrench.force, Vec3(0.0));
    EXPECT_EQ(passivity.apply(moved_up(nan, 1.0), wall(100.0, 0.01)).wrench.force, Vec3(0.0));
    EXPECT_TRUE(std::isfinite(passivity.energy()));
    EXPECT_NE(passivity.apply(moved_up(0.0, 0.0), wall(100.0, 0.001)).wrench.force, Vec3(0.0));
}

}  // namespace
}  // namespace haptic::rt
