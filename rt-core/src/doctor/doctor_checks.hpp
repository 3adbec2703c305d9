// The single checks of the doctor, each a function of the machine.
#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "doctor/doctor.hpp"

namespace haptic::rt {

/// What every check looks at.
struct Examination {
    const Machine& machine;
    const DoctorSettings& settings;
    int cpu;  // the loop's
    std::vector<int> online;
    std::vector<int> isolated;

    /// A file of the loop's processor: cpu_file("cpufreq/scaling_governor").
    [[nodiscard]] std::string cpu_file(const std::string& name) const {
        return "/sys/devices/system/cpu/cpu" + std::to_string(cpu) + "/" + name;
    }
    [[nodiscard]] std::string processor() const { return "processor " + std::to_string(cpu); }
    /// The command of haptic-tune for one of its steps.
    [[nodiscard]] std::string tune(const std::string& step) const {
        return "sudo haptic-tune apply " + step + " --cpu " + std::to_string(cpu);
    }
    /// All processors but the loop's.
    [[nodiscard]] std::vector<int> others() const {
        std::vector<int> rest = online;
        rest.erase(std::remove(rest.begin(), rest.end(), cpu), rest.end());
        return rest;
    }
};

[[nodiscard]] inline bool contains(const std::vector<int>& cpus, int cpu) {
    return std::find(cpus.begin(), cpus.end(), cpu) != cpus.end();
}

// The kernel and its command line: doctor_kernel.cpp
[[nodiscard]] Finding check_kernel(const Examination& of);
[[nodiscard]] Finding check_isolation(const Examination& of);
[[nodiscard]] Finding check_timer_tick(const Examination& of);
[[nodiscard]] Finding check_rcu(const Examination& of);
[[nodiscard]] Finding check_throttling(const Examination& of);
[[nodiscard]] Finding check_huge_pages(const Examination& of);
[[nodiscard]] Finding check_clock_source(const Examination& of);

// The loop's processor: doctor_processor.cpp
[[nodiscard]] Finding check_processor(const Examination& of);
[[nodiscard]] Finding check_interrupts(const Examination& of);
[[nodiscard]] Finding check_rivals(const Examination& of);
[[nodiscard]] Finding check_siblings(const Examination& of);
[[nodiscard]] Finding check_governor(const Examination& of);
[[nodiscard]] Finding check_idle_states(const Examination& of);
[[nodiscard]] Finding check_steal(const Examination& of);

// What this process may do: doctor_rights.cpp
[[nodiscard]] Finding check_priority(const Examination& of);
[[nodiscard]] Finding check_memory_lock(const Examination& of);

// The board on USB: doctor_usb.cpp
[[nodiscard]] Finding check_usb_access(const Examination& of);
[[nodiscard]] Finding check_usb_autosuspend(const Examination& of);
[[nodiscard]] Finding check_usb_interrupt(const Examination& of);

}  // namespace haptic::rt
