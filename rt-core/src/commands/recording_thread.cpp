#include "commands/recording_thread.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <stdexcept>
#include <string>
#include <thread>

#include "process/crash_guard.hpp"
#include "process/realtime_setup.hpp"

namespace haptic::rt {
namespace {

// A killed run loses the ticks of this time.
constexpr std::chrono::milliseconds kWriteInterval{20};

/// Holds a named pipe that somebody reads, until the recording has opened it too, so that the reader sees no end
/// meanwhile. Does nothing for other files.
class OpenedPipe {
  public:
    /// Throws std::runtime_error if the pipe has no reader: to wait for one would hold up the stop signals.
    explicit OpenedPipe(const std::filesystem::path& file) {
        if (std::filesystem::is_fifo(file)) {
            descriptor_ = open(file.c_str(), O_WRONLY | O_NONBLOCK | O_CLOEXEC);
            if (descriptor_ < 0 && errno == ENXIO) {
                throw std::runtime_error(file.string() +
                                         ": nobody reads this pipe; start the program that reads it first");
            }
        }
    }
    OpenedPipe(const OpenedPipe&) = delete;
    OpenedPipe& operator=(const OpenedPipe&) = delete;
    ~OpenedPipe() {
        if (descriptor_ >= 0) {
            close(descriptor_);
        }
    }

  private:
    int descriptor_ = -1;
};

/// Opens the file of a recording without waiting for anything.
RecordFile open_record_file(const std::filesystem::path& file, Recorder& recorder) {
    const OpenedPipe pipe(file);
    return {file, recorder};
}

}  // namespace

RecordingThread::RecordingThread(const RecordingSettings& settings)
    : recorder_(settings.queue_ticks, settings.queue_frames), file_(open_record_file(settings.file, recorder_)) {
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
