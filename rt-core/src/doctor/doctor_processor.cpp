// Doctor checks of the processor that the loop is pinned to.
#include <sstream>

#include "doctor/doctor_checks.hpp"
#include "process/cpu_list.hpp"

namespace haptic::rt {
namespace {

constexpr std::int64_t kSmiCount = 0x34;   // MSR_SMI_COUNT, Intel's manual volume 4, of each processor since Nehalem
constexpr std::int64_t kClockTicks = 100;  // /proc/stat counts per second: USER_HZ, 100 on all supported architectures

/// Longest exit latency (us) of the enabled idle states; 0 if there are none.
std::int64_t longest_idle_exit_us(const CheckContext& context, std::string& name) {
    std::int64_t longest = 0;
    for (const std::string& state : context.machine.names(context.cpu_file("cpuidle"))) {
        const std::string folder = context.cpu_file("cpuidle/" + state + "/");
        const std::int64_t latency = context.machine.number(folder + "latency").value_or(0);
        if (context.machine.number(folder + "disable").value_or(0) == 0 && latency > longest) {
            longest = latency;
            name = context.machine.line(folder + "name").value_or(state);
        }
    }
    return longest;
}

}  // namespace

Finding check_processor(const CheckContext& context) {
    const bool online = contains(context.online, context.cpu);
    return {"processor", online || context.online.empty() ? Verdict::Good : Verdict::Bad,
            context.processor() + (context.settings.cpu < 0 ? ", chosen by rt-core" : ", set by loop.cpu") +
                "; online: " + cpu_list_text(context.online),
            "the loop is pinned to one processor, so that it never migrates away from its caches",
            online || context.online.empty() ? std::string() : "rt-core run --set loop.cpu=-1"};
}

Finding check_interrupts(const CheckContext& context) {
    // Names of the first interrupts routed to the loop's processor.
    std::string here;
    std::size_t count = 0;
    constexpr std::size_t max_named = 4;
    for (const Interrupt& interrupt : context.machine.interrupts()) {
        if (contains(interrupt.cpus, context.cpu) && count++ < max_named) {
            here += (here.empty() ? "" : "; ") + std::to_string(interrupt.number) + " " + interrupt.handlers;
        }
    }
    here += count > max_named ? "; and " + std::to_string(count - max_named) + " more" : "";
    Finding finding{"interrupts", count == 0 ? Verdict::Good : Verdict::Bad,
                    count == 0 ? "no device interrupt is routed to " + context.processor()
                               : "routed to " + context.processor() + ": " + here,
                    "each device interrupt takes the loop's processor for some microseconds, at any time",
                    count == 0 ? std::string() : context.tune("irqs")};
    if (context.machine.names("/proc/irq").empty()) {
        finding = {"interrupts", Verdict::Unknown, "/proc/irq cannot be read", finding.why, {}};
    } else if (count != 0 && context.online.size() == 1) {
        finding.remedy = kNeedsTwoProcessors;
    }
    return finding;
}

Finding check_rivals(const CheckContext& context) {
    Finding finding{
        "rivals",
        Verdict::Good,
        "no other thread of priority " + std::to_string(context.settings.priority) + " or more may run on " +
            context.processor(),
        "of two real-time threads on one processor the one of higher priority runs, and at equal priority the one "
        "that started first",
        {}};
    for (const Thread& thread : context.machine.threads()) {
        // The kernel's migration threads exist on every processor, above all other priorities.
        const bool expected = thread.name.starts_with("rt-core") || thread.name.starts_with("migration/");
        if (expected || thread.priority < context.settings.priority || !contains(thread.cpus, context.cpu)) {
            continue;
        }
        const std::string id = std::to_string(thread.id);
        finding.verdict = Verdict::Bad;
        finding.found = thread.name + " (" + id + ") has priority " + std::to_string(thread.priority) +
                        " and may run on " + context.processor();
        finding.remedy = context.others().empty()
                             ? "sudo chrt -f -p " + std::to_string(context.settings.priority - 1) + " " + id
                             : "sudo taskset -cp " + cpu_list_text(context.others()) + " " + id;
        return finding;
    }
    // Nothing was found among the visible threads; good only if these are all.
    if (!context.machine.shows_every_process()) {
        finding.verdict = Verdict::Unknown;
        finding.found = kHiddenProcesses;
        finding.remedy = kShowProcesses;
    }
    return finding;
}

Finding check_siblings(const CheckContext& context) {
    std::vector<int> busy;
    for (const int sibling : context.machine.cpus(context.cpu_file("topology/thread_siblings_list"))) {
        if (sibling != context.cpu && contains(context.online, sibling) && !contains(context.isolated, sibling)) {
            busy.push_back(sibling);
        }
    }
    return {"siblings", busy.empty() ? Verdict::Good : Verdict::Bad,
            busy.empty() ? "no other work runs on the core of " + context.processor()
                         : "processor " + cpu_list_text(busy) + " shares a core with " + context.processor(),
            "two hyper-threads share the caches and execution units of one core: a tick takes up to twice as long",
            busy.empty() ? std::string() : context.tune("siblings")};
}

Finding check_governor(const CheckContext& context) {
    const std::string file = context.cpu_file("cpufreq/scaling_governor");
    const std::string governor = context.machine.line(file).value_or(std::string());
    Finding finding{
        "governor",
        Verdict::Unknown,
        "the kernel does not control the frequency of " + context.processor(),
        "a processor that is clocked down while the loop sleeps needs time to speed up again: ticks take several "
        "times longer",
        {}};
    if (governor.empty()) {
        finding.remedy = "none from here: check the power settings of the firmware or the hypervisor";
        return finding;
    }
    finding.verdict = governor == "performance" ? Verdict::Good : Verdict::Bad;
    finding.found = "governor of " + context.processor() + ": " + governor;
    finding.remedy = governor == "performance" ? std::string() : context.tune("governor");
    return finding;
}

Finding check_energy_bias(const CheckContext& context) {
    // Both are hints of the operating system to the processor; 0 and "performance" are the same.
    const auto hint = [&context](const std::string& file) {
        return context.machine.line(context.cpu_file(file)).value_or(std::string());
    };
    const std::string bias = hint("power/energy_perf_bias");
    const std::string preference = hint("cpufreq/energy_performance_preference");
    Finding finding{"energy_bias",
                    Verdict::Unknown,
                    context.processor() + " takes no such hint, or the kernel does not say",
                    "a processor that is told to save energy raises its frequency late and waits longer in idle states",
                    {}};
    if (bias.empty() && preference.empty()) {
        return finding;
    }
    const auto saves = [](const std::string& given) {
        return !given.empty() && given != "0" && given != "performance";
    };
    const bool good = !saves(bias) && !saves(preference);
    finding.verdict = good ? Verdict::Good : Verdict::Bad;
    finding.found = context.processor() + ":" + (bias.empty() ? "" : " energy_perf_bias " + bias) +
                    (bias.empty() || preference.empty() ? "" : ",") +
                    (preference.empty() ? "" : " energy_performance_preference " + preference);
    finding.remedy = good ? std::string() : context.tune("energy");
    return finding;
}

Finding check_idle_states(const CheckContext& context) {
    std::string name;
    const std::int64_t longest = longest_idle_exit_us(context, name);
    const std::string device = "/dev/cpu_dma_latency";
    Finding finding{"idle_states",
                    Verdict::Good,
                    "no idle state has an exit latency above loop.idle_exit_us",
                    "a processor in a deep idle state delays each tick by the exit latency of that state",
                    {}};
    if (longest <= std::max(context.settings.idle_exit_us, 0)) {
        return finding;
    }
    finding.found = name + " takes " + std::to_string(longest) + " us to leave";
    // A slow state is harmless if rt-core can block it through PM QoS while it runs.
    if (context.settings.idle_exit_us < 0) {
        finding.verdict = Verdict::Bad;
        finding.found += ", and loop.idle_exit_us = -1 allows it";
        finding.remedy = "rt-core run --set loop.idle_exit_us=0";
    } else if (context.machine.may_write(device)) {
        finding.found += "; rt-core blocks it while it runs, through " + device;
    } else {
        finding.verdict = Verdict::Bad;
        finding.found += ", and rt-core has no write access to " + device + " to block it";
        finding.remedy = "sudo chgrp haptic " + device + " && sudo chmod g+w " + device +
                         " (the udev rule does this permanently), as a member of group haptic";
    }
    return finding;
}

Finding check_steal(const CheckContext& context) {
    // user nice system idle iowait irq softirq steal
    std::istringstream numbers(context.machine.value_of("/proc/stat", "cpu" + std::to_string(context.cpu) + " "));
    std::int64_t steal = -1;
    for (int field = 0; field < 8 && numbers >> steal; ++field) {
    }
    Finding finding{"stolen_time",
                    Verdict::Good,
                    "none on " + context.processor() + " since boot",
                    "a hypervisor that gives the processor to other guests stops the loop, and no setting in this "
                    "guest prevents it",
                    {}};
    if (!numbers || steal < 0) {
        finding.verdict = Verdict::Unknown;
        finding.found = "the kernel does not say";
    } else if (steal > 0) {
        finding.verdict = Verdict::Bad;
        finding.found = std::to_string(steal * 1000 / kClockTicks) + " ms of " + context.processor() +
                        " went to other guests since boot";
        finding.remedy = "none from here: use a dedicated machine, or have the hypervisor dedicate a processor";
    }
    return finding;
}

Finding check_smi_count(const CheckContext& context) {
    Finding finding{
        "smi_count", Verdict::Unknown, "only processors by Intel count them",
        "for a system management interrupt the firmware takes all processors away, for up to milliseconds, and "
        "the kernel can neither see nor forbid it",
        "sudo hwlatdetect --duration=60 --threshold=10 (package rt-tests) sees the gaps themselves"};
    const std::string file = "/dev/cpu/" + std::to_string(context.cpu) + "/msr";
    const std::string information = "/proc/cpuinfo";
    if (!context.machine.value_of(information, "vendor_id").ends_with("GenuineIntel")) {
        return finding;
    }
    if ((context.machine.value_of(information, "flags") + " ").find(" hypervisor ") != std::string::npos) {
        finding.found = "a virtual machine does not see those of the machine that it runs on";
        return finding;
    }
    const std::optional<std::uint64_t> before = context.machine.word_at(file, kSmiCount);
    if (before) {
        context.machine.wait();
    }
    const std::optional<std::uint64_t> after = context.machine.word_at(file, kSmiCount);
    if (!before || !after) {
        finding.found = file + " cannot be read";
        finding.remedy = "sudo modprobe msr; sudo rt-core doctor, outside of its service";
        return finding;
    }
    // The register counts in its lower half.
    const std::uint32_t more = static_cast<std::uint32_t>(*after) - static_cast<std::uint32_t>(*before);
    finding.verdict = more == 0 ? Verdict::Good : Verdict::Bad;
    finding.found = std::to_string(static_cast<std::uint32_t>(*before)) + " since the machine was switched on, and " +
                    std::to_string(more) + " more while the doctor waited";
    finding.remedy = more == 0
                         ? std::string()
                         : "none from here: look for power saving and emulation of USB keyboards in the firmware's "
                           "set-up, or for a newer firmware";
    return finding;
}

}  // namespace haptic::rt
