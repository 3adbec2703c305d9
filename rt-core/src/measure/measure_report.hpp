// What a measurement says: JSON for machines, and from that JSON the text and the page for people.
#pragma once

#include <array>
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>

#include <haptic/edge_capture.hpp>
#include <haptic/histogram.hpp>
#include "tick/instruments.hpp"
#include "measure/kernel_watch.hpp"
#include "measure/run_report.hpp"
#include "process/timing_log.hpp"

namespace haptic::rt {

/// The wake-up latency of cyclictest, measured in the pauses of the loop.
struct CyclictestResult {
    std::string command;
    Histogram wakeup;          // ns
    std::uint64_t beyond = 0;  // that cyclictest only counts, being longer than it keeps; in `wakeup` with the maximum
};

/// The tick's probe as the kernel stamped it on the line that it is wired to, with the ticks of the warm-up.
struct LoopbackResult {
    std::string line;  // "6 of pl061"
    EdgeStatistics edges;
    EdgeKind kind = EdgeKind::Rising;
    std::uint64_t dropped = 0;  // that found no room
    std::string problem;        // why it ended early; empty if it did not
};

/// Everything that a measurement found. What it refers to must be there until the report is made.
struct Measurement {
    const RunResult* result = nullptr;
    const Instruments* instruments = nullptr;
    const TimingLog* log = nullptr;
    const KernelWatch* kernel = nullptr;
    std::int64_t began_ns = 0;                 // CLOCK_MONOTONIC
    std::int64_t real_minus_monotonic_ns = 0;  // CLOCK_REALTIME less CLOCK_MONOTONIC
    std::int64_t period_ns = 1'000'000;        // of the loop
    std::string load{};                        // command of what loaded the machine; empty: nothing did
    const CyclictestResult* other = nullptr;   // nullptr: was not asked for
    const LoopbackResult* loopback = nullptr;  // likewise
};

/// How a distribution is called in the report, in text, and what it is.
struct LatencyName {
    Latency latency;
    std::string_view key;
    std::string_view title;
    std::string_view what;
};
[[nodiscard]] const std::array<LatencyName, kLatencies>& latency_names() noexcept;

/// Percentiles that a report has: key and fraction.
struct Percentile {
    const char* key;
    const char* title;
    double fraction;
};
inline constexpr std::array<Percentile, 5> kPercentiles = {{{"p50", "p50", 0.5},
                                                            {"p90", "p90", 0.9},
                                                            {"p99", "p99", 0.99},
                                                            {"p999", "p99.9", 0.999},
                                                            {"p9999", "p99.99", 0.9999}}};

/// The report of a run (make_report()) and beside it the key `measure`.
[[nodiscard]] nlohmann::json make_measure_report(const Measurement& measurement);

/// Over the columns of a table in text: "us" in 24 characters, each percentile and "max" in ten.
[[nodiscard]] std::string percentile_header();

/// The text of a report. Throws std::runtime_error if it is no report of a measurement.
[[nodiscard]] std::string measure_text(const nlohmann::json& report);

/// Two measurements side by side, and the second as a share of the first. Throws likewise.
[[nodiscard]] nlohmann::json compare_measurements(const nlohmann::json& first, const nlohmann::json& second);
[[nodiscard]] std::string comparison_text(const nlohmann::json& comparison);

/// Throws std::runtime_error, naming `origin`, if this is no report of a measurement, or one of another version.
void require_measurement(const nlohmann::json& report, const std::string& origin);

/// "2026-11-20T18:02:11.123456+01:00", local time.
[[nodiscard]] std::string time_of_day(std::int64_t real_ns);

}  // namespace haptic::rt
