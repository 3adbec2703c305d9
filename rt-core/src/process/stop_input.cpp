#include "process/stop_input.hpp"

#include <chrono>
#include <exception>
#include <utility>

#include "haptic/clock.hpp"
#include "process/crash_guard.hpp"
#include "process/realtime_setup.hpp"

namespace haptic::rt {

StopLineMonitor::StopLineMonitor(std::unique_ptr<StopLine> line, std::function<void()> stop,
                                 const StopLineThread& thread)
    : line_(std::move(line)), stop_(std::move(stop)), settings_(thread) {
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
    if (settings_.supervision.page != nullptr) {
        settings_.supervision.page->leave(Supervisor::StopLine);
    }
}

void* StopLineMonitor::thread_entry(void* self) {
    const AlternateSignalStack signal_stack;
    auto* const monitor = static_cast<StopLineMonitor*>(self);
    monitor->priority_.store(prepare_side_thread(monitor->settings_.priority, monitor->settings_.loop_cpu));
    monitor->priority_.notify_all();
    monitor->monitor();
    return nullptr;
}

int StopLineMonitor::priority() const noexcept {
    priority_.wait(kUnknown);
    return priority_.load();
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
    SupervisionPage* const page = settings_.supervision.page;
    SupervisorCheck others(settings_.supervision, Supervisor::StopLine);
    std::unique_lock lock(mutex_);
    while (!ending_) {
        lock.unlock();
        if (page != nullptr) {
            page->beat(Supervisor::StopLine);
            others.check(monotonic_now_ns());
        }
        // Read the line, and call stop_(), without holding the mutex.
        if (poll()) {
            if (page != nullptr) {
                page->leave(Supervisor::StopLine);
            }
            stopped_.store(true);
            stop_();
            return;
        }
        lock.lock();
        wake_.wait_for(lock, std::chrono::nanoseconds(kPollNs), [this] { return ending_; });
    }
}

}  // namespace haptic::rt
