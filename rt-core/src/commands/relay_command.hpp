// `rt-core relay`: connects a session to a simulation on another machine (dds/relay.hpp). An ordinary process beside
// `rt-core run`, which knows nothing of it.
#pragma once

#include "dds/link.hpp"
#include "dds/ros_topics.hpp"

namespace haptic::rt {

struct RelayOptions {
    LinkSettings link;
    RosSettings ros;          // without names: no topics for ROS 2
    double duration_s = 0.0;  // 0: until a signal
};

/// Returns the exit status. Throws RingError, and std::runtime_error if DDS cannot use the interface.
[[nodiscard]] int relay_command(const RelayOptions& options);

}  // namespace haptic::rt
