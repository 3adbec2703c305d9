// Bring-up steps: the dialogue of each step of a device's first day. What is measured goes to the protocol at once.
#pragma once

#include <functional>
#include <string>

#include "commands/bringup_board.hpp"
#include "commands/bringup_console.hpp"
#include "commands/bringup_protocol.hpp"
#include "haptic/device/device_geometry.hpp"

namespace haptic::rt {

/// How the steps measure.
struct BringupStepSettings {
    double cap = 1.0;              // N, by the nominal geometry: the largest tension that is ever asked for
    double pull_out = 0.05;        // m, by which a string is pulled out by hand
    double ramp_s = 0.5;           // s, from zero to the code
    double steady_s = 1.0;         // s, for which a code is held for a reading
    double silence_s = 2.0;        // s, without a command in the power-cut test
    int readings = 3;              // of the balance, for each string
    std::size_t exchanges = 2000;  // of the round-trip histogram
    std::int64_t period_ns = 1'000'000;
    int exchanges_per_tick = 2;
};

class BringupSteps {
  public:
    /// All references must outlive it. `save` is called after each measurement.
    BringupSteps(BringupBoard& board, const BringupConsole& console, device::EmulatedDevice* emulated,
                 const device::DeviceGeometry& nominal, const BringupStepSettings& settings, BringupProtocol& protocol,
                 std::function<void()> save);

    /// Runs all steps that are not done yet.
    void run();

  private:
    void head(int step, const char* title, const char* look, const char* expect, const char* otherwise) const;
    [[nodiscard]] std::string ask(const std::string& question);
    [[nodiscard]] bool confirm(const std::string& question);
    [[nodiscard]] std::string name_of(std::size_t string) const;
    /// DAC code of a share of the cap, with the sign of the string's motor.
    [[nodiscard]] std::int16_t code_of(double share, std::size_t string) const;

    /// Sign of the codes with which the motor of a channel pulls.
    [[nodiscard]] double sign_of(std::size_t channel) const;

    void counters_at_rest();
    void pull_out_strings();
    [[nodiscard]] bool pull_out(std::size_t string);
    void pull_motors();
    void pull_motor(std::size_t channel);
    /// One hold of a motor and the string that became tight.
    [[nodiscard]] bool try_motor(std::size_t channel, std::int16_t code);
    [[nodiscard]] int ask_for_string(int emulated_eye);
    void show_channels() const;
    void show_signs() const;
    void weigh_strings();
    [[nodiscard]] bool weigh(std::size_t string, std::size_t channel);
    [[nodiscard]] bool read_balance(std::size_t string, std::size_t channel);
    [[nodiscard]] bool lift_weight(std::size_t string, std::size_t channel, double kilograms);
    void measure_round_trips();
    void cut_power();
    void cut_host(std::size_t channel, std::int16_t code);
    void cut_motors(std::size_t channel, std::int16_t code);
    void answer(const std::string& question, bool expected, const std::string& meaning, bool must_be_fixed);

    BringupBoard* board_;
    const BringupConsole* console_;
    device::EmulatedDevice* emulated_;  // nullptr: the device has a person who looks at it
    const device::DeviceGeometry* nominal_;
    BringupStepSettings settings_;
    BringupProtocol* protocol_;
    std::function<void()> save_;
};

}  // namespace haptic::rt
