// Measurement report: JSON for machines; text and page are made from that JSON.
#pragma once

#include <array>
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>

#include "haptic/edge_capture.hpp"
#include "haptic/histogram.hpp"
#include "measure/kernel_watch.hpp"
#include "measure/run_report.hpp"
#include "measure/trace_explanation.hpp"
#include "process/timing_log.hpp"
#include "tick/instruments.hpp"

namespace haptic::rt {

/// The wake-up latency of cyclictest, measured in the pauses of the loop.
struct CyclictestResult {
    std::string command;
    Histogram wakeup;              // ns
    std::uint64_t overflowed = 0;  // cycles beyond cyclictest's histogram; counted in `wakeup` with the maximum
};

/// Edges of the tick's probe with the kernel's time stamps, on the line wired to it; includes the warm-up.
struct LoopbackResult {
    std::string line;  // "6 of pl061"
    EdgeStatistics edges;
    EdgeKind kind = EdgeKind::Rising;
    std::string problem;  // why the capture ended early; empty if it did not
};

/// Inputs of the report. The referenced objects must live until the report is made.
struct Measurement {
    const RunResult* result = nullptr;
    const Instruments* instruments = nullptr;
    const TimingLog* log = nullptr;
    const KernelWatch* kernel = nullptr;
    std::int64_t began_ns = 0;                     // CLOCK_MONOTONIC
    std::int64_t real_minus_monotonic_ns = 0;      // CLOCK_REALTIME minus CLOCK_MONOTONIC
    std::int64_t period_ns = 1'000'000;            // of the loop
    std::string load{};                            // command of the load; empty: none
    const CyclictestResult* cyclictest = nullptr;  // nullptr: not requested
    const LoopbackResult* loopback = nullptr;      // nullptr: not requested
};

/// A latency's key in the report, its title in text, and its definition.
struct LatencyName {
    Latency latency;
    std::string_view key;
    std::string_view title;
    std::string_view what;
};
[[nodiscard]] const std::array<LatencyName, kLatencies>& latency_names() noexcept;

/// A percentile of the report: key, title and fraction.
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

/// The report of a run (make_report()) with the key `measure` added.
[[nodiscard]] nlohmann::json make_measure_report(const Measurement& measurement);

/// The tick that ended a run with --break-above: its number, lateness, cause, and what the thread did from deadline to
/// end, us after the deadline.
[[nodiscard]] nlohmann::json late_tick_json(const TimedTick& tick, const TraceExplanation& explanation);

/// Header of a text table: "us" in 24 characters, then each percentile and "max" in ten.
[[nodiscard]] std::string percentile_header();

/// The report as text. Throws std::runtime_error if it is not a measurement report.
[[nodiscard]] std::string measure_text(const nlohmann::json& report);

/// Two measurements side by side, with the ratio second / first. Throws std::runtime_error if either is not a
/// measurement report.
[[nodiscard]] nlohmann::json compare_measurements(const nlohmann::json& first, const nlohmann::json& second);
[[nodiscard]] std::string comparison_text(const nlohmann::json& comparison);

/// Throws std::runtime_error, naming `origin`, unless this is a measurement report of this version.
void require_measurement(const nlohmann::json& report, const std::string& origin);

/// "2026-11-20T18:02:11.123456+01:00", local time.
[[nodiscard]] std::string time_of_day(std::int64_t real_ns);

}  // namespace haptic::rt
