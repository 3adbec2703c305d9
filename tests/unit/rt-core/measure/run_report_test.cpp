#include "measure/run_report.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <memory>
#include <nlohmann/json.hpp>

#include "haptic/device/device_geometry_file.hpp"

namespace haptic::rt {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

TEST(RunReport, HasTheDocumentedKeys) {
    const auto instruments = std::make_unique<Instruments>();
    instruments->ticks = 12;
    instruments->overruns = 3;
    instruments->period.record(1'000'000);
    instruments->frame_age.record(5'000'000);
    RunResult result;
    result.usage.page_faults = 4;
    result.faults = HAPTIC_FAULT_JUMP | HAPTIC_FAULT_STOP;
    const nlohmann::json report = make_report(result, *instruments);
    EXPECT_EQ(report.at("ticks"), 12);
    EXPECT_EQ(report.at("overruns"), 3);
    EXPECT_EQ(report.at("page_faults"), 4);
    for (const char* name : {"period_us", "wakeup_us", "compute_us"}) {
        for (const char* key : {"min", "p50", "p99", "p999", "max"}) {
            EXPECT_TRUE(report.at(name).at(key).is_number()) << name << '.' << key;
        }
    }
    for (const char* stage : {"exchange", "pose", "proxy", "tension", "publish"}) {
        EXPECT_TRUE(report.at("stage_us").at(stage).at("p99").is_number()) << stage;
    }
    for (const char* key : {"received", "rejected", "stale_ticks"}) {
        EXPECT_TRUE(report.at("frames").at(key).is_number()) << key;
    }
    EXPECT_NEAR(report.at("frames").at("age_ms").at("max").get<double>(), 5.0, 1e-9);
    for (const char* key : {"kernel", "preempt_rt", "policy", "priority", "cpu", "mlocked"}) {
        EXPECT_TRUE(report.at("setup").contains(key)) << key;
    }
    EXPECT_EQ(report.at("motors").at("peak_load").size(), kStrings);
    EXPECT_EQ(report.at("safety").at("state"), "disarmed");
    EXPECT_EQ(report.at("safety").at("faults"), nlohmann::json({"encoder_jump", "stop"}));
    EXPECT_EQ(report.at("histograms").at("period").size(), 1u);
}

TEST(RunReport, DistinguishesARequestedStopFromAFault) {
    RunResult result;
    result.faults = HAPTIC_FAULT_STOP;
    EXPECT_TRUE(result.succeeded());
    result.faults |= HAPTIC_FAULT_OVERRUN;
    EXPECT_FALSE(result.succeeded());
}

TEST(RunReport, CountsExchangeStatusesAndStatesTheirBound) {
    const auto instruments = std::make_unique<Instruments>();
    instruments->count(device::ExchangeStatus::Ok);
    instruments->count(device::ExchangeStatus::Ok);
    instruments->count(device::ExchangeStatus::Disconnected);
    instruments->count(device::ExchangeStatus::Ok);
    RunResult result;
    result.faults = HAPTIC_FAULT_EXCHANGE;
    result.device = "a device";
    result.exchange_bound_ns = 4'000'000;
    const nlohmann::json exchange = make_report(result, *instruments).at("exchange");
    EXPECT_EQ(exchange.at("statuses").at("ok"), 3);
    EXPECT_EQ(exchange.at("statuses").at("disconnected"), 1);
    EXPECT_EQ(exchange.at("statuses").size(), device::kExchangeStatuses);
    EXPECT_EQ(exchange.at("last_failure"), "disconnected");
    EXPECT_EQ(exchange.at("device"), "a device");
    EXPECT_EQ(exchange.at("bound_us"), 4000.0);
    EXPECT_THAT(summary(result, *instruments), HasSubstr("FAULT: exchange (disconnected)"));
}

TEST(RunReport, ReportsUseAndFailureOfTheProbes) {
    const auto instruments = std::make_unique<Instruments>();
    RunResult result;
    EXPECT_TRUE(make_report(result, *instruments).at("probes").at("tick").is_null());
    EXPECT_THAT(summary(result, *instruments), Not(HasSubstr("probe")));
    instruments->probe_edge.record(700);
    instruments->probe_off_ticks = 3;
    result.probes = {.tick = {"5 of pl061", 24, 0}, .frame = {"6 of pl061", 1, EIO}, .ticks = 12};
    const nlohmann::json report = make_report(result, *instruments);
    EXPECT_EQ(report.at("probes").at("tick"),
              nlohmann::json({{"line", "5 of pl061"}, {"edges", 24}, {"off", false}, {"error", ""}}));
    EXPECT_EQ(report.at("probes").at("frame").at("off"), true);
    EXPECT_EQ(report.at("probes").at("ticks"), 12);
    EXPECT_NEAR(report.at("probes").at("edge_us").at("max").get<double>(), 0.7, 1e-9);
    EXPECT_THAT(report.at("safety").at("notices"), testing::Contains("probe_off"));
    EXPECT_THAT(summary(result, *instruments), testing::AllOf(HasSubstr("24 edges"), HasSubstr("OFF: Input/output")));
}

TEST(RunReport, NamesTheSuspectedStringsOfAFault) {
    const auto instruments = std::make_unique<Instruments>();
    RunResult result;
    result.faults = HAPTIC_FAULT_SLACK;
    result.suspects = 0b1000;
    EXPECT_EQ(make_report(result, *instruments).at("safety").at("strings"), nlohmann::json({3}));
    EXPECT_THAT(summary(result, *instruments), HasSubstr("FAULT: slack (string 3)\n"));
    result.suspects = 0b1101001;
    EXPECT_THAT(string_numbers(result.suspects), ElementsAre(0, 3, 5, 6));
    EXPECT_THAT(summary(result, *instruments),
                HasSubstr("FAULT: slack (string 0, 3, 5 or 6: the lengths cannot distinguish them)\n"));
}

TEST(RunReport, ListsMissingPrivilegesAndFaultsInTheSummary) {
    const auto instruments = std::make_unique<Instruments>();
    RunResult result;
    result.setup.missing.push_back({"memory is not locked: no", "RLIMIT_MEMLOCK", "setcap"});
    EXPECT_THAT(summary(result, *instruments), HasSubstr("degraded: memory is not locked"));
    result.setup.missing.clear();
    EXPECT_THAT(summary(result, *instruments), Not(HasSubstr("degraded")));
    result.faults = HAPTIC_FAULT_JUMP;
    EXPECT_THAT(summary(result, *instruments), HasSubstr("FAULT: encoder_jump"));
}

/// Tensions t with A^T t = f w: f p + N z. p is the shortest solution for f = 1; N spans the tensions that cancel.
struct Tensions {
    StringArray p{};
    std::array<StringArray, 2> n{};
};

double dot(const StringArray& a, const StringArray& b) {
    double sum = 0.0;
    for (std::size_t i = 0; i < kStrings; ++i) {
        sum += a[i] * b[i];
    }
    return sum;
}

/// By Gram-Schmidt, twice for accuracy.
Tensions tensions_of(const device::DeviceGeometry& geometry, const WrenchAtPose& peak) {
    const auto& [force, torque] = peak.wrench;
    const std::array<double, 6> w{force.x, force.y, force.z, torque.x, torque.y, torque.z};
    // Rows of A^T, from unit tensions by definition; each is orthonormalised together with its side of A^T t = w.
    std::array<StringArray, 6> rows{};
    for (std::size_t i = 0; i < kStrings; ++i) {
        const device::StringFacts& string = geometry.strings[i];
        const Vec3 arm = peak.pose.orientation * string.grip;
        const Vec3 pull = glm::normalize(string.motor - peak.pose.position - arm);
        const Vec3 moment = glm::cross(arm, pull);
        for (Vec3::length_type k = 0; k < 3; ++k) {
            rows[static_cast<std::size_t>(k)][i] = pull[k];
            rows[static_cast<std::size_t>(k) + 3][i] = moment[k];
        }
    }
    std::array<double, 6> side = w;
    Tensions tensions;
    for (std::size_t k = 0; k < 6; ++k) {
        for (std::size_t j = 0; j < 2 * k; ++j) {
            const double share = dot(rows[k], rows[j % k]);
            for (std::size_t i = 0; i < kStrings; ++i) {
                rows[k][i] -= share * rows[j % k][i];
            }
            side[k] -= share * side[j % k];
        }
        const double length = std::sqrt(dot(rows[k], rows[k]));
        for (double& value : rows[k]) {
            value /= length;
        }
        side[k] /= length;
        for (std::size_t i = 0; i < kStrings; ++i) {
            tensions.p[i] += side[k] * rows[k][i];
        }
    }
    // Two arbitrary vectors, projected onto the null space.
    tensions.n = {{{1, 2, 3, 4, 5, 6, 7, 9}, {3, 1, -4, 1, 5, -9, 2, 6}}};
    for (StringArray& n : tensions.n) {
        for (std::size_t j = 0; j < 12; ++j) {
            const double share = dot(n, rows[j % 6]);
            for (std::size_t i = 0; i < kStrings; ++i) {
                n[i] -= share * rows[j % 6][i];
            }
        }
        const double length = std::sqrt(dot(n, n));
        for (double& value : n) {
            value /= length;
        }
    }
    return tensions;
}

/// Largest f with min <= f p + N z <= max for some z, by a scan of z that is refined around the best one. The largest f
/// is a concave function of z, so the best cell has the maximum in its neighbourhood.
double scan_of_reach(const device::DeviceGeometry& geometry, const WrenchAtPose& peak) {
    constexpr int kSteps = 150;  // to either side
    const Tensions t = tensions_of(geometry, peak);
    double best = 0.0;
    std::array<double, 2> centre{};
    double width = 4.0 * geometry.maximum_tension * std::sqrt(static_cast<double>(kStrings));
    for (int level = 0; level < 8; ++level, width *= 0.1) {
        const std::array<double, 2> middle = centre;
        for (int a = -kSteps; a <= kSteps; ++a) {
            for (int b = -kSteps; b <= kSteps; ++b) {
                const std::array<double, 2> z{middle[0] + width * a / kSteps, middle[1] + width * b / kSteps};
                // Each string bounds f from both sides.
                double low = 0.0;
                double high = 1e9;
                for (std::size_t i = 0; i < kStrings; ++i) {
                    const double cancelling = z[0] * t.n[0][i] + z[1] * t.n[1][i];
                    const double at_min = (geometry.minimum_tension - cancelling) / t.p[i];
                    const double at_max = (geometry.maximum_tension - cancelling) / t.p[i];
                    low = std::max(low, std::min(at_min, at_max));
                    high = std::min(high, std::max(at_min, at_max));
                }
                if (low <= high && high > best) {
                    best = high;
                    centre = z;
                }
            }
        }
    }
    return best;
}

TEST(RunReport, GivesPeaksAsTheShareOfTheStringsReachThatAScanOfTensionsFinds) {
    const auto instruments = std::make_unique<Instruments>();
    RunResult result;
    const Quat turned = glm::angleAxis(0.3, glm::normalize(Vec3(1.0, 2.0, -1.0)));
    for (const char* name : {"SpidarG6X3R", "SpidarG6X5R"}) {
        result.geometry = device::built_in_geometry(name);
        for (const Pose& pose : {Pose{}, Pose{{0.008, -0.006, 0.01}, turned}}) {
            instruments->at_peak_force = {{{1.0, -2.0, 0.5}, {0.004, 0.003, -0.002}}, pose};
            instruments->at_peak_torque = {{{0.2, 0.1, 0.3}, {-0.002, 0.012, 0.005}}, pose};
            const nlohmann::json peak = make_report(result, *instruments).at("peak");
            // The last level of the scan resolves z to 1e-8 of the tensions.
            EXPECT_NEAR(
                peak.at("force_share").get<double>() * scan_of_reach(result.geometry, instruments->at_peak_force), 1.0,
                1e-5)
                << name;
            EXPECT_NEAR(
                peak.at("torque_share").get<double>() * scan_of_reach(result.geometry, instruments->at_peak_torque),
                1.0, 1e-5)
                << name;
        }
    }
}

TEST(RunReport, LeavesAnX3rRoomAt3NAnd20MillinewtonMetresAtItsCentre) {
    const auto instruments = std::make_unique<Instruments>();
    RunResult result;
    result.geometry = device::spidar_g6_x3r();
    for (Vec3::length_type axis = 0; axis < 3; ++axis) {
        for (const double sign : {-1.0, 1.0}) {
            instruments->at_peak_force = {};
            instruments->at_peak_torque = {};
            instruments->at_peak_force.wrench.force[axis] = sign * 3.0;
            instruments->at_peak_torque.wrench.torque[axis] = sign * 0.02;
            const nlohmann::json peak = make_report(result, *instruments).at("peak");
            EXPECT_GT(peak.at("force_share"), 0.0);
            EXPECT_LT(peak.at("force_share"), 1.0);
            EXPECT_LT(peak.at("torque_share"), 1.0);
        }
    }
    // Twice the wrench is twice the share, also beyond the reach.
    instruments->at_peak_force.wrench.force = {40.0, 0.0, 0.0};
    const double share = make_report(result, *instruments).at("peak").at("force_share").get<double>();
    EXPECT_GT(share, 1.0);
    instruments->at_peak_force.wrench.force = {80.0, 0.0, 0.0};
    EXPECT_NEAR(make_report(result, *instruments).at("peak").at("force_share").get<double>(), 2.0 * share, 1e-9);
}

TEST(RunReport, LeavesOutTheShareWhereTheStringsMakeNoMultiple) {
    const auto instruments = std::make_unique<Instruments>();
    RunResult result;
    EXPECT_TRUE(make_report(result, *instruments).at("peak").at("force_share").is_null()) << "no wrench at all";
    EXPECT_THAT(summary(result, *instruments), HasSubstr("peak force 0.000 N, peak torque 0.0000 N*m\n"));
    // The strings of an X3F turn the grip about y in one direction only.
    result.geometry = device::built_in_geometry("SpidarG6X3F");
    instruments->at_peak_torque.wrench.torque = {0.0, 0.01, 0.0};
    EXPECT_TRUE(make_report(result, *instruments).at("peak").at("torque_share").is_null());
    instruments->at_peak_torque.wrench.torque = {0.0, -0.01, 0.0};
    EXPECT_TRUE(make_report(result, *instruments).at("peak").at("torque_share").is_number());
    EXPECT_THAT(summary(result, *instruments), HasSubstr("% of the strings' reach"));
}

TEST(RunReport, GivesThePartOfTimeInWhichEachLimitActed) {
    const auto instruments = std::make_unique<Instruments>();
    RunResult result;
    EXPECT_EQ(make_report(result, *instruments).at("limits").at("force"), 0.0);
    EXPECT_THAT(summary(result, *instruments), Not(HasSubstr("limits acted")));
    instruments->ticks = 200;
    instruments->force_limited_ticks = 20;
    instruments->slew_limited_ticks = 2;
    instruments->unreachable_ticks = 4;
    instruments->stiffness_limited_ticks = 50;
    instruments->passivity_ticks = 100;
    instruments->derated_ticks = 1;
    EXPECT_EQ(make_report(result, *instruments).at("limits"), nlohmann::json({{"force", 0.1},
                                                                              {"slew", 0.01},
                                                                              {"reach", 0.02},
                                                                              {"stiffness", 0.25},
                                                                              {"passivity", 0.5},
                                                                              {"derating", 0.005}}));
    EXPECT_THAT(summary(result, *instruments), HasSubstr("stiffness 25.00 %"));
}

}  // namespace
}  // namespace haptic::rt
