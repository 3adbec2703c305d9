// Bounds of the wrench and of its rate, whatever a simulation asks for.
#pragma once

#include <cstdint>

#include <haptic/realtime.hpp>
#include <haptic/types.hpp>

namespace haptic::rt {

struct WrenchLimits {
    double force = 8.0;          // N; the X3R frame could make about 30, a hand is startled by far less
    double torque = 0.15;        // N*m
    double force_rate = 1000.0;  // N/s: a stiffness of 2000 N/m met at 0.5 m/s, so that contact is never blunted by it
    double torque_rate = 20.0;   // N*m/s
};

/// Limits size (direction is kept) and then rate. Each tick's result is within the limits of size, and differs from the
/// last by no more than rate times time.
class WrenchLimiter {
  public:
    explicit WrenchLimiter(const WrenchLimits& limits) : limits_(limits) {}

    struct Result {
        Wrench wrench;
        bool size_limited = false;
        bool rate_limited = false;
    };
    /// elapsed_ns: since the last call. A wrench that is not finite counts as zero.
    Result apply(const Wrench& wanted, std::int64_t elapsed_ns) HAPTIC_RT;
    void reset() HAPTIC_RT { last_ = Wrench{}; }

  private:
    WrenchLimits limits_;
    Wrench last_;
};

}  // namespace haptic::rt
