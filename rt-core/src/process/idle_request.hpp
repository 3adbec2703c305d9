// How deep the processors may sleep while the loop runs.
#pragma once

#include <filesystem>

namespace haptic::rt {

/// Asks the kernel, as long as it lives, that no processor enters an idle state which takes longer than so many
/// microseconds to leave: a number of 32 bits written to /dev/cpu_dma_latency, which the kernel heeds until the file is
/// closed (Documentation/power/pm_qos_interface). It holds for all processors, and costs power.
class IdleRequest {
  public:
    /// A negative time asks for nothing. What the kernel refuses is no error: the loop wakes up later, and that is
    /// seen.
    explicit IdleRequest(int exit_us, const std::filesystem::path& file = "/dev/cpu_dma_latency");
    IdleRequest(const IdleRequest&) = delete;
    IdleRequest& operator=(const IdleRequest&) = delete;
    ~IdleRequest();

    [[nodiscard]] bool granted() const noexcept { return fd_ >= 0; }

  private:
    int fd_ = -1;
};

}  // namespace haptic::rt
