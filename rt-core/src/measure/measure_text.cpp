// Measurement report as text for a terminal.
#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "measure/measure_report.hpp"

namespace haptic::rt {
namespace {

constexpr std::size_t kShownTicks = 5;
constexpr double kHourS = 3600.0;
constexpr double kLongRunS = 60.0;    // from here on the text shows how latencies changed over the run
constexpr double kFewTicks = 10'000;  // with fewer ticks, the last percentile is the maximum

std::string cell(double value_us) {
    std::array<char, 32> text{};
    std::snprintf(text.data(), text.size(), value_us < 99.95 ? "%10.1f" : "%10.0f", value_us);
    return text.data();
}

std::string padded(std::string text, std::size_t width) {
    text.resize(std::max(width, text.size()), ' ');
    return text;
}

/// "18:02:11.123456" of "2026-11-20T18:02:11.123456+01:00".
std::string clock_time(const std::string& time_of_day) {
    return time_of_day.size() < 26 ? time_of_day : time_of_day.substr(11, 15);
}

std::string row(const std::string& title, const nlohmann::json& distribution) {
    std::string line = "  " + padded(title, 22);
    if (distribution.at("count").get<std::uint64_t>() == 0) {
        return line + "         - (none)\n";
    }
    for (const Percentile& one : kPercentiles) {
        line += cell(distribution.at(one.key).get<double>());
    }
    line += cell(distribution.at("max").get<double>());
    if (distribution.contains("max_at")) {
        line += "  " + clock_time(distribution.at("max_at").get<std::string>()) + " " +
                distribution.at("max_stage").get<std::string>() + ": " +
                distribution.at("max_cause").get<std::string>();
    }
    return line + "\n";
}

std::string ratio_line(const std::string& title, const nlohmann::json& ratio) {
    std::string line = "  " + padded(title, 22);
    const auto add = [&](const char* key) {
        std::array<char, 32> text{};
        std::snprintf(text.data(), text.size(), "%10.2f",
                      ratio.at(key).is_number() ? ratio.at(key).get<double>() : 0.0);
        line += ratio.at(key).is_number() ? text.data() : "         -";
    };
    for (const Percentile& one : kPercentiles) {
        add(one.key);
    }
    add("max");
    return line + "\n";
}

std::string tick_lines(const nlohmann::json& tick) {
    std::array<char, 160> text{};
    const auto missed = tick.at("missed").get<long long>();
    std::snprintf(text.data(), text.size(), "  %s tick %llu ended %.0f us after its deadline%s: ",
                  clock_time(tick.at("at").get<std::string>()).c_str(), tick.at("tick").get<unsigned long long>(),
                  tick.at("late_us").get<double>(),
                  missed > 0 ? (", " + std::to_string(missed) + " missed").c_str() : "");
    std::string lines = text.data();
    lines += tick.at("stage").get<std::string>() + ", " + tick.at("why").get<std::string>();
    if (const std::string interrupts = tick.value("unusual_interrupts", ""); !interrupts.empty()) {
        lines += "; unusually many interrupts at that time: " + interrupts;
    }
    return lines + "\n";
}

std::string heading(const nlohmann::json& report) {
    const nlohmann::json& measure = report.at("measure");
    std::array<char, 320> text{};
    std::snprintf(text.data(), text.size(), "%llu ticks in %.1f s of %s, from %s\n",
                  report.at("ticks").get<unsigned long long>(), report.at("duration_s").get<double>(),
                  report.at("exchange").at("device").get<std::string>().c_str(),
                  measure.at("began").get<std::string>().c_str());
    std::string lines = text.data();
    const nlohmann::json& setup = report.at("setup");
    lines += "kernel " + setup.at("kernel").get<std::string>() + "\n";
    lines += setup.at("policy").get<std::string>() + " " + std::to_string(setup.at("priority").get<int>()) +
             " on processor " + std::to_string(setup.at("cpu").get<int>()) +
             (setup.at("mlocked").get<bool>() ? ", memory locked" : ", memory NOT locked") +
             "; load: " + (measure.at("load").is_null() ? "none" : measure.at("load").get<std::string>()) + "\n";
    for (const nlohmann::json& one : setup.at("missing")) {
        lines += "degraded: " + one.at("what").get<std::string>() + "\n";
    }
    return lines;
}

/// First and last hour of a run, or its halves, in the columns of the table above; nothing for a short run.
std::string course_lines(const nlohmann::json& course) {
    if (!course.contains("last") || course.at("last").at("to_s").get<double>() < kLongRunS) {
        return "";
    }
    const double part_s = course.at("first").at("to_s").get<double>();
    const std::string part = part_s >= kHourS ? " hour" : " half";
    std::string text;
    for (const CourseName& name : kCourses) {
        for (const char* which : {"first", "last"}) {
            text += row(std::string(name.title) + ", " + which + part, course.at(which).at(name.key));
        }
    }
    return text;
}

/// Results of the loopback line, in the columns of the table above.
std::string loopback_lines(const nlohmann::json& loopback) {
    std::string text = "measured from outside, line " + loopback.at("line").get<std::string>() + ": " +
                       std::to_string(loopback.at("rising").get<std::uint64_t>()) + " rising edges of " +
                       std::to_string(loopback.at("ticks").get<std::uint64_t>()) + " ticks\n";
    text += row("period, outside", loopback.at("period_us"));
    if (loopback.at("lateness_us").at("count").get<std::uint64_t>() > 0) {
        text += row("lateness, outside", loopback.at("lateness_us"));
    }
    if (loopback.at("high_us").is_object()) {
        text += row("time high, outside", loopback.at("high_us"));
    }
    if (const auto problem = loopback.at("problem").get<std::string>(); !problem.empty()) {
        text += "reading the line ended early: " + problem + "\n";
    }
    return text;
}

/// The tick that ended the run, and what its thread did from the deadline on.
std::string break_lines(const nlohmann::json& measure) {
    std::array<char, 256> text{};
    const nlohmann::json& tick = measure.at("break");
    if (tick.is_null()) {
        std::snprintf(text.data(), text.size(), "no tick ended more than %.0f us after its deadline\n",
                      measure.at("break_above_us").get<double>());
        return text.data();
    }
    std::snprintf(text.data(), text.size(), "tick %llu ended the run, %.0f us after its deadline; cause: %s, ",
                  tick.at("tick").get<unsigned long long>(), tick.at("late_us").get<double>(),
                  tick.at("cause").get<std::string>().c_str());
    std::string lines = std::string(text.data()) + tick.at("why").get<std::string>() + "\n";
    lines += "  us after the deadline, as the kernel traced it:\n";
    for (const nlohmann::json& part : tick.at("parts")) {
        std::snprintf(text.data(), text.size(), "  %8.0f to %8.0f  %-8s on processor %d  %s\n",
                      part.at("from_us").get<double>(), part.at("to_us").get<double>(),
                      part.at("state").get<std::string>().c_str(), part.at("cpu").get<int>(),
                      part.at("by").get<std::string>().c_str());
        lines += text.data();
    }
    return lines;
}

std::string overrun_line(const nlohmann::json& overruns) {
    const auto missed = overruns.at("deadlines_missed").get<std::uint64_t>();
    std::string line = std::to_string(missed) + (missed == 1 ? " deadline missed" : " deadlines missed");
    const auto late = overruns.at("late_ticks").get<std::uint64_t>();
    const auto explained = overruns.at("explained_ticks").get<std::uint64_t>();
    if (late > 0) {
        line += " by " + std::to_string(late) + (late == 1 ? " tick" : " ticks");
        std::string causes;
        for (const auto& [cause, count] : overruns.at("causes").items()) {
            causes += (causes.empty() ? "" : ", ") + std::to_string(count.get<int>()) + " " + cause;
        }
        // Only so many are explained.
        line += " (" + (explained < late ? "of the first " + std::to_string(explained) + ": " : std::string()) +
                causes + ")";
    }
    return line;
}

}  // namespace

std::string percentile_header() {
    std::string line = padded("us", 24);
    for (const Percentile& one : kPercentiles) {
        line += std::string(10 - std::string_view(one.title).size(), ' ') + one.title;
    }
    return line + "       max";
}

std::string measure_text(const nlohmann::json& report) {
    require_measurement(report, "this report");
    const nlohmann::json& measure = report.at("measure");
    // Table of the latencies, the peer tools below the wake-up; then how they changed over the run.
    std::string text = heading(report) + percentile_header() + "  time, stage: cause\n";
    for (const LatencyName& name : latency_names()) {
        text += row(std::string(name.title), measure.at("latency_us").at(std::string(name.key)));
        if (name.latency == Latency::Wakeup) {
            for (const PeerRow& peer : peer_rows(measure)) {
                text += peer.is_ratio ? ratio_line(peer.title, *peer.values) : row(peer.title, *peer.values);
            }
        }
    }
    text += course_lines(measure.at("course"));
    for (const std::string& note : peer_notes(measure)) {
        text += note + "\n";
    }
    if (measure.at("loopback").is_object()) {
        text += loopback_lines(measure.at("loopback"));
    }
    if (report.at("ticks").get<double>() < kFewTicks) {
        text += "fewer than 10,000 ticks: p99.99 is the maximum\n";
    }
    // Overruns, page faults, preemptions; then the latest ticks and the faults.
    text += overrun_line(measure.at("overruns")) + ", " + std::to_string(report.at("page_faults").get<long long>()) +
            " page faults, " + std::to_string(report.at("context_switches").at("forced").get<long long>()) +
            " times preempted\n";
    const nlohmann::json& worst = measure.at("worst_ticks");
    for (std::size_t i = 0; i < std::min(worst.size(), kShownTicks); ++i) {
        text += tick_lines(worst.at(i));
    }
    if (measure.contains("break")) {
        text += break_lines(measure);
    }
    for (const nlohmann::json& fault : report.at("safety").at("faults")) {
        text += fault == "stop" ? "" : "FAULT: " + fault.get<std::string>() + "\n";
    }
    return text;
}

}  // namespace haptic::rt
