// Names of sessions that no other test has, or has left segments of.
#pragma once

#include <unistd.h>

#include <chrono>
#include <string>

namespace haptic::test {

/// A session name of this process and this moment. The number of a process alone comes again within an hour of tests,
/// and a test that kills its programs leaves their segments in /dev/shm.
[[nodiscard]] inline std::string unique_session() {
    const auto now = std::chrono::system_clock::now().time_since_epoch();
    return "test-" + std::to_string(getpid()) + "-" +
           std::to_string(std::chrono::duration_cast<std::chrono::nanoseconds>(now).count());
}

}  // namespace haptic::test
