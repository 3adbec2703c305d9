// Bring-up: what the measurements of a device's first day mean. Which encoder counts which string, which motor pulls
// it, in which direction and how hard; and the device geometry that follows from that.
//
// A person pulls each string out by hand with the motors off, which finds its encoder; then each channel's motor pulls
// while the person watches, which finds its string; then a spring balance or a weight tells the tension of a code.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "haptic/device/device_geometry.hpp"

namespace haptic::rt {

/// Something that differs from the nominal geometry or from what a sound device does.
struct Deviation {
    std::string what;           // with the string
    std::string meaning;        // and what was done, or is to be done
    bool must_be_fixed = true;  // the protocol cannot be signed; otherwise the geometry file takes care of it

    friend bool operator==(const Deviation&, const Deviation&) = default;
};

/// A string that was pulled out by hand.
struct PullOut {
    double metres = 0.0;                          // by the ruler
    std::array<std::int64_t, kStrings> counts{};  // change of each channel's counter
};

/// The encoder of a string.
struct EncoderFinding {
    bool tried = false;
    int channel = -1;               // -1: no counter followed the string
    double metres_per_count = 0.0;  // m, with its sign: positive if the counter rises while the string pays out

    [[nodiscard]] bool found() const noexcept { return channel >= 0; }
};

/// The channel whose counter followed the string. None if the largest change is below a quarter of what is expected, or
/// if another counter followed by more than half as much.
[[nodiscard]] EncoderFinding judge_pull_out(const PullOut& pull, const device::StringFacts& nominal);

/// A motor that pulled, or should have.
struct MotorPull {
    std::int16_t code = 0;                        // DAC code of the channel, with the sign
    std::array<std::int64_t, kStrings> counts{};  // change of each channel's counter
    int seen = -1;                                // string that the person saw become tight; -1: none
};

enum class MotorState : std::uint8_t {
    Untried,
    Pulls,   // a string became tight
    Pushes,  // a string paid out and became loose
    Winds,   // a motor wound in without end, and no string became tight
    Still    // nothing moved
};

[[nodiscard]] std::string_view to_string(MotorState state);

/// The motor of a channel.
struct MotorFinding {
    MotorState state = MotorState::Untried;
    int string = -1;           // -1: unknown
    std::int16_t code = 0;     // that was used
    double movement = 0.0;     // m, by which its string paid out; negative: was wound in
    bool contradicts = false;  // the person saw another string than the counters
};

/// Least movement of a string that a motor caused, m, and the movement beyond which a string cannot be tight.
inline constexpr double kLeastMovement = 0.3e-3;
inline constexpr double kEndlessMovement = 0.25;

/// `encoders` are those of the strings, by judge_pull_out(). The string is the one that the person saw; if none, the
/// one that the counters show. With a string seen it pulls, even if its encoder stood still.
[[nodiscard]] MotorFinding judge_motor(const MotorPull& pull, const std::array<EncoderFinding, kStrings>& encoders);

/// One reading of the tension of a string.
struct Weighing {
    double code = 0.0;     // magnitude
    double newtons = 0.0;  // by the balance, or of the weight
};

/// Tension over code: newtons = newtons_per_code code - friction, by least squares; with one code without friction.
struct WeighingFit {
    double newtons_per_code = 0.0;  // N, of the magnitude
    double friction = 0.0;          // N
    double rms = 0.0;               // N, of what remains
};

/// Empty without a reading at a code and tension above zero, or if the tension does not rise with the code.
[[nodiscard]] std::optional<WeighingFit> fit_weighings(const std::vector<Weighing>& weighings);

/// Everything that was found about a device. Indexed by string or by channel, as named.
struct BringupFindings {
    std::array<EncoderFinding, kStrings> encoder_of_string;
    std::array<MotorFinding, kStrings> motor_of_channel;
    std::array<std::optional<WeighingFit>, kStrings> weight_of_string;
};

struct BringupResult {
    std::vector<Deviation> deviations;
    std::optional<device::DeviceGeometry> geometry;  // empty if no geometry can describe the device
};

/// Compares with the nominal geometry. Exchanged strings, exchanged motors, reversed encoders and reversed motors (on a
/// board with signed codes), scales of encoders and motors go to the geometry; dead motors and encoders, loose strings
/// and motors that push on a board with unsigned codes are for the workshop.
[[nodiscard]] BringupResult judge_bringup(const device::DeviceGeometry& nominal, const BringupFindings& findings);

/// Why a geometry is not a refinement of the measured one, as calibration makes it: it may move motors and knots and
/// change scales a little. Empty if it is one.
[[nodiscard]] std::string changed_beyond_calibration(const device::DeviceGeometry& measured,
                                                     const device::DeviceGeometry& refined);

/// Corner of a string as the person in front of the device sees it: "left, low, far".
[[nodiscard]] std::string corner_of(const device::DeviceGeometry& geometry, std::size_t string);

/// Round-trip times of exchanges, ns, and how many failed.
struct RoundTrips {
    std::vector<std::int64_t> times_ns;  // of those that succeeded
    std::uint64_t failed = 0;

    /// ns, below which this share (0 to 1) of the times lies; 0 if there are none.
    [[nodiscard]] std::int64_t quantile(double share) const;
};

/// What the round trips mean for a loop of this period with this many exchanges a tick.
[[nodiscard]] std::vector<Deviation> judge_round_trips(const RoundTrips& trips, std::int64_t period_ns, int exchanges);

/// Lines of a histogram with doubling buckets.
[[nodiscard]] std::string histogram_text(const RoundTrips& trips);

/// Decides from key presses whether a dead-man key is held. A terminal has no key-up: a held key repeats. The first
/// press is not enough, because its repeat may be late by more than the time-out; the second one is. Any other key
/// releases.
class DeadManKey {
  public:
    /// A repeat arrives at latest after this time.
    explicit DeadManKey(std::int64_t timeout_ns) : timeout_ns_(timeout_ns) {}

    /// At each poll: whether the key arrived, whether another one did.
    void update(std::int64_t now_ns, bool key, bool other);
    [[nodiscard]] bool held() const noexcept { return held_; }
    /// Was held and is no longer.
    [[nodiscard]] bool released() const noexcept { return released_; }

  private:
    std::int64_t timeout_ns_;
    std::int64_t last_ns_ = 0;
    bool pressed_ = false;  // at least once within the time-out
    bool held_ = false;
    bool released_ = false;
};

}  // namespace haptic::rt
