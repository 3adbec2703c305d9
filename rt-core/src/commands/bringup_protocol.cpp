#include "commands/bringup_protocol.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "formatted.hpp"
#include "haptic/report.hpp"

namespace haptic::rt {
namespace {

using haptic::detail::formatted;

constexpr int kVersion = 1;
constexpr double kMicro = 1e6;
constexpr double kMilli = 1e3;
// Counts by which a counter may flicker at rest.
constexpr std::int64_t kMostNoise = 2;

nlohmann::json to_json(const BringupProtocol& p) {
    nlohmann::json pull_outs = nlohmann::json::array();
    nlohmann::json pulls = nlohmann::json::array();
    nlohmann::json weighings = nlohmann::json::array();
    for (std::size_t i = 0; i < kStrings; ++i) {
        if (const auto& one = p.pull_outs[i]) {
            pull_outs.push_back({{"string", i}, {"metres", one->metres}, {"counts", one->counts}});
        }
        if (const auto& one = p.pulls[i]) {
            pulls.push_back({{"channel", i}, {"code", one->code}, {"counts", one->counts}, {"string_seen", one->seen}});
        }
        for (const Weighing& one : p.weighings[i]) {
            weighings.push_back(
                {{"string", i}, {"code", one.code}, {"newtons", one.newtons}, {"with", p.weighed_with[i]}});
        }
    }
    nlohmann::json power = nlohmann::json::array();
    for (const Answer& one : p.power) {
        power.push_back({{"question", one.question},
                         {"yes", one.yes},
                         {"expected", one.expected},
                         {"meaning", one.meaning},
                         {"must_be_fixed", one.must_be_fixed}});
    }
    nlohmann::json measured = {{"pull_outs", pull_outs}, {"pulls", pulls}, {"weighings", weighings}};
    measured["power_cut"] = {{"done", p.power_done}, {"answers", power}};
    if (p.noise) {
        measured["noise_counts"] = *p.noise;
    }
    if (p.round_trips) {
        measured["round_trips"] = {{"times_ns", p.round_trips->times_ns},
                                   {"failed", p.round_trips->failed},
                                   {"p50_us", 1e-3 * static_cast<double>(p.round_trips->quantile(0.5))},
                                   {"p99_us", 1e-3 * static_cast<double>(p.round_trips->quantile(0.99))},
                                   {"max_us", 1e-3 * static_cast<double>(p.round_trips->quantile(1.0))}};
    }
    return {{"protocol", kVersion},
            {"finished", p.finished},
            {"started", p.started},
            {"device", p.device},
            {"nominal_geometry", {{"name", p.nominal}, {"fingerprint", p.nominal_fingerprint}}},
            {"versions", {{"haptic", p.haptic_version}, {"kernel", p.kernel}}},
            {"geometry_file", p.geometry_file},
            {"measured", measured},
            {"skipped", p.skipped}};
}

void read_measured(const nlohmann::json& measured, BringupProtocol& p) {
    const auto index = [](const nlohmann::json& one, const char* key) {
        const auto at = one.at(key).get<std::size_t>();
        if (at >= kStrings) {
            throw std::runtime_error("a string or channel above 7");
        }
        return at;
    };
    for (const nlohmann::json& one : measured.at("pull_outs")) {
        p.pull_outs[index(one, "string")] = PullOut{one.at("metres"), one.at("counts")};
    }
    for (const nlohmann::json& one : measured.at("pulls")) {
        const int seen = one.at("string_seen");
        p.pulls[index(one, "channel")] =
            MotorPull{one.at("code"), one.at("counts"), std::clamp(seen, -1, static_cast<int>(kStrings) - 1)};
    }
    for (const nlohmann::json& one : measured.at("weighings")) {
        const std::size_t string = index(one, "string");
        p.weighings[string].push_back({one.at("code"), one.at("newtons")});
        p.weighed_with[string] = one.at("with");
    }
    for (const nlohmann::json& one : measured.at("power_cut").at("answers")) {
        p.power.push_back(
            {one.at("question"), one.at("yes"), one.at("expected"), one.at("meaning"), one.at("must_be_fixed")});
    }
    p.power_done = measured.at("power_cut").at("done");
    if (measured.contains("noise_counts")) {
        p.noise = measured.at("noise_counts").get<std::array<std::int64_t, kStrings>>();
    }
    if (measured.contains("round_trips")) {
        const nlohmann::json& trips = measured.at("round_trips");
        p.round_trips = RoundTrips{trips.at("times_ns"), trips.at("failed")};
    }
}

/// Steps that are still missing.
std::vector<std::string> missing_of(const BringupProtocol& p) {
    std::vector<std::string> missing;
    const auto count = [&missing](const char* what, std::size_t there) {
        if (there < kStrings) {
            missing.push_back(formatted("%s: %zu of 8", what, there));
        }
    };
    const auto given = [](const auto& one) { return one.has_value(); };
    count("strings pulled out by hand",
          static_cast<std::size_t>(std::count_if(p.pull_outs.begin(), p.pull_outs.end(), given)));
    count("motors tried", static_cast<std::size_t>(std::count_if(p.pulls.begin(), p.pulls.end(), given)));
    count("strings weighed", static_cast<std::size_t>(std::count_if(p.weighings.begin(), p.weighings.end(),
                                                                    [](const auto& one) { return !one.empty(); })));
    if (!p.noise || !p.round_trips || !p.power_done) {
        missing.push_back(!p.noise ? "counters at rest" : !p.round_trips ? "round trips" : "power-cut test");
    }
    return missing;
}

}  // namespace

BringupFindings findings_of(const BringupProtocol& protocol, const device::DeviceGeometry& nominal) {
    BringupFindings findings;
    for (std::size_t s = 0; s < kStrings; ++s) {
        if (const std::optional<PullOut>& pull = protocol.pull_outs[s]) {
            findings.encoder_of_string[s] = judge_pull_out(*pull, nominal.strings[s]);
        }
        findings.weight_of_string[s] = fit_weighings(protocol.weighings[s]);
    }
    for (std::size_t c = 0; c < kStrings; ++c) {
        if (const std::optional<MotorPull>& pull = protocol.pulls[c]) {
            findings.motor_of_channel[c] = judge_motor(*pull, findings.encoder_of_string);
        }
    }
    return findings;
}

bool BringupSummary::can_be_signed() const {
    return device.geometry &&
           std::none_of(deviations.begin(), deviations.end(), [](const Deviation& one) { return one.must_be_fixed; });
}

BringupSummary summary_of(const BringupProtocol& protocol, const device::DeviceGeometry& nominal,
                          std::int64_t period_ns, int exchanges) {
    BringupSummary summary;
    summary.device = judge_bringup(nominal, findings_of(protocol, nominal));
    summary.deviations = summary.device.deviations;
    for (std::size_t c = 0; protocol.noise && c < kStrings; ++c) {
        if ((*protocol.noise)[c] > kMostNoise) {
            summary.deviations.push_back(
                {formatted("the counter of channel %zu moved by %lld counts at rest", c,
                           static_cast<long long>((*protocol.noise)[c])),
                 "the device was touched, or the encoder's cable picks up noise: check shield and ground", true});
        }
    }
    if (protocol.round_trips) {
        const std::vector<Deviation> link = judge_round_trips(*protocol.round_trips, period_ns, exchanges);
        summary.deviations.insert(summary.deviations.end(), link.begin(), link.end());
    }
    for (const Answer& one : protocol.power) {
        if (one.deviates()) {
            summary.deviations.push_back({one.question + (one.yes ? " yes" : " no"), one.meaning, one.must_be_fixed});
        }
    }
    for (const std::string& missing : missing_of(protocol)) {
        summary.deviations.push_back({"missing: " + missing, "resume the bring-up to measure it", true});
    }
    return summary;
}

void drop_what_must_be_fixed(BringupProtocol& protocol, const device::DeviceGeometry& nominal, std::int64_t period_ns,
                             int exchanges) {
    const BringupFindings findings = findings_of(protocol, nominal);
    const auto& encoders = findings.encoder_of_string;
    const auto& motors = findings.motor_of_channel;
    for (std::size_t i = 0; i < kStrings; ++i) {
        // Two strings cannot have one encoder, nor two channels one string: both are tried again.
        const auto same_encoder = [&](const EncoderFinding& one) { return one.channel == encoders[i].channel; };
        const auto same_motor = [&](const MotorFinding& one) { return one.string == motors[i].string; };
        if (!encoders[i].found() || std::count_if(encoders.begin(), encoders.end(), same_encoder) > 1) {
            protocol.pull_outs[i].reset();
        }
        if (motors[i].state != MotorState::Pulls || motors[i].contradicts ||
            std::count_if(motors.begin(), motors.end(), same_motor) > 1) {
            protocol.pulls[i].reset();
        }
    }
    if (protocol.noise && *std::max_element(protocol.noise->begin(), protocol.noise->end()) > kMostNoise) {
        protocol.noise.reset();
    }
    if (protocol.round_trips) {
        const std::vector<Deviation> link = judge_round_trips(*protocol.round_trips, period_ns, exchanges);
        if (std::any_of(link.begin(), link.end(), [](const Deviation& one) { return one.must_be_fixed; })) {
            protocol.round_trips.reset();
        }
    }
    if (std::any_of(protocol.power.begin(), protocol.power.end(),
                    [](const Answer& one) { return one.deviates() && one.must_be_fixed; })) {
        protocol.power_done = false;
    }
    protocol.skipped.clear();
}

void save(const BringupProtocol& protocol, const std::filesystem::path& file,
          const std::vector<Deviation>& deviations) {
    nlohmann::json all = to_json(protocol);
    nlohmann::json list = nlohmann::json::array();
    for (const Deviation& one : deviations) {
        list.push_back({{"what", one.what}, {"meaning", one.meaning}, {"must_be_fixed", one.must_be_fixed}});
    }
    all["deviations"] = list;
    if (!protocol.person.empty()) {
        all["signature"] = {{"person", protocol.person},
                            {"date", protocol.signed_on},
                            {"consent", true},
                            {"geometry_fingerprint", protocol.geometry_fingerprint}};
    }
    write_report(file, all);
}

BringupProtocol load_bringup(const std::filesystem::path& file) {
    try {
        std::ifstream stream(file);
        const nlohmann::json all = nlohmann::json::parse(stream);
        if (all.at("protocol") != kVersion) {
            throw std::runtime_error("another version of the format");
        }
        BringupProtocol p;
        p.started = all.at("started");
        p.device = all.at("device");
        p.nominal = all.at("nominal_geometry").at("name");
        p.nominal_fingerprint = all.at("nominal_geometry").at("fingerprint");
        p.haptic_version = all.at("versions").at("haptic");
        p.kernel = all.at("versions").at("kernel");
        p.geometry_file = all.at("geometry_file");
        p.skipped = all.at("skipped").get<std::vector<std::string>>();
        p.finished = all.at("finished");
        p.person = all.value("signature", nlohmann::json::object()).value("person", "");
        read_measured(all.at("measured"), p);
        return p;
    } catch (const std::exception& error) {
        throw std::runtime_error(file.string() + ": is no protocol of this version of rt-core bringup (" +
                                 error.what() + "); move it away to start a new one");
    }
}

std::string strings_text(const device::DeviceGeometry& nominal, const BringupFindings& findings) {
    std::string lines =
        "  string  corner              encoder  um/count (nominal)       motor    mN/code (nominal)  friction N\n";
    for (std::size_t s = 0; s < kStrings; ++s) {
        const EncoderFinding& encoder = findings.encoder_of_string[s];
        std::string motor = "-";
        for (std::size_t c = 0; c < kStrings; ++c) {
            if (findings.motor_of_channel[c].string == static_cast<int>(s)) {
                motor = std::to_string(c) + (findings.motor_of_channel[c].state == MotorState::Pulls
                                                 ? ""
                                                 : " " + std::string(to_string(findings.motor_of_channel[c].state)));
            }
        }
        const std::optional<WeighingFit>& fit = findings.weight_of_string[s];
        lines += formatted(
            "  %-6zu  %-18s  %-7s  %-9s (%+.3f)     %-7s  %-8s (%.3f)   %s\n", s, corner_of(nominal, s).c_str(),
            (encoder.found() ? std::to_string(encoder.channel) : std::string("-")).c_str(),
            (encoder.found() ? formatted("%+.3f", kMicro * encoder.metres_per_count) : std::string("-")).c_str(),
            kMicro * nominal.strings[s].metres_per_count, motor.c_str(),
            (fit ? formatted("%.3f", kMilli * fit->newtons_per_code) : std::string("-")).c_str(),
            kMilli * std::fabs(nominal.strings[s].newtons_per_code),
            (fit ? formatted("%.3f", fit->friction) : std::string("-")).c_str());
    }
    return lines;
}

std::string deviations_text(const std::vector<Deviation>& deviations) {
    std::string lines;
    for (const Deviation& one : deviations) {
        lines += std::string(one.must_be_fixed ? "  MUST BE FIXED: " : "  deviation: ") + one.what + "\n      " +
                 one.meaning + "\n";
    }
    return lines.empty() ? "  no deviations\n" : lines;
}

std::string protocol_text(const BringupProtocol& p, const device::DeviceGeometry& nominal,
                          const BringupSummary& summary) {
    std::string lines = "Bring-up of " + p.device + "\n\n";
    lines += "started    " + p.started + "\nnominal    " + p.nominal + " (" + p.nominal_fingerprint +
             ")\nversions   haptic " + p.haptic_version + ", " + p.kernel + "\ngeometry   " +
             (p.geometry_file.empty() ? "not written" : p.geometry_file + " (" + p.geometry_fingerprint + ")") + "\n\n";
    lines += "Strings\n" + strings_text(nominal, findings_of(p, nominal)) + "\n";
    if (p.noise) {
        lines += "Counters at rest moved by";
        for (const std::int64_t range : *p.noise) {
            lines += " " + std::to_string(range);
        }
        lines += " counts.\n\n";
    }
    lines += "Readings\n";
    for (std::size_t s = 0; s < kStrings; ++s) {
        for (const Weighing& one : p.weighings[s]) {
            lines += formatted("  string %zu at code %.0f: %.3f N (%s)\n", s, one.code, one.newtons,
                               p.weighed_with[s].c_str());
        }
    }
    if (p.round_trips) {
        lines += formatted("\nRound trips: %zu, failed %llu, p50 %.3f ms, p99 %.3f ms, longest %.3f ms\n",
                           p.round_trips->times_ns.size(), static_cast<unsigned long long>(p.round_trips->failed),
                           1e-6 * static_cast<double>(p.round_trips->quantile(0.5)),
                           1e-6 * static_cast<double>(p.round_trips->quantile(0.99)),
                           1e-6 * static_cast<double>(p.round_trips->quantile(1.0))) +
                 histogram_text(*p.round_trips);
    }
    lines += "\nPower-cut test\n";
    for (const Answer& one : p.power) {
        lines += "  " + one.question + (one.yes ? " yes" : " no") + (one.deviates() ? " - NOT AS EXPECTED" : "") + "\n";
    }
    lines += "\nDeviations\n" + deviations_text(summary.deviations) + "\n";
    lines += p.person.empty() ? "NOT SIGNED: the device renders at most 1 N.\n"
                              : "Signed by " + p.person + " on " + p.signed_on + " for the geometry " +
                                    p.geometry_fingerprint + ".\n";
    return lines;
}

std::string now_text() {
    const std::time_t now = std::time(nullptr);
    std::tm date{};
    localtime_r(&now, &date);
    char text[40];
    std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%S%z", &date);
    return text;
}

}  // namespace haptic::rt
