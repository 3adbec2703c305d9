#include "device/bringup.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <glm/geometric.hpp>

#include "formatted.hpp"
#include "haptic/device/dac_codes.hpp"
#include "haptic/types.hpp"

namespace haptic::rt {
namespace {

using haptic::detail::formatted;

// Least share of the expected counts at which a counter follows a string, and largest share of the winner's counts of
// any other one.
constexpr double kFollows = 0.25;
constexpr double kAmbiguous = 0.5;
// A ruler reads 2 of 50 mm; below this the nominal scale is kept. A spring balance is as good as its reading.
constexpr double kRuler = 0.06;
constexpr double kBalance = 0.15;
// m, by which calibration may move a motor or a knot.
constexpr double kMostRefined = 0.015;
// A factor beyond which gain or scale hints at another part, not at tolerance.
constexpr double kOtherPart = 1.5;
// The largest code must make more than the maximum tension.
constexpr double kHeadroom = 0.98;
constexpr double kFailedShare = 0.001;

/// m by which a string paid out.
double paid_out(const EncoderFinding& encoder, const std::array<std::int64_t, kStrings>& counts) {
    return encoder.found()
               ? static_cast<double>(counts[static_cast<std::size_t>(encoder.channel)]) * encoder.metres_per_count
               : 0.0;
}

std::string name_of(const device::DeviceGeometry& geometry, std::size_t string) {
    return "string " + std::to_string(string) + " (" + corner_of(geometry, string) + ")";
}

/// Judges one device; collects deviations while it builds the geometry.
class Judge {
  public:
    Judge(const device::DeviceGeometry& nominal, const BringupFindings& findings)
        : nominal_(nominal), findings_(findings), geometry_(nominal) {
        motor_channel_.fill(-1);
    }

    BringupResult result() {
        judge_encoders();
        judge_motors();
        judge_exchanges();
        const bool complete = encoders_complete() && motors_complete();
        if (complete) {
            build();
        }
        return {deviations_, complete ? std::optional(geometry_) : std::nullopt};
    }

  private:
    void note(const std::string& what, const std::string& meaning, bool must_be_fixed) {
        deviations_.push_back({what, meaning, must_be_fixed});
    }

    void judge_encoders() {
        std::array<int, kStrings> counted_by{};
        counted_by.fill(-1);
        for (std::size_t s = 0; s < kStrings; ++s) {
            const EncoderFinding& encoder = findings_.encoder_of_string[s];
            if (!encoder.tried) {
                continue;
            }
            if (!encoder.found()) {
                note("no counter follows " + name_of(nominal_, s),
                     "its encoder is dead or not connected; check cable and encoder, then repeat the step", true);
                continue;
            }
            int& other = counted_by[static_cast<std::size_t>(encoder.channel)];
            if (other >= 0) {
                note(formatted("channel %d follows both string %d and string %zu", encoder.channel, other, s),
                     "one of the two was pulled by mistake, or encoder cables touch; repeat the step", true);
                encoders_clash_ = true;
            }
            other = static_cast<int>(s);
            judge_scale(s, encoder);
        }
    }

    void judge_scale(std::size_t s, const EncoderFinding& encoder) {
        const double expected = nominal_.strings[s].metres_per_count;
        if (encoder.metres_per_count * expected < 0.0) {
            note("the encoder of " + name_of(nominal_, s) + " counts backwards",
                 "its two signals are exchanged; the geometry file reverses the sign", false);
        }
        const double ratio = std::fabs(encoder.metres_per_count / expected);
        if (std::fabs(ratio - 1.0) > kRuler) {
            const bool other_part = ratio > kOtherPart || ratio < 1.0 / kOtherPart;
            note(formatted("a count of string %zu is %.3f of the expected length", s, ratio),
                 std::string(other_part ? "another encoder or pulley, or a wrong reading of the ruler; " : "") +
                     "the geometry file has the measured length",
                 false);
        }
    }

    void judge_motors() {
        for (std::size_t c = 0; c < kStrings; ++c) {
            const MotorFinding& motor = findings_.motor_of_channel[c];
            const std::string channel = "channel " + std::to_string(c);
            if (motor.state == MotorState::Untried) {
                continue;
            }
            if (motor.state == MotorState::Still) {
                note("the motor of " + channel + " does not pull",
                     "no current: check amplifier, cable and motor, then repeat the step", true);
                continue;
            }
            if (motor.state == MotorState::Winds) {
                note("the motor of " + channel + " winds, but no string becomes tight",
                     motor.string >= 0 ? "string " + std::to_string(motor.string) + " is loose, torn or off its pulley"
                                       : "its string is loose, torn or off its pulley",
                     true);
                continue;
            }
            if (motor.string < 0) {
                note("nobody saw which string " + channel + " moves", "repeat the step", true);
                continue;
            }
            judge_motor_of(c, motor);
        }
    }

    void judge_motor_of(std::size_t c, const MotorFinding& motor) {
        const auto s = static_cast<std::size_t>(motor.string);
        if (motor.contradicts) {
            note(formatted("channel %zu tightened string %zu for the eye, but its encoder did not follow", c, s),
                 "the wrong string was pulled out in the first step, or the wrong number typed; repeat both", true);
        }
        if (motor.state == MotorState::Pushes) {
            note("the motor of " + name_of(nominal_, s) + " pushes",
                 nominal_.board == device::BoardKind::Uart
                     ? "and with codes of the other sign no string became tight: check its wires, then repeat the step"
                     : "its two wires are exchanged; swap them, because this board has no negative codes",
                 true);
        } else if (motor.code * nominal_.strings[s].newtons_per_code < 0.0) {
            note("the motor of " + name_of(nominal_, s) + " pulls with codes of the other sign",
                 "its two wires are exchanged; the geometry file reverses the sign", false);
        }
        if (motor_channel_[s] >= 0) {
            note(formatted("channels %d and %zu both move string %zu", motor_channel_[s], c, s),
                 "the wrong number was typed, or two motors are on one string; repeat the step", true);
            motors_clash_ = true;
        }
        motor_channel_[s] = static_cast<int>(c);
    }

    /// Strings whose channels differ from the nominal ones, as exchanges where two strings exchanged them.
    void judge_exchanges() {
        for (std::size_t s = 0; s < kStrings; ++s) {
            const int encoder = findings_.encoder_of_string[s].channel;
            const int motor = motor_channel_[s];
            const bool encoder_moved = encoder >= 0 && encoder != static_cast<int>(s);
            const bool motor_moved = motor >= 0 && motor != nominal_.motor_channels[s];
            if (!encoder_moved && !motor_moved) {
                continue;
            }
            std::string what = encoder_moved && motor_moved ? "" : encoder_moved ? "the encoder of " : "the motor of ";
            what += name_of(nominal_, s) + " is on ";
            const std::string where = encoder_moved && motor_moved && encoder == motor ? formatted("channel %d", motor)
                                      : encoder_moved && motor_moved
                                          ? formatted("channels %d (motor) and %d (encoder)", motor, encoder)
                                          : formatted("channel %d", encoder_moved ? encoder : motor);
            what += where;
            what += formatted(" instead of %zu", s);
            note(what, "plugs are exchanged; the geometry file has it", false);
        }
    }

    [[nodiscard]] bool encoders_complete() const {
        return !encoders_clash_ && std::all_of(findings_.encoder_of_string.begin(), findings_.encoder_of_string.end(),
                                               [](const EncoderFinding& encoder) { return encoder.found(); });
    }
    [[nodiscard]] bool motors_complete() const {
        return !motors_clash_ &&
               std::all_of(motor_channel_.begin(), motor_channel_.end(), [](int channel) { return channel >= 0; });
    }

    /// The geometry, in the order of the channels that count.
    void build() {
        for (std::size_t s = 0; s < kStrings; ++s) {
            const EncoderFinding& encoder = findings_.encoder_of_string[s];
            const auto channel = static_cast<std::size_t>(encoder.channel);
            device::StringFacts& string = geometry_.strings[channel];
            string = nominal_.strings[s];
            geometry_.motor_channels[channel] = static_cast<std::uint8_t>(motor_channel_[s]);
            const double nominal_scale = std::fabs(string.metres_per_count);
            const double measured = std::fabs(encoder.metres_per_count);
            const bool kept = std::fabs(measured / nominal_scale - 1.0) <= kRuler;
            string.metres_per_count = std::copysign(kept ? nominal_scale : measured, encoder.metres_per_count);
            string.newtons_per_code = newtons_per_code(s);
        }
        limit_tension();
    }

    double newtons_per_code(std::size_t s) {
        const double nominal = nominal_.strings[s].newtons_per_code;
        const MotorFinding& motor = findings_.motor_of_channel[static_cast<std::size_t>(motor_channel_[s])];
        double magnitude = std::fabs(nominal);
        if (const std::optional<WeighingFit>& fit = findings_.weight_of_string[s]) {
            const double ratio = fit->newtons_per_code / magnitude;
            if (std::fabs(ratio - 1.0) > kBalance) {
                note(formatted("a code of string %zu pulls %.2f times as hard as expected", s, ratio),
                     "another gain of amplifier or motor; the geometry file has the measured newtons per code", false);
            }
            magnitude = fit->newtons_per_code;
        }
        return motor.state == MotorState::Pulls ? std::copysign(magnitude, motor.code) : nominal;
    }

    void limit_tension() {
        double largest = geometry_.maximum_tension;
        for (const device::StringFacts& string : geometry_.strings) {
            largest = std::min(largest, kHeadroom * device::kMaxDacCode * std::fabs(string.newtons_per_code));
        }
        if (largest < geometry_.maximum_tension) {
            note(formatted("the largest code makes %.1f N, less than the maximum tension of %.1f N",
                           largest / kHeadroom, geometry_.maximum_tension),
                 formatted("the geometry file has a maximum tension of %.1f N", largest), false);
            geometry_.maximum_tension = largest;
        }
    }

    const device::DeviceGeometry& nominal_;
    const BringupFindings& findings_;
    device::DeviceGeometry geometry_;
    std::vector<Deviation> deviations_;
    std::array<int, kStrings> motor_channel_{};  // by string
    bool encoders_clash_ = false;
    bool motors_clash_ = false;
};

}  // namespace

EncoderFinding judge_pull_out(const PullOut& pull, const device::StringFacts& nominal) {
    std::array<std::int64_t, kStrings> sizes{};
    for (std::size_t i = 0; i < kStrings; ++i) {
        sizes[i] = std::llabs(pull.counts[i]);
    }
    // The counter that changed most, and the one after it.
    const auto winner = static_cast<std::size_t>(std::max_element(sizes.begin(), sizes.end()) - sizes.begin());
    const auto largest = static_cast<double>(sizes[winner]);
    sizes[winner] = 0;
    const auto second = static_cast<double>(*std::max_element(sizes.begin(), sizes.end()));
    const double expected = std::fabs(pull.metres / nominal.metres_per_count);
    if (!(largest > kFollows * expected) || second > kAmbiguous * largest) {
        return {.tried = true};
    }
    return {true, static_cast<int>(winner), pull.metres / static_cast<double>(pull.counts[winner])};
}

std::string_view to_string(MotorState state) {
    switch (state) {
        case MotorState::Pulls:
            return "pulls";
        case MotorState::Pushes:
            return "pushes";
        case MotorState::Winds:
            return "winds without end";
        case MotorState::Still:
            return "does not move";
        case MotorState::Untried:
            break;
    }
    return "was not tried";
}

MotorFinding judge_motor(const MotorPull& pull, const std::array<EncoderFinding, kStrings>& encoders) {
    // The strings that were wound in, and that paid out, most.
    std::array<double, kStrings> moved{};
    for (std::size_t s = 0; s < kStrings; ++s) {
        moved[s] = paid_out(encoders[s], pull.counts);
    }
    const auto in = static_cast<std::size_t>(std::min_element(moved.begin(), moved.end()) - moved.begin());
    const auto out = static_cast<std::size_t>(std::max_element(moved.begin(), moved.end()) - moved.begin());
    MotorFinding finding;
    finding.state = MotorState::Still;
    finding.code = pull.code;
    if (pull.seen >= 0) {
        // The eye decides; the counters confirm.
        finding.state = MotorState::Pulls;
        finding.string = pull.seen;
        finding.movement = moved[static_cast<std::size_t>(pull.seen)];
        finding.contradicts = static_cast<std::size_t>(pull.seen) != in && moved[in] < -kLeastMovement;
    } else if (moved[in] < -kEndlessMovement || (moved[in] < -kLeastMovement && -moved[in] >= moved[out])) {
        finding.state = MotorState::Winds;
        finding.string = static_cast<int>(in);
        finding.movement = moved[in];
    } else if (moved[out] > kLeastMovement) {
        finding.state = MotorState::Pushes;
        finding.string = static_cast<int>(out);
        finding.movement = moved[out];
    }
    return finding;
}

std::optional<WeighingFit> fit_weighings(const std::vector<Weighing>& weighings) {
    double count = 0.0;
    double code = 0.0;
    double newtons = 0.0;
    for (const Weighing& one : weighings) {
        if (!(one.code > 0.0) || !(one.newtons > 0.0)) {
            return std::nullopt;
        }
        count += 1.0;
        code += one.code;
        newtons += one.newtons;
    }
    if (count == 0.0) {
        return std::nullopt;
    }
    code /= count;
    newtons /= count;
    double codes_squared = 0.0;
    double product = 0.0;
    for (const Weighing& one : weighings) {
        codes_squared += (one.code - code) * (one.code - code);
        product += (one.code - code) * (one.newtons - newtons);
    }
    // One code determines only the ratio; several also the friction that holds the string back.
    WeighingFit fit;
    fit.newtons_per_code = codes_squared > 0.0 ? product / codes_squared : newtons / code;
    if (!(fit.newtons_per_code > 0.0)) {
        return std::nullopt;
    }
    fit.friction = fit.newtons_per_code * code - newtons;
    double squares = 0.0;
    for (const Weighing& one : weighings) {
        const double rest = one.newtons - (fit.newtons_per_code * one.code - fit.friction);
        squares += rest * rest;
    }
    fit.rms = std::sqrt(squares / count);
    return fit;
}

BringupResult judge_bringup(const device::DeviceGeometry& nominal, const BringupFindings& findings) {
    return Judge(nominal, findings).result();
}

std::string changed_beyond_calibration(const device::DeviceGeometry& measured, const device::DeviceGeometry& refined) {
    if (measured.board != refined.board || measured.uart_boards != refined.uart_boards ||
        measured.motor_channels != refined.motor_channels) {
        return "its board or a motor_channel is another one";
    }
    if (refined.minimum_tension < measured.minimum_tension || refined.maximum_tension > measured.maximum_tension) {
        return "its tensions are beyond the measured ones";
    }
    for (std::size_t i = 0; i < kStrings; ++i) {
        const device::StringFacts& before = measured.strings[i];
        const device::StringFacts& after = refined.strings[i];
        if (before.newtons_per_code != after.newtons_per_code) {
            return formatted("newtons_per_code of string %zu is another one", i);
        }
        if (!(std::fabs(after.metres_per_count / before.metres_per_count - 1.0) <= kRuler)) {
            return formatted("metres_per_count of string %zu differs by more than %.0f %%", i, 100.0 * kRuler);
        }
        if (glm::length(after.motor - before.motor) > kMostRefined ||
            glm::length(after.grip - before.grip) > kMostRefined) {
            return formatted("motor or knot of string %zu is more than %.0f mm away", i, 1e3 * kMostRefined);
        }
    }
    return {};
}

std::string corner_of(const device::DeviceGeometry& geometry, std::size_t string) {
    // Relative to the largest coordinate, because the structures differ in size.
    double largest = 0.0;
    for (const device::StringFacts& one : geometry.strings) {
        largest = std::max({largest, std::fabs(one.motor.x), std::fabs(one.motor.y), std::fabs(one.motor.z)});
    }
    const Vec3 motor = geometry.strings[string].motor / largest;
    constexpr double aside = 0.2;
    std::string corner;
    const auto add = [&corner](double coordinate, const char* negative, const char* positive) {
        if (std::fabs(coordinate) > aside) {
            corner += (corner.empty() ? "" : ", ") + std::string(coordinate < 0.0 ? negative : positive);
        }
    };
    add(motor.x, "left", "right");
    add(motor.y, "low", "high");
    add(motor.z, "far", "near");
    return corner.empty() ? "middle" : corner;
}

std::int64_t RoundTrips::quantile(double share) const {
    if (times_ns.empty()) {
        return 0;
    }
    std::vector<std::int64_t> sorted = times_ns;
    const auto at = static_cast<std::ptrdiff_t>(std::lround(share * static_cast<double>(sorted.size() - 1)));
    std::nth_element(sorted.begin(), sorted.begin() + at, sorted.end());
    return sorted[static_cast<std::size_t>(at)];
}

std::vector<Deviation> judge_round_trips(const RoundTrips& trips, std::int64_t period_ns, int exchanges) {
    std::vector<Deviation> deviations;
    const auto total = static_cast<double>(trips.times_ns.size()) + static_cast<double>(trips.failed);
    if (static_cast<double>(trips.failed) > kFailedShare * total) {
        deviations.push_back(
            {formatted("%llu of %.0f exchanges failed", static_cast<unsigned long long>(trips.failed), total),
             "a bad cable or plug, or a hub in between; a sound link loses less than one in a thousand",
             static_cast<double>(trips.failed) > 0.1 * total});
    }
    if (const std::int64_t slow = trips.quantile(0.99); slow * exchanges > period_ns) {
        deviations.push_back(
            {formatted("%d exchanges take %.2f ms, more than the period of %.2f ms", exchanges,
                       1e-6 * static_cast<double>(slow * exchanges), 1e-6 * static_cast<double>(period_ns)),
             "the loop will be late: set loop.period_s longer or device.exchanges = \"one\"", false});
    }
    return deviations;
}

std::string histogram_text(const RoundTrips& trips) {
    constexpr int bucket_count = 16;
    constexpr std::int64_t first = 8'000;  // ns
    constexpr double width = 40.0;
    std::array<std::size_t, bucket_count> buckets{};
    for (const std::int64_t time : trips.times_ns) {
        std::size_t bucket = 0;
        while (bucket + 1 < bucket_count && time > first << bucket) {
            ++bucket;
        }
        ++buckets[bucket];
    }
    const auto largest = static_cast<double>(*std::max_element(buckets.begin(), buckets.end()));
    std::string lines;
    for (std::size_t k = 0; k < bucket_count; ++k) {
        if (buckets[k] > 0) {
            const auto length = static_cast<std::size_t>(std::ceil(width * static_cast<double>(buckets[k]) / largest));
            lines += formatted("  up to %7.3f ms %7zu ", 1e-6 * static_cast<double>(first << k), buckets[k]) +
                     std::string(length, '#') + "\n";
        }
    }
    return lines;
}

void DeadManKey::update(std::int64_t now_ns, bool key, bool other) {
    // A late repeat, or another key, releases.
    if (other || (pressed_ && now_ns - last_ns_ > timeout_ns_)) {
        released_ = released_ || held_;
        held_ = false;
        pressed_ = false;
        if (other) {
            return;
        }
    }
    if (key) {
        held_ = pressed_ && !released_;  // the second press within the time-out, and not after a release
        pressed_ = true;
        last_ns_ = now_ns;
    }
}

}  // namespace haptic::rt
