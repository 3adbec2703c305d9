// Tick record: everything that one tick found and did, as it is recorded.
//
// Every input of a tick is here or in the recorded frames: its times, the board's answers, the frame and the overlay
// that it took, and the requests to it. A new input of the tick must be added here as well, and be played back by
// replay.cpp.
#pragma once

#include <array>
#include <cstdint>

#include "device/kinematics.hpp"
#include "haptic/device/board.hpp"
#include "haptic/types.hpp"

namespace haptic::rt {

/// Requests to the tick since the last one (TickRecord::requests).
inline constexpr std::uint32_t kRequestNew = 1u << 0;  // first tick of this object: it has no history
inline constexpr std::uint32_t kRequestArm = 1u << 1;
inline constexpr std::uint32_t kRequestStop = 1u << 2;
inline constexpr std::uint32_t kRequestAwait = 1u << 3;  // a person is to arm

inline constexpr std::int8_t kNoExchange = -1;  // no such exchange in this tick
inline constexpr std::int8_t kNoFrame = -1;     // no frame was taken in this tick

/// A wrench overlay that was taken in a tick (TickRecord::overlay_read).
inline constexpr std::int8_t kNoOverlay = -1;
inline constexpr std::int8_t kOverlayAccepted = 0;
inline constexpr std::int8_t kOverlayRefused = 1;  // not finite, or from a time ahead

struct TickRecord {
    std::uint64_t number = 0;  // 1, 2, 3, ...; a gap in a recording is a dropped tick
    std::int64_t deadline_ns = 0;
    std::int64_t now_ns = 0;      // wake-up; taken as the time of the encoder latch
    std::int64_t missed = 0;      // deadlines skipped before this one
    std::int64_t period_ns = 0;   // since the last wake-up; 0 at the first
    std::int64_t compute_ns = 0;  // duration of the tick, by the stage clock
    Pose pose;                    // device_from_grip
    Twist velocity;
    Wrench rendered;               // after limits and fades: the wrench requested of the strings
    Wrench made;                   // wrench of the tensions as sent, truncated to DAC codes
    double energy = 0.0;           // J, of the passivity observer; negative: energy given without having been taken
    double rotation_energy = 0.0;  // J, of rotation alone
    double passivity_scale = 1.0;  // gamma of the passivity controller
    double stiffness = 0.0;        // N/m, of the frame's coupling after its limits
    double scale = 0.0;            // 0..1, part of the frame's wrench that is rendered: fade, blend, passivity
    Vec3 proxy{0.0, 0.0, 0.0};     // m, local proxy of the first particle
    StringArray tensions{};        // N, as sent
    double residual = 0.0;         // m, rms of measured minus explained lengths
    std::uint64_t frame_sequence = 0;
    std::int64_t frame_age_ns = -1;  // -1: no frame yet
    std::uint32_t in_contact = 0;    // proxy particles
    std::uint32_t safety_state = 0;
    std::uint32_t faults = 0;
    std::uint32_t flags = 0;  // HAPTIC_TICK_*
    std::uint32_t buttons = 0;
    std::uint32_t cut = 0;                         // faults for which another thread disarmed the motors (Tick::cut)
    std::uint32_t requests = 0;                    // kRequest*
    std::int8_t exchange_in = kNoExchange;         // device::ExchangeStatus of the exchange that reads the encoders
    std::int8_t exchange_out = kNoExchange;        // of the exchange that sends to the motors
    std::int8_t exchange_collected = kNoExchange;  // of the last tick's exchange_out, whose answer this tick collected
    std::int8_t frame_read = kNoFrame;             // FrameDefect of the frame that was taken
    std::int8_t overlay_read = kNoOverlay;
    std::uint8_t rotary = 0;                         // switch, 0..15
    std::array<std::uint32_t, kStrings> counters{};  // last reading
    std::array<std::uint16_t, kStrings> analog{};    // last reading
    device::MotorCommand command;                    // as sent
    std::int64_t overlay_time_ns = 0;                // arrival of the overlay that was accepted
    Wrench overlay;                                  // as it was received
};

}  // namespace haptic::rt
