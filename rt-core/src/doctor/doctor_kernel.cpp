// Checks of the kernel and its command line. Source of each: the kernel's Documentation (admin-guide/kernel-parameters,
// scheduler/sched-rt-group, timers/no_hz), and the Linux Foundation's real-time wiki.
#include <array>
#include <sstream>
#include <string_view>

#include "doctor/doctor_checks.hpp"
#include "process/cpu_list.hpp"
#include "process/realtime_setup.hpp"

namespace haptic::rt {
namespace {

#if defined(__aarch64__)
constexpr const char* kArchitecture = "arm64";
#else
constexpr const char* kArchitecture = "amd64";
#endif

/// Processors of a parameter of the kernel's command line, such as rcu_nocbs=1-3.
std::vector<int> parameter_cpus(const Machine& machine, const std::string& parameter) {
    std::istringstream words(machine.line("/proc/cmdline").value_or(std::string()));
    const std::string key = parameter + "=";
    std::vector<int> cpus;
    for (std::string word; words >> word;) {
        if (word.starts_with(key)) {
            cpus = parse_cpu_list(word.substr(key.size()));
        }
    }
    return cpus;
}

std::string reboot(const std::string& command) {
    return command + " && sudo reboot";
}

/// The choice in brackets of a file like "always [madvise] never".
std::string chosen(const std::string& line) {
    const std::size_t open = line.find('[');
    const std::size_t close = line.find(']');
    return open == std::string::npos || close == std::string::npos || close < open
               ? std::string()
               : line.substr(open + 1, close - open - 1);
}

}  // namespace

Finding check_kernel(const Examination& of) {
    const std::string release = of.machine.line("/proc/sys/kernel/osrelease").value_or(std::string());
    const std::string version = of.machine.line("/proc/sys/kernel/version").value_or(std::string());
    Finding finding{
        "kernel", Verdict::Unknown, release + ", " + version,
        "only a PREEMPT_RT kernel can be interrupted nearly everywhere; with another one the loop waits until "
        "the kernel has done what it is at, milliseconds at worst",
        reboot("sudo apt-get install linux-image-rt-" + std::string(kArchitecture))};
    if (version.empty()) {
        finding.found = "its version cannot be read";
    } else if (is_preempt_rt(version)) {
        finding.verdict = Verdict::Good;
        finding.found = release + ", PREEMPT_RT";
        finding.remedy.clear();
    } else {
        finding.verdict = Verdict::Bad;
    }
    return finding;
}

Finding check_isolation(const Examination& of) {
    Finding finding{
        "isolation", Verdict::Bad, "the kernel puts other work on " + of.processor() + " too",
        "what else runs on the loop's processor leaves it with cold caches and in the middle of the kernel's "
        "own work",
        reboot(of.tune("cmdline"))};
    if (of.online.size() == 1) {
        finding.found = "the machine has one processor, which the loop shares with everything else";
        finding.remedy = "none: use a machine with two processors at least";
    } else if (contains(of.isolated, of.cpu)) {
        finding.verdict = Verdict::Good;
        finding.found = of.processor() + " is isolated (isolcpus)";
        finding.remedy.clear();
    }
    return finding;
}

Finding check_timer_tick(const Examination& of) {
    const std::string file = "/sys/devices/system/cpu/nohz_full";
    Finding finding{
        "timer_tick",
        Verdict::Unknown,
        "this kernel was built without nohz_full",
        "the kernel's own timer interrupts the loop's processor 100 to 1000 times a second for its bookkeeping",
        {}};
    if (!of.machine.has(file)) {
        return finding;
    }
    const bool stopped = contains(of.machine.cpus(file), of.cpu);
    finding.verdict = stopped ? Verdict::Good : Verdict::Bad;
    finding.found = of.processor() + (stopped ? " is without the kernel's tick while one thread runs (nohz_full)"
                                              : " has the kernel's tick");
    finding.remedy = stopped ? std::string() : reboot(of.tune("cmdline"));
    return finding;
}

Finding check_rcu(const Examination& of) {
    const bool elsewhere = contains(parameter_cpus(of.machine, "rcu_nocbs"), of.cpu) ||
                           contains(parameter_cpus(of.machine, "nohz_full"), of.cpu);
    return {"rcu_callbacks", elsewhere ? Verdict::Good : Verdict::Bad,
            elsewhere ? "those of " + of.processor() + " are run elsewhere (rcu_nocbs)"
                      : "those of " + of.processor() + " are run there",
            "the kernel frees memory in batches, some of them long, on the processor that gave it back",
            elsewhere ? std::string() : reboot(of.tune("cmdline"))};
}

Finding check_throttling(const Examination& of) {
    const std::optional<std::int64_t> runtime = of.machine.number("/proc/sys/kernel/sched_rt_runtime_us");
    const std::optional<std::int64_t> period = of.machine.number("/proc/sys/kernel/sched_rt_period_us");
    Finding finding{"throttling",
                    Verdict::Unknown,
                    "the kernel does not say",
                    "once the real-time threads of a processor have had their share of a second, all of them, the loop "
                    "included, stand still for the rest of it",
                    {}};
    if (!runtime) {
        return finding;
    }
    if (*runtime < 0 || (period && *runtime >= *period)) {
        finding.verdict = Verdict::Good;
        finding.found = "real-time threads may run for as long as they like";
        return finding;
    }
    finding.verdict = Verdict::Bad;
    finding.found = "real-time threads may run for " + std::to_string(*runtime) + " us of " +
                    std::to_string(period.value_or(1'000'000));
    finding.remedy = of.tune("throttling");
    return finding;
}

Finding check_huge_pages(const Examination& of) {
    const std::string file = "/sys/kernel/mm/transparent_hugepage/enabled";
    const std::string mode = chosen(of.machine.line(file).value_or(std::string()));
    Finding finding{
        "huge_pages",
        Verdict::Good,
        mode,
        "with \"always\" the kernel replaces pages by larger ones behind the process' back, and a tick that "
        "touches one meanwhile waits",
        {}};
    if (mode.empty()) {
        finding.found = "this kernel has no transparent huge pages";
    } else if (mode == "always") {
        finding.verdict = Verdict::Bad;
        finding.remedy = of.tune("hugepages");
    }
    return finding;
}

Finding check_clock_source(const Examination& of) {
    const std::string folder = "/sys/devices/system/clocksource/clocksource0/";
    const std::string clock = of.machine.line(folder + "current_clocksource").value_or(std::string());
    Finding finding{
        "clock_source",
        Verdict::Unknown,
        clock.empty() ? "the kernel does not say" : clock,
        "the loop reads the clock several times a tick: 20 ns from the processor's own counter, microseconds "
        "and a system call from a chip elsewhere",
        {}};
    constexpr std::array<std::string_view, 4> fast{"tsc", "arch_sys_counter", "kvm-clock",
                                                   "hyperv_clocksource_tsc_page"};
    constexpr std::array<std::string_view, 4> slow{"hpet", "acpi_pm", "jiffies", "refined-jiffies"};
    const auto is = [&clock](std::string_view one) { return clock == one; };
    if (std::any_of(fast.begin(), fast.end(), is)) {
        finding.verdict = Verdict::Good;
    } else if (std::any_of(slow.begin(), slow.end(), is)) {
        finding.verdict = Verdict::Bad;
        const std::string others = of.machine.line(folder + "available_clocksource").value_or(std::string());
        finding.remedy =
            (" " + others + " ").find(" tsc ") != std::string::npos
                ? "echo tsc | sudo tee " + folder + "current_clocksource"
                : "none from here: the kernel found the processor's counter unstable (sudo dmesg | grep -i "
                  "clocksource); look for a newer firmware";
    }
    return finding;
}

}  // namespace haptic::rt
