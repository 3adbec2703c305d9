// Idle request: limits the exit latency of the processors' idle states while the loop runs (PM QoS).
#pragma once

#include <filesystem>

namespace haptic::rt {

/// While it exists, no processor enters an idle state with an exit latency above exit_us: a 32-bit number of
/// microseconds, written to /dev/cpu_dma_latency, that the kernel respects until the file is closed
/// (Documentation/power/pm_qos_interface). Applies to all processors, and costs power.
class IdleRequest {
  public:
    /// A negative value requests nothing. A refusal is no error, because its effect, a late wake-up, is measured
    /// anyway.
    explicit IdleRequest(int exit_us, const std::filesystem::path& file = "/dev/cpu_dma_latency");
    IdleRequest(const IdleRequest&) = delete;
    IdleRequest& operator=(const IdleRequest&) = delete;
    ~IdleRequest();

    [[nodiscard]] bool granted() const noexcept { return fd_ >= 0; }

  private:
    int fd_ = -1;
};

}  // namespace haptic::rt
