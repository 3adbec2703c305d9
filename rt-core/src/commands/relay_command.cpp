#include "commands/relay_command.hpp"

#include <spdlog/spdlog.h>

#include <optional>

#include "commands/run_output.hpp"
#include "commands/stop_signals.hpp"
#include "dds/relay.hpp"
#include "formatted.hpp"
#include "haptic/clock.hpp"
#include "program/exit_status.hpp"

namespace haptic::rt {
namespace {

using haptic::detail::formatted;

/// Logs what the relay's simulation does, once each time it changes.
class Announcements {
  public:
    void update(bool connected, const std::string& problem) {
        if (connected != connected_) {
            spdlog::info(connected ? "a simulation is connected" : "the simulation is gone");
        }
        if (!problem.empty() && problem_.empty()) {
            spdlog::warn("a simulation is refused until its place is free: {}", problem);
        }
        connected_ = connected;
        problem_ = problem;
    }

  private:
    bool connected_ = false;
    std::string problem_;
};

/// Relays until a signal or the end of the duration, and prints what it has done.
void relay_until_stopped(const RelayOptions& options, const StopSignals& signals, RunOutput& output) {
    const LinkDomain domain(options.link);
    DeviceRelay relay(options.link);
    std::optional<RosTopics> ros;
    if (!options.ros.names.empty()) {
        ros.emplace(options.ros, options.link);
        spdlog::info("ROS 2: topics /{}/... and /diagnostics in domain {}", options.ros.names, options.link.domain);
        if (options.ros.overlay) {
            spdlog::info(
                "ROS 2: /{}/wrench_overlay pushes as far as overlay.max_force and overlay.max_torque of rt-core "
                "allow; nobody on this interface is asked for a password",
                options.ros.names);
        }
    }
    spdlog::info("session {}: waiting for a simulation on interface {}", options.link.session, options.link.interface);
    const std::int64_t end_ns = options.duration_s > 0.0 ? monotonic_now_ns() + nanoseconds(options.duration_s) : 0;
    Announcements announcements;
    while (signals.wait(0) == 0 && (end_ns == 0 || monotonic_now_ns() < end_ns)) {
        const bool connected = relay.run_once(kRelayPollNs);
        announcements.update(connected, relay.problem());
        if (ros) {
            ros->run_once(monotonic_now_ns(), relay.counts());
        }
    }
    const RelayCounts& counts = relay.counts();
    output.print(formatted(
        "%llu states sent; frames: %llu received, %llu refused, %llu late, %llu displaced; simulations: %llu\n",
        static_cast<unsigned long long>(counts.states), static_cast<unsigned long long>(counts.frames),
        static_cast<unsigned long long>(counts.refused), static_cast<unsigned long long>(counts.late),
        static_cast<unsigned long long>(counts.displaced), static_cast<unsigned long long>(counts.connections)));
    if (ros) {
        const RosCounts& passed = ros->counts();
        output.print(
            formatted("ROS 2: %llu messages of the device's motion and force; overlays: %llu passed on, %llu refused\n",
                      static_cast<unsigned long long>(passed.states), static_cast<unsigned long long>(passed.overlays),
                      static_cast<unsigned long long>(passed.refused)));
    }
}

}  // namespace

int relay_command(const RelayOptions& options) {
    const StopSignals signals;
    RunOutput output;
    relay_until_stopped(options, signals, output);
    return output.finish(signals, kExitDone);
}

}  // namespace haptic::rt
