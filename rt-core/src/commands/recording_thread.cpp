#include "commands/recording_thread.hpp"

#include <chrono>
#include <thread>

#include "process/crash_guard.hpp"
#include "process/realtime_setup.hpp"

namespace haptic::rt {
namespace {

// A killed run loses the ticks of this time.
constexpr std::chrono::milliseconds kWriteInterval{20};

}  // namespace

RecordingThread::RecordingThread(const RecordingSettings& settings)
    : recorder_(settings.queue_ticks, settings.queue_frames), file_(settings.file, recorder_) {
    file_.set_observer(settings.observer);
    thread_ = create_thread(&RecordingThread::thread_entry, this, kSideStackBytes, "creating the recording's thread");
}

RecordingThread::~RecordingThread() {
    finish();
    pthread_join(thread_, nullptr);
}

void RecordingThread::require_complete() const {
    if (problem_) {
        std::rethrow_exception(problem_);
    }
}

void* RecordingThread::thread_entry(void* self) {
    const AlternateSignalStack signal_stack;
    static_cast<RecordingThread*>(self)->write();
    return nullptr;
}

void RecordingThread::write() noexcept {
    try {
        while (!finishing_.load()) {
            file_.drain();
            std::this_thread::sleep_for(kWriteInterval);
        }
        file_.close();
    } catch (...) {
        // Ends the recording, and not the run.
        problem_ = std::current_exception();
    }
    finished_.store(true);  // publishes the problem
}

}  // namespace haptic::rt
