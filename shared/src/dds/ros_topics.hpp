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
    bool overlay = false;    // takes a wrench overlay for the session
};

struct RosCounts {
    std::uint64_t states = 0;    // of the device, published
    std::uint64_t overlays = 0;  // passed on to rt-core
    std::uint64_t refused = 0;   // overlays of another frame, or with a number that is not finite
};

/// Throws std::invalid_argument for names that ROS 2 does not allow.
void check(const RosSettings& settings);

/// Observes the session's states and publishes them; passes on the newest wrench overlay, if asked to. A LinkDomain of
/// the link's domain must exist.
class RosTopics {
  public:
    /// Throws as check(), RingError for the session's name or if it has another source of overlays, and
    /// std::runtime_error of DDS.
    RosTopics(const RosSettings& settings, const LinkSettings& link);
    RosTopics(RosTopics&&) noexcept;
    RosTopics& operator=(RosTopics&&) noexcept;
    ~RosTopics();

    /// Publishes what is due, and passes on what came. Never waits. `relay` is for the diagnostics.
    void run_once(std::int64_t now_ns, const RelayCounts& relay);
    [[nodiscard]] const RosCounts& counts() const;

  private:
    struct State;
    std::unique_ptr<State> state_;
};

}  // namespace haptic
