// Wrench limiter: bounds on the size of the wrench and on its rate, whatever a simulation asks for.
#pragma once

#include <cstdint>

#include "haptic/realtime.hpp"
#include "haptic/types.hpp"

namespace haptic::rt {

struct WrenchLimits {
    double force = 8.0;          // N; the strings of an X3R could make about 30, but far less startles a hand
    double torque = 0.15;        // N*m
    double force_rate = 1000.0;  // N/s: a stiffness of 2000 N/m hit at 0.5 m/s, so it never softens a contact
    double torque_rate = 20.0;   // N*m/s
};

/// Limits first the size (keeping the direction), then the rate. The result is within the size limits, and differs from
/// the last result by at most rate times time.
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
    /// The last result.
    [[nodiscard]] const Wrench& last() const HAPTIC_RT { return last_; }
    void reset() HAPTIC_RT { last_ = Wrench{}; }

  private:
    WrenchLimits limits_;
    Wrench last_;
};

}  // namespace haptic::rt
