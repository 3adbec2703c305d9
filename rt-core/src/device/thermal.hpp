// Thermal model of the motors, from the tensions they were sent: heat is proportional to the current squared, and the
// current to the tension. For motor i with tension t_i, continuous rating c_i and thermal time constant tau_i:
//
//     d load_i / dt = ((t_i / c_i)^2 - load_i) / tau_i
//
// Load 1 is the steady state at c_i. A constant tension t above c_i reaches it after tau ln(u^2 / (u^2 - 1)), u = t /
// c. From load derate_from on, a motor's maximum tension falls smoothly, to 0.9 c_i at load 1. The load therefore stays
// below 1 for any command. Load 1 can be reached only if the motor holds another tension than it was sent (the board
// does not answer, or the process was stopped), and is a fault.
// @source First-order model behind the I^2 t limit of motor amplifiers. c_i and tau_i of a Spidar-G6 are unpublished;
// the firmware of the UART boards limits heat at half the current and 20 s, which are the defaults here.
#pragma once

#include <array>
#include <cstdint>

#include "device/kinematics.hpp"
#include "haptic/frames.hpp"
#include "haptic/realtime.hpp"

namespace haptic::rt {

struct MotorRating {
    double continuous = 0.0;       // N, that the motor can hold indefinitely
    double time_constant_s = 0.0;  // s
};

struct ThermalSettings {
    std::array<MotorRating, kStrings> motors{};
    double minimum = 0.0;      // N: lower limit of every bound
    double maximum = 0.0;      // N, of a cool motor
    double derate_from = 0.7;  // load, 0..1, from which the bound falls
};

class ThermalModel {
  public:
    /// Throws std::invalid_argument for ratings that are not positive, or that the minimum tension alone exceeds.
    explicit ThermalModel(const ThermalSettings& settings);

    /// Advances the loads by a time during which the motors held these tensions (N). Exact for any duration, so an
    /// interruption counts in full.
    void update(const StringArray& tensions, std::int64_t elapsed_ns) HAPTIC_RT;

    [[nodiscard]] const StringArray& loads() const HAPTIC_RT { return loads_; }
    /// N, maximum tension of each motor now, minimum..maximum.
    [[nodiscard]] StringArray bounds() const HAPTIC_RT;
    /// True if some motor's bound is below the maximum.
    [[nodiscard]] bool derated() const HAPTIC_RT;
    /// True if some motor's load has reached 1.
    [[nodiscard]] bool overheated() const HAPTIC_RT;

  private:
    ThermalSettings settings_;
    StringArray loads_{};
};

}  // namespace haptic::rt
