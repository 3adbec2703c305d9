#include "haptic/device/fault.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <vector>

#include "haptic/config.hpp"
#include "haptic/types.hpp"

namespace haptic::device {
namespace {

// s; longer than any test, and representable in nanoseconds.
constexpr double kMaxTime = 1e6;
constexpr double kMaxPackets = 1e9;
constexpr double kMaxBytes = 512;
constexpr double kMaxCounts = 8'388'608;  // half of 24 bits
constexpr double kMaxSlack = 1.0;         // m

using Names = std::vector<std::string_view>;

struct Kind {
    FaultKind kind;
    std::string_view name;
    Names parameters;
    std::string_view meaning;
};

const std::vector<Kind>& kinds() {
    static const std::vector<Kind> all = {
        {FaultKind::Drop, "drop", {"way", "packets"}, "packets are lost"},
        {FaultKind::Delay, "delay", {"way", "packets", "by"}, "packets arrive later, in order"},
        {FaultKind::Duplicate, "duplicate", {"way", "packets"}, "packets arrive twice"},
        {FaultKind::Truncate, "truncate", {"way", "packets", "bytes"}, "packets lose their end"},
        {FaultKind::Flip, "flip", {"way", "packets", "bit"}, "one bit of a packet is inverted"},
        {FaultKind::Unplug, "unplug", {}, "the cable is unplugged, and plugged in again after DURATION"},
        {FaultKind::Stuck, "stuck", {"string"}, "an encoder stops counting"},
        {FaultKind::Jump, "jump", {"string", "counts"}, "an encoder adds spurious counts"},
        {FaultKind::Slack,
         "slack",
         {"string", "metres", "motor"},
         "a string becomes longer, and its motor reels it in"},
        {FaultKind::Dac, "dac", {"echo"}, "the motors keep their DAC codes"},
    };
    return all;
}

std::string list_of(const Names& names) {
    std::string list;
    for (std::size_t i = 0; i < names.size(); ++i) {
        list += i == 0 ? "" : i + 1 == names.size() ? " and " : ", ";
        list += names[i];
    }
    return list;
}

/// Parser of a fault's text that reports errors with their column.
class Reader {
  public:
    explicit Reader(std::string_view text) : text_(text) {}

    [[noreturn]] void fail(std::size_t at, const std::string& problem) const {
        throw FaultError("fault '" + std::string(text_) + "', column " + std::to_string(at + 1) + ": " + problem);
    }
    [[nodiscard]] bool at_end() const { return position_ == text_.size(); }
    [[nodiscard]] std::size_t position() const { return position_; }

    /// Text up to the next of these characters, or to the end.
    std::string_view until(std::string_view stops) {
        const std::size_t end = std::min(text_.find_first_of(stops, position_), text_.size());
        const std::string_view word = text_.substr(position_, end - position_);
        position_ = end;
        return word;
    }
    bool skip(char character) {
        if (at_end() || text_[position_] != character) {
            return false;
        }
        ++position_;
        return true;
    }
    double number(std::string_view stops, const char* what, Range range) {
        const std::size_t at = position_;
        const std::string_view word = until(stops);
        double value = 0.0;
        const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
        if (error != std::errc{} || end != word.data() + word.size() || !std::isfinite(value) || value < range.min ||
            value > range.max) {
            fail(at, std::string(what) + " needs a number from " + shown(range.min) + " to " + shown(range.max) +
                         ", not '" + std::string(word) + "'");
        }
        return value;
    }
    int whole(const char* what, Range range) {
        const std::size_t at = position_;
        const double value = number(",", what, range);
        if (value != std::floor(value)) {
            fail(at, std::string(what) + " needs a whole number");
        }
        return static_cast<int>(value);
    }
    /// The index of the word among the choices.
    std::size_t choice(std::string_view stops, const std::string& what, const Names& choices) {
        const std::size_t at = position_;
        const std::string_view word = until(stops);
        for (std::size_t i = 0; i < choices.size(); ++i) {
            if (choices[i] == word) {
                return i;
            }
        }
        fail(at, "'" + std::string(word) + "' is not " + what + "; the choices are " + list_of(choices));
    }

  private:
    static std::string shown(double value) {
        char buffer[32];
        return {buffer, std::to_chars(buffer, buffer + sizeof buffer, value).ptr};
    }

    std::string_view text_;
    std::size_t position_ = 0;
};

/// Reads one NAME=VALUE.
void read_parameter(Reader& reader, const Kind& kind, Fault& fault) {
    const std::size_t at = reader.position();
    const std::string_view name = reader.until("=,");
    if (std::find(kind.parameters.begin(), kind.parameters.end(), name) == kind.parameters.end()) {
        reader.fail(at, "'" + std::string(kind.name) + "' has no parameter '" + std::string(name) + "'; " +
                            (kind.parameters.empty() ? "it takes none" : "it has " + list_of(kind.parameters)));
    }
    if (!reader.skip('=')) {
        reader.fail(reader.position(), "'" + std::string(name) + "' needs a value: " + std::string(name) + "=...");
    }
    if (name == "way") {
        fault.commands = reader.choice(",", "a direction", {"in", "out"}) == 1;
    } else if (name == "packets") {
        fault.packets = reader.whole("packets", {1, kMaxPackets});
    } else if (name == "by") {
        fault.delay_ns = nanoseconds(reader.number(",", "by (s)", {0.0, kMaxTime}));
    } else if (name == "bytes") {
        fault.bytes = reader.whole("bytes", {0, kMaxBytes});
    } else if (name == "bit") {
        fault.bit = reader.whole("bit", {0, 8 * kMaxBytes - 1});
    } else if (name == "string") {
        const std::size_t chosen = reader.choice(",", "a string", {"0", "1", "2", "3", "4", "5", "6", "7", "all"});
        fault.string = chosen < kStrings ? static_cast<int>(chosen) : Fault::kAny;
    } else if (name == "counts") {
        fault.counts = reader.whole("counts", {-kMaxCounts, kMaxCounts});
    } else if (name == "metres") {
        fault.slack_m = reader.number(",", "metres", {0.0, kMaxSlack});
    } else if (name == "motor") {
        fault.motor_dead = reader.choice(",", "a state of the motor", {"pulls", "dead"}) == 1;
    } else {
        fault.echo_frozen = reader.choice(",", "an echo", {"frozen", "sent"}) == 0;
    }
}

}  // namespace

Fault parse_fault(std::string_view text) {
    // KIND@T
    Reader reader(text);
    Names names;
    for (const Kind& kind : kinds()) {
        names.push_back(kind.name);
    }
    const Kind& kind = kinds()[reader.choice("@", "a kind of fault", names)];
    Fault fault;
    fault.kind = kind.kind;
    if (!reader.skip('@')) {
        reader.fail(reader.position(),
                    "'@' and the time in seconds are missing; write for example " + std::string(kind.name) + "@2.0");
    }
    fault.begin_ns = nanoseconds(reader.number("/:", "the time (s)", {0.0, kMaxTime}));
    // [/DURATION][:NAME=VALUE,...]
    if (reader.skip('/')) {
        fault.duration_ns = nanoseconds(reader.number(":", "the duration (s)", {0.0, kMaxTime}));
    }
    if (reader.skip(':')) {
        do {
            read_parameter(reader, kind, fault);
        } while (reader.skip(','));
    }
    return fault;
}

std::string fault_help() {
    std::string help = "KIND@T[/DURATION][:NAME=VALUE,...], times in s; without DURATION until the end.\n";
    for (const Kind& kind : kinds()) {
        help += "  " + std::string(kind.name) + ": " + std::string(kind.meaning);
        help += kind.parameters.empty() ? "\n" : " (" + list_of(kind.parameters) + ")\n";
    }
    return help +
           "way=in (replies, the default) or out (commands); packets=N at most; by=0.002 s; bytes=N kept, default "
           "half;\n"
           "bit=8*byte+bit, default a random bit of each packet; string=0..7 or all; counts=3000; metres=0.02;\n"
           "motor=pulls (it reels in the slack) or dead (it has no current); "
           "echo=frozen (the board echoes the motors' DAC codes) or sent (those it received)";
}

}  // namespace haptic::device
