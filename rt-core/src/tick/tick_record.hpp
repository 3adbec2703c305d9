// Everything that one tick found and did, as it is recorded.
//
// All that a tick depends on is here or in the recorded frames: its times, what the board answered, which frame it took
// and what was asked of it. Whoever gives the tick another input records it here too, and replay.cpp gives it back.
#pragma once

#include <array>
#include <cstdint>

#include <haptic/device/board.hpp>
#include "device/kinematics.hpp"
#include <haptic/types.hpp>

namespace haptic::rt {

/// What was asked of the tick since the last one (TickRecord::requests).
inline constexpr std::uint32_t kRequestNew = 1u << 0;  // the first tick of this object: nothing before it counts
inline constexpr std::uint32_t kRequestArm = 1u << 1;
inline constexpr std::uint32_t kRequestStop = 1u << 2;

inline constexpr std::int8_t kNoExchange = -1;  // there was no such exchange in this tick
inline constexpr std::int8_t kNoFrame = -1;     // no frame was taken in this tick

struct TickRecord {
    std::uint64_t number = 0;  // 1, 2, 3, ...: a gap in a recording is one that found no room
    std::int64_t deadline_ns = 0;
    std::int64_t now_ns = 0;      // wake-up; the encoders count as latched then
    std::int64_t missed = 0;      // deadlines skipped before this one
    std::int64_t period_ns = 0;   // since the last wake-up; 0 at the first
    std::int64_t compute_ns = 0;  // from wake-up's return to the end of the tick, by the stage clock
    Pose pose;                    // device_from_grip
    Twist velocity;
    Wrench rendered;               // after limits and fades: what the strings were asked to make
    Wrench made;                   // by the tensions as the board has them, digits and all
    double energy = 0.0;           // J, of the passivity observer; negative is energy that never came in
    double rotation_energy = 0.0;  // J, the same of rotation alone
    double passivity_scale = 1.0;  // share of the wrench that the passivity controller left
    Vec3 proxy{0.0, 0.0, 0.0};     // m, local proxy of the first particle
    StringArray tensions{};        // N, as sent
    double residual = 0.0;         // m, of the redundant lengths
    std::uint64_t frame_sequence = 0;
    std::int64_t frame_age_ns = -1;  // -1: no frame yet
    std::uint32_t in_contact = 0;    // proxy particles
    std::uint32_t safety_state = 0;
    std::uint32_t faults = 0;
    std::uint32_t flags = 0;  // HAPTIC_TICK_*
    std::uint32_t buttons = 0;
    std::uint32_t cut = 0;                   // faults for which another thread has cut the motors off (Tick::cut)
    std::uint32_t requests = 0;              // kRequest*
    std::int8_t exchange_in = kNoExchange;   // device::ExchangeStatus of the exchange that brings encoders
    std::int8_t exchange_out = kNoExchange;  // of the one that brings motors
    std::int8_t frame_read = kNoFrame;       // FrameDefect of the frame that was taken
    std::uint8_t rotary = 0;                 // switch, 0..15
    std::array<std::uint32_t, kStrings> counters{};  // as read last
    std::array<std::uint16_t, kStrings> analog{};    // as read last
    device::MotorCommand command;                    // as sent
};

}  // namespace haptic::rt
