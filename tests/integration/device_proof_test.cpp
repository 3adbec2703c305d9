// A device that is wired or calibrated wrongly is refused before it pushes; a correct one is never refused.
//
// Every wiring error is emulated behind the whole tick: a person holds the grip with a trembling hand, arms the device,
// and once it runs moves the grip while a contact frame asks for a large force. The tests with "EveryPair" and
// "AThousand" in their names take minutes and are run by toolchain/proofs.

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <glm/geometric.hpp>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "haptic/device/device_geometry_file.hpp"
#include "haptic/device/wiring.hpp"
#include "random.hpp"
#include "tick_rig.hpp"

namespace haptic::rt {
namespace {

constexpr std::int64_t kTickNs = 1'000'000;
constexpr int kLongestStartTicks = 60'000;
constexpr int kLongestMotionTicks = 30'000;
// N, largest force that a refused device may have produced.
constexpr double kLargestForce = 0.5;

/// The hand that holds the grip, and how the device was assembled.
struct Start {
    std::string geometry = "SpidarG6X3R";
    std::string wiring = {};        // as in wiring.hpp; empty: correct
    Pose held = {};                 // of the grip when it is armed
    double hand_stiffness = 400.0;  // N/m
    double hand_rotational = 1.0;   // N m/rad
    double friction = 0.01;         // N, of each motor
    double tremor = 1e-4;           // m
    std::uint32_t seed = 1;
};

struct Result {
    SafetyState state = SafetyState::Disarmed;
    std::uint32_t faults = 0;
    std::uint8_t strings = 0;
    bool proved = false;
    double largest_force = 0.0;  // N, of the strings on the grip
    SafetyState state_at_peak = SafetyState::Disarmed;
    double start_s = 0.0;  // from arming to running
    double proof_s = 0.0;  // from running to the proof of the pose
};

/// Motion of a person who tries the device out: 15 mm and 9 degrees about every axis.
PoseTrack motion_from(const Pose& held, std::uint32_t seed) {
    test::Random random(seed);
    std::array<double, 6> rates{};
    for (double& rate : rates) {
        rate = random.uniform(1.0, 3.0);
    }
    std::vector<double> times;
    std::vector<Pose> poses;
    for (int k = 0; k <= 3000; ++k) {
        const double t = 0.01 * k;
        std::array<double, 6> wave{};
        for (std::size_t i = 0; i < wave.size(); ++i) {
            wave[i] = std::sin(rates[i] * t);
        }
        const Vec3 turn = 0.16 * Vec3(wave[3], wave[4], wave[5]);
        const double angle = glm::length(turn);
        const Quat rotation = angle > 0.0 ? glm::angleAxis(angle, turn / angle) : Quat(1.0, 0.0, 0.0, 0.0);
        times.push_back(t);
        poses.push_back({held.position + 0.015 * Vec3(wave[0], wave[1], wave[2]), rotation * held.orientation});
    }
    return {std::move(times), std::move(poses)};
}

/// One start of a device, from zero tension to the verdict.
class Rig {
  public:
    explicit Rig(const Start& start)
        : settings_(tick_settings(start)),
          board_(device_settings(start, settings_.geometry)),
          session_(test::unique_session()),
          frames_in_(session_),
          states_out_(session_),
          frames_out_(session_),
          tick_(settings_, board_, frames_in_, states_out_, test::still_clock) {}

    Result run() {
        tick_.arm();
        Result result;
        int ticks = 0;
        for (; ticks < kLongestStartTicks && starting(); ++ticks) {
            step(result);
        }
        result.start_s = 1e-3 * ticks;
        board_.device().release_hand();
        for (int k = 0; k < kLongestMotionTicks && tick_.safety_state() == SafetyState::Running && !result.proved;
             ++k) {
            step(result);
            result.proved = tick_.proof().pose == Proof::Passed;
            result.proof_s = 1e-3 * k;
        }
        result.state = tick_.safety_state();
        result.faults = tick_.faults();
        result.strings = tick_.suspect_strings();
        return result;
    }
    [[nodiscard]] DeviceProofResult proof() const { return tick_.proof(); }

  private:
    static TickSettings tick_settings(const Start& start) {
        TickSettings settings;
        settings.geometry = device::find_device_geometry(start.geometry);
        settings.safety.prove = true;
        return settings;
    }
    static device::EmulatedDevice::Settings device_settings(const Start& start,
                                                            const device::DeviceGeometry& geometry) {
        device::GripMechanics mechanics;
        mechanics.hand_stiffness = start.hand_stiffness;
        mechanics.hand_damping = 0.2 * std::sqrt(start.hand_stiffness);
        mechanics.hand_rotational_stiffness = start.hand_rotational;
        mechanics.motor_friction = start.friction;
        device::EmulatedDevice::Settings settings{.geometry = geometry,
                                                  .hand = motion_from(start.held, start.seed),
                                                  .power_up = {100, 65500, 3, 40000, 0, 7, 12345, 65535},
                                                  .hand_waits = true,
                                                  .mechanics = mechanics};
        if (!start.wiring.empty()) {
            add_wiring(settings.wiring, start.wiring);
        }
        settings.tremor = {.position = start.tremor,
                           .rotation = 5.0 * start.tremor,
                           .drift = 3.0 * start.tremor,
                           .drift_rotation = 15.0 * start.tremor,
                           .seed = start.seed};
        return settings;
    }
    [[nodiscard]] bool starting() const {
        return tick_.safety_state() != SafetyState::Running && tick_.safety_state() != SafetyState::Faulted &&
               tick_.safety_state() != SafetyState::Disarmed;
    }
    void step(Result& result) {
        // A floor above the grip asks for far more than an unproven device may give.
        if (now_ns_ % (20 * kTickNs) == 0) {
            ContactFrame floor = test::floor_frame(0.03, 400.0, now_ns_);
            frames_out_.publish(floor, now_ns_);
        }
        tick_.run({now_ns_, now_ns_, 0});
        now_ns_ += kTickNs;
        const double force = glm::length(board_.device().wrench().force);
        if (force > result.largest_force) {
            result.largest_force = force;
            result.state_at_peak = tick_.safety_state();
        }
    }

    TickSettings settings_;
    device::EmulatedBoard board_;
    std::string session_;
    RingReader<ContactFrame> frames_in_;
    RingWriter<DeviceState> states_out_;
    RingWriter<ContactFrame> frames_out_;
    Tick tick_;
    std::int64_t now_ns_ = kTickNs;
};

Result run(const Start& start) {
    return Rig(start).run();
}

std::vector<std::string> single_errors() {
    std::vector<std::string> errors;
    for (int i = 0; i < 8; ++i) {
        const std::string one = std::to_string(i);
        errors.insert(errors.end(), {"sign:" + one, "gain:" + one + "=2", "dead:" + one, "slack:" + one});
        for (int j = i + 1; j < 8; ++j) {
            const std::string two = one + "," + std::to_string(j);
            errors.insert(errors.end(), {"strings:" + two, "motors:" + two, "encoders:" + two});
        }
    }
    return errors;
}

/// The kind of an error, or of both: "sign", "gain + strings".
std::string kind_of(const std::string& wiring) {
    const auto head = [](const std::string& text) { return text.substr(0, text.find(':')); };
    const std::size_t plus = wiring.find('+');
    if (plus == std::string::npos) {
        return head(wiring);
    }
    std::string one = head(wiring);
    std::string two = head(wiring.substr(plus + 1));
    return std::min(one, two) + " + " + std::max(one, two);
}

struct Tally {
    int tried = 0;
    int refused = 0;
    int named = 0;  // at least one of the strings that are wired wrong is among those named
    double largest_force = 0.0;
};

/// Strings that a wiring concerns.
std::uint8_t strings_of(const std::string& wiring) {
    device::Wiring parsed;
    add_wiring(parsed, wiring);
    unsigned bits = 0;
    for (std::size_t i = 0; i < kStrings; ++i) {
        const bool right = parsed.motor_of[i] == i && parsed.encoder_of[i] == i && parsed.gain[i] == 1.0 &&
                           parsed.encoder_factor[i] == 1.0 && !parsed.dead[i] && !parsed.slack[i];
        bits |= right ? 0U : 1U << i;
    }
    return static_cast<std::uint8_t>(bits);
}

/// Tries each wiring; prints a table by kind, and a line for each that was not refused or pushed too hard.
void expect_refused(const std::string& geometry, const std::vector<std::string>& wirings) {
    std::map<std::string, Tally> tallies;
    for (const std::string& wiring : wirings) {
        device::Wiring parsed;
        add_wiring(parsed, wiring);
        if (parsed.correct()) {
            continue;  // two errors that undo each other
        }
        const Result result = run({.geometry = geometry, .wiring = wiring});
        Tally& tally = tallies[kind_of(wiring)];
        ++tally.tried;
        const bool refused = result.faults != 0 && !result.proved;
        tally.refused += refused ? 1 : 0;
        const bool named = (result.strings & strings_of(wiring)) != 0;
        tally.named += named ? 1 : 0;
        if (!named) {
            std::printf("%s with %s: named %#x, faults %#x\n", geometry.c_str(), wiring.c_str(),
                        unsigned{result.strings}, result.faults);
        }
        tally.largest_force = std::max(tally.largest_force, result.largest_force);
        EXPECT_TRUE(refused) << geometry << " with " << wiring << (result.proved ? ": proved" : ": neither");
        EXPECT_LE(result.largest_force, kLargestForce)
            << geometry << " with " << wiring << ": running after " << result.start_s << " s, refused "
            << result.proof_s << " s later, in state " << static_cast<int>(result.state_at_peak) << ", faults "
            << result.faults;
    }
    std::printf(
        "\n%s\n| wired wrong | tried | refused | string named | largest force before, N |\n|---|---|---|---|---|\n",
        geometry.c_str());
    for (const auto& [kind, tally] : tallies) {
        std::printf("| %s | %d | %d | %d | %.2f |\n", kind.c_str(), tally.tried, tally.refused, tally.named,
                    tally.largest_force);
    }
}

class DeviceProofOf : public testing::TestWithParam<const char*> {};

TEST_P(DeviceProofOf, RefusesEverySingleWiringErrorBeforeItPushes) {
    expect_refused(GetParam(), single_errors());
}

TEST_P(DeviceProofOf, DISABLED_RefusesEveryPairOfWiringErrorsBeforeItPushes) {
    const std::vector<std::string> errors = single_errors();
    std::vector<std::string> pairs;
    for (std::size_t i = 0; i < errors.size(); ++i) {
        for (std::size_t j = i + 1; j < errors.size(); ++j) {
            pairs.push_back(errors[i] + "+" + errors[j]);
        }
    }
    // A part of the pairs, to divide them among processes: every Nth from the Kth.
    const char* const part = std::getenv("HAPTIC_PROOF_PART");  // NOLINT(concurrency-mt-unsafe)
    int first = 0;
    int stride = 1;
    if (part != nullptr) {
        ASSERT_EQ(std::sscanf(part, "%d/%d", &first, &stride), 2) << "HAPTIC_PROOF_PART must be K/N";
    }
    std::vector<std::string> chosen;
    for (std::size_t k = static_cast<std::size_t>(first); k < pairs.size(); k += static_cast<std::size_t>(stride)) {
        chosen.push_back(pairs[k]);
    }
    expect_refused(GetParam(), chosen);
}

/// A correct device, started by different people.
Start correct_start(const char* geometry, std::uint32_t seed) {
    test::Random random(seed);
    Start start{.geometry = geometry};
    start.held = {2e-3 * random.direction(), glm::angleAxis(0.04, random.direction())};
    start.hand_stiffness = random.uniform(200.0, 800.0);
    start.hand_rotational = start.hand_stiffness / 400.0 * random.uniform(0.5, 2.0);
    start.friction = random.uniform(0.0, 0.02);
    start.tremor = random.uniform(0.0, 1.5e-4);
    start.seed = seed;
    return start;
}

void expect_accepted(const char* geometry, std::uint32_t starts) {
    int refused = 0;
    double longest_start_s = 0.0;
    double longest_proof_s = 0.0;
    for (std::uint32_t seed = 1; seed <= starts; ++seed) {
        Rig rig(correct_start(geometry, seed));
        const Result result = rig.run();
        EXPECT_TRUE(result.proved) << geometry << ", seed " << seed << ": faults " << result.faults << ", strings "
                                   << int{result.strings} << ", after " << result.start_s << " and " << result.proof_s;
        refused += result.faults != 0 ? 1 : 0;
        longest_start_s = std::max(longest_start_s, result.start_s);
        longest_proof_s = std::max(longest_proof_s, result.proof_s);
    }
    std::printf("%s: %d of %u starts refused; running after %.1f s at most, pose proved %.1f s later at most\n",
                geometry, refused, starts, longest_start_s, longest_proof_s);
}

TEST_P(DeviceProofOf, NeverRefusesACorrectDevice) {
    expect_accepted(GetParam(), 24);
}

TEST_P(DeviceProofOf, DISABLED_NeverRefusesACorrectDeviceInAThousandStarts) {
    expect_accepted(GetParam(), 1000);
}

TEST_P(DeviceProofOf, RefusesAGripThatIsArmedAwayFromTheCentreOrTurned) {
    for (const Pose& held :
         {Pose{{0.0, -0.02, 0.0}, Quat(1.0, 0.0, 0.0, 0.0)}, Pose{{0.02, 0.0, 0.0}, Quat(1.0, 0.0, 0.0, 0.0)},
          Pose{Vec3(0.0), glm::angleAxis(0.5236, Vec3(0.0, 1.0, 0.0))},
          Pose{Vec3(0.0), glm::angleAxis(-0.5236, Vec3(1.0, 0.0, 0.0))}}) {
        const Result result = run({.geometry = GetParam(), .held = held});
        EXPECT_FALSE(result.proved);
        EXPECT_NE(result.faults, 0u);
        EXPECT_LE(result.largest_force, kLargestForce);
    }
}

TEST_P(DeviceProofOf, RendersInFullOnceThePoseIsProved) {
    // Tick flags tell the simulation and the view what is limited.
    Start start{.geometry = GetParam()};
    const Result result = run(start);
    EXPECT_TRUE(result.proved);
    EXPECT_EQ(result.faults, 0u);
    EXPECT_LE(result.largest_force, kLargestForce);
}

INSTANTIATE_TEST_SUITE_P(Geometries, DeviceProofOf, testing::Values("SpidarG6X3R", "SpidarG6X4"),
                         [](const testing::TestParamInfo<const char*>& param) { return param.param; });

}  // namespace
}  // namespace haptic::rt
