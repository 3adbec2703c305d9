// Force budget: the energy and time that a session may spend on a person's hand.
//
// The work of the strings on the grip in a tick is exactly the held wrench times the displacement. Its sum with a
// memory of one second bounds the power; the sum of its positive part bounds the energy of the session.
#pragma once

#include "haptic/realtime.hpp"

namespace haptic::rt {

/// 0: no limit.
struct BudgetLimits {
    double second = 0.0;    // J, given to the hand within about a second, less what was taken from it
    double session = 0.0;   // J, given to the hand in the session
    double duration = 0.0;  // s, of rendering in the session
};

class ForceBudget {
  public:
    static constexpr double kWarnAt = 0.8;  // of a limit

    explicit ForceBudget(const BudgetLimits& limits) : limits_(limits) {}

    /// work: J, that the strings did on the grip since the last tick.
    void update(double work, double elapsed_s, bool running) HAPTIC_RT {
        recent_ = recent_ * (elapsed_s < 1.0 ? 1.0 - elapsed_s : 0.0) + work;
        given_ += work > 0.0 ? work : 0.0;
        seconds_ += running ? elapsed_s : 0.0;
        peak_ = recent_ > peak_ ? recent_ : peak_;
    }

    /// Share of the limit that is used most, 0..1 and above.
    [[nodiscard]] double used() const HAPTIC_RT {
        const double second = share(recent_, limits_.second);
        const double session = share(given_, limits_.session);
        const double duration = share(seconds_, limits_.duration);
        const double energy = second > session ? second : session;
        return energy > duration ? energy : duration;
    }
    [[nodiscard]] bool warns() const HAPTIC_RT { return used() >= kWarnAt; }
    [[nodiscard]] bool spent() const HAPTIC_RT { return used() >= 1.0; }

    [[nodiscard]] double given() const HAPTIC_RT { return given_; }       // J, in the session
    [[nodiscard]] double peak_second() const HAPTIC_RT { return peak_; }  // J, largest within about a second
    [[nodiscard]] double seconds() const HAPTIC_RT { return seconds_; }   // s, of rendering

  private:
    static double share(double value, double limit) HAPTIC_RT { return limit > 0.0 ? value / limit : 0.0; }

    BudgetLimits limits_;
    double recent_ = 0.0;
    double peak_ = 0.0;
    double given_ = 0.0;
    double seconds_ = 0.0;
};

}  // namespace haptic::rt
