// Probe: a GPIO output that shows an oscilloscope, or an input of this machine, what a loop is doing.
//
// An edge costs one system call, without allocation, lock or wait. If the kernel refuses an edge, the probe turns
// itself off and reports it; callers need not check.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "haptic/config.hpp"
#include "haptic/gpio.hpp"
#include "haptic/realtime.hpp"
#include "haptic/setting.hpp"

namespace haptic {

class Probe {
  public:
    /// Default limit of the duration of an edge, ns. Lines on the processor's own bus take less than a tenth of it.
    static constexpr std::int64_t kSlowestEdgeNs = 200'000;
    using Clock = std::int64_t (*)() HAPTIC_RT;

    /// No line: set() and toggle() have no effect.
    Probe() = default;
    /// Starts low. Tests the line without changing its level: throws std::runtime_error, prefixed with `purpose`, if it
    /// cannot be set, or if every trial takes longer than `slowest_edge_ns`, as behind I2C.
    Probe(std::unique_ptr<OutputLine> line, const std::string& purpose, Clock clock,
          std::int64_t slowest_edge_ns = kSlowestEdgeNs);
    Probe(Probe&&) noexcept = default;
    Probe& operator=(Probe&&) = delete;
    /// Sets the line low.
    ~Probe();

    /// One system call; none if the line has this level already or the probe is off.
    void set(bool up) HAPTIC_RT;
    void toggle() HAPTIC_RT { set(!up_); }
    [[nodiscard]] bool up() const HAPTIC_RT { return up_; }

    /// The probe has a line.
    [[nodiscard]] bool present() const HAPTIC_RT { return line_ != nullptr; }
    /// The kernel refused an edge; no more are made.
    [[nodiscard]] bool off() const HAPTIC_RT { return error_ != 0; }
    /// errno of the refused edge; 0 if none.
    [[nodiscard]] int error() const HAPTIC_RT { return error_; }
    /// Number of edges made. Other threads may read it after the thread that sets the probe has ended.
    [[nodiscard]] std::uint64_t edges() const HAPTIC_RT { return edges_; }

  private:
    std::unique_ptr<OutputLine> line_;
    bool up_ = false;
    int error_ = 0;
    std::uint64_t edges_ = 0;
};

/// Line selected by the keys probes.chip and probes.NAME, for a program such as "rt-core". Empty if probes.NAME is "".
/// Throws ConfigError for a line without a chip.
[[nodiscard]] std::optional<GpioLine> read_probe_line(const Config& config, const std::string& name,
                                                      const std::string& user);

/// The keys of [probes] that every program has.
struct ProbeSettings {
    std::string chip;                                      // of all lines; read by read_probe_line()
    std::int64_t slowest_edge_ns = Probe::kSlowestEdgeNs;  // longest time that setting a line may take
};
[[nodiscard]] const SettingTable<ProbeSettings>& probe_settings();

/// Opens the probe; without a line if `line` is empty. Throws as open_output_line() and Probe() do.
[[nodiscard]] Probe open_probe(const std::optional<GpioLine>& line, Probe::Clock clock, std::int64_t slowest_edge_ns);

}  // namespace haptic
