// DDS on the loopback interface, for tests.
#pragma once

#include <unistd.h>

#include <cstdint>
#include <string>

#include "dds/link.hpp"

namespace haptic::test {

/// ns, after which a test gives up: others may keep the processor.
inline constexpr std::int64_t kPatienceNs = 20'000'000'000;

/// A session, and a domain, that no other test of this machine uses at the same time.
inline LinkSettings loopback(const std::string& name) {
    return {.session = name + "-" + std::to_string(::getpid()),
            .interface = "lo",
            .peers = {},
            .domain = 100u + static_cast<std::uint32_t>(::getpid()) % 100u};
}

}  // namespace haptic::test
