// Lockstep chain: board, rt-core and host-sim in one thread under one virtual clock, joined by real rings.
// Deterministic bit for bit.
#pragma once

#include <cstdint>
#include <deque>
#include <memory>

#include "app/contact_frame_publisher.hpp"
#include "haptic/device/emulated_board.hpp"
#include "haptic/ring.hpp"
#include "haptic/sim/simulation.hpp"
#include "ring_session.hpp"
#include "tick/tick.hpp"

namespace haptic::test {

class Lockstep {
  public:
    struct Settings {
        sim::Scene scene;
        PoseTrack hand;  // of the grip, device frame; time 0 is the first step
        rt::TickSettings tick;
        rt::Recorder* recorder = nullptr;  // records all ticks
        std::int64_t late_ns = 0;          // delay of each frame after the beginning of its step
        std::int64_t network_ns = 0;       // one-way delay of a network between the two, of frames and of states
    };

    /// Arms, and ticks until the grip is calibrated and the state is Running. Throws std::runtime_error otherwise.
    explicit Lockstep(const Settings& settings);

    /// One step of the simulation, then the ticks until the next one; calls `after_tick` after each.
    template <class AfterTick>
    sim::StepResult step(AfterTick&& after_tick) {
        const sim::StepResult result = step_simulation();
        step_time_ns_ += nanoseconds(result.step);
        while (now_ns_ < step_time_ns_) {
            deliver_frames();
            run_tick();
            after_tick(tick_.last(), board_);
        }
        return result;
    }
    sim::StepResult step() {
        return step([](const rt::TickRecord&, const device::EmulatedBoard&) {});
    }

    /// Idles for some frames, as a paused scene does, then recouples the hand.
    template <class AfterTick>
    void stand(int frames, AfterTick&& after_tick) {
        for (int k = 0; k < frames; ++k) {
            (void)frames_.publish_idle(now_ns_);
            for (const std::int64_t until_ns = now_ns_ + sim::ContactFramePublisher::kIdlePeriodNs;
                 now_ns_ < until_ns;) {
                run_tick();
                after_tick(tick_.last(), board_);
            }
        }
        step_time_ns_ = now_ns_;
        simulation_.recouple();
    }

    [[nodiscard]] const sim::Simulation& simulation() const { return simulation_; }
    [[nodiscard]] sim::Simulation& simulation() { return simulation_; }
    [[nodiscard]] device::EmulatedBoard& board() { return board_; }
    [[nodiscard]] const rt::Tick& tick() const { return tick_; }
    /// Input that the simulation's next step takes.
    [[nodiscard]] sim::StepInput next_input();
    /// Input of the simulation's last step.
    [[nodiscard]] const sim::StepInput& input() const { return input_; }

  private:
    void run_tick();
    sim::StepResult step_simulation();
    void deliver_frames();

    template <class Slot>
    struct InTransit {
        std::int64_t due_ns;
        std::unique_ptr<Slot> slot;
    };
    RingSession session_;
    RingWriter<DeviceState> state_writer_;
    RingReader<ContactFrame> frame_reader_;
    RingReader<DeviceState> state_reader_;
    sim::ContactFramePublisher frames_;
    std::int64_t start_ns_;  // of the simulation
    device::EmulatedBoard board_;
    rt::Tick tick_;
    sim::Simulation simulation_;
    DeviceState state_{};
    sim::StepInput input_;
    std::int64_t tick_ns_;
    std::int64_t late_ns_;
    std::int64_t network_ns_;
    std::deque<InTransit<ContactFrame>> frames_in_transit_;
    std::deque<InTransit<DeviceState>> states_in_transit_;
    std::int64_t now_ns_ = 0;
    std::int64_t step_time_ns_ = 0;  // of the simulation's next step; need not coincide with a tick
};

/// Clock of a replay in which no time is measured.
inline std::int64_t no_clock() HAPTIC_RT {
    return 0;
}

}  // namespace haptic::test
