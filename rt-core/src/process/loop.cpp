#include "process/loop.hpp"

#include <utility>

#include "haptic/clock.hpp"
#include "haptic/denormals.hpp"
#include "process/crash_guard.hpp"
#include "process/idle_request.hpp"

namespace haptic::rt {

namespace {

// ns without an answer from the board after which a disarmed loop gives the device up.
constexpr std::int64_t kLostNs = 500'000'000;

}  // namespace

NextDeadline next_deadline(std::int64_t deadline_ns, std::int64_t period_ns, std::int64_t now_ns) HAPTIC_RT {
    // An overrun skips whole periods: the loop keeps its phase and never catches up.
    NextDeadline next{deadline_ns + period_ns, 0};
    if (next.deadline_ns <= now_ns) {
        next.missed = (now_ns - next.deadline_ns) / period_ns + 1;
        next.deadline_ns += next.missed * period_ns;
    }
    return next;
}

RealtimeLoop::RealtimeLoop(const LoopSettings& settings, Tick& tick, RealtimeSetup setup, SupervisionPage* page)
    : settings_(settings),
      tick_(&tick),
      setup_(std::move(setup)),
      page_(page),
      measured_(std::make_unique<Instruments>(tick.instruments())) {
    thread_ = create_thread(&RealtimeLoop::thread_entry, this, kStackBytes, "creating the real-time thread");
    prepared_.get_future().wait();
}

RealtimeLoop::~RealtimeLoop() {
    request_stop();
    join();
}

void RealtimeLoop::start(Recorder* recorder, TimingLog* log, ArmSwitch* person) {
    recorder_ = recorder;
    log_ = log;
    person_ = person;
    started_ = true;
    go_.set_value(true);
}

void RealtimeLoop::join() {
    if (joined_) {
        return;
    }
    if (!started_) {
        go_.set_value(false);
    }
    pthread_join(thread_, nullptr);
    joined_ = true;
}

void* RealtimeLoop::thread_entry(void* self) {
    auto* const loop = static_cast<RealtimeLoop*>(self);
    // Prepare this thread, and report the result through setup().
    const AlternateSignalStack signal_stack;
    const FlushDenormals flush;
    const IdleRequest idle(loop->settings_.idle_exit_us);
    loop->setup_.idle_exit_us = idle.granted() ? loop->settings_.idle_exit_us : -1;
    prepare_thread(loop->setup_, loop->settings_.priority, loop->settings_.cpu);
    // Wait for start(), or for the destructor.
    std::future<bool> go = loop->go_.get_future();
    loop->prepared_.set_value();
    if (go.get()) {
        if (loop->log_ != nullptr) {
            loop->log_->attach();
        }
        loop->cycle();
    }
    loop->finished_.store(true, std::memory_order_release);  // publishes everything that the ticks wrote
    return nullptr;
}

std::int64_t RealtimeLoop::run_one(std::int64_t deadline_ns, std::int64_t missed) HAPTIC_RT {
    sleep_until(deadline_ns);  // clock_nanosleep, absolute
    const std::int64_t begun_ns = monotonic_now_ns();
    if (page_ != nullptr) {
        obey_supervisors(begun_ns);
    }
    tick_->run({deadline_ns, begun_ns, missed});
    state_.store(tick_->safety_state(), std::memory_order_relaxed);
    flags_.store(tick_->last().flags, std::memory_order_relaxed);
    const std::int64_t ended_ns = monotonic_now_ns();
    if (page_ != nullptr) {
        page_->loop_beat(ended_ns);
    }
    return ended_ns;
}

void RealtimeLoop::obey_supervisors(std::int64_t now_ns) HAPTIC_RT {
    page_->loop_beat(now_ns);
    if (page_->is_cut()) {
        tick_->cut(HAPTIC_FAULT_GUARD);  // the guard found this loop frozen, and the motors are at zero
    } else if (page_->has_lost()) {
        tick_->stop_for_good();
    }
}

void RealtimeLoop::warm_up(std::int64_t& deadline_ns) HAPTIC_RT {
    // At least one tick, even if it is to stop: what failed in the last loop, and the time since, would be faults of
    // the first armed one.
    for (int i = 0; i == 0 || (i < settings_.warm_up_ticks && !stop_requested_.load(std::memory_order_relaxed)); ++i) {
        deadline_ns = next_deadline(deadline_ns, settings_.period_ns, run_one(deadline_ns, 0)).deadline_ns;
    }
}

void RealtimeLoop::await_person(NextDeadline& next) HAPTIC_RT {
    HeldButton button;
    std::int64_t answered_ns = monotonic_now_ns();
    tick_->await_person();
    person_->await();
    while (!person_->pressed() && !stop_requested_.load(std::memory_order_relaxed)) {
        // A disarmed tick: zero to the motors, encoders and pose as ever.
        next = next_deadline(next.deadline_ns, settings_.period_ns, run_one(next.deadline_ns, next.missed));
        const TickRecord& tick = tick_->last();
        if (tick.cut != 0) {
            break;  // another thread ended this loop: arming leads to the disarmed state at once
        }
        // While disarmed nothing is a fault, so a device that is lost must be noticed here.
        if (tick.exchange_in == static_cast<std::int8_t>(device::ExchangeStatus::Ok)) {
            answered_ns = tick.now_ns;
            if (settings_.arm_button >= 0 &&
                button.update((tick.buttons >> static_cast<unsigned>(settings_.arm_button) & 1U) != 0, tick.now_ns)) {
                person_->press(ArmedBy::Button);
            }
        } else if (tick.now_ns - answered_ns > kLostNs) {
            lost_ = tick_->instruments().last_failure;
            break;
        }
    }
    person_->give_up();
}

void RealtimeLoop::cycle() HAPTIC_RT {
    tick_->heart().begin();
    NextDeadline next{monotonic_now_ns() + settings_.period_ns, 0};
    tick_->record_to(recorder_);  // from the first tick on, because a replay starts with a new tick too
    // Warm up disarmed, then arm, or let a person arm: calibration and the tension ramp follow.
    warm_up(next.deadline_ns);
    if (person_ != nullptr) {
        await_person(next);
    }
    if (!lost_) {
        run_armed(next);
    }
    // Leave the motors at zero, and tell the watchdog that silence is expected from here on.
    tick_->send_zero(monotonic_now_ns());
    tick_->heart().end();
    if (page_ != nullptr) {
        page_->loop_beat(0);
    }
}

void RealtimeLoop::run_armed(NextDeadline& next) HAPTIC_RT {
    tick_->arm();
    // Everything from here on is measured; what was measured while disarmed is dropped.
    tick_->swap_instruments(measured_);
    const ThreadUsage before = thread_usage();
    if (log_ != nullptr) {
        log_->begin();
    }
    // Run until the safety machine is disarmed again, that is stopped or faulted, and faded out. relaxed: no other data
    // depends on the flag.
    do {
        if (stop_requested_.load(std::memory_order_relaxed)) {
            tick_->stop();
        }
        next = next_deadline(next.deadline_ns, settings_.period_ns, run_one(next.deadline_ns, next.missed));
        if (log_ != nullptr) {
            log_->add(tick_->last(), tick_->timing(), next.missed);
        }
    } while (tick_->safety_state() != SafetyState::Disarmed);
    const ThreadUsage after = thread_usage();
    usage_ = after - before;
}

}  // namespace haptic::rt
