// The thread's life outside its ticks: creation, preparation, end. Apart from loop.cpp because this may allocate.
#include <system_error>
#include <utility>

#include <haptic/denormals.hpp>
#include "process/crash_guard.hpp"
#include "process/idle_request.hpp"
#include "process/loop.hpp"

namespace haptic::rt {
namespace {

void check(int error, const char* what) {
    if (error != 0) {
        throw std::system_error(error, std::system_category(), what);
    }
}

}  // namespace

RealtimeLoop::RealtimeLoop(const LoopSettings& settings, Tick& tick, RealtimeSetup setup)
    : settings_(settings),
      tick_(&tick),
      setup_(std::move(setup)),
      measured_(std::make_unique<Instruments>(tick.instruments())) {
    pthread_attr_t attributes;
    check(pthread_attr_init(&attributes), "pthread_attr_init");
    int error = pthread_attr_setstacksize(&attributes, kStackBytes);
    if (error == 0) {
        error = pthread_create(&thread_, &attributes, &RealtimeLoop::thread_entry, this);
    }
    pthread_attr_destroy(&attributes);
    check(error, "creating the real-time thread");
    prepared_.get_future().wait();
}

RealtimeLoop::~RealtimeLoop() {
    request_stop();
    join();
}

void RealtimeLoop::start(Recorder* recorder, TimingLog* log) {
    recorder_ = recorder;
    log_ = log;
    started_ = true;
    go_.set_value(true);
}

void RealtimeLoop::join() {
    if (joined_) {
        return;
    }
    if (!started_) {
        go_.set_value(false);
    }
    pthread_join(thread_, nullptr);
    joined_ = true;
}

void* RealtimeLoop::thread_entry(void* self) {
    auto* const loop = static_cast<RealtimeLoop*>(self);
    const AlternateSignalStack signal_stack;
    const FlushDenormals flush;
    const IdleRequest idle(loop->settings_.idle_exit_us);
    loop->setup_.idle_exit_us = idle.granted() ? loop->settings_.idle_exit_us : -1;
    prepare_thread(loop->setup_, loop->settings_.priority, loop->settings_.cpu);
    std::future<bool> go = loop->go_.get_future();
    loop->prepared_.set_value();
    if (go.get()) {
        if (loop->log_ != nullptr) {
            loop->log_->attach();
        }
        loop->cycle();
    }
    loop->finished_.store(true, std::memory_order_release);  // all that the ticks wrote comes before
    return nullptr;
}

}  // namespace haptic::rt
