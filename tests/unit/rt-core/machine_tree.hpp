// Machine tree: a folder with the files of a healthy machine, in which a test can create a problem for the doctor.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <set>
#include <string>

#include "doctor/doctor.hpp"

namespace haptic::rt::test {

/// Four processors in two cores. Processor 3 is the loop's and 1 its hyper-thread, both isolated. A board is on port
/// 1-2 of a controller with interrupt 24.
class MachineTree {
  public:
    MachineTree() : root_(std::filesystem::path(testing::TempDir()) / ("machine-" + std::to_string(getpid()))) {
        std::filesystem::remove_all(root_);
        kernel();
        processor();
        rights();
        usb();
    }
    ~MachineTree() { std::filesystem::remove_all(root_); }
    MachineTree(const MachineTree&) = delete;
    MachineTree& operator=(const MachineTree&) = delete;

    [[nodiscard]] const std::filesystem::path& root() const { return root_; }
    [[nodiscard]] std::filesystem::path file(const std::string& absolute) const {
        return root_ / std::filesystem::path(absolute).relative_path();
    }
    void write(const std::string& absolute, const std::string& text) const {
        std::filesystem::create_directories(file(absolute).parent_path());
        std::ofstream(file(absolute)) << text << '\n';
    }
    void remove(const std::string& absolute) const { std::filesystem::remove_all(file(absolute)); }
    /// Makes the file read-only for this process.
    void forbid(const std::string& absolute) { forbidden_.insert(file(absolute)); }

    std::function<void()> meanwhile = {};  // happens while the doctor waits

    [[nodiscard]] Machine machine() const {
        const auto may_write = [forbidden = forbidden_](const std::filesystem::path& file) {
            return std::filesystem::exists(file) && !forbidden.contains(file);
        };
        return Machine(root_, may_write, [this] {
            if (meanwhile) {
                meanwhile();
            }
        });
    }

  private:
    void kernel() const {
        write("/proc/sys/kernel/osrelease", "6.1.0-38-rt-amd64");
        write("/proc/sys/kernel/version", "#1 SMP PREEMPT_RT Debian 6.1.147-1 (2025-08-02)");
        write("/proc/cmdline", "quiet isolcpus=managed_irq,domain,1,3 nohz_full=1,3 rcu_nocbs=1,3 irqaffinity=0,2");
        write("/proc/sys/kernel/sched_rt_runtime_us", "-1");
        write("/proc/sys/kernel/sched_rt_period_us", "1000000");
        write("/sys/kernel/mm/transparent_hugepage/enabled", "always [madvise] never");
        write("/sys/devices/system/clocksource/clocksource0/current_clocksource", "tsc");
        write("/sys/devices/system/clocksource/clocksource0/available_clocksource", "tsc hpet acpi_pm ");
        write("/boot/config-6.1.0-38-rt-amd64", "CONFIG_SMP=y\n# CONFIG_RT_GROUP_SCHED is not set");
        write("/proc/self/cgroup", "0::/user.slice");
        write("/proc/sys/kernel/nmi_watchdog", "1");
        write("/proc/sys/kernel/watchdog_cpumask", "0,2");
        write("/sys/devices/virtual/workqueue/cpumask", "5");
        write("/proc/stat", "cpu  5 0 5 9 0 0 0 7 0 0\ncpu3 1 0 1 900 0 0 0 0 0 0\ncpu30 1 0 1 900 0 0 0 50 0 0");
    }
    void processor() const {
        write("/sys/devices/system/cpu/online", "0-3");
        write("/sys/devices/system/cpu/isolated", "1,3");
        write("/sys/devices/system/cpu/nohz_full", "1,3");
        const std::string cpu = "/sys/devices/system/cpu/cpu3/";
        write(cpu + "topology/thread_siblings_list", "1,3");
        write(cpu + "cpufreq/scaling_governor", "performance");
        write(cpu + "cpufreq/energy_performance_preference", "performance");
        write(cpu + "power/energy_perf_bias", "0");
        write("/proc/cpuinfo", "processor\t: 0\nvendor_id\t: GenuineIntel\nflags\t\t: fpu tsc msr");
        interrupts_of_firmware(12);
        const std::string idle = cpu + "cpuidle/";
        write(idle + "state0/name", "POLL");
        write(idle + "state0/latency", "0");
        write(idle + "state1/name", "C1");
        write(idle + "state1/latency", "2");
        write(idle + "state2/name", "C6");
        write(idle + "state2/latency", "133");
        write("/dev/cpu_dma_latency", "");
        write("/proc/irq/default_smp_affinity", "5");
        write("/proc/irq/2/smp_affinity_list", "0-3");  // without a handler
        interrupt(24, "xhci_hcd", "0");
        interrupt(25, "nvme0q0", "2");
    }
    void rights() const {
        write("/proc/self/status", "Uid:\t1000\t1000\nCapEff:\t0000000000000000\nCpus_allowed_list:\t0,2");
        limits("98", "unlimited");
        thread(2, "kthreadd", 0, 0, "0-3", 0);
        thread(18, "migration/3", 99, 1, "3", 2);
        thread(640, "irq/24-xhci_hcd", 80, 1, "0", 2);
        thread(641, "irq/25-nvme0q0", 50, 1, "2", 2);
        thread(700, "rt-core", 80, 1, "3");
        write("/etc/security/limits.d/haptic.conf", "@haptic - rtprio 98");
    }
    void usb() const {
        const std::string controller = "/sys/devices/pci0000:00/0000:00:14.0/";
        const std::string board = controller + "usb1/1-2/";
        write(controller + "irq", "18");
        write(controller + "msi_irqs/24", "msi");
        write(board + "idVendor", "0cec");
        write(board + "idProduct", "0205");
        write(board + "busnum", "1");
        write(board + "devnum", "7");
        write(board + "power/control", "on");
        write(board + "speed", "480");
        write(board + "1-2:1.0/ep_02/wMaxPacketSize", "0200");
        write(board + "1-2:1.0/ep_86/wMaxPacketSize", "0200");
        write("/sys/kernel/debug/usb/xhci/0000:00:14.0/reg-runtime",
              "MFINDEX = 0x00001f3a\nIR0_IMAN = 0x00000002\nIR0_IMOD = 0x001200a0\nIR0_ERSTSZ = 0x00000001");
        write("/dev/bus/usb/001/007", "");
        std::filesystem::create_directories(file("/sys/bus/usb/devices"));
        for (const char* const name : {"usb1", "usb1/1-2"}) {
            std::filesystem::create_directory_symlink(
                std::filesystem::path("../../../devices/pci0000:00/0000:00:14.0") / name,
                file("/sys/bus/usb/devices") / std::filesystem::path(name).filename());
        }
    }

  public:
    void interrupt(int number, const std::string& handler, const std::string& cpus) const {
        const std::string folder = "/proc/irq/" + std::to_string(number) + "/";
        std::filesystem::create_directories(file(folder + handler));
        write(folder + "smp_affinity_list", "0-3");
        write(folder + "effective_affinity_list", cpus);
    }
    /// Adds a process with one thread. Policy: 0 SCHED_OTHER, 1 SCHED_FIFO, 2 SCHED_RR. Parent: 2 for a thread of the
    /// kernel.
    void thread(int id, const std::string& name, int priority, int policy, const std::string& cpus,
                int parent = 1) const {
        const std::string number = std::to_string(id);
        const std::string folder = "/proc/" + number + "/task/" + number + "/";
        std::string stat = number + " (" + name + ") S " + std::to_string(parent);
        for (int field = 5; field < 40; ++field) {
            stat += " " + std::to_string(field);
        }
        write(folder + "stat", stat + " " + std::to_string(priority) + " " + std::to_string(policy) + " 0 0");
        write(folder + "status", "Name:\t" + name + "\nCpus_allowed:\tf\nCpus_allowed_list:\t" + cpus);
    }
    /// Sets processor 3's count of system management interrupts, register 0x34.
    void interrupts_of_firmware(std::uint32_t count) const {
        std::string registers(0x34, '\xff');
        for (int byte = 0; byte < 4; ++byte) {
            registers += static_cast<char>(count >> (8 * byte) & 0xffU);
        }
        write("/dev/cpu/3/msr", registers + std::string(4, '\0'));
    }
    /// Writes /proc/self/limits with the kernel's column widths.
    void limits(const std::string& priority, const std::string& memory) const {
        write("/proc/self/limits",
              "Limit                     Soft Limit           Hard Limit           Units     \n"
              "Max locked memory         " +
                  memory +
                  "            unlimited            bytes     \n"
                  "Max realtime priority     " +
                  priority +
                  "                   99                   \n"
                  "Max realtime timeout      unlimited            unlimited            us        ");
    }

  private:
    std::filesystem::path root_;
    std::set<std::filesystem::path> forbidden_;
};

}  // namespace haptic::rt::test
