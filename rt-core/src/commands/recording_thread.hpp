// Recording thread: writes the recording of a run. A file that blocks, such as a pipe whose reader stands still, so
// holds up nothing else: neither the loop nor the thread that stops it.
#pragma once

#include <pthread.h>

#include <atomic>
#include <cstddef>
#include <exception>
#include <filesystem>
#include <functional>

#include "measure/recording.hpp"
#include "tick/recorder.hpp"

namespace haptic::rt {

struct RecordingSettings {
    std::filesystem::path file;
    std::size_t queue_ticks = 0;
    std::size_t queue_frames = 0;
    std::function<void(const TickRecord&)> observer = {};  // called with each tick, in the thread; empty: none
};

class RecordingThread {
  public:
    /// Opens the file, and starts the thread with ordinary priority. Throws std::runtime_error.
    explicit RecordingThread(const RecordingSettings& settings);
    RecordingThread(const RecordingThread&) = delete;
    RecordingThread& operator=(const RecordingThread&) = delete;
    /// Waits until everything is written.
    ~RecordingThread();

    /// Queues that the tick fills.
    [[nodiscard]] Recorder& recorder() noexcept { return recorder_; }
    /// Asks the thread to write what is queued, to close the file and to end.
    void finish() noexcept { finishing_.store(true); }
    /// True once it has ended.
    [[nodiscard]] bool finished() const noexcept { return finished_.load(); }
    /// Once finished: throws std::runtime_error if the recording is incomplete.
    void require_complete() const;

  private:
    static void* thread_entry(void* self);
    void write() noexcept;

    Recorder recorder_;
    RecordFile file_;
    std::atomic<bool> finishing_{false};
    std::atomic<bool> finished_{false};
    std::exception_ptr problem_;  // of the thread; read once it has finished
    pthread_t thread_{};
};

}  // namespace haptic::rt
