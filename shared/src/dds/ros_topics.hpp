// Topics of ROS 2: a session's device under the topic and type names that ROS 2 uses in DDS, so that its tools and
// nodes see it without a bridge (shared/idl/ros_messages.idl, shared/docs/dds.md).
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "dds/link.hpp"
#include "dds/relay.hpp"

namespace haptic {

struct RosSettings {
    std::string
        names{};  // prefix of the topics, as in ROS: words of A-Z a-z 0-9 _ joined by /, none begins with a digit
    double rate_hz = 100.0;  // of each topic of the device; no more than one message a tick
};

/// Throws std::invalid_argument for names that ROS 2 does not allow.
void check(const RosSettings& settings);

/// Observes the session's states and publishes them. A LinkDomain of the link's domain must exist.
class RosTopics {
  public:
    /// Throws as check(), RingError for the session's name, and std::runtime_error of DDS.
    RosTopics(const RosSettings& settings, const LinkSettings& link);
    RosTopics(RosTopics&&) noexcept;
    RosTopics& operator=(RosTopics&&) noexcept;
    ~RosTopics();

    /// Publishes what is due. Never waits. `counts` are for the diagnostics.
    void run_once(std::int64_t now_ns, const RelayCounts& counts);
    /// States of the device, so far.
    [[nodiscard]] std::uint64_t published() const;

  private:
    struct State;
    std::unique_ptr<State> state_;
};

}  // namespace haptic
