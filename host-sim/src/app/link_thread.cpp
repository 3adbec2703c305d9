#include "app/link_thread.hpp"

#include <spdlog/spdlog.h>
#include <unistd.h>

#include "haptic/clock.hpp"

namespace haptic::sim {
namespace {

/// A number for this start: no other process of this machine has both.
std::uint64_t number_of_this_start() {
    return (static_cast<std::uint64_t>(monotonic_now_ns()) << 22U) ^ static_cast<std::uint64_t>(::getpid());
}

}  // namespace

LinkThread::LinkThread(const LinkSettings& settings)
    : domain_(settings),
      relay_(settings, number_of_this_start()),
      thread_([this](const std::stop_token& stop) { relay(stop); }) {
    spdlog::info("session {} is that of another machine, through interface {}: rt-core relay runs there",
                 settings.session, settings.interface);
}

LinkThread::~LinkThread() {
    thread_.request_stop();
    thread_.join();
    const RelayCounts& counts = relay_.counts();
    const ClockBounds& clock = relay_.clock();
    const std::optional<ClockOffset> offset = clock.at(monotonic_now_ns());
    if (!offset) {
        spdlog::warn("no rt-core relay was found on the network");
        return;
    }
    spdlog::info(
        "link: {} states received, {} frames sent, {} messages refused; shortest time there and back {:.0f} us",
        counts.states, counts.frames, counts.refused, 1e-3 * static_cast<double>(clock.shortest_ns()));
    spdlog::info("the other clock is {:.6f} s ahead, within {:.0f} us{}", seconds(offset->offset_ns),
                 1e-3 * static_cast<double>(offset->uncertainty_ns),
                 clock.drift() ? fmt::format(", and drifts by {:.1f} ppm", 1e6 * *clock.drift()) : "");
}

void LinkThread::relay(const std::stop_token& stop) {
    try {
        while (!stop.stop_requested()) {
            relay_.run_once(kRelayPollNs);
        }
    } catch (const std::exception& error) {
        // The run goes on: its hand stays in place, as if rt-core had ended.
        spdlog::error("the link to the other machine ended: {}", error.what());
    }
}

}  // namespace haptic::sim
