// haptic-tune on a machine made of files: what it changes, and that undo leaves the very same files.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

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
        write(cpu + "cpu19/online", "1");
        write("/proc/sys/kernel/sched_rt_runtime_us", "950000");
        write("/sys/kernel/mm/transparent_hugepage/enabled", "[always] madvise never");
        write("/proc/irq/default_smp_affinity", "ff,ffffffff");
        write("/proc/irq/2/smp_affinity_list", "0-39");  // without a handler
        interrupt(24, "0-39");
        interrupt(25, "39");
        interrupt(26, "0,3");
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
    void interrupt(int number, const std::string& cpus) const {
        const std::string irq = "/proc/irq/" + std::to_string(number);
        std::filesystem::create_directories(file(irq + "/eth0"));
        write(irq + "/smp_affinity_list", cpus);
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
                      HasSubstr("/proc/sys/kernel/sched_rt_runtime_us: 950000 -> -1"),
                      HasSubstr("isolcpus=managed_irq,domain,39 nohz_full=39 rcu_nocbs=39 irqaffinity=0-38")));
    EXPECT_EQ(contents(), before);
}

TEST_F(HapticTune, DoesWhatItPlanned) {
    EXPECT_EQ(tune({"apply"}).status, 0);
    EXPECT_EQ(read("/sys/devices/system/cpu/cpu39/cpufreq/scaling_governor"), "performance");
    EXPECT_EQ(read("/sys/devices/system/cpu/cpu19/online"), "0");
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
    const Finished plan = tune({"plan", "cmdline", "irqs"});
    EXPECT_EQ(plan.status, 0);
    EXPECT_THAT(plan.output,
                AllOf(HasSubstr("cmdline: this machine has no other processor"), Not(HasSubstr("isolcpus"))));
}

TEST_F(HapticTune, RefusesWhatItDoesNotKnow) {
    for (const std::vector<std::string>& wrong : {std::vector<std::string>{"frobnicate"},
                                                  {"plan", "turbo"},
                                                  {"plan", "--cpu", "last"},
                                                  {"plan", "--cpu", "40"}}) {
        const Finished finished = tune(wrong);
        EXPECT_EQ(finished.status, 1) << finished.output;
        EXPECT_THAT(finished.output, HasSubstr("haptic-tune: "));
    }
    EXPECT_EQ(contents(), before);
}

}  // namespace
}  // namespace haptic::test
