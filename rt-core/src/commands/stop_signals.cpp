#include "commands/stop_signals.hpp"

#include <ctime>
#include <initializer_list>

#include "haptic/types.hpp"

namespace haptic::rt {

StopSignals::StopSignals() {
    sigemptyset(&set_);
    // Block the stop signals, and take them with sigtimedwait().
    for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGTSTP}) {
        sigaddset(&set_, signal);
    }
    // A closed pipe or a background terminal must not end or stop the process while motors pull.
    for (const int signal : {SIGPIPE, SIGTTIN, SIGTTOU}) {
        std::signal(signal, SIG_IGN);
    }
    pthread_sigmask(SIG_BLOCK, &set_, &before_);
}

StopSignals::~StopSignals() {
    while (wait(0) != 0) {
    }
    pthread_sigmask(SIG_SETMASK, &before_, nullptr);
}

int StopSignals::wait(std::int64_t at_most_ns) const {
    const timespec time{at_most_ns / kNanosecondsPerSecond, at_most_ns % kNanosecondsPerSecond};
    const int signal = sigtimedwait(&set_, nullptr, &time);
    stopped_ = stopped_ || signal > 0;
    return signal > 0 ? signal : 0;  // EAGAIN, EINTR: none yet
}

}  // namespace haptic::rt
