// A recording before viewers: simulated again on a thread of its own, as fast as that goes, and shown from what that
// thread has kept, at any speed, from any time on.
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
    /// What `replay` makes of `record` is shown by `view`, which has to outlive this.
    Playback(Replay& replay, const RecordedRun& record, view::LiveView& view);
    Playback(const Playback&) = delete;
    Playback& operator=(const Playback&) = delete;
    ~Playback();

    /// Goes on by that much time, s, of whoever watches: does what was asked for, shows the moment. The recording
    /// begins once somebody has looked.
    void go_on(double elapsed_s);

    /// s, from the recording's start: what is shown.
    [[nodiscard]] double time() const noexcept { return time_; }
    /// s: how far it has been computed.
    [[nodiscard]] double buffered() const noexcept { return buffered_; }
    [[nodiscard]] bool diverged() const noexcept { return diverged_; }
    [[nodiscard]] bool paused() const noexcept { return paused_; }

  private:
    void compute();
    void keep(const StepResult& result, view::SceneSnapshot& moment);
    void obey(const view::SetPaused& command);
    void obey(const view::SingleStep& command);
    void obey(const view::Reset& command);
    void obey(const view::Seek& command);
    void obey(const view::SetSpeed& command);
    /// What is for runs.
    template <class Other>
    void obey(const Other& /*command*/) {}
    void show_samples(double until);
    void show_moment();

    Replay& replay_;  // the thread's
    view::LiveView& view_;
    double length_;
    MomentStore moments_;
    std::mutex samples_mutex_;
    std::vector<view::StepSample> samples_;  // of all steps so far
    std::size_t next_sample_ = 0;            // that was not shown yet
    std::atomic<double> buffered_{0.0};
    std::atomic<bool> diverged_{false};
    std::atomic<bool> stop_{false};
    double time_ = 0.0;
    double speed_ = 1.0;
    bool paused_ = false;
    bool seen_ = false;   // by anybody, so far
    std::thread thread_;  // last: all else is there before it begins
};

}  // namespace haptic::sim
