// Everything that one tick found and did, as it is recorded.
#pragma once

#include <cstdint>

#include "haptic/rt/kinematics.hpp"
#include "haptic/types.hpp"

namespace haptic::rt {

struct TickRecord {
    std::int64_t deadline_ns = 0;
    std::int64_t now_ns = 0;      // wake-up; the encoders count as latched then
    std::int64_t period_ns = 0;   // since the last wake-up; 0 at the first
    std::int64_t compute_ns = 0;  // from wake-up's return to the end of the tick, by the stage clock
    Pose pose;                    // device_from_grip
    Twist velocity;
    Wrench rendered;            // after limits and fades: what the strings were asked to make
    Wrench made;                // by the tensions as the board has them, digits and all
    Vec3 proxy{0.0, 0.0, 0.0};  // m, local proxy of the first particle
    StringArray tensions{};     // N, as sent
    double residual = 0.0;      // m, of the redundant lengths
    std::uint64_t frame_sequence = 0;
    std::int64_t frame_age_ns = -1;  // -1: no frame yet
    std::uint32_t in_contact = 0;    // proxy particles
    std::uint32_t safety_state = 0;
    std::uint32_t faults = 0;
    std::uint32_t flags = 0;  // HAPTIC_TICK_*
    std::uint32_t buttons = 0;
};

}  // namespace haptic::rt
