#include "tick/tick.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include <haptic/device/digits.hpp>
#include "tick/tick_syscalls.hpp"

namespace haptic::rt {
namespace {

// After a long interruption rates and ramps go on as if it had been this many periods, so that nothing catches up in
// one step.
constexpr std::int64_t kMostElapsedPeriods = 2;

}  // namespace

void Tick::run(const TickTime& time) HAPTIC_RT {
    begin(time);
    exchange_in(time);
    measure_pose(time);
    watch_health();
    mark_stage(instruments_.pose, TickStage::Pose);
    take_frame(time);
    render_wrench(time);
    mark_stage(instruments_.proxy, TickStage::Proxy);
    distribute();
    mark_stage(instruments_.tension, TickStage::Tension);
    exchange_out(time);
    publish(time);
    mark_stage(instruments_.publish, TickStage::Publish);
    finish(time);
}

void Tick::begin(const TickTime& time) HAPTIC_RT {
    started_ns_ = clock_();
    stage_ns_ = started_ns_;
    if (probes_ != nullptr) {
        show(probes_->tick, true);
        stage_ns_ = clock_();
    }
    record_ = TickRecord{};
    timing_ = TickTiming{};
    if (stop_asked_.load()) {
        stop();
    }
    record_.deadline_ns = time.deadline_ns;
    record_.now_ns = time.now_ns;
    record_.missed = time.missed;
    record_.number = ++number_;
    record_.requests = requests_;
    requests_ = 0;
    record_.period_ns = first_ ? 0 : time.now_ns - last_now_ns_;
    elapsed_ns_ = first_ ? settings_.period_ns
                         : std::clamp<std::int64_t>(record_.period_ns, 0, kMostElapsedPeriods * settings_.period_ns);
    late_ = time.missed > 0 || time.now_ns - time.deadline_ns >= settings_.period_ns;
    set_flag(late_, HAPTIC_TICK_OVERRUN);
    set_flag(probes_ != nullptr && (probes_->tick.off() || probes_->frame.off()), HAPTIC_TICK_PROBE_OFF);

    ++instruments_.ticks;
    instruments_.overruns += static_cast<std::uint64_t>(std::max<std::int64_t>(time.missed, 0));
    instruments_.wakeup.record(time.now_ns - time.deadline_ns);
    if (!first_) {
        instruments_.period.record(record_.period_ns);
    }
    warm_motors();
}

void Tick::warm_motors() HAPTIC_RT {
    // The whole time, not the clamped one: a process that stood still has left its motors pulling.
    thermal_.update(held_, record_.period_ns);
    tension_solver_.set_maxima(thermal_.bounds());
    set_flag(thermal_.derated(), HAPTIC_TICK_DERATED);
}

void Tick::arm() HAPTIC_RT {
    requests_ |= kRequestArm;
    if (safety_.state() != SafetyState::Disarmed) {
        return;
    }
    safety_.arm();
    encoders_.restart();
    latched_ = false;
    reset_pose();
}

device::ExchangeStatus Tick::exchange(device::BoardReading& reading, std::int64_t now_ns) HAPTIC_RT {
    records_.lend();
    const device::ExchangeStatus status = board_->exchange(command_, reading, now_ns);
    if (!records_.reclaim()) {
        sleep_for_ever();
    }
    return status;
}

void Tick::exchange_in(const TickTime& time) HAPTIC_RT {
    // The board answers only to a command: the one of the last tick, which with two exchanges it already has.
    const device::ExchangeStatus status = exchange(reading_, time.now_ns);
    in_ok_ = status == device::ExchangeStatus::Ok;
    instruments_.count(status);
    record_.exchange_in = static_cast<std::int8_t>(status);
    exchange_ns_ = lap();
    if (in_ok_ && motion_ns_ >= 0) {
        force_arrived(motion_ns_);  // of the tick before, with one exchange
    }
    motion_ns_ = in_ok_ ? started_ns_ : -1;
}

void Tick::force_arrived(std::int64_t latched_ns) HAPTIC_RT {
    timing_.motion_to_force_ns = stage_ns_ - latched_ns;
    instruments_.motion_to_force.record(timing_.motion_to_force_ns);
}

void Tick::measure_pose(const TickTime& time) HAPTIC_RT {
    jump_ = false;
    motion_ = PassivityMotion{};
    motion_.asked = held_command_.asked;
    if (!in_ok_) {
        return;
    }
    const std::int64_t since_latch_ns = latched_ ? time.now_ns - last_latch_ns_ : 0;
    if (!encoders_.update(reading_.counters, since_latch_ns)) {
        jump_ = true;
        return;
    }
    const Pose before = estimate_.pose;
    estimate_ = pose_solver_.solve(encoders_.lengths());
    if (safety_.state() == SafetyState::Running) {
        string_monitor_.update(encoders_.lengths(), estimate_);
    }
    velocity_.update(estimate_.pose, since_latch_ns);
    // The tensions were held, but the wrench turned with the strings: its mean over the way.
    const Wrench held_before = wrench_of_tensions(wires_, held_command_.tensions);
    wires_ = wire_matrix(settings_.variant, estimate_.pose);
    const Wrench held_after = wrench_of_tensions(wires_, held_command_.tensions);
    motion_.held = {0.5 * (held_before.force + held_after.force), 0.5 * (held_before.torque + held_after.torque)};
    motion_.moved = estimate_.pose.position - before.position;
    motion_.turned = rotation_between(before.orientation, estimate_.pose.orientation);
    motion_.elapsed_s = seconds(since_latch_ns);
    held_command_ = sent_command_;  // the board took the last command no later than now
    last_latch_ns_ = time.now_ns;
    latched_ = true;
}

void Tick::watch_health() HAPTIC_RT {
    TickHealth health;
    health.elapsed_ns = elapsed_ns_;
    health.exchange_ok = !exchange_failed_;
    health.jump = jump_;
    health.late = late_;
    health.finite = estimate_.status != PoseStatus::NonFinite;
    health.determined = estimate_.status != PoseStatus::RankDeficient;
    const StringSuspicion& suspicion = string_monitor_.suspicion();
    health.suspects = suspicion.strings;
    health.slack = suspicion.strings != 0 && suspicion.slack == suspicion.strings;
    record_.flags |= std::uint32_t{suspicion.strings} << HAPTIC_TICK_SUSPECTS_SHIFT;
    health.overheated = thermal_.overheated();
    health.residual = estimate_.residual;
    health.largest_movement = encoders_.largest_movement();
    if (const std::uint32_t cut = cut_.load(); cut != 0) {
        record_.cut = cut;
        safety_.cut(cut);
    }
    if (stop_button_says_stop()) {
        safety_.stop();
    }
    switch (safety_.update(health)) {
        case SafetyMachine::Calibration::None:
            break;
        case SafetyMachine::Calibration::Restart:
            encoders_.mark();
            break;
        case SafetyMachine::Calibration::Take:
            calibrate();
            break;
    }
}

bool Tick::stop_button_says_stop() const HAPTIC_RT {
    if (settings_.stop_button < 0 || !in_ok_) {
        return false;
    }
    const bool held = (reading_.buttons >> static_cast<unsigned>(settings_.stop_button) & 1U) != 0;
    return held != settings_.stop_when_released;
}

void Tick::calibrate() HAPTIC_RT {
    encoders_.calibrate();
    reset_pose();
    passivity_.reset();
    limiter_.reset();
    tension_solver_.reset();
}

void Tick::reset_pose() HAPTIC_RT {
    estimate_ = PoseEstimate{};
    pose_solver_.reset(estimate_.pose);
    string_monitor_.reset(estimate_.pose);
    velocity_.reset(estimate_.pose);
    motion_ = PassivityMotion{};
    wires_ = wire_matrix(settings_.variant, estimate_.pose);
}

void Tick::take_frame(const TickTime& time) HAPTIC_RT {
    if (!frames_->read_newest(renderer_.inbox())) {
        return;
    }
    const ContactFrame& frame = renderer_.inbox();
    const FrameDefect defect = renderer_.accept(time.now_ns);
    record_.frame_read = static_cast<std::int8_t>(defect);
    if (recorder_ != nullptr) {
        recorder_->push(time.now_ns, defect, frame);
    }
    if (defect == FrameDefect::None) {
        ++instruments_.frames_received;
        if (probes_ != nullptr) {
            show(probes_->frame, !probes_->frame.up());
        }
    } else {
        ++instruments_.frames_rejected;
        set_flag(true, HAPTIC_TICK_FRAME_REJECTED);
    }
}

void Tick::render_wrench(const TickTime& time) HAPTIC_RT {
    const Twist& velocity = velocity_.twist();
    const FrameRenderer::Result rendered = renderer_.render(estimate_.pose, velocity, time.now_ns, elapsed_ns_);
    record_.proxy = rendered.contact.proxy;
    record_.in_contact = rendered.contact.in_contact;
    record_.frame_sequence = rendered.frame_sequence;
    record_.frame_age_ns = rendered.frame_age_ns;
    timing_.state_age_ns = rendered.stale ? -1 : rendered.state_age_ns;
    set_flag(rendered.stale, HAPTIC_TICK_FRAME_STALE);
    set_flag(rendered.stiffness_limited, HAPTIC_TICK_STIFFNESS_LIMITED);
    if (!rendered.finite) {
        safety_.fault_nonfinite();
    }
    const bool running = safety_.state() == SafetyState::Running;
    limit_wrench(safety_.shape(running ? keep_passive(rendered.contact) : Wrench{}));
}

void Tick::limit_wrench(const Wrench& wanted) HAPTIC_RT {
    const SafetyState state = safety_.state();
    if (state != SafetyState::Running && state != SafetyState::Faulted) {
        limiter_.reset();
        return;
    }
    // The limits come last, so that they hold for what fades too. While the board does not answer, the wrench stands
    // still: what the motors hold is the last one that reached them, and the next that does must not be far from it.
    const bool stand_still = state == SafetyState::Running && !in_ok_;
    const WrenchLimiter::Result limited = limiter_.apply(wanted, stand_still ? 0 : elapsed_ns_);
    set_flag(limited.size_limited, HAPTIC_TICK_FORCE_LIMITED);
    set_flag(limited.rate_limited, HAPTIC_TICK_SLEW_LIMITED);
    record_.rendered = limited.wrench;
    safety_.felt(limited.wrench);
}

Wrench Tick::keep_passive(const Contact& contact) HAPTIC_RT {
    // With one exchange a tick the next command waits for the tick after.
    const double period_s = seconds(settings_.period_ns) * (settings_.exchanges == 1 ? 2.0 : 1.0);
    const Passivity::Result passive = passivity_.apply(motion_, {.wrench = contact.wrench,
                                                                 .stored = contact.stored,
                                                                 .surface_power = contact.surface_power,
                                                                 .elapsed_s = seconds(elapsed_ns_),
                                                                 .period_s = period_s});
    set_flag(passive.acted, HAPTIC_TICK_PASSIVITY_LIMITED);
    record_.energy = passivity_.energy();
    record_.rotation_energy = passivity_.rotation_energy();
    record_.passivity_scale = passive.scale;
    return passive.wrench;
}

void Tick::distribute() HAPTIC_RT {
    // Before calibration the directions of the strings are not known: all pull alike. A fault changes only the scale.
    const SafetyState state = safety_.state();
    if (state == SafetyState::Running) {
        solve_tensions_ = true;
    } else if (state != SafetyState::Faulted) {
        solve_tensions_ = false;
    }
    StringArray tensions{};
    if (solve_tensions_) {
        const TensionResult solved = tension_solver_.solve(wires_, record_.rendered);
        tensions = solved.tensions;
        set_flag(!solved.reached, HAPTIC_TICK_WRENCH_UNREACHABLE);
    } else {
        tensions.fill(settings_.variant.minimum_tension);
    }
    const double scale = safety_.tension_scale();
    const double most = settings_.tension_rate * seconds(settings_.period_ns);
    for (std::size_t i = 0; i < kStrings; ++i) {
        const double newtons_per_digit = settings_.variant.strings[i].newtons_per_digit;
        // The solver keeps to the rate; this is for the ramps, however short they were configured.
        sent_[i] =
            state == SafetyState::Disarmed ? 0.0 : std::clamp(scale * tensions[i], sent_[i] - most, sent_[i] + most);
        command_.digits[i] = device::digit_of_tension(sent_[i], newtons_per_digit);
        record_.tensions[i] = device::tension_of_digit(command_.digits[i], newtons_per_digit);
    }
    record_.made = wrench_of_tensions(wires_, record_.tensions);
    const Wrench& asked = record_.rendered;
    sent_command_ = {record_.tensions, asked.force != Vec3(0.0) || asked.torque != Vec3(0.0)};
}

void Tick::exchange_out(const TickTime& time) HAPTIC_RT {
    bool out_ok = true;
    if (settings_.exchanges == 2) {
        const device::ExchangeStatus status = exchange(unused_, time.now_ns);
        out_ok = status == device::ExchangeStatus::Ok;
        instruments_.count(status);
        record_.exchange_out = static_cast<std::int8_t>(status);
    }
    timing_.of(TickStage::Exchange) = exchange_ns_ + lap();
    instruments_.exchange.record(timing_.of(TickStage::Exchange));
    if (settings_.exchanges == 2) {
        if (out_ok && motion_ns_ >= 0) {
            force_arrived(motion_ns_);
        }
        motion_ns_ = -1;
    }
    exchange_failed_ = !in_ok_ || !out_ok;
    set_flag(exchange_failed_, HAPTIC_TICK_EXCHANGE_FAILED);
    for (std::size_t i = 0; i < kStrings; ++i) {
        // A command whose answer is missing may have arrived or not.
        held_[i] = out_ok ? record_.tensions[i] : std::max(held_[i], record_.tensions[i]);
    }
    if (settings_.exchanges == 2 && out_ok) {
        held_command_ = sent_command_;
    }
}

void Tick::publish(const TickTime& time) HAPTIC_RT {
    const Twist& velocity = velocity_.twist();
    record_.pose = estimate_.pose;
    record_.velocity = velocity;
    record_.residual = estimate_.residual;
    record_.buttons = reading_.buttons;
    record_.rotary = reading_.rotary;
    record_.counters = reading_.counters;
    record_.analog = reading_.analog;
    record_.command = command_;
    record_.safety_state = static_cast<std::uint32_t>(safety_.state());
    record_.faults = safety_.faults();

    state_.latch_time_ns = last_latch_ns_;
    state_.frame_sequence = record_.frame_sequence;
    store(record_.pose.position, state_.position);
    store(record_.pose.orientation, state_.orientation);
    store(velocity.linear, state_.linear_velocity);
    store(velocity.angular, state_.angular_velocity);
    store(record_.made.force, state_.force);
    store(record_.made.torque, state_.torque);
    store(record_.proxy, state_.proxy_position);
    std::copy(record_.tensions.begin(), record_.tensions.end(), std::begin(state_.tension));
    state_.safety_state = record_.safety_state;
    state_.faults = record_.faults;
    state_.tick_flags = record_.flags;
    state_.buttons = record_.buttons;
    states_->publish(state_, time.now_ns);
}

void Tick::finish(const TickTime& time) HAPTIC_RT {
    Instruments& m = instruments_;
    m.peak_force = std::max(m.peak_force, glm::length(record_.rendered.force));
    m.peak_torque = std::max(m.peak_torque, glm::length(record_.rendered.torque));
    m.failed_exchanges += (record_.flags & HAPTIC_TICK_EXCHANGE_FAILED) != 0 ? 1u : 0u;
    m.stale_ticks += (record_.flags & HAPTIC_TICK_FRAME_STALE) != 0 ? 1u : 0u;
    m.unreachable_ticks += (record_.flags & HAPTIC_TICK_WRENCH_UNREACHABLE) != 0 ? 1u : 0u;
    m.stiffness_limited_ticks += (record_.flags & HAPTIC_TICK_STIFFNESS_LIMITED) != 0 ? 1u : 0u;
    m.passivity_ticks += (record_.flags & HAPTIC_TICK_PASSIVITY_LIMITED) != 0 ? 1u : 0u;
    m.least_energy = std::min(m.least_energy, record_.energy);
    m.contact_ticks += record_.in_contact > 0 ? 1u : 0u;
    m.derated_ticks += (record_.flags & HAPTIC_TICK_DERATED) != 0 ? 1u : 0u;
    m.probe_off_ticks += (record_.flags & HAPTIC_TICK_PROBE_OFF) != 0 ? 1u : 0u;
    for (std::size_t i = 0; i < kStrings; ++i) {
        m.peak_motor_load[i] = std::max(m.peak_motor_load[i], thermal_.loads()[i]);
    }
    if (record_.frame_age_ns >= 0) {
        m.frame_age.record(record_.frame_age_ns);
    }
    if (timing_.state_age_ns >= 0) {
        m.state_age.record(timing_.state_age_ns);
    }
    last_now_ns_ = time.now_ns;
    first_ = false;

    const std::int64_t ended_ns = clock_();
    timing_.of(TickStage::Record) = ended_ns - stage_ns_;
    record_.compute_ns = ended_ns - started_ns_;
    m.compute.record(record_.compute_ns);
    black_box_.push(record_);
    if (recorder_ != nullptr) {
        recorder_->push(record_);
    }
    if (probes_ != nullptr) {
        show(probes_->tick, false);
    }
    heart_.beat();
}

void Tick::show(Probe& probe, bool up) HAPTIC_RT {
    if (!probe.present() || probe.off()) {
        return;
    }
    const std::int64_t before_ns = clock_();
    probe.set(up);
    instruments_.probe_edge.record(clock_() - before_ns);
}

bool RingFrames::read_newest(ContactFrame& frame) HAPTIC_RT {
    return reader_->read_newest(frame);
}

bool Tick::abandon() HAPTIC_RT {
    if (!records_.take()) {
        return false;
    }
    // The tick that hangs is the last one in the black box, with the reason.
    safety_.cut(cut_.load());
    record_.safety_state = static_cast<std::uint32_t>(safety_.state());
    record_.faults = safety_.faults();
    black_box_.push(record_);
    return true;
}

device::ExchangeStatus Tick::send_zero(std::int64_t now_ns) HAPTIC_RT {
    command_ = device::MotorCommand{};
    return exchange(unused_, now_ns);
}

std::int64_t Tick::lap() HAPTIC_RT {
    const std::int64_t now_ns = clock_();
    const std::int64_t taken_ns = now_ns - stage_ns_;
    stage_ns_ = now_ns;
    return taken_ns;
}

}  // namespace haptic::rt
