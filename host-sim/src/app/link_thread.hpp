// Link thread: connects a run to rt-core on another machine (dds/relay.hpp), beside the run and apart from its time.
#pragma once

#include <stop_token>
#include <thread>

#include "dds/relay.hpp"

namespace haptic::sim {

class LinkThread {
  public:
    /// Throws RingError, and std::runtime_error if DDS cannot use the interface.
    explicit LinkThread(const LinkSettings& settings);
    LinkThread(const LinkThread&) = delete;
    LinkThread& operator=(const LinkThread&) = delete;
    /// Ends the link; rt-core's relay notices at once. Logs what passed.
    ~LinkThread();

  private:
    void relay(const std::stop_token& stop);

    LinkDomain domain_;
    SimulationRelay relay_;
    std::jthread thread_;  // last: uses the others
};

}  // namespace haptic::sim
