// Something that `firmware-host serve` runs: an emulated board's plug, be it USB over the network or a serial line.
#pragma once

#include <cstdint>
#include <optional>

namespace haptic::device {

class Server {
  public:
    virtual ~Server() = default;

    /// A file descriptor that is readable (poll's POLLIN) while there is something to do; an epoll instance is one.
    [[nodiscard]] virtual int descriptor() const noexcept = 0;
    /// When there will be something to do even if nothing arrives, on the caller's clock.
    [[nodiscard]] virtual std::optional<std::int64_t> due_ns() const = 0;
    /// Does what there is to do, and waits for nothing.
    virtual void step(std::int64_t now_ns) = 0;
};

}  // namespace haptic::device
