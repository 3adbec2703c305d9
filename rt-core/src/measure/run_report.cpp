#include "measure/run_report.hpp"

#include <array>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <optional>
#include <system_error>
#include <utility>

#include "haptic/device/wrench_closure.hpp"
#include "haptic/report.hpp"

namespace haptic::rt {
namespace {

// A link that lost more of the recent answers than this, or was silent for longer, is named.
constexpr double kDegradedLink = 0.05;
constexpr std::int64_t kDegradedGapNs = 10'000'000;

constexpr double kMillimetres = 1e3;
constexpr double kDegrees = 57.29577951308232;

// In the order of device::ExchangeStatus.
constexpr std::array<const char*, device::kExchangeStatuses> kStatusNames = {
    "ok", "timeout", "short", "malformed", "stale", "stalled", "disconnected", "failed"};

/// summary_us() converted to milliseconds.
nlohmann::json summary_ms(const Histogram& histogram) {
    nlohmann::json result = summary_us(histogram);
    for (const char* key : {"min", "p50", "p99", "p999", "max"}) {
        result[key] = result.at(key).get<double>() * 1e-3;
    }
    return result;
}

nlohmann::json setup_json(const RealtimeSetup& setup) {
    nlohmann::json missing = nlohmann::json::array();
    for (const MissingPrivilege& one : setup.missing) {
        missing.push_back({{"what", one.what}, {"needs", one.needs}, {"remedy", one.remedy}});
    }
    return {{"kernel", setup.kernel},
            {"preempt_rt", setup.preempt_rt},
            {"policy", setup.policy},
            {"priority", setup.priority},
            {"cpu", setup.cpu},
            {"mlocked", setup.memory_locked},
            {"idle_exit_us", setup.idle_exit_us},
            {"degraded", setup.degraded()},
            {"missing", missing}};
}

nlohmann::json supervision_json(const SupervisionResult& s) {
    nlohmann::json guard;
    if (s.guarded) {
        guard = {{"priority", s.guard_priority},
                 {"oom_score_adj", s.guard_oom_score_adj},
                 {"mlocked", s.guard_locked},
                 {"silence_ms", static_cast<double>(s.silence_ns) * 1e-6}};
    }
    nlohmann::json stop_line;
    if (s.stop_line_priority >= 0) {
        stop_line = {{"priority", s.stop_line_priority}};
    }
    return {{"guard", guard},
            {"watchdog", {{"priority", s.watchdog_priority}}},
            {"stop_line", stop_line},
            {"lost", s.lost},
            {"frozen_ms", static_cast<double>(s.frozen_ns) * 1e-6}};
}

nlohmann::json exchange_json(const RunResult& result, const Instruments& m) {
    nlohmann::json statuses = nlohmann::json::object();
    for (std::size_t i = 0; i < kStatusNames.size(); ++i) {
        statuses[kStatusNames[i]] = m.exchange_statuses[i];
    }
    return {
        {"failed_ticks", m.failed_exchanges},
        {"statuses", statuses},
        {"last_failure",
         m.last_failure == device::ExchangeStatus::Ok ? "" : kStatusNames[static_cast<std::size_t>(m.last_failure)]},
        {"longest_gap_ms", static_cast<double>(m.max_latch_gap_ns) * 1e-6},
        {"device", result.device},
        {"bound_us", static_cast<double>(result.exchange_bound_ns) * 1e-3}};
}

nlohmann::json interruptions_json(const std::vector<Interruption>& interruptions) {
    nlohmann::json list = nlohmann::json::array();
    for (const Interruption& one : interruptions) {
        list.push_back({{"at_s", one.at_s},
                        {"lost_s", one.lost_s},
                        {"faults", fault_names(one.faults)},
                        {"cause", kStatusNames[static_cast<std::size_t>(one.cause)]},
                        {"black_box", one.black_box}});
    }
    return list;
}

nlohmann::json armings_json(const std::vector<Arming>& armings) {
    nlohmann::json list = nlohmann::json::array();
    for (const Arming& one : armings) {
        list.push_back({{"at_s", one.at_s}, {"by", one.by}});
    }
    return list;
}

nlohmann::json peak_json(const RunResult& result, const Instruments& m) {
    const auto share = [&](const WrenchAtPose& peak) {
        const std::optional<double> value = device::share_of_reach(result.geometry, peak.pose, peak.wrench);
        return value ? nlohmann::json(*value) : nlohmann::json();
    };
    return {{"force_n", m.peak_force},
            {"force_share", share(m.at_peak_force)},
            {"torque_nm", m.peak_torque},
            {"torque_share", share(m.at_peak_torque)}};
}

/// us, p99.9 as measured. The tick contains its exchanges; what is left of the period after wake-up and tick is the
/// reserve.
struct MeasuredPeriod {
    double wakeup;
    double tick;
    double exchanges;
    double reserve;
};
MeasuredPeriod measured_period(const PeriodDemand& demand, const Instruments& m) {
    const auto us_of = [](const Histogram& part) { return 1e-3 * static_cast<double>(part.percentile_ns(0.999)); };
    const double wakeup = us_of(m.wakeup);
    const double tick = us_of(m.compute);
    return {wakeup, tick, us_of(m.exchange), 1e-3 * static_cast<double>(demand.period_ns) - wakeup - tick};
}

nlohmann::json parts_json(const PeriodParts& parts, std::int64_t period_ns) {
    return {{"exchanges", 1e-3 * static_cast<double>(parts.exchanges_ns)},
            {"wakeups", 1e-3 * static_cast<double>(parts.wakeups_ns)},
            {"computation", 1e-3 * static_cast<double>(parts.compute_ns)},
            {"reserve", 1e-3 * static_cast<double>(period_ns - parts.sum_ns())}};
}

/// The budget that the run began with, beside what was measured. The wake-ups within an exchange are measured with it.
nlohmann::json period_budget_json(const PeriodDemand& demand, const Instruments& m) {
    const PeriodBudget budget = budget_of(demand);
    const MeasuredPeriod measured = measured_period(demand, m);
    return {{"period_us", 1e-3 * static_cast<double>(demand.period_ns)},
            {"route", route_text(demand)},
            {"exchanges", demand.exchanges},
            {"wakeups", budget.wakeups},
            {"verdict", verdict_name(budget.verdict())},
            {"needs_us", parts_json(budget.needs, demand.period_ns)},
            {"measured_p999_us",
             {{"wakeup", measured.wakeup},
              {"tick", measured.tick},
              {"exchanges", measured.exchanges},
              {"reserve", measured.reserve}}}};
}

/// Share of the ticks in which each limit acted.
nlohmann::json budget_json(const RunResult& result, const Instruments& m) {
    nlohmann::json walls = nullptr;
    if (result.walls.on) {
        const WorkspaceWalls& w = result.walls;
        walls = {{"semi_axes_m", {w.semi_axes.x, w.semi_axes.y, w.semi_axes.z}},
                 {"angle_rad", w.angle},
                 {"force_n", w.force},
                 {"torque_nm", w.torque}};
    }
    return {{"profile", result.profile},
            {"force_n", result.limits.force},
            {"torque_nm", result.limits.torque},
            {"force_rate_n_s", result.limits.force_rate},
            {"torque_rate_nm_s", result.limits.torque_rate},
            {"energy_per_second_j", {{"limit", result.budget_limits.second}, {"peak", result.budget.peak_second()}}},
            {"energy_per_session_j", {{"limit", result.budget_limits.session}, {"used", result.budget.given()}}},
            {"session_s", {{"limit", result.budget_limits.duration}, {"used", result.budget.seconds()}}},
            {"low_ticks", m.budget_low_ticks},
            {"walls", walls},
            {"edge_ticks", m.edge_ticks}};
}

nlohmann::json limits_json(const Instruments& m) {
    const auto share = [&](std::uint64_t ticks) {
        return m.ticks > 0 ? static_cast<double>(ticks) / static_cast<double>(m.ticks) : 0.0;
    };
    return {{"force", share(m.force_limited_ticks)}, {"slew", share(m.slew_limited_ticks)},
            {"reach", share(m.unreachable_ticks)},   {"stiffness", share(m.stiffness_limited_ticks)},
            {"passivity", share(m.passivity_ticks)}, {"derating", share(m.derated_ticks)}};
}

/// Peaks and limits, a line each; a share that does not exist and limits that never acted are left out.
std::string force_lines(const RunResult& result, const Instruments& m) {
    std::array<char, 160> text{};
    const auto of_reach = [&](const WrenchAtPose& peak) {
        const std::optional<double> share = device::share_of_reach(result.geometry, peak.pose, peak.wrench);
        if (!share) {
            return std::string();
        }
        std::snprintf(text.data(), text.size(), " (%.0f %% of the strings' reach)", 100.0 * *share);
        return std::string(text.data());
    };
    const std::string force_share = of_reach(m.at_peak_force);
    const std::string torque_share = of_reach(m.at_peak_torque);
    std::snprintf(text.data(), text.size(), "peak force %.3f N%s, peak torque %.4f N*m%s\n", m.peak_force,
                  force_share.c_str(), m.peak_torque, torque_share.c_str());
    const std::string lines = text.data();
    const nlohmann::json limits = limits_json(m);
    std::string acted;
    for (const auto& [name, share] : limits.items()) {
        if (share.get<double>() > 0.0) {
            std::snprintf(text.data(), text.size(), "%s%s %.2f %%", acted.empty() ? "" : ", ", name.c_str(),
                          100.0 * share.get<double>());
            acted += text.data();
        }
    }
    return acted.empty() ? lines : lines + "limits acted, of all ticks: " + acted + "\n";
}

nlohmann::json safety_shares_json(const Instruments& m) {
    return {{"exchange", m.worst.exchange}, {"late", m.worst.late}, {"residual", m.worst.residual}};
}

const char* proof_name(Proof proof) {
    switch (proof) {
        case Proof::Passed:
            return "passed";
        case Proof::Refused:
            return "refused";
        case Proof::Pending:
            break;
    }
    return "pending";
}

/// What the proof found about each string that is not right, in words.
std::vector<std::string> findings_text(const DeviceProofResult& proof) {
    std::vector<std::string> lines;
    for (std::size_t i = 0; i < kStrings; ++i) {
        const StringFinding finding = proof.findings[i];
        if (finding == StringFinding::Right) {
            continue;
        }
        std::string line = "string " + std::to_string(i) + ": " + describe(finding);
        if (finding == StringFinding::OtherMotor || finding == StringFinding::OtherString ||
            finding == StringFinding::Exchanged) {
            line += ", string " + std::to_string(proof.others[i]);
        }
        lines.push_back(std::move(line));
    }
    return lines;
}

nlohmann::json proof_json(const DeviceProofResult& proof) {
    if (!proof.required) {
        return nullptr;
    }
    const Vec6& offset = proof.offset;
    return {{"wiring", proof_name(proof.wiring)},
            {"rounds", proof.rounds},
            {"findings", findings_text(proof)},
            {"pose", proof_name(proof.pose)},
            {"offset_m", {offset[0], offset[1], offset[2]}},
            {"offset_rad", {offset[3], offset[4], offset[5]}}};
}

/// What a refused device or pose looks like, a line each.
std::string proof_lines(const RunResult& result) {
    std::string lines;
    if ((result.faults & HAPTIC_FAULT_WIRING) != 0) {
        for (const std::string& finding : findings_text(result.proof)) {
            lines += "  " + finding + "\n";
        }
    }
    // Lengths that disagree before the pose was proved.
    const bool unproved = result.proof.required && result.proof.pose != Proof::Passed;
    const std::vector<int> strings = string_numbers(result.suspects);
    if (unproved && (result.faults & (HAPTIC_FAULT_POSE | HAPTIC_FAULT_RESIDUAL)) != 0 && strings.size() == 2) {
        lines += "  strings " + std::to_string(strings[0]) + " and " + std::to_string(strings[1]) +
                 " seem to be exchanged\n";
    } else if (unproved && (result.faults & HAPTIC_FAULT_POSE) != 0 && strings.size() == 1) {
        lines += "  the encoder of string " + std::to_string(strings[0]) + " seems to count the wrong way\n";
    } else if ((result.faults & HAPTIC_FAULT_POSE) != 0) {
        const Vec6& offset = result.proof.offset;
        std::array<char, 200> text{};
        std::snprintf(text.data(), text.size(),
                      "  when it was armed, the grip was about %.0f, %.0f, %.0f mm off the centre and turned by %.0f, "
                      "%.0f, %.0f degrees (x, y, z)\n",
                      kMillimetres * offset[0], kMillimetres * offset[1], kMillimetres * offset[2],
                      kDegrees * offset[3], kDegrees * offset[4], kDegrees * offset[5]);
        lines += text.data();
    }
    return lines;
}

nlohmann::json probe_json(const ProbeUse& probe) {
    if (probe.line.empty()) {
        return nullptr;
    }
    return {{"line", probe.line},
            {"edges", probe.edges},
            {"off", probe.error != 0},
            {"error", probe.error == 0 ? "" : std::system_category().message(probe.error)}};
}

nlohmann::json probes_json(const ProbesUse& probes, const Instruments& m) {
    return {{"ticks", probes.ticks},
            {"tick", probe_json(probes.tick)},
            {"frame", probe_json(probes.frame)},
            {"relay", probe_json(probes.relay)},
            {"edge_us", summary_us(m.probe_edge)}};
}

template <class AnyHistogram>
std::string line_of(const char* name, const AnyHistogram& histogram) {
    std::array<char, 160> text{};
    std::snprintf(text.data(), text.size(), "  %-10s p50 %9.1f   p99 %9.1f   max %9.1f us\n", name,
                  static_cast<double>(histogram.percentile_ns(0.5)) * 1e-3,
                  static_cast<double>(histogram.percentile_ns(0.99)) * 1e-3,
                  static_cast<double>(histogram.max_ns()) * 1e-3);
    return text.data();
}

/// The measured parts of the period.
std::string period_line(const PeriodDemand& demand, const Instruments& m) {
    const MeasuredPeriod measured = measured_period(demand, m);
    std::array<char, 200> text{};
    std::snprintf(text.data(), text.size(),
                  "of the period, p99.9: wake-up %.1f, tick %.1f (its exchanges %.1f), reserve %.1f us\n",
                  measured.wakeup, measured.tick, measured.exchanges, measured.reserve);
    return text.data();
}

/// One line for each configured probe.
std::string probe_lines(const ProbesUse& probes, const Instruments& m) {
    std::string lines;
    for (const auto& [name, probe] : {std::pair("tick", &probes.tick), std::pair("frame", &probes.frame)}) {
        if (probe->line.empty()) {
            continue;
        }
        lines += std::string("probe ") + name + ", line " + probe->line + ": " + std::to_string(probe->edges) +
                 " edges" + (probe->error == 0 ? "" : ", then OFF: " + std::system_category().message(probe->error)) +
                 "\n";
    }
    return lines.empty() ? lines : lines + line_of("edge", m.probe_edge);
}

/// Irregularities that the loop handled by itself.
std::vector<std::string> notices(const Instruments& m) {
    std::vector<std::string> names;
    if (m.stale_ticks > 0) {
        names.emplace_back("frames_stale");  // the force faded out, and returned with the frames
    }
    if (m.frames_rejected > 0) {
        names.emplace_back("frames_rejected");
    }
    if (m.derated_ticks > 0) {
        names.emplace_back("motors_derated");
    }
    if (m.commissioning_ticks > 0) {
        names.emplace_back("commissioning");  // the device has no signed protocol: at most 1 N
    }
    if (m.probe_off_ticks > 0) {
        names.emplace_back("probe_off");
    }
    if (m.worst.exchange > kDegradedLink || m.max_latch_gap_ns > kDegradedGapNs) {
        names.emplace_back("link_degraded");
    }
    if (m.unproven_ticks > 0) {
        names.emplace_back("pose_unproven");
    }
    if (m.budget_low_ticks > 0) {
        names.emplace_back("budget_low");
    }
    if (m.edge_ticks > 0) {
        names.emplace_back("workspace_edge");
    }
    if (m.overlays_refused > 0) {
        names.emplace_back("overlays_refused");
    }
    return names;
}

/// Suspected strings in words: " (string 3)", " (string 0, 3 or 5: the lengths cannot distinguish them)".
std::string suspects_text(std::uint8_t strings) {
    const std::vector<int> numbers = string_numbers(strings);
    std::string text;
    for (std::size_t i = 0; i < numbers.size(); ++i) {
        text += (i == 0 ? "" : i + 1 == numbers.size() ? " or " : ", ") + std::to_string(numbers[i]);
    }
    return numbers.empty() ? ""
                           : " (string " + text + (numbers.size() > 1 ? ": the lengths cannot distinguish them)" : ")");
}

}  // namespace

std::vector<int> string_numbers(std::uint8_t strings) {
    std::vector<int> numbers;
    for (int i = 0; i < static_cast<int>(kStrings); ++i) {
        if ((strings >> i & 1) != 0) {
            numbers.push_back(i);
        }
    }
    return numbers;
}

nlohmann::json make_report(const RunResult& result, const Instruments& m) {
    return {
        {"ticks", m.ticks},
        {"duration_s", result.duration_s},
        {"period_us", summary_us(m.period)},
        {"wakeup_us", summary_us(m.wakeup)},
        {"compute_us", summary_us(m.compute)},
        {"stage_us",
         {{"exchange", summary_us(m.exchange)},
          {"pose", summary_us(m.pose)},
          {"proxy", summary_us(m.proxy)},
          {"tension", summary_us(m.tension)},
          {"publish", summary_us(m.publish)}}},
        {"histograms",
         {{"wakeup", buckets_us(m.wakeup)}, {"period", buckets_us(m.period)}, {"compute", buckets_us(m.compute)}}},
        {"overruns", m.overruns},
        {"page_faults", result.usage.page_faults},
        {"context_switches",
         {{"voluntary", result.usage.voluntary_switches}, {"forced", result.usage.forced_switches}}},
        {"frames",
         {{"received", m.frames_received},
          {"rejected", m.frames_rejected},
          {"stale_ticks", m.stale_ticks},
          {"age_ms", summary_ms(m.frame_age)}}},
        {"overlay", {{"received", m.overlays_received}, {"refused", m.overlays_refused}, {"ticks", m.overlay_ticks}}},
        {"exchange", exchange_json(result, m)},
        {"interruptions", interruptions_json(result.interruptions)},
        {"armings", armings_json(result.armings)},
        {"peak", peak_json(result, m)},
        {"limits", limits_json(m)},
        {"budget", budget_json(result, m)},
        {"period_budget", period_budget_json(result.period, m)},
        {"motors", {{"peak_load", m.peak_motor_load}, {"derated_ticks", m.derated_ticks}}},
        {"contact_ticks", m.contact_ticks},
        {"passivity", {{"energy_min_j", m.min_energy}, {"active_ticks", m.passivity_ticks}}},
        {"stiffness_limited_ticks", m.stiffness_limited_ticks},
        {"unreachable_ticks", m.unreachable_ticks},
        {"probes", probes_json(result.probes, m)},
        {"records_dropped", result.records_dropped},
        {"record_frames_dropped", result.frames_dropped},
        {"safety",
         {{"state", state_name(result.state)},
          {"faults", fault_names(result.faults)},
          {"strings", string_numbers(result.suspects)},
          {"stop", result.stop},
          {"worst_shares", safety_shares_json(m)},
          {"proof", proof_json(result.proof)},
          {"supervision", supervision_json(result.supervision)},
          {"notices", notices(m)},
          {"held", result.succeeded()}}},
        {"setup", setup_json(result.setup)},
    };
}

std::string summary(const RunResult& result, const Instruments& m) {
    std::array<char, 400> text{};
    std::string lines;
    // Ticks, latencies, frames and peaks.
    std::snprintf(text.data(), text.size(), "%llu ticks in %.3f s, %llu deadlines missed, %lld page faults\n",
                  static_cast<unsigned long long>(m.ticks), result.duration_s,
                  static_cast<unsigned long long>(m.overruns), static_cast<long long>(result.usage.page_faults));
    lines += text.data();
    lines += line_of("period", m.period) + line_of("wake-up", m.wakeup) + line_of("compute", m.compute);
    std::snprintf(text.data(), text.size(), "frames: %llu received, %llu rejected, %llu ticks without a fresh one\n",
                  static_cast<unsigned long long>(m.frames_received),
                  static_cast<unsigned long long>(m.frames_rejected), static_cast<unsigned long long>(m.stale_ticks));
    lines += text.data();
    if (m.overlays_received + m.overlays_refused > 0) {
        std::snprintf(text.data(), text.size(), "overlay: %llu received, %llu refused, %llu ticks with one\n",
                      static_cast<unsigned long long>(m.overlays_received),
                      static_cast<unsigned long long>(m.overlays_refused),
                      static_cast<unsigned long long>(m.overlay_ticks));
        lines += text.data();
    }
    lines += period_line(result.period, m) + force_lines(result, m);
    lines += probe_lines(result.probes, m);
    if (result.records_dropped + result.frames_dropped > 0) {
        std::snprintf(text.data(), text.size(),
                      "the recording lacks %llu ticks and %llu frames: raise recording.queue_ticks and "
                      "recording.queue_frames\n",
                      static_cast<unsigned long long>(result.records_dropped),
                      static_cast<unsigned long long>(result.frames_dropped));
        lines += text.data();
    }
    // Interruptions and faults, with their causes.
    for (const Interruption& one : result.interruptions) {
        std::snprintf(text.data(), text.size(), "interrupted at %.3f s for %.3f s: %s\n", one.at_s, one.lost_s,
                      std::string(describe(one.cause)).c_str());
        lines += text.data();
    }
    for (const std::string& name : fault_names(result.faults & ~std::uint32_t{HAPTIC_FAULT_STOP})) {
        lines += "FAULT: " + name;
        if (name == "exchange") {
            lines += " (" + std::string(describe(m.last_failure)) + ")";
        }
        if (name == "slack" || name == "residual" || name == "encoder_jump") {
            lines += suspects_text(result.suspects);
        }
        lines += "\n";
    }
    lines += proof_lines(result);
    // Real-time setup.
    if (!result.setup.degraded()) {
        lines += "real-time: " + result.setup.policy + " " + std::to_string(result.setup.priority) + " on processor " +
                 std::to_string(result.setup.cpu) + ", memory locked" +
                 (result.setup.preempt_rt ? ", PREEMPT_RT kernel" : ", kernel without PREEMPT_RT") + "\n";
    }
    for (const MissingPrivilege& one : result.setup.missing) {
        lines += "degraded: " + one.what + "\n";
    }
    return lines;
}

}  // namespace haptic::rt
