// The doctor's checks. Each is a pure function of the machine and the settings, and returns one finding.
#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "doctor/doctor.hpp"

namespace haptic::rt {

inline constexpr const char* kNeedsTwoProcessors = "none: use a machine with at least two processors";

inline constexpr const char* kHiddenProcesses = "cannot see other processes: this one's /proc does not show them";
inline constexpr const char* kShowProcesses =
    "sudo rt-core doctor, in a shell of the machine: neither in a service (ProtectProc=) nor in a container";

/// Inputs of every check.
struct CheckContext {
    const Machine& machine;
    const DoctorSettings& settings;
    int cpu;  // of the loop
    std::vector<int> online;
    std::vector<int> isolated;

    /// Path of a sysfs file of the loop's processor: cpu_file("cpufreq/scaling_governor").
    [[nodiscard]] std::string cpu_file(const std::string& name) const {
        return "/sys/devices/system/cpu/cpu" + std::to_string(cpu) + "/" + name;
    }
    [[nodiscard]] std::string processor() const { return "processor " + std::to_string(cpu); }
    /// Command that applies one step of haptic-tune.
    [[nodiscard]] std::string tune(const std::string& step) const {
        return "sudo haptic-tune apply " + step + " --cpu " + std::to_string(cpu);
    }
    /// Online processors except the loop's.
    [[nodiscard]] std::vector<int> others() const {
        std::vector<int> rest = online;
        rest.erase(std::remove(rest.begin(), rest.end(), cpu), rest.end());
        return rest;
    }
};

[[nodiscard]] inline bool contains(const std::vector<int>& cpus, int cpu) {
    return std::find(cpus.begin(), cpus.end(), cpu) != cpus.end();
}

// Kernel and its command line: doctor_kernel.cpp
[[nodiscard]] Finding check_kernel(const CheckContext& context);
[[nodiscard]] Finding check_isolation(const CheckContext& context);
[[nodiscard]] Finding check_timer_tick(const CheckContext& context);
[[nodiscard]] Finding check_rcu(const CheckContext& context);
[[nodiscard]] Finding check_throttling(const CheckContext& context);
[[nodiscard]] Finding check_group_limit(const CheckContext& context);
[[nodiscard]] Finding check_workqueues(const CheckContext& context);
[[nodiscard]] Finding check_nmi_watchdog(const CheckContext& context);
[[nodiscard]] Finding check_huge_pages(const CheckContext& context);
[[nodiscard]] Finding check_clock_source(const CheckContext& context);

// Processor of the loop: doctor_processor.cpp
[[nodiscard]] Finding check_processor(const CheckContext& context);
[[nodiscard]] Finding check_interrupts(const CheckContext& context);
[[nodiscard]] Finding check_rivals(const CheckContext& context);
[[nodiscard]] Finding check_siblings(const CheckContext& context);
[[nodiscard]] Finding check_governor(const CheckContext& context);
[[nodiscard]] Finding check_energy_bias(const CheckContext& context);
[[nodiscard]] Finding check_idle_states(const CheckContext& context);
[[nodiscard]] Finding check_steal(const CheckContext& context);
[[nodiscard]] Finding check_smi_count(const CheckContext& context);

// Privileges of this process: doctor_rights.cpp
[[nodiscard]] Finding check_priority(const CheckContext& context);
[[nodiscard]] Finding check_memory_lock(const CheckContext& context);

// USB board: doctor_usb.cpp
[[nodiscard]] Finding check_usb_access(const CheckContext& context);
[[nodiscard]] Finding check_usb_autosuspend(const CheckContext& context);
[[nodiscard]] Finding check_usb_link(const CheckContext& context);
[[nodiscard]] Finding check_period_budget(const CheckContext& context);

// USB controller: doctor_usb_controller.cpp
[[nodiscard]] Finding check_usb_interrupt(const CheckContext& context);
[[nodiscard]] Finding check_usb_thread(const CheckContext& context);
[[nodiscard]] Finding check_usb_moderation(const CheckContext& context);

}  // namespace haptic::rt
