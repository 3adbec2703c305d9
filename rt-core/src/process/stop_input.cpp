#include "process/stop_input.hpp"

#include <chrono>
#include <exception>
#include <system_error>
#include <utility>

#include "process/crash_guard.hpp"
#include "process/realtime_setup.hpp"

namespace haptic::rt {

StopWatch::StopWatch(std::unique_ptr<StopLine> line, std::function<void()> stop)
    : line_(std::move(line)), stop_(std::move(stop)) {
    pthread_attr_t attributes;
    int error = pthread_attr_init(&attributes);
    if (error == 0) {
        error = pthread_attr_setstacksize(&attributes, kSideStackBytes);
        error = error == 0 ? pthread_create(&thread_, &attributes, &StopWatch::thread_entry, this) : error;
        pthread_attr_destroy(&attributes);
    }
    if (error != 0) {
        throw std::system_error(error, std::system_category(), "creating the thread that watches the stop line");
    }
}

StopWatch::~StopWatch() {
    {
        const std::lock_guard lock(mutex_);
        ending_ = true;
    }
    wake_.notify_one();
    pthread_join(thread_, nullptr);
}

void* StopWatch::thread_entry(void* self) {
    const AlternateSignalStack signal_stack;
    static_cast<StopWatch*>(self)->watch();
    return nullptr;
}

bool StopWatch::look() {
    try {
        if (!line_->says_stop()) {
            return false;
        }
        reason_ = "the stop line says so";
    } catch (const std::exception& error) {
        reason_ = std::string("the stop line cannot be read: ") + error.what();
    }
    return true;
}

void StopWatch::watch() {
    std::unique_lock lock(mutex_);
    while (!ending_) {
        lock.unlock();
        if (look()) {
            stopped_.store(true);
            stop_();
            return;
        }
        lock.lock();
        wake_.wait_for(lock, std::chrono::nanoseconds(kLookNs), [this] { return ending_; });
    }
}

}  // namespace haptic::rt
