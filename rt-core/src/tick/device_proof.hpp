// Device proof: a device renders only after it has proved itself.
//
//     wiring   before calibration, by slight pulls of each motor in turn (wiring_proof.hpp)
//     pose     after it, by the movement of the grip (pose_proof.hpp); until then the wrench is limited, and all
//              tensions are scaled down, so that a device whose centre or strings are wrong
//              cannot push
//
// When the pose is proved, both rise smoothly to their usual values.
#pragma once

#include <array>
#include <cstdint>

#include "device/pose_proof.hpp"
#include "device/wiring_proof.hpp"
#include "haptic/realtime.hpp"
#include "haptic/types.hpp"
#include "tick/safety.hpp"

namespace haptic::rt {

struct DeviceProofSettings {
    WiringProofSettings wiring;
    PoseProofSettings pose;
    double tension = 0.1;                  // N, minimum tension until the pose is proved, at most the usual one
    double spread = 2.5;                   // largest tension over the minimum until then
    double force = 0.2;                    // N, largest force until the pose is proved
    double torque = 4e-3;                  // N*m, largest torque until then
    std::int64_t rise_ns = 1'000'000'000;  // ns, from these limits to those of the wrench
};

/// Result for the report.
struct DeviceProofResult {
    bool required = false;
    Proof wiring = Proof::Pending;
    Proof pose = Proof::Pending;
    std::array<StringFinding, kStrings> findings{};
    std::array<std::uint8_t, kStrings> others{};
    int rounds = 0;  // of the wiring proof
    Vec6 offset{};   // m and rad, of the pose at which the lengths were set
};

class DeviceProof {
  public:
    DeviceProof(const device::DeviceGeometry& geometry, const DeviceProofSettings& settings, bool required);

    /// Begins anew: the device is armed.
    void begin() HAPTIC_RT;
    /// The lengths were set: the pose must be proved.
    void begin_pose() HAPTIC_RT;

    /// One tick while Proving. elapsed_ns: since the last one.
    Proof prove_wiring(const StringArray& lengths, std::int64_t elapsed_ns) HAPTIC_RT;
    /// One tick while Running, with its pose.
    Proof prove_pose(const StringArray& lengths, const PoseEstimate& estimate, const WireMatrix& wires) HAPTIC_RT;

    /// N, of all strings in this tick of the wiring proof.
    [[nodiscard]] StringArray wiring_tensions() const HAPTIC_RT { return wiring_.tensions(); }
    /// Takes the time since the last tick while Running, for the rise.
    void advance(double elapsed_s) HAPTIC_RT;
    /// N, largest tension of a string before that factor; infinite once the pose is proved. A wrong pose may ask for
    /// much.
    [[nodiscard]] double max_tension() const HAPTIC_RT;
    /// Factor on all tensions, 0..1.
    [[nodiscard]] double tension_scale() const HAPTIC_RT;
    /// Factor on a wrench, 0..1, that keeps it within the limit of an unproven pose.
    [[nodiscard]] double wrench_scale(const Wrench& wrench) const HAPTIC_RT;
    /// Bit i: string i was not found right by the wiring proof, or explains why the pose could not be proved.
    [[nodiscard]] std::uint8_t suspects() const HAPTIC_RT {
        return wiring_.suspects() != 0 ? wiring_.suspects() : pose_.suspects();
    }
    /// The wrench is limited.
    [[nodiscard]] bool limits() const HAPTIC_RT { return required_ && risen_ < 1.0; }
    [[nodiscard]] DeviceProofResult result() const noexcept;

  private:
    DeviceProofSettings settings_;
    bool required_;
    WiringProof wiring_;
    PoseProof pose_;
    double minimum_tension_;  // N
    double unproven_scale_;   // factor on all tensions until the pose is proved
    double risen_ = 0.0;      // 0..1, since the pose was proved
};

}  // namespace haptic::rt
