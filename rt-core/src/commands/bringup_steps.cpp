#include "commands/bringup_steps.hpp"

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <thread>
#include <utility>

#include "formatted.hpp"
#include "haptic/clock.hpp"
#include "haptic/device/dac_codes.hpp"

namespace haptic::rt {
namespace {

using haptic::detail::formatted;

constexpr double kPullShare = 0.5;       // of the cap, for finding out which motor is which
constexpr double kHostDeathShare = 0.3;  // of the cap, that goes on without commands
constexpr double kTightTension = 0.05;   // N, of a string that an eye sees to be tight
constexpr std::int64_t kRestNs = 1'000'000'000;
constexpr std::int64_t kLiftRampNs = 6'000'000'000;  // slow, so that the code at the lift is certain
constexpr double kLongestPull = 1.0;                 // m

/// A positive number and nothing else; 0 otherwise.
double number_of(const std::string& answer) {
    double value = 0.0;
    const auto [end, error] = std::from_chars(answer.data(), answer.data() + answer.size(), value);
    const bool whole = error == std::errc{} && end == answer.data() + answer.size();
    return whole && std::isfinite(value) && value > 0.0 ? value : 0.0;
}

}  // namespace

BringupSteps::BringupSteps(BringupBoard& board, const BringupConsole& console, device::EmulatedDevice* emulated,
                           const device::DeviceGeometry& nominal, const BringupStepSettings& settings,
                           BringupProtocol& protocol, std::function<void()> save)
    : board_(&board),
      console_(&console),
      emulated_(emulated),
      nominal_(&nominal),
      settings_(settings),
      protocol_(&protocol),
      save_(std::move(save)) {}

void BringupSteps::run() {
    counters_at_rest();
    pull_out_strings();
    pull_motors();
    show_channels();
    show_signs();
    weigh_strings();
    measure_round_trips();
    cut_power();
}

void BringupSteps::head(int step, const char* title, const char* look, const char* expect,
                        const char* otherwise) const {
    console_->say(formatted("\nStep %d of 7: %s", step, title));
    console_->say(std::string("  look at    ") + look);
    console_->say(std::string("  expect     ") + expect);
    console_->say(std::string("  otherwise  ") + otherwise);
}

std::string BringupSteps::ask(const std::string& question) {
    return console_->ask(question, [this] { board_->idle(); });
}

bool BringupSteps::confirm(const std::string& question) {
    return console_->confirm(question, [this] { board_->idle(); });
}

std::string BringupSteps::name_of(std::size_t string) const {
    return "string " + std::to_string(string) + " (" + corner_of(*nominal_, string) + ")";
}

std::int16_t BringupSteps::code_of(double share, std::size_t string) const {
    return device::dac_code_of_tension(share * settings_.cap, nominal_->strings[string].newtons_per_code);
}

// Step 1 --------------------------------------------------------------------------------------------------------------

void BringupSteps::counters_at_rest() {
    if (protocol_->noise) {
        return;
    }
    head(1, "raw counters, motors off",
         "the eight counters while nothing moves, then while you pull one string by hand",
         "0 to 2 counts at rest; one counter follows each string, by the counts of its length",
         "noise: shield or ground of an encoder; no counter or two: cable or plug of an encoder");
    (void)ask("Take your hands off the device and press Enter.");
    // Largest excursion of each counter in one second.
    const std::array<std::int64_t, kStrings> start = board_->counts();
    std::array<std::int64_t, kStrings> low = start;
    std::array<std::int64_t, kStrings> high = start;
    const std::int64_t begin_ns = monotonic_now_ns();
    while (monotonic_now_ns() - begin_ns < kRestNs) {
        console_->check_signals();
        board_->idle();
        for (std::size_t i = 0; i < kStrings; ++i) {
            low[i] = std::min(low[i], board_->counts()[i]);
            high[i] = std::max(high[i], board_->counts()[i]);
        }
        std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    std::array<std::int64_t, kStrings> range{};
    std::string line = "  at rest the counters moved by";
    for (std::size_t i = 0; i < kStrings; ++i) {
        range[i] = high[i] - low[i];
        line += " " + std::to_string(range[i]);
    }
    console_->say(line + " counts");
    protocol_->noise = range;
    save_();
}

void BringupSteps::pull_out_strings() {
    for (std::size_t s = 0; s < kStrings; ++s) {
        while (!protocol_->pull_outs[s]) {
            if (!pull_out(s)) {
                break;
            }
        }
    }
}

bool BringupSteps::pull_out(std::size_t string) {
    board_->refresh();
    const std::array<std::int64_t, kStrings> before = board_->counts();
    const std::string answer =
        ask(formatted("Pull %s out of its pulley by %.0f mm, hold it, and press Enter "
                      "(or type the mm that you pulled; s skips).",
                      name_of(string).c_str(), 1e3 * settings_.pull_out));
    if (answer == "s") {
        protocol_->skipped.push_back("pull out string " + std::to_string(string));
        return false;
    }
    const double metres = answer.empty() ? settings_.pull_out : 1e-3 * number_of(answer);
    if (!(metres > 0.0) || metres > kLongestPull) {
        console_->say("  Please press Enter, type a length in mm up to 1000, or s.");
        return true;
    }
    if (emulated_ != nullptr) {
        emulated_->pull_out(string, metres);
        console_->say("  (emulated: a hand pulls it)");
    }
    board_->refresh();
    PullOut pull;
    pull.metres = metres;
    for (std::size_t i = 0; i < kStrings; ++i) {
        pull.counts[i] = board_->counts()[i] - before[i];
    }
    const EncoderFinding found = judge_pull_out(pull, nominal_->strings[string]);
    if (!found.found()) {
        std::string line = "  No single counter followed the string:";
        for (const std::int64_t count : pull.counts) {
            line += " " + std::to_string(count);
        }
        console_->say(line);
        if (confirm("  Wind the string back and try again? (n keeps this result)")) {
            return true;
        }
    } else {
        console_->say(
            formatted("  channel %d: %+lld counts, %+.3f um a count (nominal %+.3f on channel %zu)", found.channel,
                      static_cast<long long>(pull.counts[static_cast<std::size_t>(found.channel)]),
                      1e6 * found.metres_per_count, 1e6 * nominal_->strings[string].metres_per_count, string));
    }
    protocol_->pull_outs[string] = pull;
    save_();
    return true;
}

// Step 2 --------------------------------------------------------------------------------------------------------------

void BringupSteps::pull_motors() {
    if (std::all_of(protocol_->pulls.begin(), protocol_->pulls.end(),
                    [](const auto& one) { return one.has_value(); })) {
        return;
    }
    head(2, "one motor at a time", "which string becomes tight while you hold the key",
         "exactly one string becomes tight, the one of the channel; its counter shows that it is wound in",
         "none: motor dead, string loose, or the motor pushes; another one: plugs are exchanged");
    const BringupBoard::Limits& limits = board_->limits();
    console_->say(
        formatted("  The motor pulls with %.2f N by the nominal geometry, which may be wrong by a factor of three,",
                  kPullShare * settings_.cap));
    if (limits.button >= 0) {
        console_->say(formatted("  and only while you press button %d of the board.", limits.button));
    } else {
        console_->say(
            formatted("  and only while you hold the space bar: it stops %.1f s after the last repeat of the key, and\n"
                      "  at any other key.",
                      seconds(limits.key_timeout_ns)));
    }
    console_->say("  Hold the grip loosely at the centre with the other hand. s skips a motor, q stops.");
    for (std::size_t c = 0; c < kStrings; ++c) {
        if (!protocol_->pulls[c]) {
            pull_motor(c);
        }
    }
}

void BringupSteps::pull_motor(std::size_t channel) {
    const std::int16_t code = code_of(kPullShare, channel);
    while (try_motor(channel, code)) {
        const BringupFindings findings = findings_of(*protocol_, *nominal_);
        const MotorFinding& found = findings.motor_of_channel[channel];
        // A board with signed codes can turn a reversed motor round.
        const bool turns = nominal_->board == device::BoardKind::Uart && found.state == MotorState::Pushes;
        if (turns && found.code == code) {
            console_->say(
                formatted("  Its string %d was paid out: the motor pushes. Once more, with codes of the other sign.",
                          found.string));
            if (!try_motor(channel, static_cast<std::int16_t>(-code))) {
                return;
            }
        }
        const MotorFinding now = findings_of(*protocol_, *nominal_).motor_of_channel[channel];
        console_->say(
            formatted("  channel %zu %s", channel, std::string(to_string(now.state)).c_str()) +
            (now.string >= 0 ? formatted(": string %d moved by %+.1f mm", now.string, 1e3 * now.movement) : ""));
        if (!now.contradicts) {
            return;
        }
        if (!confirm("  But the counter of another string was wound in. Try again?")) {
            return;
        }
    }
}

bool BringupSteps::try_motor(std::size_t channel, std::int16_t code) {
    board_->wait_until_still();
    console_->say(formatted("Channel %zu, code %d: hold %s until the counters are steady, then release.", channel,
                            static_cast<int>(code), board_->limits().button >= 0 ? "the button" : "the space bar"));
    int eye = -1;
    Hold hold{.channel = channel,
              .code = code,
              .ramp_ns = nanoseconds(settings_.ramp_s),
              .steady_ns = nanoseconds(0.3 * settings_.steady_s)};
    for (const EncoderFinding& encoder : findings_of(*protocol_, *nominal_).encoder_of_string) {
        if (encoder.found()) {
            hold.metres_per_count[static_cast<std::size_t>(encoder.channel)] = encoder.metres_per_count;
        }
    }
    hold.on_steady = [this, &eye](std::int16_t) {
        if (emulated_ != nullptr) {
            const std::array<double, kStrings> tensions = emulated_->string_tensions();
            const auto* const tightest = std::max_element(tensions.begin(), tensions.end());
            eye = *tightest > kTightTension ? static_cast<int>(tightest - tensions.begin()) : -1;
        }
    };
    const HoldResult result = board_->hold(hold);
    if (result.skipped) {
        protocol_->skipped.push_back("motor of channel " + std::to_string(channel));
        return false;
    }
    if (result.travelled || result.pushed) {
        console_->say(result.pushed ? "  A string was paid out: the motor was cut."
                                    : "  A string moved too far: the motor was cut.");
    } else if (!result.steady) {
        console_->say("  Released too early; once more.");
        return try_motor(channel, code);
    }
    MotorPull pull;
    pull.code = code;
    pull.counts = result.counts;
    pull.seen = ask_for_string(eye);
    protocol_->pulls[channel] = pull;
    save_();
    return true;
}

int BringupSteps::ask_for_string(int emulated_eye) {
    const std::string look = emulated_ == nullptr ? ""
                             : emulated_eye < 0   ? " (emulated: none is tight)"
                                                  : formatted(" (emulated: string %d is tight)", emulated_eye);
    while (true) {
        const std::string answer = ask("Which string became tight? 0 to 7, n for none, ? for a list" + look + ":");
        if (answer == "n") {
            return -1;
        }
        if (answer.size() == 1 && answer[0] >= '0' && answer[0] <= '7') {
            return answer[0] - '0';
        }
        for (std::size_t s = 0; s < kStrings; ++s) {
            console_->say(formatted("  %zu  ", s) + corner_of(*nominal_, s));
        }
    }
}

// Steps 3 and 4 -------------------------------------------------------------------------------------------------------

void BringupSteps::show_channels() const {
    head(3, "which motor is which", "the channel that counts and the channel that drives each string",
         "both have the number of the string",
         "plugs are exchanged; exchange them back, or let the geometry file say it");
    console_->say(strings_text(*nominal_, findings_of(*protocol_, *nominal_)));
}

void BringupSteps::show_signs() const {
    head(4, "signs", "whether a counter changes as it should when its string is wound in, and whether motors pull",
         "the sign of um/count is the nominal one, and no motor pushes",
         "the two signals of an encoder, or the two wires of a motor, are exchanged");
    console_->say(deviations_text(judge_bringup(*nominal_, findings_of(*protocol_, *nominal_)).deviations));
}

// Step 5 --------------------------------------------------------------------------------------------------------------

void BringupSteps::weigh_strings() {
    const BringupFindings findings = findings_of(*protocol_, *nominal_);
    bool told = false;
    for (std::size_t c = 0; c < kStrings; ++c) {
        const MotorFinding& motor = findings.motor_of_channel[c];
        const bool pulls = motor.state == MotorState::Pulls && motor.string >= 0;
        if (!pulls || !protocol_->weighings[static_cast<std::size_t>(motor.string)].empty()) {
            continue;
        }
        if (!std::exchange(told, true)) {
            head(5, "newtons per code", "the tension of each string at known codes",
                 "within 15 % of the nominal newtons per code",
                 "another gain; the geometry file takes the measured one");
            console_->say(
                "  With a spring balance: hook it to the string between pulley and grip and read it while the motor\n"
                "  pulls. With a weight: hang it to the string; the code rises slowly; release when it just lifts.");
        }
        while (weigh(static_cast<std::size_t>(motor.string), c)) {
        }
    }
}

bool BringupSteps::weigh(std::size_t string, std::size_t channel) {
    const std::string answer = ask(name_of(string) + ": b for a spring balance, the kg of a weight, or s to skip:");
    if (answer == "s") {
        protocol_->skipped.push_back("weigh string " + std::to_string(string));
        return false;
    }
    if (answer == "b") {
        return !read_balance(string, channel);
    }
    const double kilograms = number_of(answer);
    if (kilograms > 0.0) {
        return !lift_weight(string, channel, kilograms);
    }
    console_->say("  Please type b, a mass in kg such as 0.05, or s.");
    return true;
}

double BringupSteps::sign_of(std::size_t channel) const {
    return findings_of(*protocol_, *nominal_).motor_of_channel[channel].code < 0 ? -1.0 : 1.0;
}

bool BringupSteps::read_balance(std::size_t string, std::size_t channel) {
    const double sign = sign_of(channel);
    std::vector<Weighing> readings;
    for (int k = 1; k <= settings_.readings; ++k) {
        const double share = static_cast<double>(k) / settings_.readings;
        const auto code = static_cast<std::int16_t>(sign * std::abs(code_of(share, string)));
        console_->say(formatted("  code %d: hold the key, read the balance, release.", static_cast<int>(code)));
        double emulated_newtons = 0.0;
        Hold hold{.channel = channel,
                  .code = code,
                  .ramp_ns = nanoseconds(settings_.ramp_s),
                  .steady_ns = nanoseconds(settings_.steady_s)};
        hold.on_steady = [this, string, &emulated_newtons](std::int16_t) {
            emulated_newtons = emulated_ != nullptr ? emulated_->tensions()[string] : 0.0;
        };
        const HoldResult result = board_->hold(hold);
        if (result.skipped || !result.steady) {
            console_->say(result.skipped ? "  skipped"
                                         : "  Released too early; the readings of this string begin again.");
            return false;
        }
        const std::string shown = emulated_ != nullptr ? formatted(" (emulated balance: %.3f)", emulated_newtons) : "";
        double newtons = 0.0;
        while (!(newtons > 0.0)) {
            newtons = number_of(ask("  newtons on the balance" + shown + ":"));
        }
        readings.push_back({std::fabs(static_cast<double>(code)), newtons});
    }
    const std::optional<WeighingFit> fit = fit_weighings(readings);
    if (!fit) {
        console_->say("  The tension does not rise with the code; the readings of this string begin again.");
        return false;
    }
    console_->say(formatted("  %.3f mN a code (nominal %.3f), friction %.3f N, rest %.3f N",
                            1e3 * fit->newtons_per_code, 1e3 * std::fabs(nominal_->strings[string].newtons_per_code),
                            fit->friction, fit->rms));
    protocol_->weighings[string] = readings;
    protocol_->weighed_with[string] = "spring balance";
    save_();
    return true;
}

bool BringupSteps::lift_weight(std::size_t string, std::size_t channel, double kilograms) {
    const double sign = sign_of(channel);
    const auto code = static_cast<std::int16_t>(sign * std::abs(code_of(1.0, string)));
    console_->say(formatted("  The code rises to %d in %.0f s: release the key when the weight just lifts.",
                            static_cast<int>(code), seconds(kLiftRampNs)));
    const HoldResult result = board_->hold(
        {.channel = channel, .code = code, .ramp_ns = kLiftRampNs, .steady_ns = nanoseconds(settings_.ramp_s)});
    if (result.skipped || result.steady || result.last_code == 0) {
        console_->say(result.steady ? formatted("  The weight was not lifted; take a lighter one, below %.3f kg.",
                                                settings_.cap / device::kGravity)
                                    : "  Nothing was measured.");
        return false;
    }
    const Weighing reading{std::fabs(static_cast<double>(result.last_code)), device::kGravity * kilograms};
    console_->say(formatted("  lifted at code %.0f: %.3f mN a code (nominal %.3f)", reading.code,
                            1e3 * reading.newtons / reading.code,
                            1e3 * std::fabs(nominal_->strings[string].newtons_per_code)));
    protocol_->weighings[string] = {reading};
    protocol_->weighed_with[string] = "weight";
    save_();
    return true;
}

// Step 6 --------------------------------------------------------------------------------------------------------------

void BringupSteps::measure_round_trips() {
    if (protocol_->round_trips) {
        return;
    }
    head(6, "round trips", "how long the board takes to answer, and how many answers are lost",
         "none lost; 99 % of two round trips within the period of the loop",
         "lost: cable, plug or hub; slow: a longer period, or one exchange a tick");
    protocol_->round_trips = board_->measure_round_trips(settings_.exchanges);
    const RoundTrips& trips = *protocol_->round_trips;
    console_->say(
        formatted("  %zu answers, %llu lost; p50 %.3f ms, p99 %.3f ms, longest %.3f ms", trips.times_ns.size(),
                  static_cast<unsigned long long>(trips.failed), 1e-6 * static_cast<double>(trips.quantile(0.5)),
                  1e-6 * static_cast<double>(trips.quantile(0.99)), 1e-6 * static_cast<double>(trips.quantile(1.0))));
    console_->say(histogram_text(trips) +
                  deviations_text(judge_round_trips(trips, settings_.period_ns, settings_.exchanges_per_tick)));
    save_();
}

// Step 7 --------------------------------------------------------------------------------------------------------------

void BringupSteps::cut_power() {
    if (protocol_->power_done) {
        return;
    }
    const BringupFindings findings = findings_of(*protocol_, *nominal_);
    const auto* const motor =
        std::find_if(findings.motor_of_channel.begin(), findings.motor_of_channel.end(),
                     [](const MotorFinding& one) { return one.state == MotorState::Pulls && one.string >= 0; });
    if (motor == findings.motor_of_channel.end()) {
        console_->say("\nStep 7 of 7, the power-cut test, needs a motor that pulls; it is left out.");
        return;
    }
    head(7, "power cut", "one string, while commands stop and while the motors' supply is switched off",
         "with the supply off the string is loose at once, and stays loose when it comes back",
         "the switch does not cut the motors' power: nobody may hold the grip until it does");
    const auto channel = static_cast<std::size_t>(motor - findings.motor_of_channel.begin());
    const double sign = motor->code < 0 ? -1.0 : 1.0;
    const auto code =
        static_cast<std::int16_t>(sign * std::abs(code_of(kHostDeathShare, static_cast<std::size_t>(motor->string))));
    protocol_->power.clear();
    console_->say("  It is " + name_of(static_cast<std::size_t>(motor->string)) + ", channel " +
                  std::to_string(channel) + ".");
    cut_host(channel, code);
    cut_motors(channel, code);
    protocol_->power_done = true;
    save_();
}

void BringupSteps::cut_host(std::size_t channel, std::int16_t code) {
    while (true) {
        console_->say(
            formatted("Host death: hold the key. After the ramp nothing is sent for %.1f s, as if this computer had "
                      "died.",
                      settings_.silence_s));
        if (board_->limits().button >= 0) {
            console_->say("  The button cannot be read in that time: any key of the keyboard ends it.");
        }
        const HoldResult result = board_->hold({.channel = channel,
                                                .code = code,
                                                .ramp_ns = nanoseconds(settings_.ramp_s),
                                                .silent_ns = nanoseconds(settings_.silence_s)});
        if (result.steady) {
            break;
        }
        console_->say("  Released too early; once more.");
    }
    answer(
        "Did the string become loose before the time was over?", true,
        "the board keeps its last command: only the motors' power switch, or rt-core's own process that watches over "
        "the loop, ends a pull after the host died",
        false);
}

void BringupSteps::cut_motors(std::size_t channel, std::int16_t code) {
    while (true) {
        console_->say(
            "Power cut: hold the key; while the string pulls, switch the motors' supply off; release the key.");
        const HoldResult result = board_->hold({.channel = channel,
                                                .code = code,
                                                .ramp_ns = nanoseconds(settings_.ramp_s),
                                                .steady_ns = nanoseconds(settings_.steady_s),
                                                .board_may_vanish = true,
                                                .on_steady = [this](std::int16_t) {
                                                    if (emulated_ != nullptr) {
                                                        emulated_->set_motor_power(false);
                                                    }
                                                }});
        if (result.steady || result.vanished) {
            break;
        }
        console_->say("  Released too early; once more.");
    }
    answer("Did the string become loose at once?", true, "the switch does not cut the motors' power", true);
    // The supply may be that of the board too: its counters may begin anew.
    (void)console_->ask("Switch the supply on again with your hands off the grip, then press Enter.", [] {});
    if (emulated_ != nullptr) {
        emulated_->set_motor_power(true);
    }
    board_->wait_for_device();
    answer("Did any string pull when the supply came back?", false,
           "a board that pulls after power-on is a hazard: switch the motors on only after rt-core has sent zeros",
           true);
}

void BringupSteps::answer(const std::string& question, bool expected, const std::string& meaning, bool must_be_fixed) {
    // The board may be without power here: the question waits without exchanges.
    const bool yes = console_->confirm(question, [] {});
    protocol_->power.push_back({question, yes, expected, meaning, must_be_fixed});
}

}  // namespace haptic::rt
