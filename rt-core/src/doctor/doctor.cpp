#include "doctor/doctor.hpp"

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>

#include "doctor/doctor_checks.hpp"
#include "process/cpu_list.hpp"

namespace haptic::rt {
namespace {

constexpr std::array kChecks{
    &check_kernel,      &check_processor,      &check_isolation,       &check_interrupts,   &check_timer_tick,
    &check_rcu,         &check_workqueues,     &check_nmi_watchdog,    &check_rivals,       &check_siblings,
    &check_governor,    &check_energy_bias,    &check_idle_states,     &check_clock_source, &check_throttling,
    &check_group_limit, &check_huge_pages,     &check_steal,           &check_smi_count,    &check_priority,
    &check_memory_lock, &check_usb_access,     &check_usb_autosuspend, &check_usb_link,     &check_usb_interrupt,
    &check_usb_thread,  &check_usb_moderation, &check_period_budget,
};

// Column widths of the text, in characters.
constexpr std::size_t kVerdictWidth = 9;
constexpr std::size_t kNameWidth = 17;

std::string padded(std::string_view text, std::size_t width) {
    return std::string(text) + std::string(text.size() < width ? width - text.size() : 1, ' ');
}

std::ptrdiff_t count(const Diagnosis& diagnosis, Verdict verdict) {
    return std::count_if(diagnosis.findings.begin(), diagnosis.findings.end(),
                         [verdict](const Finding& one) { return one.verdict == verdict; });
}

}  // namespace

std::string_view verdict_name(Verdict verdict) noexcept {
    switch (verdict) {
        case Verdict::Good:
            return "good";
        case Verdict::Bad:
            return "bad";
        case Verdict::Unknown:
            return "unknown";
    }
    return "unknown";
}

bool Diagnosis::good() const noexcept {
    return std::none_of(findings.begin(), findings.end(),
                        [](const Finding& one) { return one.verdict == Verdict::Bad; });
}

Diagnosis examine(const Machine& machine, const DoctorSettings& settings) {
    const std::vector<int> online = machine.cpus("/sys/devices/system/cpu/online");
    const std::vector<int> isolated = machine.cpus("/sys/devices/system/cpu/isolated");
    const std::vector<int> allowed = parse_cpu_list(machine.value_of("/proc/self/status", "Cpus_allowed_list:"));
    // Check the processor that the loop would be pinned to.
    const int cpu =
        settings.cpu >= 0
            ? settings.cpu
            : choose_cpu({.allowed = allowed.empty() ? online : allowed, .online = online, .isolated = isolated});
    const CheckContext examination{machine, settings, cpu, online, isolated};
    Diagnosis diagnosis{cpu, {}};
    for (const auto check : kChecks) {
        diagnosis.findings.push_back(check(examination));
    }
    return diagnosis;
}

std::string text_of(const Diagnosis& diagnosis) {
    std::string text;
    const std::string margin(kVerdictWidth, ' ');
    for (const Finding& one : diagnosis.findings) {
        text += padded(verdict_name(one.verdict), kVerdictWidth) + padded(one.name, kNameWidth) + one.found + "\n";
        if (one.verdict == Verdict::Good) {
            continue;
        }
        text += margin + padded("", kNameWidth) + "why:  " + one.why + "\n";
        if (!one.remedy.empty()) {
            text += margin + padded("", kNameWidth) + "fix:  " + one.remedy + "\n";
        }
    }
    return text + std::to_string(count(diagnosis, Verdict::Good)) + " good, " +
           std::to_string(count(diagnosis, Verdict::Bad)) + " bad, " +
           std::to_string(count(diagnosis, Verdict::Unknown)) + " unknown\n";
}

nlohmann::json json_of(const Diagnosis& diagnosis) {
    nlohmann::json checks = nlohmann::json::array();
    for (const Finding& one : diagnosis.findings) {
        checks.push_back({{"name", one.name},
                          {"verdict", verdict_name(one.verdict)},
                          {"found", one.found},
                          {"why", one.why},
                          {"remedy", one.remedy}});
    }
    return {{"processor", diagnosis.cpu}, {"good", diagnosis.good()}, {"checks", checks}};
}

}  // namespace haptic::rt
