// How warm the motors are, worked out from what they were sent: heat goes with the current squared, and the current
// with the tension. For motor i, with t_i the tension that it holds, c_i the one that it bears for ever, and tau_i:
//
//     d load_i / dt = ((t_i / c_i)^2 - load_i) / tau_i
//
// load 1 is as warm as c_i makes the motor in the end. At a constant tension above c_i it is reached after
// tau ln(u^2 / (u^2 - 1)), u = t / c. From derate_from on, a motor's largest tension comes down smoothly, to 0.9 c_i at
// load 1: whatever is asked for, the load then stays below 1, so load 1 is reached only if what the motor holds is not
// what it is sent (the board does not answer, or the process stood still), and is a fault.
// @source The first-order model behind the I^2 t limit of motor amplifiers. c_i and tau_i of a Spidar-G6 are nowhere
// published; the firmware of the UART boards limits heat at half the current and 20 s, which are the defaults here.
#pragma once

#include <array>
#include <cstdint>

#include <haptic/frames.hpp>
#include <haptic/realtime.hpp>
#include "device/kinematics.hpp"

namespace haptic::rt {

struct MotorRating {
    double continuous = 0.0;       // N, that the motor bears for ever
    double time_constant_s = 0.0;  // s
};

struct ThermalSettings {
    std::array<MotorRating, kStrings> motors{};
    double minimum = 0.0;      // N: no bound goes below it
    double maximum = 0.0;      // N, of a cool motor
    double derate_from = 0.7;  // load, 0..1
};

class ThermalModel {
  public:
    /// Throws std::invalid_argument for ratings that are not positive, or that the minimum tension alone exceeds.
    explicit ThermalModel(const ThermalSettings& settings);

    /// The motors held these tensions, N, for a time. Exact for any length of it, so that an interruption counts in
    /// full.
    void update(const StringArray& tensions, std::int64_t elapsed_ns) HAPTIC_RT;

    [[nodiscard]] const StringArray& loads() const HAPTIC_RT { return loads_; }
    /// N: the largest tension that each motor may have now, minimum..maximum.
    [[nodiscard]] StringArray bounds() const HAPTIC_RT;
    [[nodiscard]] bool derated() const HAPTIC_RT;
    /// Some motor's load has reached 1.
    [[nodiscard]] bool overheated() const HAPTIC_RT;

  private:
    ThermalSettings settings_;
    StringArray loads_{};
};

}  // namespace haptic::rt
