// GPIO lines: an output, an input, and a source of edges with kernel time stamps. Implemented in one file per major
// version of libgpiod (src/gpio_libgpiod1.cpp, src/gpio_libgpiod2.cpp), and by fakes in tests.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "haptic/realtime.hpp"

namespace haptic {

/// Selects a line and describes its use.
struct GpioLine {
    std::string chip;     // label (preferred: numbers differ between machines), name (gpiochip0) or path
    std::string line;     // name, or offset in the chip if it consists of digits
    std::string purpose;  // for messages, with the configuration keys: "tick probe (probes.chip, probes.tick)"
    std::string user;     // consumer shown by gpioinfo, at most 31 characters: "rt-core tick"
};

class OutputLine {
  public:
    virtual ~OutputLine() = default;
    /// Sets the line high or low with one system call. Returns 0 or the kernel's errno. For a line on the processor's
    /// own bus the call takes a few microseconds at most; for a line behind I2C or SPI it waits for that bus.
    virtual int set(bool up) HAPTIC_RT = 0;
};

class InputLine {
  public:
    virtual ~InputLine() = default;
    /// Whether the line is high. Throws std::system_error.
    [[nodiscard]] virtual bool is_up() = 0;
};

/// Edges to capture. The kernel stamps an edge in its interrupt handler. With Both it determines the direction from the
/// level when the interrupt's thread (SCHED_FIFO 50) runs, and sees no other edge before that: Both is reliable only if
/// the thread is faster than the line. Rising is reliable if the thread runs before the next rising edge.
enum class EdgeKind { Rising, Both };

struct Edge {
    std::int64_t time_ns;  // CLOCK_MONOTONIC, stamped in the interrupt handler (Linux 5.7 or newer)
    bool rising;
};

class EdgeSource {
  public:
    virtual ~EdgeSource() = default;
    /// Waits at most max_wait_ns for an edge, then reads the available edges that fit. Returns their number, 0 on
    /// time-out. The kernel buffers 16 edges; of more it drops the last (libgpiod 1) or the first (libgpiod 2).
    /// Throws std::system_error.
    [[nodiscard]] virtual std::size_t read(std::span<Edge> edges, std::int64_t max_wait_ns) = 0;
};

/// Pull resistor inside the chip. Whether the chip has one cannot be queried.
enum class GpioBias { None, Up, Down };

// These throw std::runtime_error with the problem and a remedy: no such chip or line, in use, or no permission. The
// destructor releases the line. open_output_line() sets the line low.
[[nodiscard]] std::unique_ptr<OutputLine> open_output_line(const GpioLine& line);
[[nodiscard]] std::unique_ptr<InputLine> open_input_line(const GpioLine& line, GpioBias bias);
[[nodiscard]] std::unique_ptr<EdgeSource> open_edge_source(const GpioLine& line, EdgeKind kind);

}  // namespace haptic
