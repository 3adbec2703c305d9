// A probe: an output line that says to an oscilloscope, or to another line of the machine, what a loop is doing now.
//
// An edge costs one system call and nothing else: no allocation, no lock of ours, no wait. If the kernel refuses one,
// the probe is off from then on and says so; whoever sets it goes on without asking.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "haptic/config.hpp"
#include "haptic/gpio.hpp"
#include "haptic/realtime.hpp"

namespace haptic {

class Probe {
  public:
    /// The longest that an edge may take unless more is allowed, ns. Lines on the processor's own bus take less than a
    /// tenth of it.
    static constexpr std::int64_t kSlowestEdgeNs = 200'000;
    using Clock = std::int64_t (*)() HAPTIC_RT;

    /// Without a line: set() and toggle() do nothing.
    Probe() = default;
    /// Begins low. Tries the line, which stays low: throws std::runtime_error, `purpose` in front, if it is refused, or
    /// if each trial takes longer than `slowest_edge_ns`, as behind I2C.
    Probe(std::unique_ptr<OutputLine> line, const std::string& purpose, Clock clock,
          std::int64_t slowest_edge_ns = kSlowestEdgeNs);
    Probe(Probe&&) noexcept = default;
    Probe& operator=(Probe&&) = delete;
    /// Leaves the line low.
    ~Probe();

    /// One system call, none if the line is there already or the probe is off.
    void set(bool up) HAPTIC_RT;
    void toggle() HAPTIC_RT { set(!up_); }
    [[nodiscard]] bool up() const HAPTIC_RT { return up_; }

    /// There is a line.
    [[nodiscard]] bool present() const HAPTIC_RT { return line_ != nullptr; }
    /// There is a line, and the kernel has refused an edge of it.
    [[nodiscard]] bool off() const HAPTIC_RT { return error_ != 0; }
    /// Why: the errno of the edge that was refused; 0 if none was.
    [[nodiscard]] int error() const HAPTIC_RT { return error_; }
    /// Edges that were made. For other threads once the one that sets the probe has ended.
    [[nodiscard]] std::uint64_t edges() const HAPTIC_RT { return edges_; }

  private:
    std::unique_ptr<OutputLine> line_;
    bool up_ = false;
    int error_ = 0;
    std::uint64_t edges_ = 0;
};

/// The line that the keys probes.chip and probes.NAME choose, for a user such as "rt-core"; none where the latter is
/// "". Throws ConfigError for a line without a chip.
[[nodiscard]] std::optional<GpioLine> read_probe_line(const Config& config, const std::string& name,
                                                      const std::string& user);

/// The key probes.slowest_edge_s, ns: the longest that an edge may take.
[[nodiscard]] std::int64_t read_slowest_edge_ns(const Config& config);

/// A probe without a line for none. Throws what open_output_line() and the trial throw.
[[nodiscard]] Probe open_probe(const std::optional<GpioLine>& line, Probe::Clock clock, std::int64_t slowest_edge_ns);

}  // namespace haptic
