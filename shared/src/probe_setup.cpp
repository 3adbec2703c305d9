// Probe, cold half: opens, tests, configures and closes. Separate from probe.cpp, because it may allocate.
#include <algorithm>
#include <limits>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "haptic/probe.hpp"
#include "haptic/types.hpp"

namespace haptic {
namespace {

// Number of trials; the fastest one was not interrupted.
constexpr int kTrials = 8;

std::string in_microseconds(std::int64_t duration_ns) {
    return std::to_string(duration_ns / 1000) + " us";
}

}  // namespace

Probe::Probe(std::unique_ptr<OutputLine> line, const std::string& purpose, Clock clock, std::int64_t slowest_edge_ns)
    : line_(std::move(line)) {
    std::int64_t fastest_ns = std::numeric_limits<std::int64_t>::max();
    for (int trial = 0; trial < kTrials; ++trial) {
        const std::int64_t before_ns = clock();
        if (const int error = line_->set(false); error != 0) {
            throw std::runtime_error(purpose + ": the line cannot be set: " + std::system_category().message(error) +
                                     "; gpioinfo shows whether it is an output that is free");
        }
        fastest_ns = std::min(fastest_ns, clock() - before_ns);
    }
    if (fastest_ns > slowest_edge_ns) {
        throw std::runtime_error(
            purpose + ": an edge takes " + in_microseconds(fastest_ns) + ", more than the " +
            in_microseconds(slowest_edge_ns) +
            " of probes.slowest_edge_s; choose a line of the processor itself instead of an expander "
            "behind I2C or SPI, or raise the limit if the loop has time");
    }
}

Probe::~Probe() {
    set(false);
}

std::optional<GpioLine> read_probe_line(const Config& config, const std::string& name, const std::string& user) {
    const std::string key = "probes." + name;
    const std::string chip = config.text("probes.chip", "");
    const bool offset = config.has(key) && !config.has_text(key);
    const std::string line =
        offset ? std::to_string(config.integer(key, 0, {0, 1023})) : config.text(key, std::string());
    if (line.empty()) {
        return std::nullopt;
    }
    if (chip.empty()) {
        config.fail(key, "needs probes.chip, the label of the line's GPIO chip; gpiodetect lists them");
    }
    return GpioLine{chip, line, name + " probe (probes.chip, " + key + ")", user + " " + name};
}

const SettingTable<ProbeSettings>& probe_settings() {
    using S = ProbeSettings;
    using V = SettingValues<S>;
    static const SettingTable<S> table{
        "probes",
        "Output lines of a GPIO chip for an oscilloscope.",
        {
            {{.key = "chip", .meaning = "GPIO chip of the lines: label (gpiodetect lists them), name or path."},
             V::text(&S::chip)},
            {{.key = "slowest_edge_s",
              .unit = "s",
              .meaning = "Longest time that setting a line may take. Raise it for lines behind I2C or emulated lines, "
                         "where the loop has time for them."},
             V::duration(&S::slowest_edge_ns, {1e-6, 0.1})},
        }};
    return table;
}

Probe open_probe(const std::optional<GpioLine>& line, Probe::Clock clock, std::int64_t slowest_edge_ns) {
    return line ? Probe(open_output_line(*line), line->purpose, clock, slowest_edge_ns) : Probe();
}

}  // namespace haptic
