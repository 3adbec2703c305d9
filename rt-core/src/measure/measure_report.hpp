// Measurement report: JSON for machines; text and page are made from that JSON.
#pragma once

#include <array>
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "haptic/edge_capture.hpp"
#include "haptic/histogram.hpp"
#include "measure/kernel_watch.hpp"
#include "measure/latency_course.hpp"
#include "measure/peer_tool.hpp"
#include "measure/run_report.hpp"
#include "measure/trace_explanation.hpp"
#include "process/timing_log.hpp"
#include "tick/instruments.hpp"

namespace haptic::rt {

/// A tool that was asked for beside the loop, and what it found in the pauses.
struct MeasuredPeer {
    const PeerTool* tool;
    const PeerResult* result;
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
    const RunCourse* course = nullptr;
    std::int64_t began_ns = 0;                 // CLOCK_MONOTONIC
    std::int64_t real_minus_monotonic_ns = 0;  // CLOCK_REALTIME minus CLOCK_MONOTONIC
    std::int64_t period_ns = 1'000'000;        // of the loop
    std::string load{};                        // command of the load; empty: none
    std::vector<MeasuredPeer> peers{};
    const LoopbackResult* loopback = nullptr;  // nullptr: not requested
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

/// A latency whose course over the run is reported: its key, title, and definition.
struct CourseName {
    const LatencyCourse RunCourse::* course;
    const char* key;
    const char* title;
    const char* what;
};
inline constexpr std::array<CourseName, 3> kCourses = {
    {{&RunCourse::wakeup, "wakeup", "wake-up", "from the deadline to the start of the tick"},
     {&RunCourse::jitter, "jitter", "jitter", "how far the period is off its nominal length"},
     {&RunCourse::compute, "compute", "compute", "the whole tick, from wake-up to end, including the exchanges"}}};
/// Percentiles of each interval of a course: keys of kPercentiles, beside "max".
inline constexpr std::array<const char*, 3> kCoursePercentiles = {"p50", "p99", "p999"};

/// A line about a peer tool in the table of latencies: a distribution, or ratios of two.
struct PeerRow {
    std::string title;
    const nlohmann::json* values;
    bool is_ratio;
};
/// The lines about all peer tools of a report that measured latencies; they refer to `measure`.
[[nodiscard]] std::vector<PeerRow> peer_rows(const nlohmann::json& measure);
/// Sentences about the other tools: the noise that one found, and why one was not run.
[[nodiscard]] std::vector<std::string> peer_notes(const nlohmann::json& measure);

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
