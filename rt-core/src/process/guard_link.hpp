// Guard link: the run's side of its guard (guard.hpp): starts the process, tells it of a device that was opened again,
// and lets it go.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <string>

#include "haptic/device/zero_packet.hpp"
#include "process/guard_channel.hpp"
#include "process/supervision.hpp"

namespace haptic::rt {

struct GuardSettings {
    std::int64_t silence_ns = 12'000'000;    // ns, without a tick, after which the loop counts as frozen
    int priority = 82;                       // SCHED_FIFO; a refusal is reported
    int loop_cpu = -1;                       // processor to avoid, as LoopSettings::cpu
    std::int64_t lost_ns = 150'000'000;      // Supervision::limit_ns
    std::string program = "/proc/self/exe";  // that has the command `guard`
};

/// ns, the silence after which a loop counts as frozen: the setting, unless a tick may wait for its board that long.
[[nodiscard]] std::int64_t guard_silence_ns(std::int64_t setting_ns, std::int64_t exchange_bound_ns,
                                            std::int64_t period_ns) noexcept;

class GuardLink {
  public:
    /// Starts the guard and waits until it watches. `black_box`: descriptor of the black box's file, or -1. Throws
    /// std::runtime_error if it cannot be started or does not answer in 5 s.
    GuardLink(const GuardSettings& settings, const SharedSupervision& shared, const device::ZeroPacket& zero,
              int black_box);
    GuardLink(const GuardLink&) = delete;
    GuardLink& operator=(const GuardLink&) = delete;
    /// Orderly end: the motors are at zero. Lets the guard go and waits for it, at most a second.
    ~GuardLink();

    /// The device was opened again. Throws std::runtime_error if the guard is gone.
    void renew(const device::ZeroPacket& zero);

    [[nodiscard]] const GuardGrant& grant() const noexcept { return grant_; }
    [[nodiscard]] std::int64_t silence_ns() const noexcept { return silence_ns_; }

  private:
    void begin(const GuardSettings& settings, const SharedSupervision& shared, const device::ZeroPacket& zero,
               int black_box);
    void reap() noexcept;

    SupervisionPage* page_;
    std::int64_t silence_ns_;
    int socket_ = -1;
    pid_t process_ = -1;
    GuardGrant grant_;
};

}  // namespace haptic::rt
