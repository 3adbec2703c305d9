#include "measure/trace_explanation.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdio>
#include <map>
#include <optional>
#include <sstream>
#include <utility>

#include "measure/kernel_trace.hpp"

namespace haptic::rt {
namespace {

// The kernel's numbers of priorities: below this real-time, the smaller the more urgent.
constexpr int kOrdinary = 100;
constexpr int kIdleThread = 0;

struct Thread {
    int number = -1;
    std::string name;
    int priority = kOrdinary;  // the kernel's number

    [[nodiscard]] std::string label() const { return name + "-" + std::to_string(number); }
    [[nodiscard]] bool is_idle() const { return number == kIdleThread; }
};

struct Event {
    enum class Kind : std::uint8_t { Switch, Waking, Call, LockWait, PageFault, InterruptBegin, InterruptEnd };
    Kind kind = Kind::Switch;
    std::int64_t at_ns = 0;
    int cpu = -1;
    bool in_interrupt = false;  // where it was recorded
    Thread by;                  // that was running
    Thread first;               // switch: that leaves; waking: that is woken
    Thread second;              // switch: that comes
    bool stays_ready = false;   // switch: the first did not want to leave
    std::string name;           // of an interrupt
};

/// The text between two others, searched from the beginning; empty if there is none.
std::string between(const std::string& text, const std::string& before, const std::string& after) {
    const std::size_t begin = text.find(before);
    if (begin == std::string::npos) {
        return {};
    }
    const std::size_t from = begin + before.size();
    return text.substr(from, after.empty() ? after.npos : text.find(after, from) - from);
}

int number_in(const std::string& text) {
    int value = -1;
    (void)std::from_chars(text.data(), text.data() + text.size(), value);
    return value;
}

/// "comm-pid" before the processor of a line.
Thread running_of(const std::string& line, std::size_t processor) {
    std::string who = line.substr(0, processor);
    who.erase(0, who.find_first_not_of(' '));
    who.erase(who.find_last_not_of(' ') + 1);
    const std::size_t dash = who.rfind('-');
    return dash == who.npos ? Thread{} : Thread{number_in(who.substr(dash + 1)), who.substr(0, dash), kOrdinary};
}

std::optional<Event> event_of(const std::string& line) {
    Event event;
    event.at_ns = time_of_line(line);
    if (event.at_ns < 0) {
        return std::nullopt;
    }
    const std::size_t processor = processor_in(line);
    // Interrupts off, reschedule, context, depth: the third character says where the event was recorded.
    const std::string flags = line.substr(line.find_first_not_of(' ', processor + kProcessorLength), 3);
    event.cpu = number_in(line.substr(processor + 1));
    event.in_interrupt = flags.size() == 3 && (flags[2] == 'h' || flags[2] == 'H');
    event.by = running_of(line, processor);
    if (line.find(": sched_switch: ") != line.npos) {
        event.kind = Event::Kind::Switch;
        event.first = {number_in(between(line, " prev_pid=", " ")), between(line, " prev_comm=", " prev_pid="),
                       number_in(between(line, " prev_prio=", " "))};
        event.second = {number_in(between(line, " next_pid=", " ")), between(line, " next_comm=", " next_pid="),
                        number_in(between(line, " next_prio=", " "))};
        event.stays_ready = between(line, " prev_state=", " ").substr(0, 1) == "R";
    } else if (line.find(": sched_waking: ") != line.npos) {
        event.kind = Event::Kind::Waking;
        event.first = {number_in(between(line, " pid=", " ")), between(line, " comm=", " pid="),
                       number_in(between(line, " prio=", " "))};
    } else if (line.find(": sys_futex(") != line.npos || line.find(": sys_enter_futex") != line.npos) {
        event.kind = Event::Kind::LockWait;
    } else if (line.find(": sys_enter: ") != line.npos) {
        event.kind = Event::Kind::Call;
    } else if (line.find(": page_fault_user: ") != line.npos) {
        event.kind = Event::Kind::PageFault;
    } else if (line.find(": irq_handler_entry: ") != line.npos) {
        event.kind = Event::Kind::InterruptBegin;
        event.name = between(line, " name=", "");
    } else if (line.find(": irq_handler_exit: ") != line.npos) {
        event.kind = Event::Kind::InterruptEnd;
    } else {
        return std::nullopt;
    }
    return event;
}

/// Time by thread, ns.
class Shares {
  public:
    void add(const Thread& thread, std::int64_t duration_ns) {
        if (duration_ns > 0) {
            auto& [known, sum_ns] = of_[thread.number];
            known = thread;
            sum_ns += duration_ns;
        }
    }
    void add(const Shares& others) {
        for (const auto& [number, share] : others.of_) {
            add(share.first, share.second);
        }
    }
    /// Those for which `counts` is true together, and the largest of them.
    template <class Counts>
    [[nodiscard]] std::pair<std::int64_t, Thread> sum(const Counts& counts) const {
        std::int64_t all_ns = 0;
        std::int64_t most_ns = 0;
        Thread largest;
        for (const auto& [number, share] : of_) {
            if (counts(share.first)) {
                all_ns += share.second;
                if (share.second > most_ns) {
                    most_ns = share.second;
                    largest = share.first;
                }
            }
        }
        return {all_ns, largest};
    }

  private:
    std::map<int, std::pair<Thread, std::int64_t>> of_;
};

/// The events in order, and what follows from all of them.
class Trace {
  public:
    explicit Trace(const std::string& lines) {
        std::istringstream stream(lines);
        for (std::string line; std::getline(stream, line);) {
            if (std::optional<Event> event = event_of(line)) {
                events_.push_back(std::move(*event));
            }
        }
        for (const Event& event : events_) {
            for (const Thread* const one : {&event.first, &event.second}) {
                if (one->number >= 0) {
                    priority_[one->number] = one->priority;
                }
            }
        }
        for (Event& event : events_) {
            event.by.priority = priority_of(event.by.number);
            ran_[event.cpu].emplace_back(event.at_ns, event.by);
        }
    }

    [[nodiscard]] const std::vector<Event>& events() const noexcept { return events_; }
    /// The kernel's number; that of ordinary threads if the trace does not say.
    [[nodiscard]] int priority_of(int thread) const {
        const auto known = priority_.find(thread);
        return known == priority_.end() ? kOrdinary : known->second;
    }
    /// What a processor ran just before a time: what it ran at its next event, because some kernels do not record that
    /// they leave an idle state.
    [[nodiscard]] Thread running(int cpu, std::int64_t before_ns) const {
        const auto processor = ran_.find(cpu);
        if (processor == ran_.end()) {
            return {};
        }
        const auto next =
            std::ranges::lower_bound(processor->second, before_ns, {}, &std::pair<std::int64_t, Thread>::first);
        return next == processor->second.end() ? Thread{} : next->second;
    }

  private:
    std::vector<Event> events_;
    std::map<int, int> priority_;
    std::map<int, std::vector<std::pair<std::int64_t, Thread>>> ran_;  // by processor, at each of its events
};

/// A part of a thread's time, with what its processor ran meanwhile.
struct Followed {
    TracePart part{};
    Shares meanwhile{};
    bool in_lock = false;             // asleep: it waits for a lock
    bool in_fault = false;            // asleep: its page fault waits, for a lock of the kernel or a disk
    std::optional<Event> waking{};    // asleep: what ended it
    std::int64_t interrupted_ns = 0;  // running: by interrupts
    std::string interrupt{};          // the last of them
};

/// Follows a thread from `begin_ns` to `end_ns`.
std::vector<Followed> follow(const Trace& trace, int thread, std::int64_t begin_ns, std::int64_t end_ns) {
    using State = TracePart::State;
    std::vector<Followed> parts;
    std::optional<State> state;
    int cpu = -1;
    bool lock = false;
    bool fault = false;
    std::int64_t last_ns = 0;
    std::int64_t interrupt_ns = -1;  // when the one on the thread's processor began
    std::string interrupt;
    // Charges the time since the last event to the present state.
    const auto pass = [&](std::int64_t now_ns) {
        const std::int64_t from_ns = std::max(last_ns, begin_ns);
        const std::int64_t to_ns = std::min(now_ns, end_ns);
        last_ns = std::max(last_ns, now_ns);
        if (!state || to_ns <= from_ns) {
            return;
        }
        if (parts.empty() || parts.back().part.state != *state || parts.back().part.cpu != cpu || parts.back().waking) {
            parts.push_back({.part = {.state = *state, .begin_ns = from_ns, .end_ns = from_ns, .cpu = cpu, .by = {}}});
        }
        Followed& present = parts.back();
        present.part.end_ns = to_ns;
        present.in_lock = present.in_lock || (*state == State::Asleep && lock);
        present.in_fault = present.in_fault || (*state == State::Asleep && fault);
        if (*state != State::Running) {
            present.meanwhile.add(trace.running(cpu, to_ns), to_ns - from_ns);
        }
    };
    for (const Event& event : trace.events()) {
        // A thread whose first event is not its own was in the state that this event ends.
        const bool leaves = event.kind == Event::Kind::Switch && event.first.number == thread;
        const bool comes = event.kind == Event::Kind::Switch && event.second.number == thread;
        const bool woken = event.kind == Event::Kind::Waking && event.first.number == thread;
        if (!state && (leaves || comes || woken)) {
            state = leaves ? State::Running : comes ? State::Ready : State::Asleep;
            cpu = event.cpu;
        }
        if (event.by.number == thread && state == State::Ready) {
            state = State::Running;  // its switch was not recorded
            cpu = event.cpu;
        }
        pass(event.at_ns);
        if (comes) {
            state = State::Running;
            cpu = event.cpu;
            lock = false;
        } else if (leaves) {
            state = event.stays_ready ? State::Ready : State::Asleep;
            cpu = event.cpu;
        } else if (woken && state == State::Asleep) {
            if (!parts.empty() && parts.back().part.state == State::Asleep && event.at_ns > begin_ns) {
                parts.back().waking = event;
            }
            state = State::Ready;
        } else if (event.kind == Event::Kind::LockWait && event.by.number == thread) {
            lock = true;
            fault = false;
        } else if (event.kind == Event::Kind::Call && event.by.number == thread) {
            fault = false;
        } else if (event.kind == Event::Kind::PageFault && event.by.number == thread) {
            // Its end is not recorded; what does not sleep in it sleeps in what it asks the kernel for next.
            fault = true;
        } else if (event.kind == Event::Kind::InterruptBegin && event.cpu == cpu) {
            interrupt_ns = event.at_ns;
            interrupt = event.name;
        } else if (event.kind == Event::Kind::InterruptEnd && event.cpu == cpu && interrupt_ns >= 0) {
            const std::int64_t took_ns = std::min(event.at_ns, end_ns) - std::max(interrupt_ns, begin_ns);
            interrupt_ns = -1;
            if (state == State::Running && took_ns > 0 && !parts.empty()) {
                parts.back().interrupted_ns += took_ns;
                parts.back().interrupt = interrupt;
            }
        }
        if (event.at_ns > end_ns) {
            break;
        }
    }
    pass(end_ns);
    return parts;
}

std::string time_text(std::int64_t duration_ns) {
    std::array<char, 32> text{};
    std::snprintf(text.data(), text.size(), "%.0f us", static_cast<double>(duration_ns) * 1e-3);
    return text.data();
}

/// "irq/24-disk-88 (real-time priority 90)".
std::string described(const Thread& thread) {
    if (thread.number < 0) {
        return "something that the trace does not show";
    }
    if (thread.is_idle()) {
        return "no thread (the processor was idle)";
    }
    return thread.label() + (thread.priority < kOrdinary
                                 ? " (real-time priority " + std::to_string(kOrdinary - 1 - thread.priority) + ")"
                                 : " (ordinary priority)");
}

/// A cause, with the time that it took.
struct Finding {
    TraceCause cause = TraceCause::Unseen;
    std::int64_t lost_ns = 0;
    std::string thread;  // or interrupt; empty: none
    std::string why;
};

/// As a finding names it.
std::string named(const Thread& thread) {
    return thread.number < 0 ? std::string() : thread.label();
}

bool anybody(const Thread& /*thread*/) {
    return true;
}

/// The thread sleeps until its deadline; here it slept on.
Finding of_late_timer(const Followed& slept) {
    const auto [held_ns, holder] = slept.meanwhile.sum(anybody);
    const std::int64_t lost_ns = slept.part.end_ns - slept.part.begin_ns;
    return {TraceCause::LateTimer, lost_ns, holder.is_idle() ? std::string() : named(holder),
            "the timer interrupt that wakes the loop came " + time_text(lost_ns) + " late, while its processor ran " +
                described(holder)};
}

/// It slept in its tick: for a page, for a lock, or until its device answered.
Finding of_sleep(const Trace& trace, const Followed& slept, int loop_priority) {
    const std::int64_t lost_ns = slept.part.end_ns - slept.part.begin_ns;
    const bool by_thread = slept.waking && !slept.waking->in_interrupt;
    if (slept.in_fault) {
        return {TraceCause::PageFault, lost_ns, by_thread ? named(slept.waking->by) : std::string(),
                "a page fault of the loop slept for " + time_text(lost_ns) + ", until " +
                    (by_thread ? described(slept.waking->by) : std::string("an interrupt")) +
                    " woke it: memory of the loop was not there"};
    }
    if (!by_thread) {
        return {TraceCause::Device,
                lost_ns,
                {},
                "the loop slept for " + time_text(lost_ns) + " in its tick, until an interrupt woke it"};
    }
    // What kept the thread that woke it, in the same time.
    const Thread& waker = slept.waking->by;
    Shares instead;
    std::int64_t waited_ns = 0;
    for (const Followed& one : follow(trace, waker.number, slept.part.begin_ns, slept.part.end_ns)) {
        if (one.part.state == TracePart::State::Ready) {
            instead.add(one.meanwhile);
            waited_ns += one.part.end_ns - one.part.begin_ns;
        }
    }
    const auto [held_ns, holder] = instead.sum(anybody);
    const std::string kept = waited_ns > 0 ? ", which itself waited " + time_text(waited_ns) +
                                                 " for its processor, used by " + described(holder)
                                           : std::string();
    if (slept.in_lock && waker.priority > loop_priority) {
        return {TraceCause::PriorityInversion, lost_ns, named(waker),
                "the loop waited " + time_text(lost_ns) + " for a lock of " + described(waker) + kept};
    }
    return {
        2 * waited_ns > lost_ns ? TraceCause::LateWaker : TraceCause::Device, lost_ns, named(waker),
        "the loop slept for " + time_text(lost_ns) + " in its tick, until it was woken by " + described(waker) + kept};
}

/// It was ready, and its processor ran something else.
void add_waits(const Shares& instead, int loop_priority, std::vector<Finding>& findings) {
    const auto [urgent_ns, urgent] =
        instead.sum([&](const Thread& t) { return !t.is_idle() && t.priority <= loop_priority; });
    findings.push_back({TraceCause::HigherPriority, urgent_ns, named(urgent),
                        described(urgent) + ", which is at least as urgent as the loop, used its processor; " +
                            time_text(urgent_ns) + " in all"});
    const auto [kept_ns, kept] =
        instead.sum([&](const Thread& t) { return !t.is_idle() && t.priority > loop_priority; });
    findings.push_back({TraceCause::KernelSection, kept_ns, named(kept),
                        described(kept) +
                            " kept the processor although the loop was ready and more urgent: the "
                            "kernel did not preempt it; " +
                            time_text(kept_ns) + " in all"});
    const auto [idle_ns, idle] = instead.sum([](const Thread& t) { return t.is_idle(); });
    findings.push_back(
        {TraceCause::LateTimer,
         idle_ns,
         {},
         "the loop was ready, and its processor took " + time_text(idle_ns) + " to leave its idle state"});
}

/// It ran, longer than usual.
Finding of_running(const TracedTick& tick, std::int64_t running_ns, std::int64_t interrupted_ns,
                   const std::string& interrupt) {
    const std::int64_t lost_ns = std::max<std::int64_t>(0, running_ns - tick.usual_ns);
    if (tick.page_faults > 0) {
        return {TraceCause::PageFault,
                lost_ns,
                {},
                std::to_string(tick.page_faults) + (tick.page_faults == 1 ? " page fault" : " page faults") +
                    " in the tick: memory of the loop was not there"};
    }
    if (2 * interrupted_ns > lost_ns && lost_ns > 0) {
        return {TraceCause::Interrupts, lost_ns, interrupt,
                "interrupts took " + time_text(interrupted_ns) + " of the tick, the last of them " + interrupt};
    }
    return {TraceCause::Unseen,
            lost_ns,
            {},
            "the loop had its processor for " + time_text(running_ns) +
                "; the trace has nothing that took the time: computation, firmware, a hypervisor, or cold caches"};
}

/// What is printed for a part of the time.
TracePart summary_of(const Followed& one) {
    TracePart part = one.part;
    if (one.waking) {
        part.by = one.waking->in_interrupt ? "woken by an interrupt" : "woken by " + one.waking->by.label();
    } else if (part.state != TracePart::State::Running) {
        part.by = described(one.meanwhile.sum(anybody).second);
    }
    return part;
}

}  // namespace

const char* name_of(TraceCause cause) noexcept {
    constexpr std::array<const char*, 10> names = {
        "late_timer", "higher_priority", "kernel_section", "priority_inversion", "late_waker",
        "device",     "page_fault",      "interrupts",     "other_processor",    "unseen"};
    return names[static_cast<std::size_t>(cause)];
}

TraceExplanation explain_trace(const std::string& lines, const TracedTick& tick) {
    using State = TracePart::State;
    const Trace trace(lines);
    const int priority = trace.priority_of(tick.thread);
    // Each part of the time is a finding, or adds to one.
    std::vector<Finding> findings;
    TraceExplanation result;
    Shares instead;
    std::int64_t running_ns = 0;
    std::int64_t elsewhere_ns = 0;
    std::int64_t interrupted_ns = 0;
    std::string interrupt;
    bool has_run = false;
    for (const Followed& one : follow(trace, tick.thread, tick.deadline_ns, tick.end_ns)) {
        const std::int64_t took_ns = one.part.end_ns - one.part.begin_ns;
        if (one.part.state == State::Running) {
            has_run = true;
            running_ns += took_ns;
            elsewhere_ns += tick.cpu >= 0 && one.part.cpu != tick.cpu ? took_ns : 0;
            interrupted_ns += one.interrupted_ns;
            interrupt = one.interrupted_ns > 0 ? one.interrupt : interrupt;
        } else if (one.part.state == State::Ready) {
            instead.add(one.meanwhile);
        } else {
            findings.push_back(has_run ? of_sleep(trace, one, priority) : of_late_timer(one));
        }
        result.parts.push_back(summary_of(one));
    }
    add_waits(instead, priority, findings);
    findings.push_back(of_running(tick, running_ns, interrupted_ns, interrupt));
    const Finding* worst = &findings.back();
    for (const Finding& one : findings) {
        worst = one.lost_ns > worst->lost_ns ? &one : worst;
    }
    result.cause = worst->cause;
    result.lost_ns = worst->lost_ns;
    result.thread = worst->thread;
    result.why = worst->why;
    // A loop on the wrong processor is a defect by itself, whatever made it late there.
    if (elsewhere_ns > 0) {
        result.cause = TraceCause::OtherProcessor;
        result.why = "the loop is pinned to processor " + std::to_string(tick.cpu) + " and ran on another one for " +
                     time_text(elsewhere_ns) + "; there " + result.why;
    }
    return result;
}

}  // namespace haptic::rt
