#include "tick/tick_probes.hpp"

namespace haptic::rt {
namespace {

ProbeUse use_of(const Probe& probe, const std::optional<GpioLine>& line) {
    return line ? ProbeUse{line->line + " of " + line->chip, probe.edges(), probe.error()} : ProbeUse{};
}

}  // namespace

TickProbes open_tick_probes(const ProbeLines& lines, Probe::Clock clock) {
    return {open_probe(lines.tick, clock, lines.slowest_edge_ns), open_probe(lines.frame, clock, lines.slowest_edge_ns),
            open_probe(lines.relay, clock, lines.slowest_edge_ns)};
}

ProbesUse use_of(const TickProbes& probes, const ProbeLines& lines, std::uint64_t ticks) {
    return {use_of(probes.tick, lines.tick), use_of(probes.frame, lines.frame), use_of(probes.relay, lines.relay),
            ticks};
}

}  // namespace haptic::rt
