#include "lockstep.hpp"

#include <stdexcept>

namespace haptic::test {
namespace {

constexpr std::int64_t kArmingMarginNs = 50'000'000;
constexpr double kSampleS = 0.001;

std::int64_t stopped_clock() HAPTIC_RT {
    return 0;
}

/// The hand rests at the centre until start_ns, then follows the track.
PoseTrack from(std::int64_t start_ns, const PoseTrack& track) {
    std::vector<double> times{0.0};
    std::vector<Pose> poses{Pose{}};
    const int samples = static_cast<int>(track.duration_s() / kSampleS);
    for (int i = 0; i <= samples; ++i) {
        times.push_back(seconds(start_ns) + i * kSampleS);
        poses.push_back(track.at(nanoseconds(i * kSampleS)));
    }
    return {std::move(times), std::move(poses)};
}

}  // namespace

Lockstep::Lockstep(const Settings& settings)
    : state_writer_(session_.name()),
      frame_reader_(session_.name()),
      state_reader_(session_.name()),
      frames_(session_.name()),
      start_ns_(rt::arming_time_ns(settings.tick.safety) + kArmingMarginNs),
      board_({.geometry = settings.tick.geometry,
              .hand = from(start_ns_, settings.hand),
              .power_up = {60000, 1, 32768, 12345, 65535, 0, 40000, 777}}),
      tick_(settings.tick, board_, frame_reader_, state_writer_, stopped_clock),
      simulation_(settings.scene),
      tick_ns_(settings.tick.period_ns),
      late_ns_(settings.late_ns),
      network_ns_(settings.network_ns) {
    tick_.record_to(settings.recorder);
    tick_.arm();
    while (now_ns_ < start_ns_) {
        run_tick();
    }
    if (tick_.safety_state() != rt::SafetyState::Running) {
        throw std::runtime_error("the tick did not come to run");
    }
    simulation_.set_verification(true);
    step_time_ns_ = now_ns_;
}

void Lockstep::run_tick() {
    tick_.run({.deadline_ns = now_ns_, .now_ns = now_ns_});
    now_ns_ += tick_ns_;
    auto state = std::make_unique<DeviceState>();
    if (state_reader_.read_newest(*state)) {
        states_in_transit_.push_back({now_ns_ + network_ns_, std::move(state)});
    }
}

sim::StepInput Lockstep::next_input() {
    for (; !states_in_transit_.empty() && states_in_transit_.front().due_ns <= step_time_ns_;
         states_in_transit_.pop_front()) {
        state_ = *states_in_transit_.front().slot;
    }
    if (state_.sequence == 0) {
        throw std::runtime_error("ticks ran, but published no device state");
    }
    return sim::input_from(state_, step_time_ns_);
}

sim::StepResult Lockstep::step_simulation() {
    input_ = next_input();
    const sim::StepResult result = simulation_.step(input_);
    frames_in_transit_.push_back(
        {step_time_ns_ + late_ns_ + network_ns_, std::make_unique<ContactFrame>(simulation_.frame())});
    return result;
}

void Lockstep::deliver_frames() {
    for (; !frames_in_transit_.empty() && frames_in_transit_.front().due_ns <= now_ns_;
         frames_in_transit_.pop_front()) {
        (void)frames_.publish(*frames_in_transit_.front().slot, now_ns_, now_ns_);
    }
}

}  // namespace haptic::test
