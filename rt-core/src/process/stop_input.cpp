#include "process/stop_input.hpp"

#include <chrono>
#include <exception>
#include <utility>

#include "process/crash_guard.hpp"
#include "process/realtime_setup.hpp"

namespace haptic::rt {

StopLineMonitor::StopLineMonitor(std::unique_ptr<StopLine> line, std::function<void()> stop)
    : line_(std::move(line)), stop_(std::move(stop)) {
    thread_ = create_thread(&StopLineMonitor::thread_entry, this, kSideStackBytes,
                            "creating the thread that monitors the stop line");
}

StopLineMonitor::~StopLineMonitor() {
    {
        const std::lock_guard lock(mutex_);
        ending_ = true;
    }
    wake_.notify_one();
    pthread_join(thread_, nullptr);
}

void* StopLineMonitor::thread_entry(void* self) {
    const AlternateSignalStack signal_stack;
    static_cast<StopLineMonitor*>(self)->monitor();
    return nullptr;
}

bool StopLineMonitor::poll() {
    try {
        if (!line_->says_stop()) {
            return false;
        }
        reason_ = "the stop line is active";
    } catch (const std::exception& error) {
        reason_ = std::string("the stop line cannot be read: ") + error.what();
    }
    return true;
}

void StopLineMonitor::monitor() {
    std::unique_lock lock(mutex_);
    while (!ending_) {
        lock.unlock();
        // Read the line, and call stop_(), without holding the mutex.
        if (poll()) {
            stopped_.store(true);
            stop_();
            return;
        }
        lock.lock();
        wake_.wait_for(lock, std::chrono::nanoseconds(kPollNs), [this] { return ending_; });
    }
}

}  // namespace haptic::rt
