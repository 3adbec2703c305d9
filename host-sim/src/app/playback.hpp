// Playback: shows a recording to viewers at any speed and from any time. A thread simulates it again as fast as
// possible and stores snapshots; viewers are served from these.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include "app/moment_store.hpp"
#include "app/recorded_run.hpp"
#include "app/replay.hpp"
#include "view/command.hpp"
#include "view/live_view.hpp"

namespace haptic::sim {

class Playback {
  public:
    /// Starts the simulating thread. All arguments must outlive this object.
    Playback(Replay& replay, const RecordedRun& record, view::LiveView& view);
    Playback(const Playback&) = delete;
    Playback& operator=(const Playback&) = delete;
    ~Playback();

    /// Advances by that much of the viewers' time, s: executes commands and shows the current moment. The recording
    /// starts when the first viewer has seen a moment.
    void advance(double elapsed_s);

    /// s, shown time since the start of the recording.
    [[nodiscard]] double time() const noexcept { return time_; }
    /// s, computed so far.
    [[nodiscard]] double buffered() const noexcept { return buffered_; }
    [[nodiscard]] bool diverged() const noexcept { return diverged_; }
    [[nodiscard]] bool paused() const noexcept { return paused_; }

  private:
    void compute();
    void keep(const StepResult& result, view::SceneSnapshot& moment);
    void handle(const view::SetPaused& command);
    void handle(const view::SingleStep& command);
    void handle(const view::Reset& command);
    void handle(const view::Seek& command);
    void handle(const view::SetSpeed& command);
    /// Commands for runs have no effect.
    template <class Other>
    void handle(const Other& /*command*/) {}
    void show_samples(double until);
    void show_moment();

    Replay& replay_;  // used by the thread only
    view::LiveView& view_;
    double length_;
    MomentStore moments_;
    std::mutex samples_mutex_;
    std::vector<view::StepSample> samples_;  // of all steps so far; guarded by samples_mutex_
    std::size_t next_sample_ = 0;            // first sample that was not shown yet
    std::atomic<double> buffered_{0.0};
    std::atomic<bool> diverged_{false};
    std::atomic<bool> stop_{false};
    double time_ = 0.0;
    double speed_ = 1.0;
    bool paused_ = false;
    bool seen_ = false;   // a viewer has seen a moment
    std::thread thread_;  // last member: starts after the others are initialised
};

}  // namespace haptic::sim
