#include "measure/trace_explanation.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

#include "measure/kernel_trace.hpp"

namespace haptic::rt {
namespace {

using testing::HasSubstr;

constexpr std::int64_t kDeadlineNs = 100'000'000'000;
constexpr int kLoop = 500;

struct TracedThread {
    int number;
    const char* name;
    int priority;
};
constexpr TracedThread kLoopThread{kLoop, "rt-core", 19};  // SCHED_FIFO 80
constexpr TracedThread kIdleThread{0, "swapper/1", 120};
constexpr TracedThread kWorker{61, "stress ng-vm] ", 120};  // a name may contain anything
constexpr TracedThread kUsbThread{62, "vhci_rx", 120};
constexpr TracedThread kHolder{63, "holder", 120};
constexpr TracedThread kHog{64, "hog", 59};  // SCHED_FIFO 40
constexpr TracedThread kInterruptThread{65, "irq/24-virtio0", 9};

/// Lines as the kernel writes them, of processor 1, at us after the deadline.
class TraceLines {
  public:
    /// What processor 1 runs from here on.
    TraceLines& runs(double us, const TracedThread& next, const char* left_as = "S", int cpu = 1) {
        line(us, "d..2.", cpu,
             "sched_switch: prev_comm=" + std::string(now_.name) + " prev_pid=" + std::to_string(now_.number) +
                 " prev_prio=" + std::to_string(now_.priority) + " prev_state=" + left_as +
                 " ==> next_comm=" + next.name + " next_pid=" + std::to_string(next.number) +
                 " next_prio=" + std::to_string(next.priority));
        now_ = next;
        return *this;
    }
    TraceLines& wakes(double us, const TracedThread& woken, bool in_interrupt = true) {
        line(us, in_interrupt ? "d.h2." : "d..2.", 1,
             "sched_waking: comm=" + std::string(woken.name) + " pid=" + std::to_string(woken.number) +
                 " prio=" + std::to_string(woken.priority) + " target_cpu=001");
        return *this;
    }
    TraceLines& event(double us, const std::string& what) {
        line(us, ".....", 1, what);
        return *this;
    }
    [[nodiscard]] const std::string& text() const { return text_; }

  private:
    void line(double us, const char* flags, int cpu, const std::string& what) {
        char head[128];
        std::snprintf(head, sizeof head, "%16s-%-7d [%03d] %s %.6f: ", now_.name, now_.number, cpu, flags,
                      100.0 + 1e-6 * us);
        text_ += head + what + "\n";
    }
    TracedThread now_ = kIdleThread;
    std::string text_ = "# tracer: nop\n#\n";
};

TraceExplanation explained(const TraceLines& lines, double end_us, std::int64_t page_faults = 0) {
    return explain_trace(lines.text(), {.thread = kLoop,
                                        .cpu = 1,
                                        .deadline_ns = kDeadlineNs,
                                        .end_ns = kDeadlineNs + static_cast<std::int64_t>(1000.0 * end_us),
                                        .usual_ns = 20'000,
                                        .page_faults = page_faults});
}

/// The loop sleeps from -900 us on, and is woken when it should be.
TraceLines woken_in_time(const TracedThread& meanwhile = kIdleThread) {
    TraceLines lines;
    lines.runs(-950, kLoopThread).runs(-900, meanwhile).wakes(3, kLoopThread);
    return lines;
}

TEST(TraceExplanation, ChargesALateWakeUpToTheTimer) {
    TraceLines lines;
    lines.runs(-950, kLoopThread).runs(-900, kWorker).wakes(850, kLoopThread).runs(852, kLoopThread, "R");
    const TraceExplanation why = explained(lines, 870);
    EXPECT_EQ(why.cause, TraceCause::LateTimer);
    EXPECT_EQ(why.lost_ns, 850'000);
    EXPECT_EQ(why.thread, "stress ng-vm] -61");
    EXPECT_THAT(why.why, HasSubstr("850 us late"));
    ASSERT_EQ(why.parts.size(), 3U);
    EXPECT_EQ(why.parts[0].state, TracePart::State::Asleep);
    EXPECT_EQ(why.parts[1].state, TracePart::State::Ready);
    EXPECT_EQ(why.parts[2].state, TracePart::State::Running);
    EXPECT_EQ(why.parts[0].begin_ns, kDeadlineNs);
    EXPECT_EQ(why.parts[2].end_ns, kDeadlineNs + 870'000);
}

TEST(TraceExplanation, NamesAThreadOfLowerPriorityThatTheKernelDoesNotPreempt) {
    const TraceExplanation why = explained(woken_in_time(kWorker).runs(703, kLoopThread, "R"), 720);
    EXPECT_EQ(why.cause, TraceCause::KernelSection);
    EXPECT_EQ(why.lost_ns, 700'000);
    EXPECT_EQ(why.thread, "stress ng-vm] -61");
    EXPECT_THAT(why.why, HasSubstr("did not preempt"));
}

TEST(TraceExplanation, NamesAThreadOfHigherPriority) {
    const TraceExplanation why = explained(woken_in_time().runs(4, kInterruptThread, "R").runs(904, kLoopThread), 920);
    EXPECT_EQ(why.cause, TraceCause::HigherPriority);
    EXPECT_EQ(why.thread, "irq/24-virtio0-65");
    EXPECT_THAT(why.why, HasSubstr("real-time priority 90"));
}

TEST(TraceExplanation, NamesWhoHoldsALockOfTheLoop) {
    const TraceExplanation why =
        explained(woken_in_time()
                      .runs(5, kLoopThread, "R")
                      .event(8, "sys_futex(uaddr: 0x7f4a5b65ca4c, op: 0x80, val: 2, utime: 0, uaddr2: 3, val3: 0)")
                      .runs(9, kHolder)
                      .runs(20, kHog, "R")
                      .runs(800, kHolder)
                      .wakes(830, kLoopThread, false)
                      .runs(831, kLoopThread, "R"),
                  850);
    EXPECT_EQ(why.cause, TraceCause::PriorityInversion);
    EXPECT_EQ(why.lost_ns, 821'000);
    EXPECT_EQ(why.thread, "holder-63");
    EXPECT_THAT(why.why, HasSubstr("waited 780 us for its processor, used by hog-64 (real-time priority 40)"));
}

TEST(TraceExplanation, NamesTheThreadOfTheDeviceThatHadToWaitItself) {
    const TraceExplanation why = explained(woken_in_time()
                                               .runs(5, kLoopThread, "R")
                                               .runs(9, kWorker)
                                               .wakes(20, kUsbThread)
                                               .runs(900, kUsbThread, "R")
                                               .wakes(910, kLoopThread, false)
                                               .runs(911, kLoopThread, "R"),
                                           930);
    EXPECT_EQ(why.cause, TraceCause::LateWaker);
    EXPECT_EQ(why.thread, "vhci_rx-62");
    EXPECT_THAT(why.why, HasSubstr("waited 880 us for its processor, used by stress ng-vm] -61"));
}

TEST(TraceExplanation, LeavesALateAnswerToTheDevice) {
    const TraceExplanation why = explained(
        woken_in_time().runs(5, kLoopThread, "R").runs(9, kIdleThread).wakes(700, kLoopThread).runs(702, kLoopThread),
        720);
    EXPECT_EQ(why.cause, TraceCause::Device);
    EXPECT_EQ(why.lost_ns, 691'000);
}

TEST(TraceExplanation, CountsPageFaultsOfALongTick) {
    const TraceExplanation why =
        explained(woken_in_time()
                      .runs(5, kLoopThread, "R")
                      .event(8, "page_fault_user: address=0x7ffe340bf668 ip=0x7f0a4976d08e error_code=0x7"),
                  900, 40);
    EXPECT_EQ(why.cause, TraceCause::PageFault);
    EXPECT_EQ(why.lost_ns, 875'000);
    EXPECT_THAT(why.why, HasSubstr("40 page faults"));
}

TEST(TraceExplanation, ChargesASleepToThePageFaultThatItBeganIn) {
    // Another thread of the program changes its memory, and holds the kernel's lock of it meanwhile.
    TraceLines lines = woken_in_time();
    lines.runs(5, kLoopThread, "R")
        .event(8, "page_fault_user: address=0x7ffe340bf668 ip=0x7f0a4976d08e error_code=0x7");
    TraceLines by_thread = lines;
    by_thread.runs(9, kWorker, "D").wakes(700, kLoopThread, false).runs(702, kLoopThread, "R");
    const TraceExplanation why = explained(by_thread, 720, 1);
    EXPECT_EQ(why.cause, TraceCause::PageFault);
    EXPECT_EQ(why.lost_ns, 691'000);
    EXPECT_EQ(why.thread, "stress ng-vm] -61");
    EXPECT_THAT(why.why, HasSubstr("slept for 691 us, until stress ng-vm] -61 (ordinary priority) woke it"));
    // Or a disk has the page.
    TraceLines by_disk = lines;
    by_disk.runs(9, kIdleThread, "D").wakes(700, kLoopThread).runs(702, kLoopThread);
    EXPECT_EQ(explained(by_disk, 720, 1).cause, TraceCause::PageFault);
    EXPECT_EQ(explained(by_disk, 720, 1).thread, "");
    // It sleeps twice in one fault, and the second time longer.
    TraceLines twice = lines;
    twice.runs(9, kWorker, "D").wakes(20, kLoopThread, false).runs(21, kLoopThread, "R");
    twice.runs(22, kWorker, "D").wakes(700, kLoopThread, false).runs(702, kLoopThread, "R");
    EXPECT_EQ(explained(twice, 720, 1).cause, TraceCause::PageFault);
}

TEST(TraceExplanation, DoesNotChargeWhatComesAfterAPageFaultToIt) {
    TraceLines lines = woken_in_time();
    lines.runs(5, kLoopThread, "R")
        .event(8, "page_fault_user: address=0x7ffe340bf668 ip=0x7f0a4976d08e error_code=0x7");
    TraceLines device = lines;
    device.event(8.5, "sys_enter: NR 7 (7ffe340bf660, 2, 3e8, 0, 0, 0)");
    device.runs(9, kIdleThread, "D").wakes(700, kLoopThread).runs(702, kLoopThread);
    EXPECT_EQ(explained(device, 720, 1).cause, TraceCause::Device);
    TraceLines lock = lines;
    lock.event(9, "sys_futex(uaddr: 0x7f4a5b65ca4c, op: 0x80, val: 2, utime: 0, uaddr2: 3, val3: 0)");
    lock.runs(10, kHolder).wakes(700, kLoopThread, false).runs(702, kLoopThread, "R");
    EXPECT_EQ(explained(lock, 720, 1).cause, TraceCause::PriorityInversion);
}

TEST(TraceExplanation, NamesInterruptsThatTookTheTime) {
    const TraceExplanation why = explained(woken_in_time()
                                               .runs(5, kLoopThread, "R")
                                               .event(20, "irq_handler_entry: irq=36 name=virtio1-req.0")
                                               .event(700, "irq_handler_exit: irq=36 ret=handled"),
                                           720);
    EXPECT_EQ(why.cause, TraceCause::Interrupts);
    EXPECT_EQ(why.thread, "virtio1-req.0");
}

TEST(TraceExplanation, SaysWhenTheTraceShowsNothing) {
    EXPECT_EQ(explained(woken_in_time().runs(5, kLoopThread, "R"), 900).cause, TraceCause::Unseen);
    EXPECT_EQ(explained(TraceLines{}, 900).cause, TraceCause::Unseen);
}

TEST(TraceExplanation, NamesALoopThatRanOnAnotherProcessor) {
    TraceLines lines;
    lines.runs(-950, kLoopThread, "S", 0).runs(-900, kWorker, "S", 0).wakes(3, kLoopThread);
    lines.runs(703, kLoopThread, "R", 0);
    const TraceExplanation why = explained(lines, 720);
    EXPECT_EQ(why.cause, TraceCause::OtherProcessor);
    EXPECT_THAT(why.why, HasSubstr("pinned to processor 1"));
}

TEST(TraceExplanation, IgnoresLinesThatItDoesNotUnderstand) {
    const std::string whole = woken_in_time(kWorker).runs(703, kLoopThread, "R").text();
    for (std::size_t length = 0; length <= whole.size(); ++length) {
        (void)explain_trace(whole.substr(0, length), {.thread = kLoop,
                                                      .cpu = 1,
                                                      .deadline_ns = kDeadlineNs,
                                                      .end_ns = kDeadlineNs + 720'000,
                                                      .usual_ns = 0,
                                                      .page_faults = 0});
    }
    EXPECT_EQ(explain_trace("CPU:1 [LOST 12 EVENTS]\n" + whole, {.thread = kLoop,
                                                                 .cpu = 1,
                                                                 .deadline_ns = kDeadlineNs,
                                                                 .end_ns = kDeadlineNs + 720'000,
                                                                 .usual_ns = 0,
                                                                 .page_faults = 0})
                  .cause,
              TraceCause::KernelSection);
}

TEST(KernelTrace, ReadsTheTimeOfALine) {
    EXPECT_EQ(time_of_line("          <idle>-0       [001] d.h1. 30833.159729: irq_handler_entry: irq=36 name=x"),
              30'833'159'729'000);
    for (const char* none : {"", "# tracer: nop", "CPU:1 [LOST 12 EVENTS]", "a-1 [001] d.h1.", "a-1 [001] d.h1. x: y",
                             "a-1 [001] d.h1. 12: y"}) {
        EXPECT_EQ(time_of_line(none), -1) << none;
    }
}

TEST(KernelTrace, SaysWhatToDoWithoutATracer) {
    try {
        const KernelTrace trace("/nowhere/tracing");
        FAIL() << "there is no such tracer";
    } catch (const std::runtime_error& error) {
        EXPECT_THAT(error.what(), HasSubstr("/nowhere/tracing/instances"));
        EXPECT_THAT(error.what(), HasSubstr("mount -t tracefs"));
    }
}

}  // namespace
}  // namespace haptic::rt
