// Comparison of two measurement reports, as JSON and as text.
#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "measure/measure_report.hpp"

namespace haptic::rt {
namespace {

/// Conditions of a measurement. Two runs whose conditions differ do not compare the loop alone.
nlohmann::json conditions(const nlohmann::json& report) {
    const nlohmann::json& setup = report.at("setup");
    const nlohmann::json& measure = report.at("measure");
    return {{"kernel", setup.at("kernel")},
            {"preempt_rt", setup.at("preempt_rt")},
            {"policy", setup.at("policy")},
            {"priority", setup.at("priority")},
            {"cpu", setup.at("cpu")},
            {"mlocked", setup.at("mlocked")},
            {"period_s", measure.at("period_s")},
            {"load", measure.at("load")},
            {"device", report.at("exchange").at("device")}};
}

nlohmann::json side(const nlohmann::json& report) {
    const nlohmann::json& overruns = report.at("measure").at("overruns");
    return {{"began", report.at("measure").at("began")},
            {"ticks", report.at("ticks")},
            {"deadlines_missed", overruns.at("deadlines_missed")},
            {"page_faults", report.at("page_faults")},
            {"conditions", conditions(report)}};
}

nlohmann::json compared(const nlohmann::json& first, const nlohmann::json& second) {
    nlohmann::json result = {{"count", {first.at("count"), second.at("count")}}};
    const auto add = [&](const char* key) {
        const double a = first.at(key).get<double>();
        const double b = second.at(key).get<double>();
        result[key] = {{"first", a}, {"second", b}, {"ratio", a > 0.0 ? nlohmann::json(b / a) : nlohmann::json()}};
    };
    for (const Percentile& one : kPercentiles) {
        add(one.key);
    }
    add("max");
    return result;
}

/// One line of the table: `part` ("first", "second" or "ratio") of each percentile.
std::string line_of(const std::string& title, const nlohmann::json& entry, const char* part, int decimals) {
    std::array<char, 48> text{};
    std::snprintf(text.data(), text.size(), "  %-22s", title.c_str());
    std::string line = text.data();
    const auto add = [&](const char* key) {
        const nlohmann::json& value = entry.at(key).at(part);
        if (!value.is_number()) {
            line += "         -";
            return;
        }
        std::snprintf(text.data(), text.size(), "%10.*f", decimals, value.get<double>());
        line += text.data();
    };
    for (const Percentile& one : kPercentiles) {
        add(one.key);
    }
    add("max");
    return line + "\n";
}

std::string value_text(const nlohmann::json& value) {
    return value.is_null() ? "none" : value.is_string() ? value.get<std::string>() : value.dump();
}

}  // namespace

nlohmann::json compare_measurements(const nlohmann::json& first, const nlohmann::json& second) {
    require_measurement(first, "the first report");
    require_measurement(second, "the second report");
    nlohmann::json latencies = nlohmann::json::object();
    for (const LatencyName& name : latency_names()) {
        const std::string key(name.key);
        latencies[key] =
            compared(first.at("measure").at("latency_us").at(key), second.at("measure").at("latency_us").at(key));
    }
    // Conditions that differ between the two runs.
    nlohmann::json differences = nlohmann::json::array();
    const nlohmann::json a = conditions(first);
    const nlohmann::json b = conditions(second);
    for (const auto& [key, value] : a.items()) {
        if (value != b.at(key)) {
            differences.push_back(key);
        }
    }
    return {{"first", side(first)}, {"second", side(second)}, {"differences", differences}, {"latency_us", latencies}};
}

std::string comparison_text(const nlohmann::json& comparison) {
    std::string text;
    for (const char* which : {"first", "second"}) {
        const nlohmann::json& one = comparison.at(which);
        text += std::string(which) + ": " + one.at("began").get<std::string>() + ", " + one.at("ticks").dump() +
                " ticks, " + one.at("deadlines_missed").dump() + " deadlines missed, " + one.at("page_faults").dump() +
                " page faults\n";
    }
    // Differing conditions.
    for (const nlohmann::json& key : comparison.at("differences")) {
        const std::string name = key.get<std::string>();
        text += "  different " + name + ": " + value_text(comparison.at("first").at("conditions").at(name)) + " | " +
                value_text(comparison.at("second").at("conditions").at(name)) + "\n";
    }
    // Table of the latencies: first, second and their ratio.
    text += percentile_header() + "\n";
    for (const LatencyName& name : latency_names()) {
        const nlohmann::json& entry = comparison.at("latency_us").at(std::string(name.key));
        if (entry.at("count").at(0) == 0 && entry.at("count").at(1) == 0) {
            continue;
        }
        const std::string title(name.title);
        text += line_of(title + ", first", entry, "first", 1) + line_of(title + ", second", entry, "second", 1) +
                line_of("  second / first", entry, "ratio", 2);
    }
    return text;
}

}  // namespace haptic::rt
