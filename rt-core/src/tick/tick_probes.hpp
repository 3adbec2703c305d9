// The probes of the real-time loop, and the lines that they are on.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include <haptic/probe.hpp>

namespace haptic::rt {

/// Of the configuration, [probes].
struct ProbeLines {
    std::optional<GpioLine> tick;
    std::optional<GpioLine> frame;
    std::optional<GpioLine> loopback;  // wired to the tick's, to be captured by this process too
    EdgeKind loopback_edges = EdgeKind::Rising;
    std::int64_t slowest_edge_ns = Probe::kSlowestEdgeNs;
};

struct TickProbes {
    Probe tick;   // up while a tick runs
    Probe frame;  // another level with each new contact frame
};

/// How a probe was used, for the report.
struct ProbeUse {
    std::string line;         // "5 of pl061"; empty: there was none
    std::uint64_t edges = 0;  // in all, those of the warm-up too
    int error = 0;            // errno of the edge that the kernel refused; 0 if it refused none
};
struct ProbesUse {
    ProbeUse tick;
    ProbeUse frame;
    std::uint64_t ticks = 0;  // in all, those of the warm-up too: half the edges of the tick's probe
};
[[nodiscard]] ProbesUse use_of(const TickProbes& probes, const ProbeLines& lines, std::uint64_t ticks);

/// Throws as open_probe() does.
[[nodiscard]] TickProbes open_tick_probes(const ProbeLines& lines, Probe::Clock clock);

}  // namespace haptic::rt
