// haptic-tune on a machine made of files: what it changes, and that undo leaves the very same files.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "process.hpp"

namespace haptic::test {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

const char* const kSnippet = "/etc/default/grub.d/haptic.cfg";

/// Forty processors: 39 is the loop's, 19 its hyper-thread; nothing is set up yet.
class HapticTune : public testing::Test {
  protected:
    void SetUp() override {
        const std::string cpu = "/sys/devices/system/cpu/";
        write(cpu + "online", "0-39");
        write(cpu + "isolated", "");
        write(cpu + "cpu39/topology/thread_siblings_list", "19,39");
        write(cpu + "cpu39/cpufreq/scaling_governor", "schedutil");
        write(cpu + "cpu39/cpufreq/energy_performance_preference", "balance_performance");
        write(cpu + "cpu39/power/energy_perf_bias", "6");
        write(cpu + "cpu19/online", "1");
        write("/proc/sys/kernel/sched_rt_runtime_us", "950000");
        write("/proc/sys/kernel/nmi_watchdog", "1");
        write("/proc/sys/kernel/watchdog_cpumask", "0-39");
        write("/sys/devices/virtual/workqueue/cpumask", "ff,ffffffff");
        write("/sys/kernel/mm/transparent_hugepage/enabled", "[always] madvise never");
        write("/proc/irq/default_smp_affinity", "ff,ffffffff");
        write("/proc/irq/2/smp_affinity_list", "0-39");  // without a handler
        interrupt(24, "0-39");
        interrupt(25, "39");
        interrupt(26, "0,3");
        interrupt(127, "0-39", "xhci_hcd");
        thread(2, "kthreadd", "0 0", "0-39", 0);
        thread(640, "irq/127-xhci_hc", "50 1", "0-39");
        thread(641, "irq/24-eth0", "50 1", "0-39");
        thread(900, "irq/127-xhci_hc", "0 0", "0-39", 1);  // of a user who chose that name
        write("/sys/bus/usb/devices/1-2/idVendor", "0cec");
        write("/sys/bus/usb/devices/1-2/power/control", "auto");
        write("/sys/bus/usb/devices/1-3/idVendor", "046d");
        write("/sys/bus/usb/devices/1-3/power/control", "auto");
        std::filesystem::create_directories(file("/etc/default"));
        before = contents();
    }

    [[nodiscard]] std::filesystem::path file(const std::string& absolute) const {
        return folder / ("machine" + absolute);
    }
    void write(const std::string& absolute, const std::string& text) const {
        std::filesystem::create_directories(file(absolute).parent_path());
        std::ofstream(file(absolute)) << text << '\n';
    }
    void interrupt(int number, const std::string& cpus, const std::string& handler = "eth0") const {
        const std::string irq = "/proc/irq/" + std::to_string(number);
        std::filesystem::create_directories(file(irq + "/" + handler));
        write(irq + "/smp_affinity_list", cpus);
    }
    /// `scheduling` is real-time priority and policy (0 SCHED_OTHER, 1 SCHED_FIFO), `parent` is 2 for the kernel.
    void thread(int id, const std::string& name, const std::string& scheduling, const std::string& cpus,
                int parent = 2) const {
        const std::string process = "/proc/" + std::to_string(id) + "/";
        std::string stat = std::to_string(id) + " (" + name + ") S " + std::to_string(parent);
        for (int field = 5; field < 40; ++field) {
            stat += " " + std::to_string(field);
        }
        write(process + "stat", stat + " " + scheduling + " 0 0");
        write(process + "status", "Name:\t" + name + "\nCpus_allowed_list:\t" + cpus + "\nThreads:\t1");
    }
    /// Real-time priority and policy of a thread, fields 40 and 41 of its stat, and the processors where it may run.
    [[nodiscard]] std::string scheduling(int id) const {
        const std::string process = "/proc/" + std::to_string(id) + "/";
        std::istringstream fields(read(process + "stat"));
        std::string priority;
        for (int field = 1; field <= 40; ++field) {
            fields >> priority;
        }
        std::string policy;
        fields >> policy;
        std::ifstream status(file(process + "status"));
        std::string line;
        while (std::getline(status, line) && !line.starts_with("Cpus_allowed_list:\t")) {
        }
        return priority + " " + policy + " on " + line.substr(std::min(line.size(), line.find('\t') + 1));
    }
    [[nodiscard]] std::string read(const std::string& absolute) const {
        std::string line;
        std::ifstream stream(file(absolute));
        std::getline(stream, line);
        return line;
    }
    /// Every file and folder, with what is in it.
    [[nodiscard]] std::map<std::string, std::string> contents() const {
        std::map<std::string, std::string> all;
        for (const auto& entry : std::filesystem::recursive_directory_iterator(folder / "machine")) {
            std::ostringstream text;
            if (entry.is_regular_file()) {
                text << std::ifstream(entry.path()).rdbuf();
            }
            all[entry.path()] = text.str();
        }
        return all;
    }
    [[nodiscard]] Finished tune(const std::vector<std::string>& arguments) const {
        std::vector<std::string> command{HAPTIC_TUNE};
        command.insert(command.end(), arguments.begin(), arguments.end());
        command.insert(command.end(), {"--root", folder / "machine"});
        return run(command);
    }

    ScratchFolder folder;
    std::map<std::string, std::string> before;
};

TEST_F(HapticTune, PlansWhatItWouldDoAndChangesNothing) {
    const Finished plan = tune({"plan"});
    EXPECT_EQ(plan.status, 0) << plan.output;
    EXPECT_THAT(plan.output,
                AllOf(HasSubstr("cpu39/cpufreq/scaling_governor: schedutil -> performance"),
                      HasSubstr("/proc/irq/24/smp_affinity_list: 0-39 -> 0-38"),
                      HasSubstr("usbthreads: priority of irq/127-xhci_hc (640): fifo 50 -> fifo 80"),
                      HasSubstr("usbthreads: processors of irq/127-xhci_hc (640): 0-39 -> 0-38"),
                      HasSubstr("/proc/sys/kernel/sched_rt_runtime_us: 950000 -> -1"),
                      HasSubstr("isolcpus=managed_irq,domain,39 nohz_full=39 rcu_nocbs=39 irqaffinity=0-38")));
    EXPECT_EQ(contents(), before);
}

TEST_F(HapticTune, DoesWhatItPlanned) {
    EXPECT_EQ(tune({"apply"}).status, 0);
    EXPECT_EQ(read("/sys/devices/system/cpu/cpu39/cpufreq/scaling_governor"), "performance");
    EXPECT_EQ(read("/sys/devices/system/cpu/cpu39/cpufreq/energy_performance_preference"), "performance");
    EXPECT_EQ(read("/sys/devices/system/cpu/cpu39/power/energy_perf_bias"), "0");
    EXPECT_EQ(read("/sys/devices/system/cpu/cpu19/online"), "0");
    EXPECT_EQ(read("/sys/devices/virtual/workqueue/cpumask"), "7f,ffffffff");
    EXPECT_EQ(read("/proc/sys/kernel/nmi_watchdog"), "0");
    EXPECT_EQ(scheduling(640), "80 1 on 0-38");
    EXPECT_EQ(scheduling(641), "50 1 on 0-39") << "of another device";
    EXPECT_EQ(scheduling(900), "0 0 on 0-39") << "of a user";
    EXPECT_EQ(read("/proc/sys/kernel/sched_rt_runtime_us"), "-1");
    EXPECT_EQ(read("/sys/kernel/mm/transparent_hugepage/enabled"), "madvise");
    EXPECT_EQ(read("/proc/irq/default_smp_affinity"), "7f,ffffffff");
    EXPECT_EQ(read("/proc/irq/2/smp_affinity_list"), "0-39");
    EXPECT_EQ(read("/proc/irq/24/smp_affinity_list"), "0-38");
    EXPECT_EQ(read("/proc/irq/25/smp_affinity_list"), "0-38");
    EXPECT_EQ(read("/proc/irq/26/smp_affinity_list"), "0,3");
    EXPECT_EQ(read("/sys/bus/usb/devices/1-2/power/control"), "on");
    EXPECT_EQ(read("/sys/bus/usb/devices/1-3/power/control"), "auto");
}

TEST_F(HapticTune, WritesASnippetThatAddsToGrubsCommandLine) {
    EXPECT_EQ(tune({"apply", "cmdline", "--cpu", "3"}).status, 0);
    const Finished line = run({"/bin/bash", "-c",
                               "GRUB_CMDLINE_LINUX_DEFAULT=quiet; . '" + file(kSnippet).string() +
                                   "'; printf %s \"$GRUB_CMDLINE_LINUX_DEFAULT\""});
    EXPECT_EQ(line.output, "quiet isolcpus=managed_irq,domain,3 nohz_full=3 rcu_nocbs=3 irqaffinity=0-2,4-39");
    EXPECT_EQ(read("/proc/sys/kernel/sched_rt_runtime_us"), "950000") << "of a step that was not asked for";
}

TEST_F(HapticTune, UndoesExactlyWhatItDidThoughItWasAppliedTwice) {
    EXPECT_EQ(tune({"apply"}).status, 0);
    const auto applied = contents();
    EXPECT_EQ(tune({"apply"}).status, 0);
    EXPECT_EQ(contents(), applied);
    EXPECT_EQ(tune({"apply", "irqs", "--cpu", "3"}).status, 0);
    EXPECT_EQ(tune({"undo"}).status, 0);
    before[file("/sys/kernel/mm/transparent_hugepage/enabled")] = "always\n";  // as one writes it
    std::filesystem::remove_all(file("/run"));                                 // the folder itself stays
    EXPECT_EQ(contents(), before);
}

TEST_F(HapticTune, GivesThreadsOfUsbThePriorityOfTheLoopAndTakesNoneAway) {
    EXPECT_EQ(tune({"apply", "usbthreads", "--priority", "45"}).status, 0);
    EXPECT_EQ(scheduling(640), "50 1 on 0-38");
    EXPECT_EQ(tune({"apply", "usbthreads", "--priority", "90"}).status, 0);
    EXPECT_EQ(scheduling(640), "90 1 on 0-38");
    EXPECT_EQ(tune({"undo", "usbthreads"}).status, 0);
    EXPECT_EQ(scheduling(640), "50 1 on 0-39");
    // Of a thread that an administrator made an ordinary one.
    thread(640, "irq/127-xhci_hc", "0 0", "39");
    EXPECT_EQ(tune({"apply", "usbthreads"}).status, 0);
    EXPECT_EQ(scheduling(640), "80 1 on 0-38");
    EXPECT_EQ(tune({"undo", "usbthreads"}).status, 0);
    EXPECT_EQ(scheduling(640), "0 0 on 39");
}

TEST_F(HapticTune, LeavesAThreadThatHasTheNumberOfAFormerOne) {
    EXPECT_EQ(tune({"apply", "usbthreads"}).status, 0);
    thread(640, "kworker/1:2", "0 0", "0-39");
    const Finished undo = tune({"undo", "usbthreads"});
    EXPECT_EQ(undo.status, 0);
    EXPECT_THAT(undo.output, HasSubstr("usbthreads: priority of irq/127-xhci_hc (640) no longer exists"));
    EXPECT_EQ(scheduling(640), "0 0 on 0-39");
}

TEST_F(HapticTune, SaysWhereTheKernelHasNoThreadsOfUsb) {
    std::filesystem::remove_all(file("/proc/640"));
    EXPECT_THAT(tune({"plan", "usbthreads"}).output, HasSubstr("usbthreads: this kernel handles interrupts of USB"));
    std::filesystem::remove_all(file("/proc/2"));
    EXPECT_THAT(tune({"plan", "usbthreads"}).output, HasSubstr("usbthreads: /proc hides them"));
}

TEST_F(HapticTune, LeavesAWatchdogThatDoesNotWatchTheLoopsProcessor) {
    write("/proc/sys/kernel/watchdog_cpumask", "0-38");
    EXPECT_EQ(tune({"apply", "watchdog"}).status, 0);
    EXPECT_EQ(read("/proc/sys/kernel/nmi_watchdog"), "1");
}

TEST_F(HapticTune, SetsTheEnergyPreferenceWhileTheGovernorAllowsIt) {
    // With intel_pstate, governor "performance" allows one preference only.
    const auto governor_first = [](const std::string& output) {
        return output.find("scaling_governor") < output.find("energy_performance_preference");
    };
    const Finished apply = tune({"apply", "governor", "energy"});
    EXPECT_FALSE(governor_first(apply.output)) << apply.output;
    const Finished undo = tune({"undo", "governor", "energy"});
    EXPECT_TRUE(governor_first(undo.output)) << undo.output;
}

TEST_F(HapticTune, RepeatsEveryStepAtBootButTheCommandLine) {
    // The error lists them.
    const std::string error = tune({"plan", "turbo"}).output;
    const std::string list = "the steps are: cmdline ";
    ASSERT_THAT(error, HasSubstr(list));
    const std::string steps = error.substr(error.find(list) + list.size());
    std::ifstream unit(std::filesystem::path(HAPTIC_TUNE).parent_path() / "systemd/haptic-tune.service");
    std::ostringstream text;
    text << unit.rdbuf();
    EXPECT_THAT(text.str(), AllOf(HasSubstr("ExecStart=haptic-tune apply " + steps),
                                  HasSubstr("ExecStop=haptic-tune undo " + steps)));
}

TEST_F(HapticTune, UndoesOnlyTheStepsThatItIsAskedFor) {
    EXPECT_EQ(tune({"apply"}).status, 0);
    EXPECT_EQ(tune({"undo", "throttling"}).status, 0);
    EXPECT_EQ(read("/proc/sys/kernel/sched_rt_runtime_us"), "950000");
    EXPECT_EQ(read("/proc/irq/24/smp_affinity_list"), "0-38");
    EXPECT_TRUE(std::filesystem::exists(file(kSnippet)));
}

TEST_F(HapticTune, PassesOverWhatIsGoneSinceItWasChanged) {
    EXPECT_EQ(tune({"apply"}).status, 0);
    std::filesystem::remove_all(file("/sys/bus/usb/devices/1-2"));
    const Finished undo = tune({"undo"});
    EXPECT_EQ(undo.status, 0);
    EXPECT_THAT(undo.output, HasSubstr("usb: /sys/bus/usb/devices/1-2/power/control no longer exists"));
    EXPECT_EQ(read("/proc/sys/kernel/sched_rt_runtime_us"), "950000");
}

TEST_F(HapticTune, LeavesASnippetOfSomebodyElse) {
    write(kSnippet, "GRUB_CMDLINE_LINUX_DEFAULT=mine");
    for (const char* const command : {"apply", "undo"}) {
        const Finished finished = tune({command, "cmdline"});
        EXPECT_EQ(finished.status, 1);
        EXPECT_THAT(finished.output, HasSubstr("was not written by haptic-tune"));
    }
    EXPECT_EQ(read(kSnippet), "GRUB_CMDLINE_LINUX_DEFAULT=mine");
}

TEST_F(HapticTune, SaysWhatTheKernelRefusesAndForgetsIt) {
    std::filesystem::remove(file("/proc/sys/kernel/sched_rt_runtime_us"));
    std::filesystem::create_directories(file("/proc/sys/kernel/sched_rt_runtime_us"));  // nothing can be written to it
    const Finished apply = tune({"apply", "throttling"});
    EXPECT_EQ(apply.status, 1);
    EXPECT_THAT(apply.output, HasSubstr("the kernel refused it"));
    EXPECT_FALSE(std::filesystem::exists(file("/run/haptic-tune")));
}

TEST_F(HapticTune, TakesTheLastIsolatedProcessorByItself) {
    write("/sys/devices/system/cpu/isolated", "2,5");
    EXPECT_THAT(tune({"plan", "cmdline"}).output, HasSubstr("nohz_full=5 "));
    EXPECT_THAT(tune({"plan", "irqs"}).output, HasSubstr("0-39 -> 0-4,6-39"));
}

TEST_F(HapticTune, NeedsASecondProcessorToKeepOneFree) {
    write("/sys/devices/system/cpu/online", "0");
    const Finished plan = tune({"plan", "cmdline", "irqs", "workqueues"});
    EXPECT_EQ(plan.status, 0);
    EXPECT_THAT(plan.output,
                AllOf(HasSubstr("cmdline: this machine has no other processor"), Not(HasSubstr("isolcpus")),
                      HasSubstr("workqueues: this machine has no other processor")));
}

TEST_F(HapticTune, RefusesWhatItDoesNotKnow) {
    for (const std::vector<std::string>& wrong : {std::vector<std::string>{"frobnicate"},
                                                  {"plan", "turbo"},
                                                  {"plan", "--cpu", "last"},
                                                  {"plan", "--cpu", "40"},
                                                  {"plan", "--priority", "98"},
                                                  {"plan", "--priority", "0"}}) {
        const Finished finished = tune(wrong);
        EXPECT_EQ(finished.status, 1) << finished.output;
        EXPECT_THAT(finished.output, HasSubstr("haptic-tune: "));
    }
    EXPECT_EQ(contents(), before);
}

}  // namespace
}  // namespace haptic::test
