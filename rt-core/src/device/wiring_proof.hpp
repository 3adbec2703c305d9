// Wiring proof: whether each motor pulls its own string, and each encoder counts its own string in the right direction.
//
// While a hand holds the grip, all strings have a small equal tension, and each motor in turn pulls more and less by a
// little, a few times. The grip yields, and all lengths change: column i of D (8 x 8, m) holds the changes for motor i.
// With the pull a, the wire matrix W, the hand's unknown compliance C (6 x 6, symmetric), the friction f of each moving
// string and the sign S of each change,
//
//     D = -K (a G - f S),    K = W C W^T,
//
// where G is diagonal and holds 1 for a motor that pulls as its DAC codes say. For a hand that is equally soft in all
// directions K is known up to a factor: T = -W C_0 W^T. So
//     rows of D resemble the rows of T      else an encoder counts another string, or backwards,
//     columns resemble the columns of T     else a motor pulls another string,
//     a column is zero                      the motor is dead,
//     a column changes one length only      the string is slack or broken,
//     another G explains D much better      the motor pulls too strongly.
// A pull moves the grip by fractions of a millimetre, as does tremor, so the proof repeats until it is certain.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "device/kinematics.hpp"
#include "haptic/realtime.hpp"

namespace haptic::rt {

struct WiringProofSettings {
    double rest = 0.11;                   // N, tension of all strings
    double pull = 0.086;                  // N, more and less than that, of one motor
    std::int64_t half_ns = 120'000'000;   // ns, of more, and of less
    std::int64_t settle_ns = 50'000'000;  // ns of it, in which the grip settles
    int rounds = 12;                      // of all motors, until the proof begins anew
    double certainty = 8.0;               // answer over its noise, both rms, from which on it is judged
};

/// What the answers say about one string.
enum class StringFinding : std::uint8_t {
    Right,
    Silent,       // its motor moves nothing
    Alone,        // its motor moves this string only: slack or broken
    OtherMotor,   // its motor moves another string
    OtherString,  // its encoder counts another string
    Exchanged,    // its motor pulls another string, which its encoder counts
    Backwards,    // its encoder counts the wrong way
    Strong,       // its motor pulls about twice what was asked
    Unclear       // none of these, but not right either
};

[[nodiscard]] const char* describe(StringFinding finding) noexcept;

class WiringProof {
  public:
    enum class Verdict : std::uint8_t { Pending, Passed, Refused };
    using Answers = std::array<StringArray, kStrings>;  // [string][motor], m

    /// Throws std::invalid_argument for settings that are not positive, or a pull beyond the rest tension.
    WiringProof(const device::DeviceGeometry& geometry, const WiringProofSettings& settings);

    /// Begins anew.
    void reset() HAPTIC_RT;
    /// Takes one tick's lengths. The verdict is final until reset().
    Verdict update(const StringArray& lengths, std::int64_t elapsed_ns) HAPTIC_RT;
    /// N, for the motors in this tick.
    [[nodiscard]] StringArray tensions() const HAPTIC_RT;

    [[nodiscard]] Verdict verdict() const HAPTIC_RT { return verdict_; }
    [[nodiscard]] const std::array<StringFinding, kStrings>& findings() const HAPTIC_RT { return findings_; }
    /// For OtherMotor and OtherString: the string that was moved or counted.
    [[nodiscard]] const std::array<std::uint8_t, kStrings>& others() const HAPTIC_RT { return others_; }
    /// Bit i: string i was not found right.
    [[nodiscard]] std::uint8_t suspects() const HAPTIC_RT;
    /// Mean answers of all rounds so far; m for a change of tension by twice the pull.
    [[nodiscard]] const Answers& answers() const HAPTIC_RT { return answers_; }
    [[nodiscard]] int rounds() const HAPTIC_RT { return rounds_; }
    /// Largest error of explaining the answers, relative to them; of the right gains and of the best others.
    [[nodiscard]] double misfit() const HAPTIC_RT { return misfit_; }
    [[nodiscard]] double best_other_misfit() const HAPTIC_RT { return other_misfit_; }

  private:
    // Halves of one motor: less, more, less, more, less.
    static constexpr int kHalves = 5;
    // Right gains, each motor doubled or halved, and each pair of motors doubled.
    static constexpr std::size_t kGainHypotheses = 1 + 2 * kStrings + kStrings * (kStrings - 1) / 2;

    void add_motor() HAPTIC_RT;
    void finish_round() HAPTIC_RT;
    [[nodiscard]] bool answers_are_certain() const HAPTIC_RT;
    void judge_strings() HAPTIC_RT;
    void judge_silent_motors() HAPTIC_RT;
    void judge_channels() HAPTIC_RT;
    /// Names one exchange or one wrong direction that explains all answers, if there is such; else keeps the findings.
    void name_single_error() HAPTIC_RT;
    /// Correlation of all answers with the template of a device whose rows and columns i and j are exchanged, or whose
    /// row i is reversed.
    [[nodiscard]] double resemblance(std::size_t i, std::size_t j, bool rows, bool columns) const HAPTIC_RT;
    void find(std::size_t string, StringFinding finding, std::size_t other) HAPTIC_RT;
    void begin_gains() HAPTIC_RT;
    void judge_next_gain() HAPTIC_RT;
    [[nodiscard]] StringArray gains_of(std::size_t hypothesis) const HAPTIC_RT;
    [[nodiscard]] double misfit_of(const StringArray& gains) const HAPTIC_RT;

    WiringProofSettings settings_;
    Answers template_{};                           // T
    Answers projection_{};                         // W (W^T W)^-1 W^T
    std::array<StringArray, 3> to_translation_{};  // first three rows of (W^T W)^-1 W^T

    Verdict verdict_ = Verdict::Pending;
    std::array<StringFinding, kStrings> findings_{};
    std::array<std::uint8_t, kStrings> others_{};
    Answers answers_{};
    int rounds_ = 0;

    std::int64_t time_ns_ = 0;  // in this half
    std::size_t motor_ = 0;
    int half_ = 0;
    std::array<StringArray, kHalves> means_{};  // m, of each half of this motor
    StringArray sum_{};
    int summed_ = 0;
    double noise_squares_ = 0.0;  // m^2, sum over all pairs of cycles of the squared half difference
    std::size_t noise_count_ = 0;

    bool judging_gains_ = false;
    std::size_t hypothesis_ = 0;
    std::size_t best_hypothesis_ = 0;
    double misfit_ = 0.0;
    double other_misfit_ = 0.0;
};

}  // namespace haptic::rt
