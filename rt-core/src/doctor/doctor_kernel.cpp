// Doctor checks of the kernel and its command line. Sources: the kernel's Documentation (admin-guide/kernel-parameters,
// scheduler/sched-rt-group, timers/no_hz) and the Linux Foundation's real-time wiki.
#include <array>
#include <filesystem>
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

/// Processors listed by a kernel command-line parameter such as rcu_nocbs=1-3; the last occurrence counts.
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

/// Active choice of a sysfs file like "always [madvise] never".
std::string chosen(const std::string& line) {
    const std::size_t open = line.find('[');
    const std::size_t close = line.find(']');
    return open == std::string::npos || close == std::string::npos || close < open
               ? std::string()
               : line.substr(open + 1, close - open - 1);
}

/// This process's group in the hierarchy of a controller of cgroup v1, below /sys/fs/cgroup:
/// "cpu,cpuacct/system.slice"; that of v2 with an empty `controller`. Empty if there is no such hierarchy.
std::string control_group(const Machine& machine, const std::string& controller) {
    // "4:cpu,cpuacct:/system.slice" and "0::/system.slice"
    for (const std::string& line : machine.lines("/proc/self/cgroup")) {
        const std::size_t first = line.find(':');
        const std::size_t second = first == std::string::npos ? first : line.find(':', first + 1);
        if (second == std::string::npos) {
            continue;
        }
        const std::string controllers = line.substr(first + 1, second - first - 1);
        if (("," + controllers + ",").find("," + controller + ",") != std::string::npos) {
            return controllers + line.substr(second + 1);
        }
    }
    return {};
}

/// True if cgroup v2 divides the processors between this process and others: controller cpu is enabled for its group or
/// one above it. The root has no cpu.weight.
bool scheduled_by_group(const Machine& machine) {
    const std::filesystem::path root = "/sys/fs/cgroup";
    for (std::filesystem::path group = control_group(machine, ""); group.has_relative_path();
         group = group.parent_path()) {
        if (machine.has((root / group.relative_path() / "cpu.weight").string())) {
            return true;
        }
    }
    return false;
}

}  // namespace

Finding check_kernel(const CheckContext& context) {
    const std::string release = context.machine.line("/proc/sys/kernel/osrelease").value_or(std::string());
    const std::string version = context.machine.line("/proc/sys/kernel/version").value_or(std::string());
    Finding finding{
        "kernel", Verdict::Unknown, release + ", " + version,
        "only a PREEMPT_RT kernel can be preempted nearly everywhere; on any other kernel the loop waits until the "
        "running system call or handler is done, milliseconds at worst",
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

Finding check_isolation(const CheckContext& context) {
    Finding finding{
        "isolation", Verdict::Bad, "the kernel also schedules other work on " + context.processor(),
        "other work on the loop's processor evicts its caches, and delays the loop while it is inside the kernel",
        reboot(context.tune("cmdline"))};
    if (context.online.size() == 1) {
        finding.found = "the machine has one processor, which the loop shares with everything else";
        finding.remedy = kNeedsTwoProcessors;
    } else if (contains(context.isolated, context.cpu)) {
        finding.verdict = Verdict::Good;
        finding.found = context.processor() + " is isolated (isolcpus)";
        finding.remedy.clear();
    }
    return finding;
}

Finding check_timer_tick(const CheckContext& context) {
    const std::string file = "/sys/devices/system/cpu/nohz_full";
    Finding finding{
        "timer_tick",
        Verdict::Unknown,
        "this kernel was built without nohz_full",
        "the kernel's periodic tick interrupts the loop's processor 100 to 1000 times a second for bookkeeping",
        {}};
    if (!context.machine.has(file)) {
        return finding;
    }
    const bool stopped = contains(context.machine.cpus(file), context.cpu);
    finding.verdict = stopped ? Verdict::Good : Verdict::Bad;
    finding.found = context.processor() + (stopped ? " has no kernel tick while a single thread runs (nohz_full)"
                                                   : " has the periodic kernel tick");
    finding.remedy = stopped ? std::string() : reboot(context.tune("cmdline"));
    return finding;
}

Finding check_rcu(const CheckContext& context) {
    const std::string why = "the kernel frees memory in batches, some of them long, on the processor that released it";
    if (!context.machine.line("/proc/cmdline")) {
        return {"rcu_callbacks", Verdict::Unknown, "/proc/cmdline cannot be read", why, {}};
    }
    const bool elsewhere = contains(parameter_cpus(context.machine, "rcu_nocbs"), context.cpu) ||
                           contains(parameter_cpus(context.machine, "nohz_full"), context.cpu);
    return {"rcu_callbacks", elsewhere ? Verdict::Good : Verdict::Bad,
            elsewhere ? "callbacks of " + context.processor() + " run on other processors (rcu_nocbs)"
                      : "callbacks of " + context.processor() + " run on it",
            why, elsewhere ? std::string() : reboot(context.tune("cmdline"))};
}

Finding check_throttling(const CheckContext& context) {
    const std::optional<std::int64_t> runtime = context.machine.number("/proc/sys/kernel/sched_rt_runtime_us");
    const std::optional<std::int64_t> period = context.machine.number("/proc/sys/kernel/sched_rt_period_us");
    Finding finding{"throttling",
                    Verdict::Unknown,
                    "the kernel does not say",
                    "when the real-time threads of a processor have used up their share of a period, all of them, the "
                    "loop included, are suspended for the rest of it",
                    {}};
    if (!runtime) {
        return finding;
    }
    // A runtime of -1, or one as long as the period, disables throttling.
    if (*runtime < 0 || (period && *runtime >= *period)) {
        finding.verdict = Verdict::Good;
        finding.found = "real-time threads may run without a limit";
        return finding;
    }
    finding.verdict = Verdict::Bad;
    finding.found = "real-time threads may run for " + std::to_string(*runtime) + " us of " +
                    std::to_string(period.value_or(1'000'000));
    finding.remedy = context.tune("throttling");
    return finding;
}

Finding check_group_limit(const CheckContext& context) {
    Finding finding{"rt_group",
                    Verdict::Unknown,
                    "the kernel does not say whether it limits real-time threads by control group",
                    "with CONFIG_RT_GROUP_SCHED each control group has a share of real-time processor time of its own, "
                    "which is none by default: the loop is refused SCHED_FIFO, or suspended as by throttling",
                    {}};
    // Without throttling the kernel applies none of these limits.
    if (context.machine.number("/proc/sys/kernel/sched_rt_runtime_us").value_or(0) < 0) {
        finding.verdict = Verdict::Good;
        finding.found = "sched_rt_runtime_us = -1 lifts the limits of control groups too";
        return finding;
    }
    // cgroup v1 shows the limit of this process's group.
    const std::string folder = "/sys/fs/cgroup/" + control_group(context.machine, "cpu") + "/";
    if (const std::optional<std::int64_t> runtime = context.machine.number(folder + "cpu.rt_runtime_us")) {
        const std::int64_t period = context.machine.number(folder + "cpu.rt_period_us").value_or(1'000'000);
        const bool limited = *runtime >= 0 && *runtime < period;
        finding.verdict = limited ? Verdict::Bad : Verdict::Good;
        finding.found = "real-time threads of this control group may run " +
                        (limited ? "for " + std::to_string(*runtime) + " us of " + std::to_string(period)
                                 : std::string("without a limit"));
        finding.remedy = limited ? context.tune("throttling") : std::string();
        return finding;
    }
    // cgroup v2 shows none, and gives every group but the root none of that time.
    const std::string config = "/boot/config-" + context.machine.line("/proc/sys/kernel/osrelease").value_or("");
    if (!context.machine.has(config)) {
        return finding;
    }
    const bool built = context.machine.value_of(config, "CONFIG_RT_GROUP_SCHED=") == "y";
    const bool limited = built && scheduled_by_group(context.machine);
    finding.verdict = limited ? Verdict::Bad : Verdict::Good;
    finding.found = !built    ? "this kernel was built without CONFIG_RT_GROUP_SCHED"
                    : limited ? "real-time threads of this control group may not run at all"
                              : "controller cpu is not enabled for this control group";
    finding.remedy = limited ? context.tune("throttling") : std::string();
    return finding;
}

Finding check_workqueues(const CheckContext& context) {
    const std::string file = "/sys/devices/virtual/workqueue/cpumask";
    const std::vector<int> cpus = parse_cpu_mask(context.machine.line(file).value_or(std::string()));
    const bool here = contains(cpus, context.cpu);
    Finding finding{"workqueues", here ? Verdict::Bad : Verdict::Good,
                    "work that is bound to no processor runs on processor " + cpu_list_text(cpus),
                    "drivers and file systems put off work, which runs for milliseconds, to any of these processors",
                    here ? context.tune("workqueues") : std::string()};
    if (cpus.empty()) {
        finding.verdict = Verdict::Unknown;
        finding.found = "the kernel does not say where it runs such work";
    } else if (here && context.online.size() == 1) {
        finding.remedy = kNeedsTwoProcessors;
    }
    return finding;
}

Finding check_nmi_watchdog(const CheckContext& context) {
    const std::optional<std::int64_t> on = context.machine.number("/proc/sys/kernel/nmi_watchdog");
    const std::string watched = "/proc/sys/kernel/watchdog_cpumask";
    Finding finding{
        "nmi_watchdog",
        Verdict::Good,
        "it is off",
        "the kernel's search for processors that hang interrupts each of them, whatever masks interrupts, and "
        "occupies a counter of the processor",
        {}};
    if (!on) {
        finding.verdict = Verdict::Unknown;
        finding.found = "the kernel does not say";
    } else if (*on != 0 && context.machine.has(watched) && !contains(context.machine.cpus(watched), context.cpu)) {
        finding.found = "it leaves out " + context.processor();
    } else if (*on != 0) {
        finding.verdict = Verdict::Bad;
        finding.found = "it watches " + context.processor();
        finding.remedy = context.tune("watchdog");
    }
    return finding;
}

Finding check_huge_pages(const CheckContext& context) {
    const std::string file = "/sys/kernel/mm/transparent_hugepage/enabled";
    const std::string mode = chosen(context.machine.line(file).value_or(std::string()));
    Finding finding{
        "huge_pages",
        Verdict::Good,
        mode,
        "with \"always\" the kernel merges pages of a running process into larger ones, and a tick that touches one "
        "of them meanwhile waits",
        {}};
    if (mode.empty()) {
        finding.found = "this kernel has no transparent huge pages";
    } else if (mode == "always") {
        finding.verdict = Verdict::Bad;
        finding.remedy = context.tune("hugepages");
    }
    return finding;
}

Finding check_clock_source(const CheckContext& context) {
    const std::string folder = "/sys/devices/system/clocksource/clocksource0/";
    const std::string clock = context.machine.line(folder + "current_clocksource").value_or(std::string());
    Finding finding{
        "clock_source",
        Verdict::Unknown,
        clock.empty() ? "the kernel does not say" : clock,
        "the loop reads the clock several times a tick: 20 ns from the processor's own counter, microseconds and a "
        "system call from an external timer",
        {}};
    // Clock sources read in user space, and those that need a system call and a device access.
    constexpr std::array<std::string_view, 4> fast{"tsc", "arch_sys_counter", "kvm-clock",
                                                   "hyperv_clocksource_tsc_page"};
    constexpr std::array<std::string_view, 4> slow{"hpet", "acpi_pm", "jiffies", "refined-jiffies"};
    const auto is = [&clock](std::string_view one) { return clock == one; };
    if (std::any_of(fast.begin(), fast.end(), is)) {
        finding.verdict = Verdict::Good;
    } else if (std::any_of(slow.begin(), slow.end(), is)) {
        finding.verdict = Verdict::Bad;
        const std::string others = context.machine.line(folder + "available_clocksource").value_or(std::string());
        finding.remedy =
            (" " + others + " ").find(" tsc ") != std::string::npos
                ? "echo tsc | sudo tee " + folder + "current_clocksource"
                : "none from here: the kernel found the processor's counter unstable (sudo dmesg | grep -i "
                  "clocksource); look for a newer firmware";
    }
    return finding;
}

}  // namespace haptic::rt
