// Probes outside of the loop: opened, tried, configured, put down. Apart from probe.cpp because this may allocate.
#include <algorithm>
#include <limits>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "haptic/probe.hpp"
#include "haptic/types.hpp"

namespace haptic {
namespace {

// The quickest of so many is not one that was interrupted.
constexpr int kTrials = 8;

std::string in_microseconds(std::int64_t duration_ns) {
    return std::to_string(duration_ns / 1000) + " us";
}

}  // namespace

Probe::Probe(std::unique_ptr<OutputLine> line, const std::string& purpose, Clock clock, std::int64_t slowest_edge_ns)
    : line_(std::move(line)) {
    std::int64_t quickest_ns = std::numeric_limits<std::int64_t>::max();
    for (int trial = 0; trial < kTrials; ++trial) {
        const std::int64_t before_ns = clock();
        if (const int error = line_->set(false); error != 0) {
            throw std::runtime_error(purpose + ": the line cannot be set: " + std::system_category().message(error) +
                                     "; gpioinfo says whether it is an output that the kernel lets go");
        }
        quickest_ns = std::min(quickest_ns, clock() - before_ns);
    }
    if (quickest_ns > slowest_edge_ns) {
        throw std::runtime_error(purpose + ": an edge takes " + in_microseconds(quickest_ns) + ", more than the " +
                                 in_microseconds(slowest_edge_ns) +
                                 " of probes.slowest_edge_s; choose a line of the processor itself, not one of an "
                                 "expander behind I2C or SPI, or allow more where the loop can bear it");
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

std::int64_t read_slowest_edge_ns(const Config& config) {
    return nanoseconds(config.number("probes.slowest_edge_s", seconds(Probe::kSlowestEdgeNs), {1e-6, 0.1}));
}

Probe open_probe(const std::optional<GpioLine>& line, Probe::Clock clock, std::int64_t slowest_edge_ns) {
    return line ? Probe(open_output_line(*line), line->purpose, clock, slowest_edge_ns) : Probe();
}

}  // namespace haptic
