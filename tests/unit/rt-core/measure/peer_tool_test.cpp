#include "measure/peer_tool.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

namespace haptic::rt {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::StartsWith;

// Printed by cyclictest 2.40 with --histogram=30000 --loops=12 --json: four cycles were later than its histogram.
constexpr const char* kCyclictest = R"({
  "file_version": 1,
  "rt_test_version:": "2.40",
  "return_code": 0,
  "num_threads": 1,
  "resolution_in_ns": 1,
  "thread": {
    "0": {
      "histogram": {
        "19753": 1,
        "20648": 1,
        "21634": 1,
        "21739": 1,
        "22277": 1,
        "23333": 1,
        "24248": 1,
        "28999": 1
      },
      "cycles": 12,
      "min": 19753,
      "max": 165242,
      "avg": 37837.00,
      "cpu": 1,
      "node": 0
    }
  }
})";

// Printed by rtla 6.1 on Debian's kernel 6.1.0-rt, which ran in QEMU: timerlat hist --duration 2 --period 1000 --nano
// --bucket-size 100, with --entries 100000 and with --entries 45.
constexpr const char* kTimerlat =
    "# RTLA timerlat histogram\n"
    "# Time unit is nanoseconds (ns)\n"
    "# Duration:   0 00:00:02\n"
    "Index   IRQ-000   Thr-000\n"
    "500           1         0 \n"
    "600           3         0 \n"
    "700        1996         0 \n"
    "4000          0         1 \n"
    "4200          0      1370 \n"
    "4300          0       160 \n"
    "4500          0        13 \n"
    "4600          0         1 \n"
    "4800          0         4 \n"
    "4900          0       104 \n"
    "5000          0        64 \n"
    "5200          0       279 \n"
    "5400          0         2 \n"
    "5500          0         2 \n"
    "over:         0         0 \n"
    "count:     2000      2000 \n"
    "min:        584      4075 \n"
    "avg:        727      4492 \n"
    "max:        788      5561 \n";
constexpr const char* kTimerlatOver =
    "# RTLA timerlat histogram\n"
    "# Time unit is nanoseconds (ns)\n"
    "# Duration:   0 00:00:02\n"
    "Index   IRQ-000   Thr-000\n"
    "500           1         0 \n"
    "600           2         0 \n"
    "700        1997         0 \n"
    "4000          0         1 \n"
    "4200          0      1351 \n"
    "4300          0       186 \n"
    "over:         0       462 \n"
    "count:     2000      2000 \n"
    "min:        598      4027 \n"
    "avg:        728      4484 \n"
    "max:        788      5552 \n";
// As newer versions print it, by their source: a column for the return to user space, and a sum over processors.
constexpr const char* kTimerlatUser =
    "# RTLA timerlat histogram\n"
    "# Time unit is nanoseconds (ns)\n"
    "# Duration:   0 00:00:01\n"
    "Index   IRQ-000   Thr-000   Usr-000   IRQ-001   Thr-001   Usr-001\n"
    "600           2         0         0         0         0         0 \n"
    "4200          0         2         0         0         0         0 \n"
    "6100          0         0         2         0         0         0 \n"
    "over:         0         0         0         0         0         0 \n"
    "count:        2         2         2         0         0         0 \n"
    "min:        610      4210      6110         -         -         - \n"
    "avg:        620      4220      6120         -         -         - \n"
    "max:        630      4230      6130         -         -         - \n";
constexpr const char* kTimerlatTail =
    "ALL:        IRQ       Thr       Usr\n"
    "count:     2000      2000         0 \n"
    "min:        584      4075         - \n"
    "avg:        727      4492         - \n"
    "max:        788      5561         - \n";

// Printed by rtla 6.1 on the same machine: osnoise top --quiet --duration 3 --period 1000000 --runtime 900000.
constexpr const char* kOsnoise =
    "\x1b[2;37;40m                                          Operating System Noise                                     "
    " "
    "                                    \x1b[0;0;0m\n"
    "duration:   0 00:00:03 | time is in us\n"
    "\x1b[2;30;47mCPU Period       Runtime        Noise  % CPU Aval   Max Noise   Max Single          HW          NMI"
    "          IRQ      Softirq       Thread\x1b[0;0;0m\n"
    "  0 #3           2700000            5    99.99981           5            5           0            0          677 "
    "           0            1\n";

const PeerTool& tool_named(std::string_view name) {
    const auto tools = peer_tools();
    return *std::find_if(tools.begin(), tools.end(), [&](const PeerTool& tool) { return tool.name == name; });
}

PeerResult parsed(std::string_view tool, const std::string& output) {
    PeerResult result;
    tool_named(tool).parse(output, result);
    return result;
}

std::vector<std::string> arguments_of(std::string_view tool, const RealtimeSetup& setup) {
    return tool_named(tool).arguments({.setup = setup, .period_ns = 250'000, .duration_s = 7});
}

TEST(PeerTool, ReadsTheWakeUpsOfCyclictest) {
    const PeerResult result = parsed("cyclictest", kCyclictest);
    EXPECT_EQ(result.wakeup.count(), 12U);
    EXPECT_EQ(result.beyond, 4U);
    EXPECT_EQ(result.wakeup.min_ns(), 19'753);
    EXPECT_EQ(result.wakeup.max_ns(), 165'242);
    EXPECT_NEAR(static_cast<double>(result.wakeup.percentile_ns(0.5)), 23'333.0, 0.004 * 23'333.0);
    EXPECT_EQ(result.wakeup.percentile_ns(0.9), 165'242) << "those beyond the histogram count as its maximum";
}

TEST(PeerTool, ReadsInterruptAndThreadOfTimerlat) {
    const PeerResult result = parsed("timerlat", kTimerlat);
    EXPECT_EQ(result.wakeup.count(), 2000U);
    EXPECT_EQ(result.beyond, 0U);
    EXPECT_EQ(result.wakeup.max_ns(), 5561);
    EXPECT_GE(result.wakeup.min_ns(), 4075);
    // 50 ns of timerlat's buckets, 0.4 % of ours; the tool prints its mean itself.
    EXPECT_NEAR(static_cast<double>(result.wakeup.percentile_ns(0.5)), 4250.0, 50.0 + 17.0);
    EXPECT_NEAR(result.wakeup.mean_ns(), 4492.0, 50.0 + 18.0);
    EXPECT_EQ(result.interrupt.count(), 2000U);
    EXPECT_EQ(result.interrupt.max_ns(), 788);
    EXPECT_NEAR(result.interrupt.mean_ns(), 727.0, 50.0 + 3.0);
}

TEST(PeerTool, CountsWhatIsBeyondTimerlatsHistogramAsItsMaximum) {
    const PeerResult result = parsed("timerlat", kTimerlatOver);
    EXPECT_EQ(result.beyond, 462U);
    EXPECT_EQ(result.wakeup.count(), 2000U);
    EXPECT_EQ(result.wakeup.max_ns(), 5552);
    EXPECT_NEAR(static_cast<double>(result.wakeup.percentile_ns(0.9)), 5552.0, 0.004 * 5552.0);
    EXPECT_LT(result.wakeup.percentile_ns(0.76), 4400);
}

TEST(PeerTool, LeavesOutTheSumThatNewerVersionsOfTimerlatAdd) {
    const PeerResult result = parsed("timerlat", std::string(kTimerlat) + kTimerlatTail);
    EXPECT_EQ(result.wakeup.count(), 2000U);
    EXPECT_EQ(result.wakeup.max_ns(), 5561);
}

TEST(PeerTool, LeavesOutWhenTimerlatsThreadIsBackInUserSpace) {
    const PeerResult result = parsed("timerlat", std::string(kTimerlatUser) + kTimerlatTail);
    EXPECT_EQ(result.wakeup.count(), 2U);
    EXPECT_EQ(result.wakeup.max_ns(), 4230);
    EXPECT_EQ(result.interrupt.count(), 2U);
    EXPECT_EQ(result.interrupt.max_ns(), 630);
    // A '-' hides nothing behind it.
    std::string without_minimum = kTimerlat;
    without_minimum.replace(without_minimum.find("584"), 3, "  -");
    EXPECT_EQ(parsed("timerlat", without_minimum).wakeup.max_ns(), 5561);
    EXPECT_GE(parsed("timerlat", without_minimum).wakeup.min_ns(), 4075);
}

TEST(PeerTool, ReadsTheNoiseOfOsnoise) {
    const PeerResult result = parsed("osnoise", kOsnoise);
    ASSERT_TRUE(result.noise);
    EXPECT_DOUBLE_EQ(result.noise->runtime_us, 2'700'000.0);
    EXPECT_DOUBLE_EQ(result.noise->noise_us, 5.0);
    EXPECT_DOUBLE_EQ(result.noise->available_percent, 99.99981);
    EXPECT_DOUBLE_EQ(result.noise->max_period_us, 5.0);
    EXPECT_DOUBLE_EQ(result.noise->max_single_us, 5.0);
    EXPECT_EQ(result.noise->hardware, 0U);
    EXPECT_EQ(result.noise->nmi, 0U);
    EXPECT_EQ(result.noise->interrupts, 677U);
    EXPECT_EQ(result.noise->softirqs, 0U);
    EXPECT_EQ(result.noise->threads, 1U);
    EXPECT_EQ(result.wakeup.count(), 0U);
}

TEST(PeerTool, AddsTheTurnsOfARun) {
    PeerResult result;
    tool_named("timerlat").parse(kTimerlat, result);
    tool_named("timerlat").parse(kTimerlatOver, result);
    EXPECT_EQ(result.wakeup.count(), 4000U);
    EXPECT_EQ(result.wakeup.max_ns(), 5561);
    EXPECT_EQ(result.beyond, 462U);
}

TEST(PeerTool, SaysWhichResultItCannotUnderstand) {
    for (const PeerTool& tool : peer_tools()) {
        for (const char* output : {"", "{}", "Tracer not found!\n", "Index   IRQ-000   Thr-000\nover: 1"}) {
            try {
                parsed(tool.name, output);
                ADD_FAILURE() << tool.name << " accepts " << output;
            } catch (const std::runtime_error& error) {
                EXPECT_THAT(error.what(), HasSubstr(std::string(tool.name)));
            }
        }
    }
    // A line of the histogram is missing.
    std::string shorter = kTimerlat;
    shorter.erase(shorter.find("4200 "), shorter.find("4300 ") - shorter.find("4200 "));
    EXPECT_THROW(parsed("timerlat", shorter), std::runtime_error);
    std::string microseconds = kTimerlat;
    microseconds.replace(microseconds.find("nanoseconds (ns)"), 16, "microseconds (us)");
    EXPECT_THROW(parsed("timerlat", microseconds), std::runtime_error);
}

TEST(PeerTool, RunsOnTheLoopsProcessorWithItsPolicyPriorityAndPeriod) {
    RealtimeSetup setup;
    setup.policy = "SCHED_FIFO";
    setup.priority = 80;
    setup.cpu = 3;
    setup.memory_locked = true;
    EXPECT_THAT(arguments_of("cyclictest", setup),
                AllOf(Contains("--policy=fifo"), Contains("--priority=80"), Contains("--affinity=3"),
                      Contains("--interval=250"), Contains("--duration=7"), Contains("--mlockall")));
    for (const char* name : {"timerlat", "osnoise"}) {
        const std::vector<std::string> words = arguments_of(name, setup);
        EXPECT_EQ(words.front(), name);
        std::string text;
        for (const std::string& word : words) {
            text += word + " ";
        }
        EXPECT_THAT(text, AllOf(HasSubstr("--cpus 3 "), HasSubstr("--priority f:80 "), HasSubstr("--duration 7 ")));
    }
    EXPECT_THAT(arguments_of("timerlat", setup), Contains("250"));
    // Without privileges: ordinary scheduling, and any processor.
    const RealtimeSetup refused;
    EXPECT_THAT(arguments_of("cyclictest", refused),
                AllOf(Contains("--policy=other"), Not(Contains(StartsWith("--affinity")))));
    EXPECT_THAT(arguments_of("timerlat", refused), Contains("o:0"));
}

TEST(PeerTool, SaysWhichTracerTheKernelDoesNotHave) {
    const std::filesystem::path tracefs = std::filesystem::path(testing::TempDir()) / "peer-tool-tracefs";
    std::filesystem::remove_all(tracefs);
    EXPECT_THAT(missing_tracer("timerlat", tracefs), AllOf(HasSubstr("as root"), HasSubstr("mount -t tracefs")));
    std::filesystem::create_directories(tracefs);
    std::ofstream(tracefs / "available_tracers") << "timerlat hwlat function nop\n";
    EXPECT_THAT(missing_tracer("timerlat", tracefs), IsEmpty());
    EXPECT_THAT(missing_tracer("osnoise", tracefs), HasSubstr("CONFIG_OSNOISE_TRACER"));
    EXPECT_THAT(missing_tracer("", "/nowhere"), IsEmpty()) << "a tool without a tracer";
    std::filesystem::remove_all(tracefs);
}

}  // namespace
}  // namespace haptic::rt
