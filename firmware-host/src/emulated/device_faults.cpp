#include "emulated/device_faults.hpp"

#include <algorithm>
#include <utility>

#include "haptic/types.hpp"

namespace haptic::device {

DeviceFaults::DeviceFaults(std::vector<Fault> faults) : faults_(std::move(faults)) {
    std::erase_if(faults_, [](const Fault& fault) { return is_packet_fault(fault.kind); });
}

void DeviceFaults::advance(std::int64_t time_ns, std::int64_t passed_ns) HAPTIC_RT {
    // Sum the active faults of each string.
    std::array<double, kStrings> slack{};
    offset_ = {};
    stuck_ = {};
    dead_ = {};
    motors_frozen_ = false;
    for (const Fault& fault : faults_) {
        if (!fault.active(time_ns)) {
            continue;
        }
        if (fault.kind == FaultKind::Dac) {
            motors_frozen_ = true;
            echo_frozen_ = fault.echo_frozen;
        }
        for (std::size_t i = 0; i < kStrings; ++i) {
            if (!fault.affects(i)) {
                continue;
            }
            stuck_[i] = stuck_[i] || fault.kind == FaultKind::Stuck;
            offset_[i] += fault.kind == FaultKind::Jump ? static_cast<std::uint32_t>(fault.counts) : 0U;
            dead_[i] = dead_[i] || (fault.kind == FaultKind::Slack && fault.motor_dead);
            slack[i] += fault.kind == FaultKind::Slack ? fault.slack_m : 0.0;
        }
    }
    // Slack appears at once, but is removed at a limited speed.
    const double removable = kSlackRemovalSpeed * seconds(std::max<std::int64_t>(passed_ns, 0));
    for (std::size_t i = 0; i < kStrings; ++i) {
        slack_[i] = std::max(slack[i], slack_[i] - removable);
        has_latched_[i] = has_latched_[i] && stuck_[i];
    }
}

void DeviceFaults::latch_stuck_encoders(const std::array<std::uint32_t, kStrings>& counters) HAPTIC_RT {
    for (std::size_t i = 0; i < kStrings; ++i) {
        if (stuck_[i] && !has_latched_[i]) {
            latched_[i] = counters[i] + offset_[i];
            has_latched_[i] = true;
        }
    }
}

std::array<std::uint32_t, kStrings> DeviceFaults::counters(
    const std::array<std::uint32_t, kStrings>& counters) const HAPTIC_RT {
    std::array<std::uint32_t, kStrings> reported{};
    for (std::size_t i = 0; i < kStrings; ++i) {
        reported[i] = has_latched_[i] ? latched_[i] : counters[i] + offset_[i];
    }
    return reported;
}

}  // namespace haptic::device
