// Opening and closing what a TimingLog reads, apart from what the tick reaches.
#include <fcntl.h>
#include <unistd.h>

#include "process/timing_log.hpp"

namespace haptic::rt {

void TimingLog::attach() {
    if (waits_ >= 0) {
        close(waits_);
    }
    // Missing on a kernel that was built without it: then the log says so of each tick.
    waits_ = open("/proc/thread-self/schedstat", O_RDONLY | O_CLOEXEC);
    if (waits_ >= 0) {
        (void)waited_for_processor_ns(waits_);  // the kernel allocates its buffer at the first read
    }
}

TimingLog::~TimingLog() {
    if (waits_ >= 0) {
        close(waits_);
    }
}

}  // namespace haptic::rt
