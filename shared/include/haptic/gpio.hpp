// Lines of GPIO chips: one to set, one to read, one whose edges the kernel stamps. What is behind these interfaces is
// in one file for each version of libgpiod, src/gpio_libgpiod1.cpp, and in tests a fake.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "haptic/realtime.hpp"

namespace haptic {

/// Which line, and for whom.
struct GpioLine {
    std::string chip;     // label (best: numbers differ between machines), name (gpiochip0) or path
    std::string line;     // name, or offset in the chip: what has only digits is an offset
    std::string purpose;  // for messages, with the keys that chose it: "tick probe (probes.chip, probes.tick)"
    std::string user;     // for gpioinfo, at most 31 characters: "rt-core tick"
};

class OutputLine {
  public:
    virtual ~OutputLine() = default;
    /// Takes the line up or down: one system call. 0, or the kernel's error, an errno. Of a line on the processor's own
    /// bus the call takes microseconds at most; a line behind I2C or SPI would wait for that bus.
    virtual int set(bool up) HAPTIC_RT = 0;
};

class InputLine {
  public:
    virtual ~InputLine() = default;
    /// Throws std::system_error if the line cannot be read.
    [[nodiscard]] virtual bool is_up() = 0;
};

/// Which edges are captured. The kernel stamps an edge in its interrupt, but of both kinds it says which it was by the
/// level that the line has when the interrupt's thread (SCHED_FIFO 50) runs, and until then it sees no other. So Both
/// needs that thread to be quicker than the line; Rising is right whenever the thread comes before the next one.
enum class EdgeKind { Rising, Both };

struct Edge {
    std::int64_t time_ns;  // CLOCK_MONOTONIC, by the kernel in its interrupt (Linux 5.7 or newer)
    bool rising;
};

class EdgeSource {
  public:
    virtual ~EdgeSource() = default;
    /// Waits for an edge, at most so long, and takes as many as there are and find room. 0: none came in time.
    /// The kernel keeps 16 edges for who is slow; it drops what is beyond. Throws std::system_error.
    [[nodiscard]] virtual std::size_t read(std::span<Edge> edges, std::int64_t at_most_ns) = 0;
};

/// What a line is pulled to inside the chip, where that can do so (the kernel does not say).
enum class GpioBias { None, Up, Down };

// Each throws std::runtime_error that says what is wrong and what to do: no such chip or line, in use, or not allowed.
// The lines are given back when the object ends. open_output_line() takes the line down.
[[nodiscard]] std::unique_ptr<OutputLine> open_output_line(const GpioLine& line);
[[nodiscard]] std::unique_ptr<InputLine> open_input_line(const GpioLine& line, GpioBias bias);
[[nodiscard]] std::unique_ptr<EdgeSource> open_edge_source(const GpioLine& line, EdgeKind kind);

}  // namespace haptic
