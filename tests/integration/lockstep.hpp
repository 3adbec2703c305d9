// Board, rt-core and host-sim in one thread under one virtual clock, joined by real rings: the whole chain, bit for bit
// the same each time.
#pragma once

#include <cstdint>

#include "app/frame_outlet.hpp"
#include "haptic/device/emulated_board.hpp"
#include "haptic/ring.hpp"
#include "tick/tick.hpp"
#include "haptic/sim/simulation.hpp"
#include "ring_session.hpp"

namespace haptic::test {

class Lockstep {
  public:
    struct Settings {
        sim::Scene scene;
        PoseTrack hand;  // of the grip, device frame, from the first step on
        rt::TickSettings tick;
        rt::Recorder* recorder = nullptr;  // of all ticks, from the first on
        std::int64_t late_ns = 0;          // that each frame is published after the beginning of its step
    };

    /// Arms, and ticks until the grip is calibrated and the state is Running. Throws std::runtime_error if it is not.
    explicit Lockstep(const Settings& settings);

    /// One step of the simulation, then the ticks until the next one; `after_tick` sees each of them.
    template <class AfterTick>
    sim::StepResult step(AfterTick&& after_tick) {
        const sim::StepResult result = step_simulation();
        const std::int64_t publish_ns = step_time_ns_ + late_ns_;
        step_time_ns_ += nanoseconds(result.step);
        while (now_ns_ < step_time_ns_) {
            if (pending_ && now_ns_ >= publish_ns) {
                publish_frame();
            }
            run_tick();
            after_tick(tick_.last(), board_);
        }
        return result;
    }
    sim::StepResult step() {
        return step([](const rt::TickRecord&, const device::EmulatedBoard&) {});
    }

    /// The scene stands for so many frames, as one does that viewers have paused; then the hand is coupled anew.
    template <class AfterTick>
    void stand(int frames, AfterTick&& after_tick) {
        for (int k = 0; k < frames; ++k) {
            (void)frames_.stand(now_ns_);
            for (const std::int64_t until_ns = now_ns_ + sim::FrameOutlet::kStandNs; now_ns_ < until_ns;) {
                run_tick();
                after_tick(tick_.last(), board_);
            }
        }
        step_time_ns_ = now_ns_;
        simulation_.couple_anew();
    }

    [[nodiscard]] const sim::Simulation& simulation() const { return simulation_; }
    [[nodiscard]] sim::Simulation& simulation() { return simulation_; }
    [[nodiscard]] device::EmulatedBoard& board() { return board_; }
    [[nodiscard]] const rt::Tick& tick() const { return tick_; }
    /// What the simulation's last step was given.
    [[nodiscard]] const sim::StepInput& input() const { return input_; }

  private:
    void run_tick();
    sim::StepResult step_simulation();
    void publish_frame();

    RingSession session_;
    RingWriter<DeviceState> state_writer_;
    RingReader<ContactFrame> frame_reader_;
    RingReader<DeviceState> state_reader_;
    sim::FrameOutlet frames_;
    std::int64_t start_ns_;  // of the simulation
    device::EmulatedBoard board_;
    rt::Tick tick_;
    sim::Simulation simulation_;
    DeviceState state_{};
    sim::StepInput input_;
    std::int64_t tick_ns_;
    std::int64_t late_ns_;
    std::int64_t now_ns_ = 0;
    std::int64_t step_time_ns_ = 0;  // of the simulation's next step; need not be that of a tick
    bool pending_ = false;           // the last step's frame is not published yet
};

}  // namespace haptic::test
