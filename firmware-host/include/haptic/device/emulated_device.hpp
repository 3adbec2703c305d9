// Emulated device: the Spidar-G6 behind an emulated board, with grip, strings, motors, encoders and the hand that holds
// the grip.
//
// The emulated firmware sets DAC codes and reads counters. advance() moves everything to the caller's time. The motors
// keep their DAC codes until new ones arrive, so a firmware calls advance() first and then set_dac_codes().
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "haptic/device/button_track.hpp"
#include "haptic/device/device_geometry.hpp"
#include "haptic/device/fault.hpp"
#include "haptic/device/grip_mechanics.hpp"
#include "haptic/device/tremor.hpp"
#include "haptic/device/wiring.hpp"
#include "haptic/pose_track.hpp"
#include "haptic/realtime.hpp"

namespace haptic::device {

class EmulatedDevice {
  public:
    struct Settings {
        DeviceGeometry geometry;
        PoseTrack hand{Pose{}};                          // pose over time since the first advance(), or the release
        ButtonTrack hand_buttons = {};                   // over the same time; if known, they replace set_buttons()
        std::array<std::uint32_t, kStrings> power_up{};  // counters at the centre: arbitrary on the real board
        std::uint8_t rotary = 0;                         // rotary switch, 0..15
        bool hand_waits = false;                         // at the start of its track until release_hand()
        std::optional<GripMechanics> mechanics = {};     // if empty, the grip follows the hand exactly
        std::vector<Fault> faults = {};                  // device faults; make_firmware() handles the packet faults
        bool faults_wait = false;  // the fault clock starts when the hand is first released, not at the first advance()
        Wiring wiring = {};        // of the board's channels to motors, encoders and strings
        TremorSettings tremor = {};  // of the hand
    };

    /// Throws std::invalid_argument for settings that cannot be emulated.
    explicit EmulatedDevice(Settings settings);
    EmulatedDevice(const EmulatedDevice&) = delete;
    EmulatedDevice& operator=(const EmulatedDevice&) = delete;
    ~EmulatedDevice();

    /// Moves hand, grip and strings to a time. The first call defines time zero.
    void advance(std::int64_t now_ns) HAPTIC_RT;
    /// Sets the DAC codes of the board's channels from now on.
    void set_dac_codes(const std::array<std::int16_t, kStrings>& dac_codes) HAPTIC_RT;
    /// Lets a waiting hand follow its track, starting at the time of the last advance().
    void release_hand() HAPTIC_RT;
    /// Returns the hand to the start of its track within half a second, where it waits.
    void hold_hand() HAPTIC_RT;
    /// A hand pulls this length of a string off its pulley, or with a negative one winds it back, m. A motor that pulls
    /// reels it in again.
    void pull_out(std::size_t string, double metres) HAPTIC_RT;
    /// The switch of the motors' supply. The board keeps its codes and counters.
    void set_motor_power(bool on) HAPTIC_RT;
    /// Sets the external switches, bits 0-2.
    void set_buttons(std::uint8_t buttons) HAPTIC_RT;

    /// Present encoder counters of the board's channels, modulo 2^counter_bits, with the host's sign.
    [[nodiscard]] std::array<std::uint32_t, kStrings> counters() const HAPTIC_RT;
    [[nodiscard]] const std::array<std::int16_t, kStrings>& dac_codes() const HAPTIC_RT;
    [[nodiscard]] std::uint8_t buttons() const HAPTIC_RT;
    [[nodiscard]] std::uint8_t rotary() const HAPTIC_RT;
    [[nodiscard]] const DeviceGeometry& geometry() const HAPTIC_RT;

    [[nodiscard]] Pose grip_pose() const HAPTIC_RT;
    /// Velocity of the grip; zero without mechanics.
    [[nodiscard]] Twist grip_velocity() const HAPTIC_RT;
    /// Tensions that the motors of the strings pull with, N.
    [[nodiscard]] std::array<double, kStrings> tensions() const HAPTIC_RT;
    /// Tensions that the strings carry, N. Without mechanics: the motors' tensions, or 0 while a string is slack.
    [[nodiscard]] std::array<double, kStrings> string_tensions() const HAPTIC_RT;
    /// DAC codes as the board reads them back.
    [[nodiscard]] const std::array<std::int16_t, kStrings>& echo() const HAPTIC_RT;
    /// Force and torque of all strings on the grip, from the present pose and string_tensions().
    [[nodiscard]] Wrench wrench() const HAPTIC_RT;

    /// All faults of the Settings.
    [[nodiscard]] const std::vector<Fault>& faults() const noexcept;
    /// Time on the fault clock, ns; negative before it starts.
    [[nodiscard]] std::int64_t fault_time_ns(std::int64_t now_ns) const HAPTIC_RT;

  private:
    struct State;
    std::unique_ptr<State> state_;
};

}  // namespace haptic::device
