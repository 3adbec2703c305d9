#include "device/tension.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "haptic/device/device_geometry_file.hpp"
#include "haptic/device/wrench_closure.hpp"
#include "not_finite.hpp"
#include "random.hpp"

namespace haptic::rt {
namespace {

using test::kInfinity;
using test::kNaN;

TensionSettings x3r_settings() {
    TensionSettings settings;
    settings.minimum = 0.3;
    settings.maximum = 20.0;
    settings.torque_scale = 1.0 / 0.0225;
    return settings;
}

StringArray all(double tension) {
    StringArray tensions{};
    tensions.fill(tension);
    return tensions;
}

WireMatrix centre_wires() {
    return wire_matrix(device::spidar_g6_x3r(), {});
}

TensionSettings settings_of(const device::DeviceGeometry& geometry) {
    TensionSettings settings;
    settings.minimum = geometry.minimum_tension;
    settings.maximum = geometry.maximum_tension;
    double radius = 0.0;
    for (const device::StringFacts& string : geometry.strings) {
        radius = std::max(radius, glm::length(string.grip));
    }
    settings.torque_scale = 1.0 / radius;
    return settings;
}

const std::vector<device::DeviceGeometry>& all_geometries() {
    static const std::vector<device::DeviceGeometry> geometries = [] {
        std::vector<device::DeviceGeometry> made;
        for (const std::string& name : device::built_in_geometry_names()) {
            made.push_back(device::built_in_geometry(name));
        }
        return made;
    }();
    return geometries;
}

class RandomLoads : public test::Random {
  public:
    using test::Random::Random;
    /// Anywhere in the workspace, rotated by up to about a radian.
    Pose pose() {
        const Vec3 position = normal() * 0.015;
        const Vec3 half = normal() * 0.15;
        return {position, glm::normalize(Quat(1.0, half.x, half.y, half.z))};
    }
    WireMatrix wires() { return wire_matrix(x3r_, pose()); }
    /// From 0.01 N to 100 N: feasible and far from feasible.
    Wrench wrench() {
        const double size = std::pow(10.0, uniform(-2.0, 2.0));
        return {normal() * size, normal() * size * 0.02};
    }

  private:
    device::DeviceGeometry x3r_ = device::spidar_g6_x3r();
};

/// The programme as the header states it, evaluated in long double independently of the solver.
struct Programme {
    WireMatrix wires{};
    Wrench wanted;
    TensionSettings settings;
    StringArray previous{};

    using Real = long double;

    [[nodiscard]] std::array<Real, 6> weighted_error(const StringArray& t) const {
        const double goal[6] = {wanted.force.x,  wanted.force.y,  wanted.force.z,
                                wanted.torque.x, wanted.torque.y, wanted.torque.z};
        std::array<Real, 6> error{};
        for (std::size_t k = 0; k < 6; ++k) {
            error[k] = -static_cast<Real>(goal[k]);
            for (std::size_t i = 0; i < kStrings; ++i) {
                error[k] += static_cast<Real>(wires[i][k]) * t[i];
            }
            error[k] *= k < 3 ? 1.0 : settings.torque_scale;
        }
        return error;
    }

    [[nodiscard]] double objective(const StringArray& t) const {
        Real sum = 0.0;
        for (const Real e : weighted_error(t)) {
            sum += e * e;
        }
        for (std::size_t i = 0; i < kStrings; ++i) {
            const Real effort = static_cast<Real>(t[i]) - settings.minimum;
            const Real change = static_cast<Real>(t[i]) - previous[i];
            sum += settings.effort * effort * effort + settings.continuity * change * change;
        }
        return static_cast<double>(sum);
    }

    [[nodiscard]] std::pair<double, double> bounds(std::size_t i) const {
        return {std::max(settings.minimum, previous[i] - settings.slew),
                std::min(settings.maximum, previous[i] + settings.slew)};
    }

    /// Largest violation of the optimality conditions: half the gradient where it does not push against a bound,
    /// relative to the wanted wrench (and 1 N).
    [[nodiscard]] double kkt_violation(const StringArray& t) const {
        const std::array<Real, 6> error = weighted_error(t);
        const double size =
            std::max({1.0, glm::length(wanted.force), glm::length(wanted.torque) * settings.torque_scale});
        Real worst = 0.0;
        for (std::size_t i = 0; i < kStrings; ++i) {
            Real slope = settings.effort * (static_cast<Real>(t[i]) - settings.minimum) +
                         settings.continuity * (static_cast<Real>(t[i]) - previous[i]);
            for (std::size_t k = 0; k < 6; ++k) {
                slope += wires[i][k] * (k < 3 ? 1.0 : settings.torque_scale) * error[k];
            }
            const auto [lower, upper] = bounds(i);
            if (t[i] <= lower) {
                slope = std::min<Real>(slope, 0.0);
            } else if (t[i] >= upper) {
                slope = std::max<Real>(slope, 0.0);
            }
            worst = std::max(worst, std::abs(slope));
        }
        return static_cast<double>(worst / size);
    }
};

/// Solves a dense system by Gaussian elimination with pivoting; false if it is singular.
bool solve_dense(std::array<std::array<long double, 8>, 8>& m, std::array<long double, 8>& b, std::size_t n) {
    for (std::size_t column = 0; column < n; ++column) {
        std::size_t pivot = column;
        for (std::size_t row = column + 1; row < n; ++row) {
            if (std::abs(m[row][column]) > std::abs(m[pivot][column])) {
                pivot = row;
            }
        }
        if (m[pivot][column] == 0.0L) {
            return false;
        }
        std::swap(m[pivot], m[column]);
        std::swap(b[pivot], b[column]);
        for (std::size_t row = column + 1; row < n; ++row) {
            const long double factor = m[row][column] / m[column][column];
            for (std::size_t k = column; k < n; ++k) {
                m[row][k] -= factor * m[column][k];
            }
            b[row] -= factor * b[column];
        }
    }
    for (std::size_t row = n; row-- > 0;) {
        for (std::size_t k = row + 1; k < n; ++k) {
            b[row] -= m[row][k] * b[k];
        }
        b[row] /= m[row][row];
    }
    return true;
}

/// Brute force: the minimum over all 3^8 assignments of strings to lower bound, upper bound or free.
StringArray brute_force(const Programme& programme) {
    std::array<std::array<long double, 8>, 8> hessian{};
    std::array<long double, 8> linear{};
    const double goal[6] = {programme.wanted.force.x,  programme.wanted.force.y,  programme.wanted.force.z,
                            programme.wanted.torque.x, programme.wanted.torque.y, programme.wanted.torque.z};
    const TensionSettings& settings = programme.settings;
    for (std::size_t i = 0; i < 8; ++i) {
        for (std::size_t k = 0; k < 6; ++k) {
            const long double weight = k < 3 ? 1.0L : static_cast<long double>(settings.torque_scale);
            linear[i] += programme.wires[i][k] * weight * weight * goal[k];
            for (std::size_t j = 0; j < 8; ++j) {
                hessian[i][j] += programme.wires[i][k] * weight * weight * programme.wires[j][k];
            }
        }
        hessian[i][i] += settings.effort + settings.continuity;
        linear[i] += settings.effort * settings.minimum + settings.continuity * programme.previous[i];
    }
    StringArray best{};
    double lowest = kInfinity;
    for (int code = 0; code < 6561; ++code) {
        std::array<std::size_t, 8> free{};
        std::size_t count = 0;
        StringArray t{};
        for (int rest = code, i = 0; i < 8; ++i, rest /= 3) {
            const auto index = static_cast<std::size_t>(i);
            const auto [lower, upper] = programme.bounds(index);
            t[index] = rest % 3 == 0 ? lower : upper;
            if (rest % 3 == 2) {
                free[count++] = index;
                t[index] = 0.0;
            }
        }
        std::array<std::array<long double, 8>, 8> m{};
        std::array<long double, 8> b{};
        for (std::size_t r = 0; r < count; ++r) {
            b[r] = linear[free[r]];
            for (std::size_t j = 0; j < 8; ++j) {
                b[r] -= hessian[free[r]][j] * t[j];
            }
            for (std::size_t c = 0; c < count; ++c) {
                m[r][c] = hessian[free[r]][free[c]];
            }
        }
        if (!solve_dense(m, b, count)) {
            continue;
        }
        bool inside = true;
        for (std::size_t r = 0; r < count; ++r) {
            const auto [lower, upper] = programme.bounds(free[r]);
            const auto value = static_cast<double>(b[r]);
            inside = inside && value >= lower - 1e-12 && value <= upper + 1e-12;
            t[free[r]] = value;
        }
        if (inside && programme.objective(t) < lowest) {
            lowest = programme.objective(t);
            best = t;
        }
    }
    return best;
}

TEST(Tension, SixDegreesOfFreedomAreReproducedAtTheCentreOfEveryDeviceThatRenders) {
    int frames = 0;
    for (const device::DeviceGeometry& geometry : all_geometries()) {
        if (!device::wrench_closure(geometry, {}).closed()) {
            continue;
        }
        ++frames;
        const WireMatrix wires = wire_matrix(geometry, {});
        for (int axis = 0; axis < 6; ++axis) {
            for (const double sign : {-1.0, 1.0}) {
                SCOPED_TRACE(testing::Message() << geometry.name << ", axis " << axis << ", sign " << sign);
                Wrench wanted;
                (axis < 3 ? wanted.force : wanted.torque)[axis % 3] = sign * (axis < 3 ? 3.0 : 0.020);
                TensionSolver solver(settings_of(geometry));
                const TensionResult result = solver.solve(wires, wanted);
                EXPECT_TRUE(result.reached);
                EXPECT_TRUE(result.exact);
                // 1e-4 of the wanted wrench, on the axis and across it; forces and torques are compared at the knots.
                const double scale = settings_of(geometry).torque_scale;
                const double asked = glm::length(wanted.force) + glm::length(wanted.torque) * scale;
                EXPECT_LT(glm::length(result.wrench.force - wanted.force), 1e-4 * asked);
                EXPECT_LT(glm::length(result.wrench.torque - wanted.torque) * scale, 1e-4 * asked);
            }
        }
    }
    EXPECT_EQ(frames, 5);
}

TEST(Tension, OptimalityConditionsHoldForAMillionWrenchesAndPosesOnAllDevices) {
    RandomLoads random(21);
    constexpr int kCases = 1'000'000;
    const int each = kCases / static_cast<int>(all_geometries().size()) + 1;
    double worst = 0.0;
    int max_rounds = 0;
    int reached = 0;
    for (const device::DeviceGeometry& geometry : all_geometries()) {
        const TensionSettings settings = settings_of(geometry);
        TensionSolver solver(settings);
        StringArray previous = all(settings.minimum);
        for (int k = 0; k < each; ++k) {
            const Programme programme{wire_matrix(geometry, random.pose()), random.wrench(), settings, previous};
            const TensionResult result = solver.solve(programme.wires, programme.wanted);
            ASSERT_TRUE(result.exact);
            for (const double tension : result.tensions) {
                ASSERT_GE(tension, settings.minimum);
                ASSERT_LE(tension, settings.maximum);
            }
            worst = std::max(worst, programme.kkt_violation(result.tensions));
            max_rounds = std::max(max_rounds, result.rounds);
            reached += result.reached ? 1 : 0;
            previous = result.tensions;
        }
    }
    EXPECT_LT(worst, 1e-9);
    EXPECT_LE(max_rounds, 30);
    // Guard: feasible and infeasible cases must both occur often.
    EXPECT_GT(reached, kCases / 5);
    EXPECT_LT(reached, kCases * 4 / 5);
    RecordProperty("worst_kkt", std::to_string(worst * 1e12) + "e-12");
    RecordProperty("most_rounds", max_rounds);
}

TEST(Tension, KeepsTheDirectionOfAnInfeasibleWrenchAndTheLargestFeasibleShare) {
    // Oracle for the largest share: wrench_reach() tries every vertex of the linear programme.
    RandomLoads random(31);
    int infeasible = 0;
    int max_rounds = 0;
    double share_of_reach = 0.0;
    for (const char* name : {"SpidarG6X3R", "SpidarG6X4", "SpidarG6X5R"}) {
        const device::DeviceGeometry geometry = device::built_in_geometry(name);
        TensionSettings settings = settings_of(geometry);
        settings.infeasible = Infeasible::Direction;
        for (int k = 0; k < 1000; ++k) {
            const Pose pose{random.direction() * 0.01, glm::angleAxis(0.2, random.direction())};
            const WireMatrix wires = wire_matrix(geometry, pose);
            const Wrench wanted = random.wrench();
            TensionSolver solver(settings);
            const TensionResult result = solver.solve(wires, wanted);
            max_rounds = std::max(max_rounds, result.rounds);
            for (const double tension : result.tensions) {
                ASSERT_GE(tension, settings.minimum);
                ASSERT_LE(tension, settings.maximum);
            }
            const std::optional<double> reach = device::wrench_reach(
                geometry, pose,
                {wanted.force.x, wanted.force.y, wanted.force.z, wanted.torque.x, wanted.torque.y, wanted.torque.z});
            ASSERT_TRUE(reach.has_value());
            if (result.reached) {
                EXPECT_EQ(result.scale, 1.0);
                continue;
            }
            const double size = std::max(glm::length(wanted.force), glm::length(wanted.torque) * settings.torque_scale);
            if (*reach * size < 0.5) {
                continue;  // almost infeasible: only the absolute tolerance applies
            }
            ++infeasible;
            // Below the oracle by 8 strings at full pull / 4096, and by what the effort term keeps from being met to
            // 1e-3; above it by as much as a wrench met to 1e-3 may lie outside. Both are larger where the direction
            // runs along the border of the feasible wrenches.
            share_of_reach += result.scale / *reach;
            EXPECT_GT(result.scale * size, *reach * size * 0.93 - 8.0 * settings.maximum / 4096.0);
            EXPECT_LT(result.scale * size, *reach * size * 1.05 + 0.02);
            EXPECT_LE(glm::length(result.wrench.force - result.scale * wanted.force),
                      std::max(1e-3, 1e-3 * result.scale * glm::length(wanted.force)) * 1.001);
            EXPECT_LE(glm::length(result.wrench.torque - result.scale * wanted.torque),
                      std::max(50e-6, 1e-3 * result.scale * glm::length(wanted.torque)) * 1.001);
        }
    }
    EXPECT_GT(infeasible, 500);
    EXPECT_NEAR(share_of_reach / infeasible, 1.0, 0.01);
    EXPECT_LE(max_rounds,
              (TensionSolver::kHalvings + 1) * (TensionSolver::kBlockRounds + TensionSolver::kDescentRounds));
    RecordProperty("most_rounds", max_rounds);
}

TEST(Tension, KeepingTheDirectionDoesNotChangeAFeasibleWrench) {
    RandomLoads random(32);
    TensionSettings settings = x3r_settings();
    TensionSolver closest(settings);
    settings.infeasible = Infeasible::Direction;
    TensionSolver direction(settings);
    for (int k = 0; k < 2000; ++k) {
        const WireMatrix wires = wire_matrix(device::spidar_g6_x3r(), {random.direction() * 0.01, Quat(1, 0, 0, 0)});
        const Wrench wanted{random.normal(), 0.01 * random.normal()};
        const TensionResult one = closest.solve(wires, wanted);
        ASSERT_TRUE(one.reached);
        ASSERT_EQ(one.tensions, direction.solve(wires, wanted).tensions);
    }
}

TEST(Tension, RespectsSlewAndBoundsWhileKeepingTheDirection) {
    RandomLoads random(33);
    TensionSettings settings = x3r_settings();
    settings.infeasible = Infeasible::Direction;
    settings.slew = 0.5;
    TensionSolver solver(settings);
    StringArray last = all(settings.minimum);
    for (int k = 0; k < 3000; ++k) {
        const StringArray now = solver.solve(random.wires(), random.wrench()).tensions;
        for (std::size_t i = 0; i < kStrings; ++i) {
            ASSERT_LE(std::abs(now[i] - last[i]), 0.5 * (1.0 + 1e-12));
            ASSERT_GE(now[i], 0.3);
            ASSERT_LE(now[i], 20.0);
        }
        last = now;
    }
}

TEST(Tension, OptimalityConditionsHoldWithSlewAndStrongTerms) {
    RandomLoads random(22);
    TensionSettings settings = x3r_settings();
    for (const auto& [effort, continuity, slew] : {std::array{1e-9, 0.0, 0.5}, std::array{0.0, 1e-3, 0.05},
                                                   std::array{0.3, 0.01, 2.0}, std::array{1e-5, 1e-5, 1e-6}}) {
        settings.effort = effort;
        settings.continuity = continuity;
        settings.slew = slew;
        TensionSolver solver(settings);
        StringArray previous = all(settings.minimum);
        for (int k = 0; k < 5000; ++k) {
            const Programme programme{random.wires(), random.wrench(), settings, previous};
            const TensionResult result = solver.solve(programme.wires, programme.wanted);
            ASSERT_TRUE(result.exact);
            ASSERT_LT(programme.kkt_violation(result.tensions), 1e-9);
            for (std::size_t i = 0; i < kStrings; ++i) {
                ASSERT_LE(std::abs(result.tensions[i] - previous[i]), slew * (1.0 + 1e-12));
            }
            previous = result.tensions;
        }
    }
}

TEST(Tension, AgreesWithTheBestOfAllActiveSets) {
    RandomLoads random(23);
    for (int k = 0; k < 120; ++k) {
        TensionSettings settings = x3r_settings();
        settings.effort = k % 2 == 0 ? 1e-5 : 1e-2;
        settings.slew = k % 3 == 0 ? 1.0 : kInfinity;
        const Programme programme{random.wires(), random.wrench(), settings, all(settings.minimum)};
        TensionSolver solver(settings);
        const TensionResult result = solver.solve(programme.wires, programme.wanted);
        const StringArray best = brute_force(programme);
        EXPECT_LE(programme.objective(result.tensions), programme.objective(best) * (1.0 + 1e-12) + 1e-15);
        for (std::size_t i = 0; i < kStrings; ++i) {
            // Rounding of 1e-16 in the gradient of some 100 N, over the smallest curvature, 1e-5.
            EXPECT_NEAR(result.tensions[i], best[i], 1e-7) << "string " << i;
        }
    }
}

TEST(Tension, KeepsMinimumTensionWhenTheWrenchIsInfeasible) {
    const WireMatrix wires = centre_wires();
    for (const double size : {50.0, 1e3, 1e9, 1e150, 1e308}) {
        for (const Vec3& direction : {Vec3(1.0, 0.0, 0.0), Vec3(0.0, -1.0, 0.0), Vec3(0.6, 0.0, 0.8)}) {
            TensionSolver solver(x3r_settings());
            const TensionResult result = solver.solve(wires, {direction * size, {0.0, 0.0, 0.0}});
            EXPECT_FALSE(result.reached);
            EXPECT_TRUE(result.exact);
            for (const double tension : result.tensions) {
                EXPECT_GE(tension, 0.3);
                EXPECT_LE(tension, 20.0);
            }
            EXPECT_GT(glm::dot(result.wrench.force, direction), 10.0) << "must pull in the wanted direction";
        }
    }
}

TEST(Tension, ReportsTheWrenchThatTheTensionsMake) {
    RandomLoads random(24);
    TensionSolver solver(x3r_settings());
    for (int k = 0; k < 100; ++k) {
        const WireMatrix wires = random.wires();
        const TensionResult result = solver.solve(wires, random.wrench());
        Vec3 force(0.0);
        Vec3 torque(0.0);
        for (std::size_t i = 0; i < kStrings; ++i) {
            force += result.tensions[i] * Vec3(wires[i][0], wires[i][1], wires[i][2]);
            torque += result.tensions[i] * Vec3(wires[i][3], wires[i][4], wires[i][5]);
        }
        EXPECT_LT(glm::length(force - result.wrench.force), 1e-12);
        EXPECT_LT(glm::length(torque - result.wrench.torque), 1e-12);
    }
}

TEST(Tension, ReachedTellsWhetherTheWrenchIsMet) {
    RandomLoads random(25);
    TensionSolver solver(x3r_settings());
    for (int k = 0; k < 5000; ++k) {
        const Wrench wanted = random.wrench();
        const TensionResult result = solver.solve(random.wires(), wanted);
        const double force_error = glm::length(result.wrench.force - wanted.force);
        const double torque_error = glm::length(result.wrench.torque - wanted.torque);
        const bool met = force_error <= std::max(1e-3, 1e-3 * glm::length(wanted.force)) &&
                         torque_error <= std::max(50e-6, 1e-3 * glm::length(wanted.torque));
        EXPECT_EQ(result.reached, met);
    }
}

TEST(Tension, SmallChangesOfTheWrenchMoveTensionsByABoundedAmount) {
    // For the same previous tensions, the minimiser of a programme with curvature of at least effort + continuity moves
    // by at most |W dw| / sqrt(effort + continuity).
    RandomLoads random(26);
    const Wrench small{{0.001, -0.002, 0.001}, {1e-5, 2e-5, -1e-5}};
    for (const double continuity : {1e-5, 1e-3, 1e-1}) {
        TensionSettings settings = x3r_settings();
        settings.continuity = continuity;
        const double change =
            std::sqrt(glm::dot(small.force, small.force) +
                      glm::dot(small.torque, small.torque) * settings.torque_scale * settings.torque_scale);
        const double bound = change / std::sqrt(settings.effort + settings.continuity);
        for (int k = 0; k < 1000; ++k) {
            const WireMatrix wires = random.wires();
            const Wrench wanted = random.wrench();
            TensionSolver one(settings);
            TensionSolver other(settings);
            const StringArray a = one.solve(wires, wanted).tensions;
            const StringArray b =
                other.solve(wires, {wanted.force + small.force, wanted.torque + small.torque}).tensions;
            double squared = 0.0;
            for (std::size_t i = 0; i < kStrings; ++i) {
                squared += (a[i] - b[i]) * (a[i] - b[i]);
            }
            ASSERT_LE(std::sqrt(squared), bound * (1.0 + 1e-9));
        }
    }
}

TEST(Tension, ContinuityTakesTheTensionsNearestToTheLastOnes) {
    // Two of eight dimensions do not change the wrench. After a detour through another wrench the tensions return to
    // the minimum effort at once without continuity, and only slowly with a strong one.
    const WireMatrix wires = centre_wires();
    const Wrench detour{{0.0, 0.0, 0.0}, {0.05, 0.0, 0.0}};
    const auto change_after = [&](double continuity) {
        TensionSettings settings = x3r_settings();
        settings.continuity = continuity;
        TensionSolver solver(settings);
        const Wrench wanted{{2.0, 1.0, 0.0}, {0.0, 0.0, 0.0}};
        for (int k = 0; k < 200; ++k) {
            solver.solve(wires, detour);
        }
        const StringArray before = solver.solve(wires, detour).tensions;
        const StringArray after = solver.solve(wires, wanted).tensions;
        double squared = 0.0;
        for (std::size_t i = 0; i < kStrings; ++i) {
            squared += (after[i] - before[i]) * (after[i] - before[i]);
        }
        return std::sqrt(squared);
    };
    EXPECT_LT(change_after(1e-3), change_after(0.0) - 0.01);
}

TEST(Tension, SlewBoundsAJumpBetweenDistantSets) {
    // A case at the border of the feasible wrenches: without slew, 0.02 N more moves a string by 18 N.
    TensionSettings settings = x3r_settings();
    settings.slew = 0.25;
    TensionSolver solver(settings);
    RandomLoads random(27);
    StringArray last = all(settings.minimum);
    for (int k = 0; k < 20000; ++k) {
        const StringArray now = solver.solve(random.wires(), random.wrench()).tensions;
        for (std::size_t i = 0; i < kStrings; ++i) {
            ASSERT_LE(std::abs(now[i] - last[i]), 0.25 * (1.0 + 1e-12));
            ASSERT_GE(now[i], 0.3);
        }
        last = now;
    }
}

TEST(Tension, NonFiniteWrenchCountsAsZero) {
    const WireMatrix wires = centre_wires();
    TensionSolver reference(x3r_settings());
    const StringArray at_rest = reference.solve(wires, {}).tensions;
    for (const double bad : {kNaN, kInfinity, -kInfinity}) {
        TensionSolver solver(x3r_settings());
        EXPECT_EQ(solver.solve(wires, {{0.0, bad, 0.0}, {0.0, 0.0, 0.0}}).tensions, at_rest);
        solver.reset();
        EXPECT_EQ(solver.solve(wires, {{1.0, 0.0, 0.0}, {0.0, 0.0, bad}}).tensions, at_rest);
    }
}

TEST(Tension, NonFiniteWiresGiveMinimumTensionAndAreReported) {
    TensionSolver solver(x3r_settings());
    solver.solve(centre_wires(), {{5.0, 0.0, 0.0}, {0.0, 0.0, 0.0}});
    for (const double bad : {kNaN, kInfinity, 1e308, 1e150, -1e7}) {
        WireMatrix wires = centre_wires();
        wires[3][4] = bad;
        wires[6][0] = bad;
        const TensionResult result = solver.solve(wires, {{5.0, 0.0, 0.0}, {0.0, 0.0, 0.0}});
        EXPECT_EQ(result.tensions, all(0.3));
        EXPECT_FALSE(result.reached);
        EXPECT_FALSE(result.exact);
        EXPECT_TRUE(std::isfinite(glm::length(result.wrench.force)));
    }
    EXPECT_TRUE(solver.solve(centre_wires(), {{5.0, 0.0, 0.0}, {0.0, 0.0, 0.0}}).reached) << "and it recovers";
}

TEST(Tension, DegenerateWiresStillHaveAUniqueMinimum) {
    const TensionSettings settings = x3r_settings();
    // No string has any effect: minimum effort.
    TensionSolver idle(settings);
    const TensionResult none = idle.solve(WireMatrix{}, {{1.0, 0.0, 0.0}, {0.0, 0.0, 0.0}});
    EXPECT_EQ(none.tensions, all(0.3));
    EXPECT_TRUE(none.exact);
    EXPECT_FALSE(none.reached);
    // Eight equal strings share the load.
    WireMatrix equal{};
    for (Vec6& row : equal) {
        row = {1.0, 0.0, 0.0, 0.0, 0.0, 0.0};
    }
    TensionSolver shared(settings);
    const TensionResult share = shared.solve(equal, {{16.0, 0.0, 0.0}, {0.0, 0.0, 0.0}});
    for (const double tension : share.tensions) {
        EXPECT_NEAR(tension, 2.0, 1e-4);
    }
    EXPECT_TRUE(share.reached);
}

TEST(Tension, WrenchesOnTheFacesOfTheBoxAreSolved) {
    // Wrenches of tensions that are at bounds themselves: zero multipliers, where an active-set method may cycle.
    RandomLoads random(28);
    const WireMatrix wires = centre_wires();
    TensionSolver solver(x3r_settings());
    StringArray previous = all(0.3);
    for (int k = 0; k < 20000; ++k) {
        StringArray goal{};
        for (double& tension : goal) {
            const double choice = random.uniform(0.0, 3.0);
            tension = choice < 1.0 ? 0.3 : (choice < 2.0 ? 20.0 : random.uniform(0.3, 20.0));
        }
        const Programme programme{wires, wrench_of_tensions(wires, goal), x3r_settings(), previous};
        const TensionResult result = solver.solve(wires, programme.wanted);
        ASSERT_TRUE(result.exact);
        ASSERT_LT(programme.kkt_violation(result.tensions), 1e-9);
        previous = result.tensions;
    }
}

TEST(Tension, SameCallsGiveTheSameBits) {
    TensionSolver one(x3r_settings());
    TensionSolver other(x3r_settings());
    RandomLoads random(29);
    for (int k = 0; k < 1000; ++k) {
        const WireMatrix wires = random.wires();
        const Wrench wanted = random.wrench();
        if (k % 100 == 0) {
            one.reset();
            other = TensionSolver(x3r_settings());
        }
        ASSERT_EQ(one.solve(wires, wanted).tensions, other.solve(wires, wanted).tensions);
    }
}

TEST(Tension, RejectsSettingsWithoutAUniqueMinimum) {
    const auto refused = [](auto change) {
        TensionSettings settings = x3r_settings();
        change(settings);
        EXPECT_THROW(TensionSolver{settings}, std::invalid_argument);
    };
    refused([](TensionSettings& s) { s.minimum = -0.1; });
    refused([](TensionSettings& s) { s.minimum = kNaN; });
    refused([](TensionSettings& s) { s.maximum = 0.3; });
    refused([](TensionSettings& s) { s.maximum = kInfinity; });
    refused([](TensionSettings& s) { s.torque_scale = 0.0; });
    refused([](TensionSettings& s) { s.effort = 0.0, s.continuity = 0.0; });
    refused([](TensionSettings& s) { s.effort = -1e-3, s.continuity = 1.0; });
    refused([](TensionSettings& s) { s.continuity = kNaN; });
    refused([](TensionSettings& s) { s.slew = 0.0; });
    refused([](TensionSettings& s) { s.slew = kNaN; });
}

}  // namespace
}  // namespace haptic::rt
