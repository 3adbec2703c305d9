// The Spidar-G6 behind an emulated board: grip, strings, motors and encoders, and the hand that holds the grip.
//
// The firmware (firmware.hpp) sets digits and reads counters; advance() moves everything on to the caller's time. The
// motors hold their digits until they are sent others, so firmware advances first and then sets what came.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "haptic/device/board.hpp"
#include "emulated/device_faults.hpp"
#include "haptic/device/fault.hpp"
#include "haptic/device/grip_mechanics.hpp"
#include "emulated/hand_motion.hpp"
#include "emulated/mechanical_grip.hpp"
#include "haptic/device/variant.hpp"
#include "haptic/pose_track.hpp"
#include "haptic/realtime.hpp"

namespace haptic::device {

class EmulatedDevice {
  public:
    struct Settings {
        Variant variant;
        PoseTrack hand{Pose{}};                          // pose over time since the first advance(), or the release
        std::array<std::uint32_t, kStrings> power_up{};  // counters at the centre: arbitrary on the real board
        std::uint8_t rotary = 0;                         // rotary switch, 0..15
        bool hand_waits = false;                         // at the beginning of its track, until release_hand()
        std::optional<GripMechanics> mechanics = {};     // without, grip and hand are one, whatever the strings do
        std::vector<Fault> faults = {};                  // of packets too: make_firmware() hands them on
        bool faults_wait = false;  // their clock begins when the hand is first released, not at the first advance()
    };

    /// Throws std::invalid_argument for settings that cannot be emulated.
    explicit EmulatedDevice(Settings settings);

    /// Moves hand, grip and strings on to a time; the first call is time zero.
    void advance(std::int64_t now_ns) HAPTIC_RT;
    /// What the motors pull with from now on.
    void set_digits(const std::array<std::int16_t, kStrings>& digits) HAPTIC_RT;
    /// Lets a waiting hand begin to follow its track, from the last advance() on.
    void release_hand() HAPTIC_RT;
    /// Takes the hand back to the beginning of its track, within half a second, where it waits.
    void hold_hand() HAPTIC_RT { hand_.hold(); }
    /// External switches, bits 0-2.
    void set_buttons(std::uint8_t buttons) HAPTIC_RT { buttons_ = buttons; }

    /// Encoders of now, modulo 2^counter_bits, in the host's sense of direction.
    [[nodiscard]] std::array<std::uint32_t, kStrings> counters() const HAPTIC_RT;
    [[nodiscard]] const std::array<std::int16_t, kStrings>& digits() const HAPTIC_RT { return digits_; }
    [[nodiscard]] std::uint8_t buttons() const HAPTIC_RT;
    [[nodiscard]] std::uint8_t rotary() const HAPTIC_RT { return settings_.rotary; }
    [[nodiscard]] const Variant& variant() const HAPTIC_RT { return settings_.variant; }

    /// Where the grip is.
    [[nodiscard]] Pose grip_pose() const HAPTIC_RT { return grip_; }
    /// Velocity of the grip; of a grip without mechanics zero.
    [[nodiscard]] Twist grip_velocity() const HAPTIC_RT;
    /// N, what the motors pull.
    [[nodiscard]] std::array<double, kStrings> tensions() const HAPTIC_RT;
    /// N, what the strings carry: without mechanics what the motors pull, and nothing while slack.
    [[nodiscard]] std::array<double, kStrings> string_tensions() const HAPTIC_RT;
    /// D/A digits as the board reads them back.
    [[nodiscard]] const std::array<std::int16_t, kStrings>& echo() const HAPTIC_RT;
    /// Force and torque of all strings on the grip, from the present pose and what the strings carry.
    [[nodiscard]] Wrench wrench() const HAPTIC_RT;

    /// Those that Settings gave.
    [[nodiscard]] const std::vector<Fault>& faults() const noexcept { return settings_.faults; }
    /// ns on the faults' clock; negative before it runs.
    [[nodiscard]] std::int64_t fault_time_ns(std::int64_t now_ns) const HAPTIC_RT;

  private:
    [[nodiscard]] std::array<std::uint32_t, kStrings> true_counters() const HAPTIC_RT;
    void move_ideally(std::int64_t passed_ns) HAPTIC_RT;
    [[nodiscard]] double paid_out_length(std::size_t string) const HAPTIC_RT;

    Settings settings_;
    HandMotion hand_;
    std::optional<MechanicalGrip> mechanical_;
    DeviceFaults faults_;
    Pose grip_;
    std::array<std::int16_t, kStrings> digits_{};   // of the motors
    std::array<std::int16_t, kStrings> written_{};  // by the firmware
    std::array<double, kStrings> reeled_{};         // m, of the slack; only of a grip without mechanics
    std::int64_t last_ns_ = 0;
    std::int64_t fault_ns_ = 0;  // on the faults' clock, at last_ns_
    std::uint8_t buttons_ = 0;
    bool started_ = false;
    bool released_ = false;
};

}  // namespace haptic::device
