// Server: makes an emulated board available to other processes, over USB/IP, usbredir or a pseudo terminal.
// `firmware-host serve` runs one or more.
#pragma once

#include <cstdint>
#include <optional>

namespace haptic::device {

class Server {
  public:
    virtual ~Server() = default;

    /// File descriptor that is readable (POLLIN) while there is work; may be an epoll instance.
    [[nodiscard]] virtual int descriptor() const noexcept = 0;
    /// Time of the next work that does not depend on input, on the caller's clock; empty if none.
    [[nodiscard]] virtual std::optional<std::int64_t> due_ns() const = 0;
    /// Does the pending work without blocking.
    virtual void step(std::int64_t now_ns) = 0;
};

}  // namespace haptic::device
