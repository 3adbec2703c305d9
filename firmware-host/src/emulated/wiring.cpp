#include "haptic/device/wiring.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <utility>
#include <vector>

namespace haptic::device {
namespace {

// A factor beyond this is no wiring error that anybody makes.
constexpr double kMaxFactor = 100.0;

struct WiringKind {
    std::string_view name;
    std::size_t numbers;  // channels or strings
    bool factor;          // "=FACTOR" follows
    std::string_view meaning;
};

constexpr std::array<WiringKind, 9> kWiringKinds = {{
    {"sign", 1, false, "sign:3: the encoder of channel 3 counts backwards"},
    {"strings", 2, false, "strings:2,5: channels 2 and 5 exchange motor and encoder"},
    {"motors", 2, false, "motors:0,4: channels 0 and 4 exchange their motors"},
    {"encoders", 2, false, "encoders:1,2: channels 1 and 2 exchange their encoders"},
    {"gain", 1, true, "gain:6=2: the motor of channel 6 pulls twice as hard; -1: it pushes"},
    {"counts", 1, true, "counts:6=2: the encoder of channel 6 counts twice as much; 0: it does not count"},
    {"dead", 1, false, "dead:7: the motor of channel 7 has no current"},
    {"slack", 1, false, "slack:1: string 1 never becomes taut"},
    {"none", 0, false, "none: as the device geometry says"},
}};

[[noreturn]] void fail(std::string_view text, const std::string& problem) {
    throw WiringError("wiring '" + std::string(text) + "': " + problem);
}

const WiringKind& kind_of(std::string_view text, std::string_view name) {
    const auto* const found = std::find_if(kWiringKinds.begin(), kWiringKinds.end(),
                                           [name](const WiringKind& kind) { return kind.name == name; });
    if (found == kWiringKinds.end()) {
        std::string choices;
        for (const WiringKind& kind : kWiringKinds) {
            choices += (choices.empty() ? "" : ", ") + std::string(kind.name);
        }
        fail(text, "'" + std::string(name) + "' is no wiring error; the choices are " + choices);
    }
    return *found;
}

std::size_t index_of(std::string_view text, std::string_view word) {
    if (word.size() != 1 || word.front() < '0' || word.front() > '7') {
        fail(text, "needs a number from 0 to 7, not '" + std::string(word) + "'");
    }
    return static_cast<std::size_t>(word.front() - '0');
}

double factor_of(std::string_view text, std::string_view word) {
    double factor = 0.0;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), factor);
    if (error != std::errc{} || end != word.data() + word.size() || !(std::fabs(factor) <= kMaxFactor)) {
        fail(text, "needs a factor from -100 to 100, not '" + std::string(word) + "'");
    }
    return factor;
}

/// Text up to the first `separator`, which is removed from `rest`.
std::string_view next(std::string_view& rest, char separator) {
    const std::size_t end = std::min(rest.find(separator), rest.size());
    const std::string_view word = rest.substr(0, end);
    rest.remove_prefix(std::min(end + 1, rest.size()));
    return word;
}

/// Adds one KIND:VALUE.
void add_error(Wiring& wiring, std::string_view text, std::string_view error) {
    std::string_view rest = error;
    const WiringKind& kind = kind_of(text, next(rest, ':'));
    // The numbers before '='.
    std::string_view numbers = next(rest, '=');
    std::vector<std::size_t> of;
    while (!numbers.empty()) {
        of.push_back(index_of(text, next(numbers, ',')));
    }
    if (of.size() != kind.numbers || (kind.numbers == 2 && of[0] == of[1])) {
        fail(text, "'" + std::string(kind.name) + "' needs " +
                       (kind.numbers == 0   ? "no number"
                        : kind.numbers == 1 ? "one number from 0 to 7"
                                            : "two different numbers from 0 to 7"));
    }
    if (!kind.factor && !rest.empty()) {
        fail(text, "'" + std::string(kind.name) + "' has no factor");
    }
    const double factor = kind.factor ? factor_of(text, rest) : 0.0;
    // Its effect, in addition to what the wiring has already.
    if (kind.name == "sign") {
        wiring.encoder_factor[of[0]] *= -1.0;
    } else if (kind.name == "gain") {
        wiring.gain[of[0]] *= factor;
    } else if (kind.name == "counts") {
        wiring.encoder_factor[of[0]] *= factor;
    } else if (kind.name == "dead") {
        wiring.dead[of[0]] = true;
    } else if (kind.name == "slack") {
        wiring.slack[of[0]] = true;
    }
    if (kind.name == "strings" || kind.name == "motors") {
        std::swap(wiring.motor_of[of[0]], wiring.motor_of[of[1]]);
    }
    if (kind.name == "strings" || kind.name == "encoders") {
        std::swap(wiring.encoder_of[of[0]], wiring.encoder_of[of[1]]);
    }
}

bool is_permutation(std::array<std::uint8_t, kStrings> of) {
    std::sort(of.begin(), of.end());
    return of == Wiring{}.motor_of;
}

}  // namespace

std::size_t Wiring::channel_of_motor(std::size_t motor) const HAPTIC_RT {
    for (std::size_t channel = 0; channel < kStrings; ++channel) {
        if (motor_of[channel] == motor) {
            return channel;
        }
    }
    return motor;
}

void add_wiring(Wiring& wiring, std::string_view text) {
    Wiring changed = wiring;
    std::string_view rest = text;
    do {
        add_error(changed, text, next(rest, '+'));
    } while (!rest.empty());
    wiring = changed;
}

void validate(const Wiring& wiring) {
    if (!is_permutation(wiring.motor_of) || !is_permutation(wiring.encoder_of)) {
        throw WiringError("wiring: each motor and each encoder must have exactly one channel");
    }
    for (std::size_t i = 0; i < kStrings; ++i) {
        if (!std::isfinite(wiring.gain[i]) || !std::isfinite(wiring.encoder_factor[i])) {
            throw WiringError("wiring: the factors of channel " + std::to_string(i) + " must be finite");
        }
    }
}

std::string wiring_help() {
    std::string help = "KIND:VALUE[+KIND:VALUE...]; channels and strings are 0..7.\n";
    for (const WiringKind& kind : kWiringKinds) {
        help += "  " + std::string(kind.meaning) + "\n";
    }
    help.pop_back();
    return help;
}

}  // namespace haptic::device
