// Probes of the real-time loop: GPIO lines that show ticks and contact frames to an oscilloscope.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "haptic/probe.hpp"

namespace haptic::rt {

/// Lines of the probes, from [probes] of the configuration.
struct ProbeLines {
    std::optional<GpioLine> tick;
    std::optional<GpioLine> frame;
    std::optional<GpioLine> relay;     // safety.relay_chip, safety.relay_line
    std::optional<GpioLine> loopback;  // input wired to the tick's line, captured by this process
    EdgeKind loopback_edges = EdgeKind::Rising;
    std::int64_t slowest_edge_ns = Probe::kSlowestEdgeNs;
};

struct TickProbes {
    Probe tick;     // high while a tick runs
    Probe frame;    // toggles with each new contact frame
    Probe relay{};  // toggles with each tick while the loop is armed and its board answers; steady otherwise
};

/// Use of a probe, for the report.
struct ProbeUse {
    std::string line;         // "5 of pl061"; empty: no probe
    std::uint64_t edges = 0;  // total, including the warm-up
    int error = 0;            // errno of the edge that failed; 0 if none failed
};
struct ProbesUse {
    ProbeUse tick;
    ProbeUse frame;
    ProbeUse relay = {};
    std::uint64_t ticks = 0;  // total, including the warm-up: half the edges of the tick's probe
};
[[nodiscard]] ProbesUse use_of(const TickProbes& probes, const ProbeLines& lines, std::uint64_t ticks);

/// Opens the probes that have lines. Throws as open_probe() does.
[[nodiscard]] TickProbes open_tick_probes(const ProbeLines& lines, Probe::Clock clock);

}  // namespace haptic::rt
