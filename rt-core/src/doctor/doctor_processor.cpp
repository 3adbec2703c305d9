// Checks of the processor that the loop is pinned to.
#include <sstream>

#include "doctor/doctor_checks.hpp"
#include "process/cpu_list.hpp"

namespace haptic::rt {
namespace {

constexpr std::int64_t kClockTicks = 100;  // of /proc/stat in a second: USER_HZ, the same on every architecture here

/// The longest time, in us, that an idle state which is not disabled takes to be left; 0 without any.
std::int64_t longest_idle_exit_us(const Examination& of, std::string& name) {
    std::int64_t longest = 0;
    for (const std::string& state : of.machine.names(of.cpu_file("cpuidle"))) {
        const std::string folder = of.cpu_file("cpuidle/" + state + "/");
        const std::int64_t latency = of.machine.number(folder + "latency").value_or(0);
        if (of.machine.number(folder + "disable").value_or(0) == 0 && latency > longest) {
            longest = latency;
            name = of.machine.line(folder + "name").value_or(state);
        }
    }
    return longest;
}

}  // namespace

Finding check_processor(const Examination& of) {
    const bool online = contains(of.online, of.cpu);
    return {"processor", online || of.online.empty() ? Verdict::Good : Verdict::Bad,
            of.processor() + (of.settings.cpu < 0 ? ", chosen by rt-core" : ", of loop.cpu") + "; online are " +
                cpu_list_text(of.online),
            "the loop is pinned to one processor, so that it never waits for caches that are elsewhere",
            online || of.online.empty() ? std::string() : "rt-core run --set loop.cpu=-1"};
}

Finding check_interrupts(const Examination& of) {
    std::string here;
    std::size_t count = 0;
    constexpr std::size_t most_named = 4;
    for (const Interrupt& interrupt : of.machine.interrupts()) {
        if (contains(interrupt.cpus, of.cpu) && count++ < most_named) {
            here += (here.empty() ? "" : "; ") + std::to_string(interrupt.number) + " " + interrupt.handlers;
        }
    }
    here += count > most_named ? "; and " + std::to_string(count - most_named) + " more" : "";
    Finding finding{"interrupts", count == 0 ? Verdict::Good : Verdict::Bad,
                    count == 0 ? "no device interrupts " + of.processor() : "on " + of.processor() + ": " + here,
                    "each interrupt of a device takes the loop's processor for some microseconds, whenever it likes",
                    count == 0 ? std::string() : of.tune("irqs")};
    if (of.machine.names("/proc/irq").empty()) {
        finding = {"interrupts", Verdict::Unknown, "/proc/irq cannot be read", finding.why, {}};
    } else if (count != 0 && of.online.size() == 1) {
        finding.remedy = "none: use a machine with two processors at least";
    }
    return finding;
}

Finding check_rivals(const Examination& of) {
    Finding finding{
        "rivals",
        Verdict::Good,
        "no other thread of priority " + std::to_string(of.settings.priority) + " or more may run on " + of.processor(),
        "of two real-time threads on one processor the one of higher priority runs, and of equals the one "
        "that came first",
        {}};
    for (const RealtimeThread& thread : of.machine.realtime_threads()) {
        // The kernel's own, which moves threads between processors, is there on each and above all others.
        const bool meant = thread.name.starts_with("rt-core") || thread.name.starts_with("migration/");
        if (meant || thread.priority < of.settings.priority || !contains(thread.cpus, of.cpu)) {
            continue;
        }
        const std::string id = std::to_string(thread.id);
        finding.verdict = Verdict::Bad;
        finding.found = thread.name + " (" + id + ") has priority " + std::to_string(thread.priority) +
                        " and may run on " + of.processor();
        finding.remedy = of.others().empty() ? "sudo chrt -f -p " + std::to_string(of.settings.priority - 1) + " " + id
                                             : "sudo taskset -cp " + cpu_list_text(of.others()) + " " + id;
        return finding;
    }
    return finding;
}

Finding check_siblings(const Examination& of) {
    std::vector<int> busy;
    for (const int sibling : of.machine.cpus(of.cpu_file("topology/thread_siblings_list"))) {
        if (sibling != of.cpu && contains(of.online, sibling) && !contains(of.isolated, sibling)) {
            busy.push_back(sibling);
        }
    }
    return {"siblings", busy.empty() ? Verdict::Good : Verdict::Bad,
            busy.empty() ? "nothing else runs on the core of " + of.processor()
                         : "processor " + cpu_list_text(busy) + " shares a core with " + of.processor(),
            "two hyper-threads share one core's caches and execution units: a tick takes up to twice as long",
            busy.empty() ? std::string() : of.tune("siblings")};
}

Finding check_governor(const Examination& of) {
    const std::string file = of.cpu_file("cpufreq/scaling_governor");
    const std::string governor = of.machine.line(file).value_or(std::string());
    Finding finding{
        "governor",
        Verdict::Unknown,
        "the kernel does not set the frequency of " + of.processor(),
        "a processor that is slowed down while the loop sleeps takes a while to speed up again: ticks become "
        "several times longer",
        {}};
    if (governor.empty()) {
        finding.remedy = "none from here: see what firmware or the hypervisor say of power";
        return finding;
    }
    finding.verdict = governor == "performance" ? Verdict::Good : Verdict::Bad;
    finding.found = of.processor() + " has governor " + governor;
    finding.remedy = governor == "performance" ? std::string() : of.tune("governor");
    return finding;
}

Finding check_idle_states(const Examination& of) {
    std::string name;
    const std::int64_t longest = longest_idle_exit_us(of, name);
    const std::string device = "/dev/cpu_dma_latency";
    Finding finding{"idle_states",
                    Verdict::Good,
                    "none that takes longer than loop.idle_exit_us to be left",
                    "a processor in a deep idle state wakes up as late as that state takes to be left, in each tick",
                    {}};
    if (longest <= std::max(of.settings.idle_exit_us, 0)) {
        return finding;
    }
    finding.found = name + " takes " + std::to_string(longest) + " us to be left";
    if (of.settings.idle_exit_us < 0) {
        finding.verdict = Verdict::Bad;
        finding.found += ", and loop.idle_exit_us = -1 allows it";
        finding.remedy = "rt-core run --set loop.idle_exit_us=0";
    } else if (of.machine.may_write(device)) {
        finding.found += "; rt-core keeps it away while it runs, through " + device;
    } else {
        finding.verdict = Verdict::Bad;
        finding.found += ", and rt-core may not write to " + device + " to keep it away";
        finding.remedy = "sudo chgrp haptic " + device + " && sudo chmod g+w " + device +
                         " (as the udev rule does for good), and be a member of group haptic";
    }
    return finding;
}

Finding check_steal(const Examination& of) {
    // user nice system idle iowait irq softirq steal
    std::istringstream numbers(of.machine.value_of("/proc/stat", "cpu" + std::to_string(of.cpu) + " "));
    std::int64_t steal = -1;
    for (int field = 0; field < 8 && numbers >> steal; ++field) {
    }
    Finding finding{
        "stolen_time",
        Verdict::Good,
        "none of " + of.processor() + " since the machine started",
        "a hypervisor that lends the processor to others stops the loop, and no setting in here prevents it",
        {}};
    if (!numbers || steal < 0) {
        finding.verdict = Verdict::Unknown;
        finding.found = "the kernel does not say";
    } else if (steal > 0) {
        finding.verdict = Verdict::Bad;
        finding.found = std::to_string(steal * 1000 / kClockTicks) + " ms of " + of.processor() +
                        " went to other guests since the machine started";
        finding.remedy = "none from here: use a machine of its own, or have the hypervisor dedicate a processor";
    }
    return finding;
}

}  // namespace haptic::rt
