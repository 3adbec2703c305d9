#include "tick/tick.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <utility>

#include "haptic/device/dac_codes.hpp"
#include "rendering/wrench_arithmetic.hpp"
#include "tick/tick_syscalls.hpp"

namespace haptic::rt {
namespace {

// Periods; after an interruption, rate limits advance by at most this much, so that no output jumps.
constexpr std::int64_t kMaxElapsedPeriods = 2;

}  // namespace

Tick::Tick(const TickSettings& settings, device::Board& board, RingReader<ContactFrame>& frames,
           RingWriter<DeviceState>& states, StageClock clock)
    : Tick(settings, board, std::make_unique<RingFrames>(frames), nullptr, states, clock) {}

Tick::Tick(const TickSettings& settings, device::Board& board, FrameSource& frames, RingWriter<DeviceState>& states,
           StageClock clock)
    : Tick(settings, board, nullptr, &frames, states, clock) {}

Tick::Tick(const TickSettings& settings, device::Board& board, std::unique_ptr<FrameSource> owned, FrameSource* frames,
           RingWriter<DeviceState>& states, StageClock clock)
    : settings_(checked(settings)),
      board_(&board),
      owned_frames_(std::move(owned)),
      intake_in_tick_(frames != nullptr ? *frames : *owned_frames_),
      states_(&states),
      clock_(clock),
      encoders_(settings.geometry, settings.maximum_string_speed),
      pose_solver_(settings.geometry),
      string_monitor_(settings.geometry, {.residual = settings.safety.residual}),
      velocity_({.window_ticks = settings.velocity_window_ticks, .noise = quantisation_noise(settings.geometry)}),
      renderer_(settings.frames),
      passivity_(settings.passivity, settings.limits),
      overlay_(settings.overlay),
      limiter_(settings.limits),
      limiter_without_overlay_(settings.limits),
      budget_(settings.budget),
      safety_(settings.safety),
      proof_(settings.geometry, settings.proof, settings.safety.prove),
      thermal_(thermal_settings(settings)),
      tension_solver_(tension_settings(settings)),
      idle_solver_(tension_settings(settings)),
      black_box_(static_cast<std::size_t>(settings.black_box_ns / settings.period_ns)),
      instruments_(std::make_unique<Instruments>(settings.period_ns)) {}

void Tick::run(const TickTime& time) HAPTIC_RT {
    // Measure: the pose, the motion since the last tick, and the faults of this one.
    begin(time);
    exchange_in(time);
    update_thermal_model();
    measure_pose(time);
    integrate_wrench();
    spend_budget();
    check_health();
    mark_stage(instruments_->pose, TickStage::Pose);
    // Render: the wrench of the newest contact frame at this pose, within all bounds.
    read_frame(time);
    read_overlay(time);
    render_wrench(time);
    mark_stage(instruments_->proxy, TickStage::Proxy);
    // Act: the tensions that make the wrench, sent in this tick if there is a second exchange.
    solve_tensions();
    mark_stage(instruments_->tension, TickStage::Tension);
    exchange_out(time);
    // Report to the simulation and to the records.
    publish(time);
    mark_stage(instruments_->publish, TickStage::Publish);
    finish(time);
}

void Tick::begin(const TickTime& time) HAPTIC_RT {
    // Start of the tick: probe and stage clock.
    started_ns_ = clock_();
    stage_ns_ = started_ns_;
    if (probes_ != nullptr) {
        set_probe(probes_->tick, true);
        stage_ns_ = clock_();
    }
    record_ = TickRecord{};
    timing_ = TickTiming{};
    if (stop_requested_.load()) {
        stop();
    }
    // Inputs of this tick.
    record_.deadline_ns = time.deadline_ns;
    record_.now_ns = time.now_ns;
    record_.missed = time.missed;
    record_.number = ++number_;
    record_.requests = requests_;
    requests_ = 0;
    // Elapsed time, clamped for rates; lateness: the time since the first of the deadlines that were missed.
    record_.period_ns = first_ ? 0 : time.now_ns - last_now_ns_;
    elapsed_ns_ = first_ ? settings_.period_ns
                         : std::clamp<std::int64_t>(record_.period_ns, 0, kMaxElapsedPeriods * settings_.period_ns);
    const bool late = time.missed > 0 || time.now_ns - time.deadline_ns >= settings_.period_ns;
    late_ns_ = late ? time.now_ns - time.deadline_ns + time.missed * settings_.period_ns : 0;
    set_flag(late, HAPTIC_TICK_OVERRUN);
    set_flag(awaits_person_, HAPTIC_TICK_ARM_AWAITED);
    set_flag(settings_.commissioning, HAPTIC_TICK_COMMISSIONING);
    set_flag(probes_ != nullptr && (probes_->tick.off() || probes_->frame.off()), HAPTIC_TICK_PROBE_OFF);

    // Wake-up statistics.
    ++instruments_->ticks;
    instruments_->overruns += static_cast<std::uint64_t>(std::max<std::int64_t>(time.missed, 0));
    instruments_->wakeup.record(time.now_ns - time.deadline_ns);
    if (!first_) {
        instruments_->period.record(record_.period_ns);
    }
}

void Tick::update_thermal_model() HAPTIC_RT {
    // The unclamped time: while the process was stopped, the motors kept pulling.
    thermal_.update(held_, record_.period_ns);
    StringArray bounds = thermal_.bounds();
    for (double& bound : bounds) {
        bound = std::min(bound, proof_.max_tension());
    }
    tension_solver_.set_maxima(bounds);
    idle_solver_.set_maxima(bounds);
    set_flag(thermal_.derated(), HAPTIC_TICK_DERATED);
}

void Tick::arm() HAPTIC_RT {
    requests_ |= kRequestArm;
    if (safety_.state() != SafetyState::Disarmed) {
        return;
    }
    safety_.arm();
    proof_.begin();
    awaits_person_ = false;
    encoders_.restart();
    latched_ = false;
    reset_pose();
}

template <class Call>
device::ExchangeStatus Tick::lend_records(const Call& call) HAPTIC_RT {
    // A call of the board can hang, so the records are lent to the watchdog meanwhile. If it took them, this thread
    // must not touch them again.
    records_.lend();
    const device::ExchangeStatus status = call();
    if (!records_.reclaim()) {
        sleep_for_ever();
    }
    return status;
}

device::ExchangeStatus Tick::exchange(device::BoardReading& reading, std::int64_t now_ns) HAPTIC_RT {
    return lend_records([&]() HAPTIC_RT { return board_->exchange(command_, reading, now_ns); });
}

device::ExchangeStatus Tick::send(std::int64_t now_ns) HAPTIC_RT {
    return lend_records([&]() HAPTIC_RT { return board_->send(command_, now_ns); });
}

device::ExchangeStatus Tick::collect(std::int64_t now_ns) HAPTIC_RT {
    return lend_records([&]() HAPTIC_RT { return board_->collect(now_ns); });
}

void Tick::collect_answer(const TickTime& time) HAPTIC_RT {
    answer_lost_ = false;
    if (!board_->answer_due()) {
        return;
    }
    const device::ExchangeStatus status = collect(time.now_ns);
    record_.exchange_collected = static_cast<std::int8_t>(status);
    const std::int64_t motion_to_force_ns = std::exchange(unanswered_ns_, -1);
    if (status == device::ExchangeStatus::Ok) {
        if (motion_to_force_ns >= 0) {
            instruments_->motion_to_force.record(motion_to_force_ns);
        }
        return;
    }
    // The command may have arrived or not: as if the exchange of the last tick had failed.
    answer_lost_ = true;
    exchange_failed_ = true;
    instruments_->recount(status);
    for (std::size_t i = 0; i < kStrings; ++i) {
        held_[i] = std::max(held_before_[i], held_[i]);
    }
    held_command_ = held_before_command_;
}

void Tick::exchange_in(const TickTime& time) HAPTIC_RT {
    collect_answer(time);
    // The board answers only to a command, so the last one is sent again; with two exchanges the board already has it.
    const device::ExchangeStatus status = exchange(reading_, time.now_ns);
    in_ok_ = status == device::ExchangeStatus::Ok;
    // Count the outcome, and keep the time until the second exchange adds its own.
    instruments_->count(status);
    record_.exchange_in = static_cast<std::int8_t>(status);
    exchange_ns_ = lap();
    // A latch begins a measurement of motion-to-force; the exchange that sends its command ends it.
    if (in_ok_ && motion_ns_ >= 0) {
        record_motion_to_force(motion_ns_);  // with one exchange: of the tick before
    }
    motion_ns_ = in_ok_ ? started_ns_ : -1;
}

void Tick::record_motion_to_force(std::int64_t latched_ns) HAPTIC_RT {
    timing_.motion_to_force_ns = stage_ns_ - latched_ns;
    // A command whose answer is still due counts once that has come: until then it may have been lost.
    if (board_->answer_due()) {
        unanswered_ns_ = timing_.motion_to_force_ns;
    } else {
        instruments_->motion_to_force.record(timing_.motion_to_force_ns);
    }
}

void Tick::measure_pose(const TickTime& time) HAPTIC_RT {
    // Without a valid latch the pose stays, and no motion is reported to the passivity observer.
    jump_ = false;
    motion_ = PassivityMotion{};
    if (safety_.state() == SafetyState::Disarmed) {
        // A board that was lost has not taken the zeros; it got them when it was opened again. What it held before must
        // not count for the time in between.
        held_command_ = HeldCommand{};
    }
    motion_.requested = held_command_.requested;
    held_contact_ = held_command_.contact;
    held_overlay_ = held_command_.overlay;
    if (!in_ok_) {
        return;
    }
    // Counts to lengths; a jump rejects the latch.
    const std::int64_t since_latch_ns = latched_ ? time.now_ns - last_latch_ns_ : 0;
    if (!encoders_.update(reading_.counters, since_latch_ns)) {
        jump_ = true;
        return;
    }
    // Pose, string suspicion and velocity.
    const Pose before = estimate_.pose;
    estimate_ = pose_solver_.solve(encoders_.lengths());
    if (safety_.state() == SafetyState::Running) {
        string_monitor_.update(encoders_.lengths(), estimate_);
    }
    velocity_.update(estimate_.pose, since_latch_ns);
    // The tensions were held, but the wrench changed with the strings' directions: mean of begin and end.
    const Wrench held_before = wrench_of_tensions(wires_, held_command_.tensions);
    wires_ = wire_matrix(settings_.geometry, estimate_.pose);
    const Wrench held_after = wrench_of_tensions(wires_, held_command_.tensions);
    motion_.held = {0.5 * (held_before.force + held_after.force), 0.5 * (held_before.torque + held_after.torque)};
    // Motion over which the held wrench did its work.
    motion_.displacement = estimate_.pose.position - before.position;
    motion_.rotation = rotation_between(before.orientation, estimate_.pose.orientation);
    motion_.elapsed_s = seconds(since_latch_ns);
    held_command_ = sent_command_;  // the board took the last command no later than now
    if (safety_.state() != SafetyState::Disarmed) {
        instruments_->max_latch_gap_ns = std::max(instruments_->max_latch_gap_ns, since_latch_ns);
    }
    last_latch_ns_ = time.now_ns;
    latched_ = true;
}

void Tick::integrate_wrench() HAPTIC_RT {
    // The whole time since the last tick: while the process was stopped, the motors kept pulling.
    const double elapsed_s = seconds(record_.period_ns);
    impulse_.force += elapsed_s * held_contact_.force;
    impulse_.torque += elapsed_s * held_contact_.torque;
}

void Tick::spend_budget() HAPTIC_RT {
    // Work of the strings on the grip, whatever they pulled for.
    const double work =
        glm::dot(motion_.held.force, motion_.displacement) + glm::dot(motion_.held.torque, motion_.rotation);
    budget_.update(work, seconds(record_.period_ns), safety_.state() == SafetyState::Running);
    set_flag(budget_.warns(), HAPTIC_TICK_BUDGET_LOW);
    if (budget_.spent()) {
        safety_.fault_budget();
    }
}

void Tick::check_health() HAPTIC_RT {
    // Exchanges of the last tick; timing and pose of this one.
    TickHealth health;
    health.elapsed_ns = record_.period_ns > 0 ? record_.period_ns : settings_.period_ns;
    health.late_ns = late_ns_;
    health.exchange_ok = !exchange_failed_;
    health.encoder_age_ns = latched_ && !in_ok_ ? record_.now_ns - last_latch_ns_ : 0;
    health.jump = jump_;
    health.finite = estimate_.status != PoseStatus::NonFinite;
    health.determined = estimate_.status != PoseStatus::RankDeficient;
    // The suspects count as slack only if every one of them reads too long.
    const StringSuspicion& suspicion = string_monitor_.suspicion();
    health.suspects = jump_ ? encoders_.jumped() : suspicion.strings;
    health.slack = suspicion.strings != 0 && suspicion.slack == suspicion.strings;
    // Suspects as flags of the tick; motor load, residual and string movement.
    record_.flags |= std::uint32_t{suspicion.strings} << HAPTIC_TICK_SUSPECTS_SHIFT;
    health.overheated = thermal_.overheated();
    health.residual = estimate_.residual;
    health.largest_movement = encoders_.largest_movement();
    update_proof(health);
    // Requests from other threads and the stop button come before the state machine's own step.
    if (const std::uint32_t cut = cut_.load(); cut != 0) {
        record_.cut = cut;
        safety_.cut(cut);
    }
    if (stop_button_active()) {
        safety_.stop();
    }
    // Step of the safety machine; the calibration acts on the encoders.
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

void Tick::update_proof(TickHealth& health) HAPTIC_RT {
    if (safety_.state() == SafetyState::Proving) {
        health.wiring = proof_.prove_wiring(encoders_.lengths(), health.elapsed_ns);
        health.suspects = health.wiring == Proof::Refused ? proof_.suspects() : health.suspects;
    } else if (safety_.state() == SafetyState::Running && in_ok_) {
        health.pose = proof_.prove_pose(encoders_.lengths(), estimate_, wires_);
        // Only where a fault may need it: it costs as much as the rest of the proof.
        const bool contradicted = health.residual > settings_.safety.residual || health.pose == Proof::Refused;
        health.mixed_up = health.pose != Proof::Passed && contradicted ? proof_.suspects() : std::uint8_t{0};
    }
}

bool Tick::stop_button_active() const HAPTIC_RT {
    if (settings_.stop_button < 0 || !in_ok_) {
        return false;
    }
    const bool held = (reading_.buttons >> static_cast<unsigned>(settings_.stop_button) & 1U) != 0;
    return held != settings_.stop_when_released;
}

void Tick::calibrate() HAPTIC_RT {
    encoders_.calibrate();
    proof_.begin_pose();
    reset_pose();
    passivity_.reset();
    overlay_.reset();
    limiter_.reset();
    limiter_without_overlay_.reset();
    tension_solver_.reset();
    idle_solver_.reset();
}

void Tick::reset_pose() HAPTIC_RT {
    estimate_ = PoseEstimate{};
    pose_solver_.reset(estimate_.pose);
    string_monitor_.reset(estimate_.pose);
    velocity_.reset(estimate_.pose);
    motion_ = PassivityMotion{};
    wires_ = wire_matrix(settings_.geometry, estimate_.pose);
}

void Tick::read_frame(const TickTime& time) HAPTIC_RT {
    // Only the newest frame counts; older ones in the ring are skipped.
    if (!intake_->take(renderer_.inbox(), time.deadline_ns)) {
        return;
    }
    // Valid frames replace the one in use; defective ones are recorded and counted only.
    const ContactFrame& frame = renderer_.inbox()->frame;
    const FrameDefect defect = renderer_.accept(time.now_ns);
    record_.frame_read = static_cast<std::int8_t>(defect);
    if (recorder_ != nullptr) {
        recorder_->push(time.now_ns, defect, frame);
    }
    if (defect == FrameDefect::None) {
        ++instruments_->frames_received;
        if (probes_ != nullptr) {
            set_probe(probes_->frame, !probes_->frame.up());
        }
    } else {
        ++instruments_->frames_rejected;
        set_flag(true, HAPTIC_TICK_FRAME_REJECTED);
    }
}

void Tick::read_overlay(const TickTime& time) HAPTIC_RT {
    WrenchOverlay received{};
    if (overlays_ == nullptr || !overlays_->read_newest(received)) {
        return;
    }
    if (!overlay_.accept(received, time.now_ns)) {
        record_.overlay_read = kOverlayRefused;
        ++instruments_->overlays_refused;
        return;
    }
    record_.overlay_read = kOverlayAccepted;
    record_.overlay_time_ns = received.arrival_time_ns;
    record_.overlay = {to_vec3(received.force), to_vec3(received.torque)};
    ++instruments_->overlays_received;
}

void Tick::render_wrench(const TickTime& time) HAPTIC_RT {
    // Wrench of the frame at this pose.
    FrameRenderer::Result rendered = renderer_.render(estimate_.pose, time.now_ns, elapsed_ns_);
    intake_->expect(renderer_.next_start());
    // Values for the record and the flags.
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
    // Walls of the workspace, passivity, the overlay, then the safety machine, then the limits.
    const bool running = safety_.state() == SafetyState::Running;
    if (running) {
        push_back(rendered);
    }
    const Wrench passive = running ? apply_passivity(rendered) : Wrench{};
    const Wrench overlay = render_overlay(time, running);
    Wrench wanted = passive;
    if (!is_zero(overlay)) {
        wanted = sum(passive, overlay);
    }
    // Until movement has proved the pose, only as much as cannot push.
    if (running) {
        proof_.advance(seconds(elapsed_ns_));
    }
    const double proved = proof_.wrench_scale(wanted);
    wanted = scaled(proved, wanted);
    set_flag(running && proof_.limits(), HAPTIC_TICK_UNPROVEN);
    limit_wrench(safety_.permitted_wrench(wanted), scaled(proved, passive));
    if (running) {
        separate_pushes(rendered);
    }
    // What the simulation may apply to its bodies.
    record_.stiffness = rendered.finite ? rendered.stiffness : 0.0;
    record_.scale =
        running && rendered.finite ? proved * proof_.tension_scale() * rendered.scale * record_.passivity_scale : 0.0;
}

/// Adds the walls of the workspace to the wrench of the frame, with their energy, so that the passivity observer
/// accounts for both. Inside the region nothing changes, not even the sign of a zero.
void Tick::push_back(FrameRenderer::Result& rendered) HAPTIC_RT {
    const Wrench& asked = rendered.contact.wrench;
    frame_requests_ = !is_zero(asked);
    walls_ = push_of_walls(settings_.walls, estimate_.pose, velocity_.twist());
    set_flag(walls_.pushes, HAPTIC_TICK_WORKSPACE_EDGE);
    if (walls_.pushes) {
        rendered.contact.wrench.force += walls_.wrench.force;
        rendered.contact.wrench.torque += walls_.wrench.torque;
        rendered.contact.stored += walls_.stored;
    }
}

/// The overlay comes after the passivity controller, which must not take it for a contact, and before all bounds.
Wrench Tick::render_overlay(const TickTime& time, bool running) HAPTIC_RT {
    // A pose that is not proved may be wrong, and the wrench with it.
    if (overlays_ == nullptr || !running || proof_.limits()) {
        overlay_.reset();
        return Wrench{};
    }
    const Wrench overlay = yielding(overlay_.render(time.now_ns, elapsed_ns_), walls_, settings_.walls);
    set_flag(!is_zero(overlay), HAPTIC_TICK_OVERLAY);
    return overlay;
}

void Tick::limit_wrench(const Wrench& wanted, const Wrench& without_overlay) HAPTIC_RT {
    const SafetyState state = safety_.state();
    if (state != SafetyState::Running && state != SafetyState::Faulted) {
        limiter_.reset();
        limiter_without_overlay_.reset();
        pushes_ = Pushes{};
        return;
    }
    // The limits come last, so that they hold for a fading wrench too. While the board does not answer, the wrench is
    // held: the motors hold the last command that reached them, and the next one to arrive must not be far from it.
    const bool hold_wrench = state == SafetyState::Running && !in_ok_;
    const std::int64_t elapsed_ns = hold_wrench ? 0 : elapsed_ns_;
    const Wrench before = limiter_.last();
    const WrenchLimiter::Result limited = limiter_.apply(wanted, elapsed_ns);
    // Report the limits that acted. A fault fades out from the limited wrench.
    set_flag(limited.size_limited, HAPTIC_TICK_FORCE_LIMITED);
    set_flag(limited.rate_limited, HAPTIC_TICK_SLEW_LIMITED);
    record_.rendered = limited.wrench;
    safety_.set_rendered(limited.wrench);
    if (state == SafetyState::Running) {
        // The overlay's part: what the same limits, with a history of their own, would not have rendered without it.
        pushes_.overlay =
            overlays_ != nullptr
                ? difference(limited.wrench, limiter_without_overlay_.apply(without_overlay, elapsed_ns).wrench)
                : Wrench{};
        return;
    }
    // A fault fades all parts alike.
    pushes_.walls = shortened(pushes_.walls, before, limited.wrench);
    pushes_.overlay = shortened(pushes_.overlay, before, limited.wrench);
}

/// The part of the walls in what is rendered beside the overlay: all of it is asked of the passivity controller
/// together, and reduced alike.
void Tick::separate_pushes(const FrameRenderer::Result& rendered) HAPTIC_RT {
    pushes_.walls = Wrench{};
    if (walls_.pushes) {
        const double asked = size_of(rendered.contact.wrench);
        const double made = size_of(difference(record_.rendered, pushes_.overlay));
        pushes_.walls = scaled(asked > 0.0 ? std::min(1.0, made / asked) : 0.0, walls_.wrench);
    }
}

Wrench Tick::apply_passivity(const FrameRenderer::Result& rendered) HAPTIC_RT {
    // With one exchange per tick the next command is sent a tick later.
    const double period_s = seconds(settings_.period_ns) * (settings_.exchanges == 1 ? 2.0 : 1.0);
    // The work of the overlay is not that of the contact.
    PassivityMotion motion = motion_;
    motion.held = difference(motion.held, held_overlay_);
    const Passivity::Result passive = passivity_.apply(motion, {.wrench = rendered.contact.wrench,
                                                                .stored = rendered.contact.stored,
                                                                .surface_power = rendered.contact.surface_power,
                                                                .reported = rendered.reported,
                                                                .body_work = rendered.body_work,
                                                                .elapsed_s = seconds(elapsed_ns_),
                                                                .period_s = period_s});
    // Energies of both observers, and gamma.
    set_flag(passive.acted, HAPTIC_TICK_PASSIVITY_LIMITED);
    record_.energy = passivity_.energy();
    record_.rotation_energy = passivity_.rotation_energy();
    record_.passivity_scale = passive.scale;
    return passive.wrench;
}

void Tick::solve_tensions() HAPTIC_RT {
    // Before calibration the strings' directions are unknown: equal tensions. A fault keeps the solver and fades the
    // scale.
    const SafetyState state = safety_.state();
    if (state == SafetyState::Running) {
        directions_known_ = true;
    } else if (state != SafetyState::Faulted) {
        directions_known_ = false;
    }
    // Quadratic programme of tension.hpp, or the minimum tension in every string.
    StringArray tensions{};
    Wrench overlay = pushes_.overlay;
    if (directions_known_) {
        const TensionResult solved = tension_solver_.solve(wires_, record_.rendered);
        tensions = solved.tensions;
        set_flag(!solved.reached, HAPTIC_TICK_WRENCH_UNREACHABLE);
        // What the strings cannot make is missing from the overlay as from the contact.
        overlay = solved.reached ? overlay : shortened(overlay, record_.rendered, solved.wrench);
    } else {
        tensions.fill(settings_.geometry.minimum_tension);
    }
    // Scale by the safety machine's ramp and by the proof, bound the change, and convert to DAC codes.
    double scale = safety_.tension_scale() * proof_.tension_scale();
    if (state == SafetyState::Proving) {
        tensions = proof_.wiring_tensions();
        scale = 1.0;
    }
    const double max_change = settings_.tension_rate * seconds(settings_.period_ns);
    for (std::size_t i = 0; i < kStrings; ++i) {
        const double newtons_per_code = settings_.geometry.strings[i].newtons_per_code;
        // The solver respects the rate; this bounds the ramps, however short they are configured.
        sent_[i] = state == SafetyState::Disarmed
                       ? 0.0
                       : std::clamp(scale * tensions[i], sent_[i] - max_change, sent_[i] + max_change);
        command_.dac_codes[i] = device::dac_code_of_tension(sent_[i], newtons_per_code);
        record_.tensions[i] = device::tension_of_dac_code(command_.dac_codes[i], newtons_per_code);
    }
    // The wrench that the tensions of these DAC codes make, and the command as the passivity observer needs it.
    record_.made = wrench_of_tensions(wires_, record_.tensions);
    overlay = scaled(scale, overlay);
    const bool requested = !is_zero(difference(record_.rendered, pushes_.overlay));
    sent_command_ = {record_.tensions, requested, requested ? contact_wrench(scale, overlay) : Wrench{}, overlay};
}

/// The wrench of the sent tensions before they are rounded to DAC codes, less the one that the strings would exert here
/// anyway: their minimum tensions cancel only where they are wrench-closed. Less the pushes, too.
Wrench Tick::contact_wrench(double scale, const Wrench& overlay) HAPTIC_RT {
    const Wrench sent = wrench_of_tensions(wires_, sent_);
    const Wrench idle = directions_known_ ? idle_solver_.solve(wires_, Wrench{}).wrench : Wrench{};
    const Wrench all = difference(sent, scaled(scale, idle));
    // Nothing but walls: without a rest of what the tensions could not make.
    if (walls_.pushes && !frame_requests_) {
        return Wrench{};
    }
    // The pushes are no contact: the bodies of the simulation must not be pushed with them.
    return difference(difference(all, scaled(scale, pushes_.walls)), overlay);
}

void Tick::exchange_out(const TickTime& time) HAPTIC_RT {
    // Second exchange: the motors, in this same tick. A board that can leaves its answer to the next tick; until then
    // the command counts as taken. With one exchange the next tick sends it, and this one knows of the command before.
    bool out_ok = settings_.exchanges == 2 || in_ok_;
    if (settings_.exchanges == 2) {
        const device::ExchangeStatus status = send(time.now_ns);
        out_ok = status == device::ExchangeStatus::Ok;
        instruments_->count(status);
        record_.exchange_out = static_cast<std::int8_t>(status);
    }
    // Timing: both exchanges, and the latency from latch to force.
    timing_.of(TickStage::Exchange) = exchange_ns_ + lap();
    instruments_->exchange.record(timing_.of(TickStage::Exchange));
    if (settings_.exchanges == 2) {
        if (out_ok && motion_ns_ >= 0) {
            record_motion_to_force(motion_ns_);
        }
        motion_ns_ = -1;
    }
    exchange_failed_ = !in_ok_ || !out_ok;
    set_flag(exchange_failed_ || answer_lost_, HAPTIC_TICK_EXCHANGE_FAILED);
    // Tensions that the motors hold from here on.
    held_before_ = held_;
    held_before_command_ = held_command_;
    for (std::size_t i = 0; i < kStrings; ++i) {
        // A command without an answer may have arrived or not: assume the larger tension, for the thermal model.
        held_[i] = out_ok ? record_.tensions[i] : std::max(held_[i], record_.tensions[i]);
    }
    if (settings_.exchanges == 2 && out_ok) {
        held_command_ = sent_command_;
    }
}

void Tick::publish(const TickTime& time) HAPTIC_RT {
    // Rest of the tick record.
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

    // Device state for the simulation.
    state_.latch_time_ns = last_latch_ns_;
    state_.frame_sequence = record_.frame_sequence;
    // Motion, and the force that the hand feels.
    store(record_.pose.position, state_.position);
    store(record_.pose.orientation, state_.orientation);
    store(velocity.linear, state_.linear_velocity);
    store(velocity.angular, state_.angular_velocity);
    store(record_.made.force, state_.force);
    store(record_.made.torque, state_.torque);
    store(record_.proxy, state_.proxy_position);
    // The part of the frame's coupling that is rendered, and what the hand has received in all.
    state_.stiffness = record_.stiffness;
    state_.scale = record_.scale;
    store(impulse_.force, state_.impulse);
    store(impulse_.torque, state_.angular_impulse);
    // State of the device, and the user's inputs.
    std::copy(record_.tensions.begin(), record_.tensions.end(), std::begin(state_.tension));
    state_.safety_state = record_.safety_state;
    state_.faults = record_.faults;
    state_.tick_flags = record_.flags;
    state_.buttons = record_.buttons;
    states_->publish(state_, time.now_ns);
}

void Tick::finish(const TickTime& time) HAPTIC_RT {
    // Peaks; the report compares them with the strings' reach at the same pose.
    Instruments& m = *instruments_;
    const double force = glm::length(record_.rendered.force);
    if (force > m.peak_force) {
        m.peak_force = force;
        m.at_peak_force = {record_.rendered, record_.pose};
    }
    const double torque = glm::length(record_.rendered.torque);
    if (torque > m.peak_torque) {
        m.peak_torque = torque;
        m.at_peak_torque = {record_.rendered, record_.pose};
    }
    // One count per tick and condition, from the flags.
    m.failed_exchanges += (record_.flags & HAPTIC_TICK_EXCHANGE_FAILED) != 0 ? 1u : 0u;
    m.stale_ticks += (record_.flags & HAPTIC_TICK_FRAME_STALE) != 0 ? 1u : 0u;
    m.unreachable_ticks += (record_.flags & HAPTIC_TICK_WRENCH_UNREACHABLE) != 0 ? 1u : 0u;
    m.force_limited_ticks += (record_.flags & HAPTIC_TICK_FORCE_LIMITED) != 0 ? 1u : 0u;
    m.slew_limited_ticks += (record_.flags & HAPTIC_TICK_SLEW_LIMITED) != 0 ? 1u : 0u;
    m.stiffness_limited_ticks += (record_.flags & HAPTIC_TICK_STIFFNESS_LIMITED) != 0 ? 1u : 0u;
    m.passivity_ticks += (record_.flags & HAPTIC_TICK_PASSIVITY_LIMITED) != 0 ? 1u : 0u;
    m.min_energy = std::min(m.min_energy, record_.energy);
    m.contact_ticks += record_.in_contact > 0 ? 1u : 0u;
    m.unproven_ticks += (record_.flags & HAPTIC_TICK_UNPROVEN) != 0 ? 1u : 0u;
    m.derated_ticks += (record_.flags & HAPTIC_TICK_DERATED) != 0 ? 1u : 0u;
    m.overlay_ticks += (record_.flags & HAPTIC_TICK_OVERLAY) != 0 ? 1u : 0u;
    m.edge_ticks += (record_.flags & HAPTIC_TICK_WORKSPACE_EDGE) != 0 ? 1u : 0u;
    m.budget_low_ticks += (record_.flags & HAPTIC_TICK_BUDGET_LOW) != 0 ? 1u : 0u;
    m.commissioning_ticks += (record_.flags & HAPTIC_TICK_COMMISSIONING) != 0 ? 1u : 0u;
    m.probe_off_ticks += (record_.flags & HAPTIC_TICK_PROBE_OFF) != 0 ? 1u : 0u;
    record_link_quality();
    // Motor loads, and ages of what was rendered; negative: none.
    for (std::size_t i = 0; i < kStrings; ++i) {
        m.peak_motor_load[i] = std::max(m.peak_motor_load[i], thermal_.loads()[i]);
    }
    if (record_.frame_age_ns >= 0) {
        m.frame_age.record(record_.frame_age_ns);
    }
    if (timing_.state_age_ns >= 0) {
        m.state_age.record(timing_.state_age_ns);
    }
    // History for the next tick.
    last_now_ns_ = time.now_ns;
    first_ = false;

    // End of the tick: what follows is not part of compute_ns.
    const std::int64_t ended_ns = clock_();
    timing_.of(TickStage::Record) = ended_ns - stage_ns_;
    record_.compute_ns = ended_ns - started_ns_;
    m.compute.record(record_.compute_ns);
    // Records, the probe's falling edge, and the watchdog's heartbeat.
    black_box_.push(record_);
    if (recorder_ != nullptr) {
        recorder_->push(record_);
    }
    if (probes_ != nullptr) {
        drive_relay();
        set_probe(probes_->tick, false);
    }
    heart_.beat();
}

void Tick::record_link_quality() HAPTIC_RT {
    if (safety_.state() == SafetyState::Disarmed) {
        return;
    }
    const RecentShares now = safety_.shares();
    RecentShares& worst = instruments_->worst;
    worst.exchange = std::max(worst.exchange, now.exchange);
    worst.late = std::max(worst.late, now.late);
    worst.residual = std::max(worst.residual, now.residual);
}

void Tick::drive_relay() HAPTIC_RT {
    // A fade goes on under power, unless it does not reach the motors: then the relay is what sets them to zero.
    const bool armed = safety_.state() != SafetyState::Disarmed;
    if (armed && (safety_.faults() & HAPTIC_FAULT_EXCHANGE) == 0) {
        set_probe(probes_->relay, !probes_->relay.up());
    }
}

void Tick::set_probe(Probe& probe, bool up) HAPTIC_RT {
    if (!probe.present() || probe.off()) {
        return;
    }
    const std::int64_t before_ns = clock_();
    probe.set(up);
    instruments_->probe_edge.record(clock_() - before_ns);
}

bool Tick::abandon() HAPTIC_RT {
    if (!records_.take()) {
        return false;
    }
    // The hanging tick becomes the last one in the black box, with its faults.
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
