#include "doctor/doctor.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>

#include "machine_tree.hpp"

namespace haptic::rt {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr device::UsbId kBoard{0x0cec, 0x0205};

class DoctorTest : public testing::Test {
  protected:
    [[nodiscard]] Diagnosis diagnosis() const { return examine(tree.machine(), settings); }

    /// Names of the findings with a verdict.
    [[nodiscard]] std::vector<std::string> that_are(Verdict verdict) const {
        std::vector<std::string> names;
        for (const Finding& one : diagnosis().findings) {
            if (one.verdict == verdict) {
                names.push_back(one.name);
            }
        }
        return names;
    }

    [[nodiscard]] Finding finding(const std::string& name) const {
        for (const Finding& one : diagnosis().findings) {
            if (one.name == name) {
                return one;
            }
        }
        ADD_FAILURE() << "no finding " << name;
        return {};
    }

    /// Expects that exactly this finding is bad, with this remedy.
    void expect_only(const std::string& name, const std::string& remedy) const {
        EXPECT_THAT(that_are(Verdict::Bad), ElementsAre(name));
        EXPECT_THAT(finding(name).remedy, HasSubstr(remedy));
        EXPECT_FALSE(diagnosis().good());
    }

    test::MachineTree tree;
    DoctorSettings settings{.usb = device::UsbSelection{.id = kBoard}};
};

TEST_F(DoctorTest, FindsNothingBadOnAWellConfiguredMachine) {
    EXPECT_THAT(that_are(Verdict::Bad), IsEmpty());
    EXPECT_THAT(that_are(Verdict::Unknown), IsEmpty());
    EXPECT_TRUE(diagnosis().good());
    EXPECT_EQ(diagnosis().cpu, 3);
}

TEST_F(DoctorTest, NamesAKernelWithoutPreemptRt) {
    tree.write("/proc/sys/kernel/version", "#1 SMP PREEMPT_DYNAMIC Debian 6.1.147-1 (2025-08-02)");
    expect_only("kernel", "sudo apt-get install linux-image-rt-");
}

TEST_F(DoctorTest, NamesAProcessorThatIsNotIsolated) {
    settings.cpu = 2;
    tree.write("/sys/devices/system/cpu/nohz_full", "2");
    tree.write("/proc/cmdline", "rcu_nocbs=0-3");
    tree.interrupt(25, "nvme0q0", "0");
    tree.write("/sys/devices/virtual/workqueue/cpumask", "b");
    tree.write("/proc/sys/kernel/nmi_watchdog", "0");
    std::filesystem::rename(tree.file("/sys/devices/system/cpu/cpu3"), tree.file("/sys/devices/system/cpu/cpu2"));
    tree.write("/sys/devices/system/cpu/cpu2/topology/thread_siblings_list", "2");
    tree.write("/proc/stat", "cpu2 1 0 1 900 0 0 0 0 0 0");
    expect_only("isolation", "haptic-tune apply cmdline --cpu 2 && sudo reboot");
}

TEST_F(DoctorTest, NeedsTwoProcessorsForIsolation) {
    settings.cpu = 0;
    tree.write("/sys/devices/system/cpu/online", "0");
    tree.write("/sys/devices/system/cpu/isolated", "");
    EXPECT_EQ(finding("isolation").verdict, Verdict::Bad);
    EXPECT_THAT(finding("isolation").remedy, HasSubstr("two processors"));
}

TEST_F(DoctorTest, NamesAProcessorThatIsOffline) {
    settings.cpu = 6;
    EXPECT_EQ(finding("processor").verdict, Verdict::Bad);
    EXPECT_THAT(finding("processor").remedy, HasSubstr("loop.cpu=-1"));
}

TEST_F(DoctorTest, NamesTheKernelsTick) {
    tree.write("/sys/devices/system/cpu/nohz_full", "  (null)");
    expect_only("timer_tick", "haptic-tune apply cmdline --cpu 3");
}

TEST_F(DoctorTest, NamesCallbacksOfRcu) {
    tree.write("/proc/cmdline", "quiet isolcpus=1,3 rcu_nocbs=1");
    expect_only("rcu_callbacks", "haptic-tune apply cmdline --cpu 3");
}

TEST_F(DoctorTest, HasNoVerdictOnCallbacksOfRcuWithoutTheCommandLine) {
    tree.remove("/proc/cmdline");
    EXPECT_THAT(that_are(Verdict::Unknown), ElementsAre("rcu_callbacks"));
}

TEST_F(DoctorTest, NamesPutOffWorkOnTheLoopsProcessor) {
    tree.write("/sys/devices/virtual/workqueue/cpumask", "f");
    expect_only("workqueues", "haptic-tune apply workqueues --cpu 3");
    EXPECT_THAT(finding("workqueues").found, HasSubstr("processor 0-3"));
    tree.remove("/sys/devices/virtual/workqueue");
    EXPECT_THAT(that_are(Verdict::Unknown), ElementsAre("workqueues"));
}

TEST_F(DoctorTest, NamesTheNmiWatchdogOfTheLoopsProcessor) {
    tree.write("/proc/sys/kernel/watchdog_cpumask", "0-3");
    expect_only("nmi_watchdog", "haptic-tune apply watchdog --cpu 3");
    tree.remove("/proc/sys/kernel/watchdog_cpumask");
    expect_only("nmi_watchdog", "haptic-tune apply watchdog --cpu 3");
    tree.write("/proc/sys/kernel/nmi_watchdog", "0");
    EXPECT_THAT(that_are(Verdict::Bad), IsEmpty());
    tree.remove("/proc/sys/kernel/nmi_watchdog");
    EXPECT_THAT(that_are(Verdict::Unknown), ElementsAre("nmi_watchdog"));
}

TEST_F(DoctorTest, NamesInterruptsOnTheLoopsProcessor) {
    tree.interrupt(30, "eth0", "0,3");
    expect_only("interrupts", "haptic-tune apply irqs --cpu 3");
    EXPECT_THAT(finding("interrupts").found, HasSubstr("30 eth0"));
}

TEST_F(DoctorTest, UsesTheRequestedAffinityIfTheEffectiveOneIsUnknown) {
    tree.interrupt(30, "eth0", "");
    expect_only("interrupts", "haptic-tune apply irqs --cpu 3");
}

TEST_F(DoctorTest, TreatsAReroutedInterruptAsGoneAtOnce) {
    tree.interrupt(30, "eth0", "3");
    tree.write("/proc/irq/30/smp_affinity_list", "0-2");
    EXPECT_THAT(that_are(Verdict::Bad), IsEmpty());
}

TEST_F(DoctorTest, NamesAnotherThreadThatMayTakeTheProcessor) {
    tree.thread(812, "jack (d) 1", 80, 2, "0-3");
    expect_only("rivals", "sudo taskset -cp 0-2 812");
    EXPECT_THAT(finding("rivals").found, HasSubstr("jack (d) 1 (812) has priority 80"));
    tree.thread(812, "jackd", 80, 2, "0-2");
    EXPECT_THAT(that_are(Verdict::Bad), IsEmpty());
    tree.thread(812, "jackd", 79, 1, "3");
    EXPECT_THAT(that_are(Verdict::Bad), IsEmpty());
}

TEST_F(DoctorTest, HasNoVerdictOnThreadsWhereTheyAreHidden) {
    // As ProtectProc=invisible does: of the threads only its own remain.
    for (const char* const hidden : {"/proc/2", "/proc/18", "/proc/640", "/proc/641"}) {
        tree.remove(hidden);
    }
    EXPECT_THAT(that_are(Verdict::Unknown), ElementsAre("rivals", "usb_thread"));
    EXPECT_THAT(finding("rivals").found, HasSubstr("cannot see other processes"));
    EXPECT_THAT(finding("rivals").remedy, HasSubstr("sudo rt-core doctor"));
    EXPECT_THAT(finding("usb_thread").found, HasSubstr("cannot see other processes"));
    // What is visible may still be bad.
    tree.thread(812, "rival", 90, 1, "3");
    EXPECT_EQ(finding("rivals").verdict, Verdict::Bad);
}

TEST_F(DoctorTest, HasNoVerdictOnThreadsInAProcessNamespace) {
    tree.remove("/proc/640");
    tree.thread(2, "sh", 0, 0, "0-3");
    EXPECT_THAT(that_are(Verdict::Unknown), ElementsAre("rivals", "usb_thread"));
}

TEST_F(DoctorTest, NamesABusyHyperThread) {
    tree.write("/sys/devices/system/cpu/isolated", "3");
    tree.write("/proc/self/status", "CapEff:\t0\nCpus_allowed_list:\t0-2");
    expect_only("siblings", "haptic-tune apply siblings --cpu 3");
    tree.write("/sys/devices/system/cpu/online", "0,2-3");
    EXPECT_THAT(that_are(Verdict::Bad), IsEmpty());
}

TEST_F(DoctorTest, NamesAGovernorThatSlowsDown) {
    tree.write("/sys/devices/system/cpu/cpu3/cpufreq/scaling_governor", "schedutil");
    expect_only("governor", "haptic-tune apply governor --cpu 3");
}

TEST_F(DoctorTest, ReportsNoVerdictWithoutFrequencyControl) {
    tree.remove("/sys/devices/system/cpu/cpu3/cpufreq");
    EXPECT_THAT(that_are(Verdict::Unknown), ElementsAre("governor"));
    EXPECT_TRUE(diagnosis().good());
}

TEST_F(DoctorTest, NamesHintsToSaveEnergy) {
    const std::string bias = "/sys/devices/system/cpu/cpu3/power/energy_perf_bias";
    const std::string preference = "/sys/devices/system/cpu/cpu3/cpufreq/energy_performance_preference";
    tree.write(bias, "6");
    expect_only("energy_bias", "haptic-tune apply energy --cpu 3");
    tree.write(bias, "0");
    tree.write(preference, "balance_performance");
    expect_only("energy_bias", "haptic-tune apply energy --cpu 3");
    tree.remove(preference);
    EXPECT_EQ(finding("energy_bias").verdict, Verdict::Good);
    tree.remove(bias);
    EXPECT_THAT(that_are(Verdict::Unknown), ElementsAre("energy_bias"));
}

TEST_F(DoctorTest, NamesInterruptsOfTheFirmwareThatGoOn) {
    std::uint32_t count = 0xffff'fffe;  // it wraps
    tree.interrupts_of_firmware(count);
    tree.meanwhile = [&] { tree.interrupts_of_firmware(count += 3); };
    EXPECT_THAT(finding("smi_count").found, HasSubstr("4294967294 since the machine was switched on, and 3 more"));
    expect_only("smi_count", "firmware");
    tree.meanwhile = {};
    tree.interrupts_of_firmware(15);
    EXPECT_EQ(finding("smi_count").verdict, Verdict::Good);
    EXPECT_THAT(finding("smi_count").found, HasSubstr("15 since the machine was switched on, and 0 more"));
}

TEST_F(DoctorTest, HasNoVerdictOnInterruptsOfTheFirmwareWhereNothingCountsThem) {
    tree.remove("/dev/cpu/3/msr");
    EXPECT_THAT(that_are(Verdict::Unknown), ElementsAre("smi_count"));
    EXPECT_THAT(finding("smi_count").remedy, HasSubstr("modprobe msr"));
    tree.interrupts_of_firmware(12);
    tree.meanwhile = [this] { tree.remove("/dev/cpu/3/msr"); };
    EXPECT_EQ(finding("smi_count").verdict, Verdict::Unknown);
    tree.meanwhile = {};
    tree.interrupts_of_firmware(12);
    tree.write("/proc/cpuinfo", "vendor_id\t: GenuineIntel\nflags\t\t: fpu hypervisor tsc");
    EXPECT_THAT(that_are(Verdict::Unknown), ElementsAre("smi_count"));
    tree.write("/proc/cpuinfo", "vendor_id\t: AuthenticAMD\nflags\t\t: fpu tsc");
    EXPECT_THAT(that_are(Verdict::Unknown), ElementsAre("smi_count"));
}

TEST_F(DoctorTest, NamesDeepIdleStatesThatItCannotBlock) {
    tree.forbid("/dev/cpu_dma_latency");
    expect_only("idle_states", "chgrp haptic /dev/cpu_dma_latency");
    EXPECT_THAT(finding("idle_states").found, HasSubstr("C6 takes 133 us"));
    tree.write("/sys/devices/system/cpu/cpu3/cpuidle/state2/disable", "1");
    EXPECT_THAT(finding("idle_states").found, HasSubstr("C1 takes 2 us"));
    settings.idle_exit_us = 2;
    EXPECT_THAT(that_are(Verdict::Bad), IsEmpty());
}

TEST_F(DoctorTest, NamesASettingThatAllowsDeepIdleStates) {
    settings.idle_exit_us = -1;
    expect_only("idle_states", "loop.idle_exit_us=0");
}

TEST_F(DoctorTest, NamesASlowClock) {
    tree.write("/sys/devices/system/clocksource/clocksource0/current_clocksource", "hpet");
    expect_only("clock_source", "echo tsc | sudo tee /sys/devices/system/clocksource/clocksource0/current_clocksource");
    tree.write("/sys/devices/system/clocksource/clocksource0/available_clocksource", "hpet acpi_pm ");
    expect_only("clock_source", "none from here");
}

TEST_F(DoctorTest, NamesThrottling) {
    tree.write("/proc/sys/kernel/sched_rt_runtime_us", "950000");
    expect_only("throttling", "haptic-tune apply throttling");
    tree.write("/proc/sys/kernel/sched_rt_runtime_us", "1000000");
    EXPECT_THAT(that_are(Verdict::Bad), IsEmpty());
}

TEST_F(DoctorTest, NamesALimitOfTheControlGroup) {
    tree.write("/proc/sys/kernel/sched_rt_runtime_us", "1000000");  // as long as the period: no throttling
    tree.write("/proc/self/cgroup", "9:name=systemd:/\n4:cpu,cpuacct:/system.slice/loop\n0::/system.slice/loop");
    const std::string folder = "/sys/fs/cgroup/cpu,cpuacct/system.slice/loop/";
    tree.write(folder + "cpu.rt_period_us", "1000000");
    tree.write(folder + "cpu.rt_runtime_us", "0");
    expect_only("rt_group", "haptic-tune apply throttling --cpu 3");
    tree.write(folder + "cpu.rt_runtime_us", "950000");
    expect_only("rt_group", "haptic-tune apply throttling --cpu 3");
    tree.write(folder + "cpu.rt_runtime_us", "1000000");
    EXPECT_EQ(finding("rt_group").verdict, Verdict::Good);
    // Without throttling it does not apply.
    tree.write(folder + "cpu.rt_runtime_us", "0");
    tree.write("/proc/sys/kernel/sched_rt_runtime_us", "-1");
    EXPECT_EQ(finding("rt_group").verdict, Verdict::Good);
}

TEST_F(DoctorTest, AsksTheKernelsConfigurationForLimitsOfControlGroups) {
    tree.write("/proc/sys/kernel/sched_rt_runtime_us", "1000000");
    tree.write("/proc/self/cgroup", "0::/system.slice/loop");
    EXPECT_EQ(finding("rt_group").verdict, Verdict::Good);
    const std::string config = "/boot/config-6.1.0-38-rt-amd64";
    tree.remove(config);
    EXPECT_THAT(that_are(Verdict::Unknown), ElementsAre("rt_group"));
    tree.write(config, "CONFIG_SMP=y\nCONFIG_RT_GROUP_SCHED=y");
    EXPECT_EQ(finding("rt_group").verdict, Verdict::Good);
    tree.write("/sys/fs/cgroup/system.slice/cpu.weight", "100");
    expect_only("rt_group", "haptic-tune apply throttling --cpu 3");
}

TEST_F(DoctorTest, NamesAutomaticHugePages) {
    tree.write("/sys/kernel/mm/transparent_hugepage/enabled", "[always] madvise never");
    expect_only("huge_pages", "haptic-tune apply hugepages");
}

TEST_F(DoctorTest, NamesTimeStolenByAHypervisor) {
    tree.write("/proc/stat", "cpu  1 0 1 900 0 0 0 0 0 0\ncpu3 1 0 1 900 0 0 0 25 0 0");
    expect_only("stolen_time", "none from here");
    EXPECT_THAT(finding("stolen_time").found, HasSubstr("250 ms"));
}

TEST_F(DoctorTest, NamesALimitOfPriorityBelowTheWatchdogs) {
    tree.limits("80", "unlimited");
    expect_only("priority", "sudo usermod -aG haptic");
    settings.priority = 79;
    EXPECT_THAT(that_are(Verdict::Bad), IsEmpty());
}

TEST_F(DoctorTest, NamesALimitOfLockedMemoryHoweverLarge) {
    tree.limits("98", "999999999");
    expect_only("memory_lock", "sudo usermod -aG haptic");
}

TEST_F(DoctorTest, OffersCapabilitiesWhereNoLimitsAreInstalled) {
    tree.limits("0", "8388608");
    tree.remove("/etc/security/limits.d/haptic.conf");
    EXPECT_THAT(that_are(Verdict::Bad), ElementsAre("priority", "memory_lock"));
    EXPECT_THAT(finding("priority").remedy, HasSubstr("setcap cap_sys_nice,cap_ipc_lock+ep"));
}

TEST_F(DoctorTest, AcceptsCapabilitiesInPlaceOfLimits) {
    tree.limits("0", "8388608");
    // Bits 14 (CAP_IPC_LOCK) and 23 (CAP_SYS_NICE).
    tree.write("/proc/self/status", "CapEff:\t0000000000804000\nCpus_allowed_list:\t0,2");
    EXPECT_THAT(that_are(Verdict::Bad), IsEmpty());
    tree.write("/proc/self/status", "CapEff:\t0000000000004000\nCpus_allowed_list:\t0,2");
    expect_only("priority", "usermod");
}

TEST_F(DoctorTest, NamesABoardThatThisUserMayNotOpen) {
    tree.forbid("/dev/bus/usb/001/007");
    expect_only("usb_access", "70-spidar-g6.rules /etc/udev/rules.d/");
    tree.write("/usr/lib/udev/rules.d/70-spidar-g6.rules", "");
    expect_only("usb_access", "usermod -aG haptic");
}

TEST_F(DoctorTest, NamesABoardThatMayBeSuspended) {
    tree.write("/sys/bus/usb/devices/1-2/power/control", "auto");
    expect_only("usb_autosuspend", "echo on | sudo tee /sys/bus/usb/devices/1-2/power/control");
}

TEST_F(DoctorTest, NamesAConnectionAtFullSpeed) {
    const std::string device = "/sys/bus/usb/devices/1-2/";
    tree.write(device + "speed", "12");
    EXPECT_THAT(that_are(Verdict::Bad), ElementsAre("usb_link", "period_budget"));
    EXPECT_THAT(finding("usb_link").remedy, HasSubstr("none from here: plug it into a port of the machine itself"));
    tree.write(device + "speed", "480");
    tree.write(device + "1-2:1.0/ep_86/wMaxPacketSize", "0040");
    expect_only("usb_link", "none from here");
    EXPECT_THAT(finding("usb_link").found, HasSubstr("480 Mbit/s, with bulk packets of 64 bytes"));
    tree.remove(device + "1-2:1.0/ep_86");
    EXPECT_THAT(that_are(Verdict::Unknown), ElementsAre("usb_link"));
}

TEST_F(DoctorTest, NamesAPeriodThatCannotHoldItsExchanges) {
    EXPECT_THAT(finding("period_budget").found, HasSubstr("exchanges 250.0 us"));
    // Two exchanges of whole microframes do not fit 4 kHz, one does.
    settings.period_ns = 250'000;
    EXPECT_EQ(finding("period_budget").verdict, Verdict::Bad);
    EXPECT_THAT(finding("period_budget").remedy, HasSubstr("device.exchanges = \"one\""));
    EXPECT_THAT(finding("period_budget").why, HasSubstr("may not hold its"));
    settings.exchanges = 1;
    EXPECT_EQ(finding("period_budget").verdict, Verdict::Good);
    // A full-speed link holds two neither at 4 kHz nor at 1 kHz.
    settings.exchanges = 2;
    settings.period_ns = 1'000'000;
    tree.write("/sys/bus/usb/devices/1-2/speed", "12");
    EXPECT_THAT(finding("period_budget").why, HasSubstr("cannot hold its two exchanges with USB at 12 Mbit/s"));
    EXPECT_THAT(finding("period_budget").remedy, HasSubstr("480 Mbit/s"));
    // Over a network, that of usbip is added.
    tree.write("/sys/bus/usb/devices/1-2/speed", "480");
    tree.write("/sys/bus/usb/devices/usb1/product", "USB/IP Virtual Host Controller");
    EXPECT_THAT(finding("period_budget").found, HasSubstr("over a network: exchanges 650.0 us"));
}

TEST_F(DoctorTest, JudgesThePeriodOfASerialLineByItsSpeed) {
    settings.usb.reset();
    settings.packets = {{74, 0}, 34};
    EXPECT_EQ(finding("period_budget").verdict, Verdict::Good);
    settings.baud = 1'000'000;
    EXPECT_EQ(finding("period_budget").verdict, Verdict::Bad);
    EXPECT_THAT(finding("period_budget").why, HasSubstr("a serial line of 1000000 bit/s"));
}

TEST_F(DoctorTest, ReadsThePacketsOfWhateverConfigurationIsActive) {
    const std::string device = "/sys/bus/usb/devices/1-2/";
    std::filesystem::rename(tree.file(device + "1-2:1.0"), tree.file(device + "1-2:2.0"));
    tree.write(device + "1-2:2.1/ep_02/wMaxPacketSize", "0040");  // of another interface
    EXPECT_EQ(finding("usb_link").verdict, Verdict::Good);
}

TEST_F(DoctorTest, NamesAnInterruptThreadBehindTheLoop) {
    tree.thread(640, "irq/24-xhci_hcd", 50, 1, "0", 2);
    expect_only("usb_thread", "sudo haptic-tune apply usbthreads --cpu 3 --priority 80");
    EXPECT_THAT(finding("usb_thread").found, HasSubstr("irq/24-xhci_hcd (640) has priority 50, the loop 80"));
    tree.thread(640, "irq/24-xhci_hcd", 0, 0, "0", 2);
    expect_only("usb_thread", "--priority 80");
    settings.priority = 49;
    tree.thread(640, "irq/24-xhci_hcd", 50, 1, "0", 2);
    EXPECT_EQ(finding("usb_thread").verdict, Verdict::Good);
}

TEST_F(DoctorTest, NamesAnInterruptThreadOnTheLoopsProcessor) {
    tree.thread(640, "irq/24-xhci_hcd", 80, 1, "0-3", 2);
    EXPECT_THAT(that_are(Verdict::Bad), ElementsAre("rivals", "usb_thread"));
    EXPECT_THAT(finding("usb_thread").found, HasSubstr("may run on processor 0-3"));
}

TEST_F(DoctorTest, NamesEachThreadOfASharedInterrupt) {
    tree.thread(642, "irq/24-s-other", 50, 1, "0", 2);
    expect_only("usb_thread", "usbthreads");
    EXPECT_THAT(finding("usb_thread").found, HasSubstr("irq/24-s-other (642)"));
}

TEST_F(DoctorTest, MissesAnInterruptThreadOnlyWhereTheKernelHasThem) {
    // A name that a user may have chosen is no thread of the kernel.
    tree.thread(640, "irq/24-xhci_hcd", 80, 1, "0", 1);
    EXPECT_THAT(that_are(Verdict::Unknown), ElementsAre("usb_thread"));
    tree.write("/proc/sys/kernel/version", "#1 SMP PREEMPT_DYNAMIC Debian 6.1.147-1 (2025-08-02)");
    EXPECT_EQ(finding("usb_thread").verdict, Verdict::Good);
    tree.write("/proc/cmdline", "threadirqs rcu_nocbs=3");
    EXPECT_EQ(finding("usb_thread").verdict, Verdict::Unknown);
}

TEST_F(DoctorTest, NamesAModerationThatTakesMuchOfThePeriod) {
    EXPECT_THAT(finding("usb_moderation").found, HasSubstr("0000:00:14.0 holds interrupts back for 40000 ns"));
    settings.period_ns = 399'999;
    expect_only("usb_moderation", "longer loop.period_s");
    settings.period_ns = 400'000;
    EXPECT_EQ(finding("usb_moderation").verdict, Verdict::Good);
    tree.remove("/sys/kernel/debug");
    EXPECT_THAT(that_are(Verdict::Unknown), ElementsAre("usb_moderation"));
    EXPECT_THAT(finding("usb_moderation").remedy, HasSubstr("sudo rt-core doctor"));
}

TEST_F(DoctorTest, NamesTheControllerOnTheLoopsProcessor) {
    tree.interrupt(24, "xhci_hcd", "3");
    EXPECT_THAT(that_are(Verdict::Bad), ElementsAre("interrupts", "usb_interrupt"));
    EXPECT_EQ(finding("usb_interrupt").remedy, "echo 0-2 | sudo tee /proc/irq/24/smp_affinity_list");
    EXPECT_THAT(finding("usb_interrupt").found, HasSubstr("interrupt 24 (xhci_hcd) of 1-2"));
}

TEST_F(DoctorTest, FindsTheLineOfAControllerWithoutMessageSignalledInterrupts) {
    tree.remove("/sys/devices/pci0000:00/0000:00:14.0/msi_irqs");
    tree.interrupt(18, "ehci_hcd:usb1", "0");
    EXPECT_THAT(finding("usb_interrupt").found, HasSubstr("interrupt 18 (ehci_hcd:usb1) of 1-2"));
}

TEST_F(DoctorTest, FindsASystemOnChipControllerByItsHandlerName) {
    tree.remove("/sys/devices/pci0000:00/0000:00:14.0/msi_irqs");
    tree.remove("/sys/devices/pci0000:00/0000:00:14.0/irq");
    tree.remove("/proc/irq/24");
    tree.interrupt(24, "xhci-hcd:usb1", "3");
    EXPECT_EQ(finding("usb_interrupt").verdict, Verdict::Bad);
    EXPECT_THAT(finding("usb_interrupt").found, HasSubstr("interrupt 24 (xhci-hcd:usb1)"));
}

TEST_F(DoctorTest, ChecksTheBoardOfTheSettings) {
    tree.write("/sys/bus/usb/devices/1-2/power/control", "auto");
    settings.usb->path = "1-3";
    EXPECT_EQ(finding("usb_access").verdict, Verdict::Unknown);
    settings.usb->path = "/dev/bus/usb/001/007";
    EXPECT_EQ(finding("usb_autosuspend").verdict, Verdict::Bad);
    settings.usb = device::UsbSelection{.id = {0x0cec, 0x0203}};
    EXPECT_THAT(finding("usb_access").found, HasSubstr("no 0cec:0203 is plugged in"));
}

TEST_F(DoctorTest, ExpectsTheUdevRuleWhereNoBoardIsPluggedIn) {
    tree.remove("/sys/bus/usb/devices/1-2");
    expect_only("usb_autosuspend", "70-spidar-g6.rules");
    EXPECT_EQ(finding("usb_interrupt").verdict, Verdict::Good);  // of all controllers
    tree.write("/etc/udev/rules.d/70-spidar-g6.rules", "");
    EXPECT_THAT(that_are(Verdict::Bad), IsEmpty());
}

TEST_F(DoctorTest, ReportsNoVerdictOnUsbForABoardOnASerialLine) {
    settings.usb.reset();
    settings.packets = {{74, 0}, 34};
    EXPECT_THAT(that_are(Verdict::Unknown),
                ElementsAre("usb_access", "usb_autosuspend", "usb_link", "usb_thread", "usb_moderation"));
    EXPECT_TRUE(diagnosis().good());
}

TEST_F(DoctorTest, ReportsUnreadableFilesAsUnknown) {
    tree.remove("/proc");
    tree.remove("/sys");
    for (const Finding& one : diagnosis().findings) {
        EXPECT_FALSE(one.found.empty()) << one.name;
        EXPECT_FALSE(one.why.empty()) << one.name;
    }
    EXPECT_EQ(finding("kernel").verdict, Verdict::Unknown);
    EXPECT_EQ(finding("interrupts").verdict, Verdict::Unknown);
    EXPECT_EQ(finding("priority").verdict, Verdict::Unknown);
    EXPECT_EQ(finding("stolen_time").verdict, Verdict::Unknown);
    EXPECT_EQ(finding("rivals").verdict, Verdict::Unknown);
    EXPECT_EQ(finding("usb_thread").verdict, Verdict::Unknown);
}

TEST_F(DoctorTest, GivesReasonAndRemedyForEveryBadFinding) {
    for (const Finding& one : examine(Machine("/", {}, [] {}), settings).findings) {
        EXPECT_FALSE(one.found.empty()) << one.name;
        EXPECT_FALSE(one.why.empty()) << one.name;
        EXPECT_TRUE(one.verdict != Verdict::Bad || !one.remedy.empty()) << one.name;
    }
}

TEST_F(DoctorTest, ChangesNothing) {
    const auto contents = [this] {
        std::map<std::string, std::string> all;
        for (const auto& entry : std::filesystem::recursive_directory_iterator(tree.root())) {
            std::ostringstream text;
            if (entry.is_regular_file()) {
                text << std::ifstream(entry.path()).rdbuf() << entry.last_write_time().time_since_epoch().count();
            }
            all[entry.path()] = text.str();
        }
        return all;
    };
    tree.interrupt(30, "eth0", "3");
    const auto before = contents();
    EXPECT_FALSE(diagnosis().good());
    EXPECT_EQ(contents(), before);
}

TEST_F(DoctorTest, WritesALineForEachFindingAndTheCommandForTheBadOnes) {
    tree.write("/proc/sys/kernel/sched_rt_runtime_us", "950000");
    const std::string text = text_of(diagnosis());
    EXPECT_THAT(text, HasSubstr("good     kernel           6.1.0-38-rt-amd64, PREEMPT_RT\n"));
    EXPECT_THAT(text, HasSubstr("bad      throttling       real-time threads may run for 950000 us of 1000000\n"));
    EXPECT_THAT(text, HasSubstr("fix:  sudo haptic-tune apply throttling --cpu 3\n"));
    EXPECT_THAT(text, HasSubstr("27 good, 1 bad, 0 unknown\n"));
}

TEST_F(DoctorTest, WritesEachFindingAsJson) {
    tree.write("/proc/sys/kernel/sched_rt_runtime_us", "950000");
    const nlohmann::json json = json_of(diagnosis());
    EXPECT_EQ(json.at("processor"), 3);
    EXPECT_EQ(json.at("good"), false);
    EXPECT_EQ(json.at("checks").size(), diagnosis().findings.size());
    const auto throttling = std::find_if(json.at("checks").begin(), json.at("checks").end(),
                                         [](const nlohmann::json& one) { return one.at("name") == "throttling"; });
    ASSERT_NE(throttling, json.at("checks").end());
    EXPECT_EQ(throttling->at("verdict"), "bad");
    EXPECT_EQ(throttling->at("remedy"), "sudo haptic-tune apply throttling --cpu 3");
    EXPECT_FALSE(throttling->at("why").get<std::string>().empty());
}

}  // namespace
}  // namespace haptic::rt
