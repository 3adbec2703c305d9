// Pose proof: whether the grip was level at the centre when its lengths were set, judged from movement.
//
// Encoders are relative: calibration declares the present pose to be level at the centre. If it was the pose x instead
// (translation and rotation vector), every length is wrong by L(x) - L(0) = -W_0 x, with W_0 the wire matrix at the
// centre. At another pose the eight lengths then contradict each other: least squares leave the residual
//
//     r_k = Q_k W_0 x,    Q_k = 1 - W_k (W_k^T W_k)^-1 W_k^T    (projection onto the two redundant lengths)
//
// One pose shows two of the six unknowns, and some movement shows all: x minimises sum |r_k - Q_k W_0 x|^2, so
//
//     H x = g,    H = sum W_0^T Q_k W_0,    g = sum W_0^T r_k    (Q_k is a projection, and Q_k r_k = r_k).
//
// Two strings or encoders that are exchanged, or an encoder that counts the wrong way (a mix-up h), make lengths that
// no pose and no x explain: what remains, sum |r_k|^2 - g.x, has 2 degrees of freedom a sample. How much a mix-up would
// leave depends on the movement: it changes the lengths l_k - L(0) by d_hk, so
//
//     v_h = sum |Q_k d_hk|^2 - c_h H^-1 c_h,    c_h = sum W_0^T Q_k d_hk.
//
// The pose is proved only after a movement that would have shown each of the 36 mix-ups. If it is not proved, the
// mix-up whose correction d_hk leaves the least names the strings.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "device/kinematics.hpp"
#include "haptic/realtime.hpp"

namespace haptic::rt {

struct PoseProofSettings {
    double position = 0.01;      // m, largest offset of the centre
    double angle = 0.2;          // rad, largest rotation from level
    double certainty = 0.25;     // of these limits: largest standard deviation with which the offset must be known
    double length_error = 3e-4;  // m, standard deviation of a length, mostly by errors of the geometry
    double unexplained = 1.5;    // times length_error: largest rms of the residuals that no offset explains
    double visible = 9;          // ratio of what each mix-up would leave to what remains, both as sums of squares
    double spacing = 1e-3;       // m, between samples, by the string that moved the most
};

class PoseProof {
  public:
    enum class Verdict : std::uint8_t { Pending, Passed, Refused };

    /// Throws std::invalid_argument for settings that are not positive and finite.
    PoseProof(const device::DeviceGeometry& geometry, const PoseProofSettings& settings);

    /// Forgets all samples: lengths were set anew.
    void reset() HAPTIC_RT;
    /// Takes one tick's lengths and their least-squares pose. The verdict is final until reset().
    Verdict update(const StringArray& lengths, const PoseEstimate& estimate, const WireMatrix& wires) HAPTIC_RT;

    [[nodiscard]] Verdict verdict() const HAPTIC_RT { return verdict_; }
    /// Pose of the grip, relative to level at the centre, when the lengths were set: translation, m, and rotation
    /// vector, rad. Zero before there is a sample.
    [[nodiscard]] const Vec6& offset() const HAPTIC_RT { return offset_; }
    /// Largest standard deviation of the offset in units of the limits; 1 before there is a sample.
    [[nodiscard]] double uncertainty() const HAPTIC_RT { return uncertainty_; }
    /// Bit i: string i belongs to the mix-up that explains the lengths much better than none; 0 if there is no such.
    [[nodiscard]] std::uint8_t suspects() const HAPTIC_RT;
    [[nodiscard]] std::size_t samples() const HAPTIC_RT { return samples_; }

  private:
    using Mat6 = std::array<Vec6, 6>;
    using Projection = std::array<StringArray, kStrings>;  // Q_k

    /// An encoder that counts the wrong way, or two strings that are exchanged.
    struct MixUp {
        std::size_t first = 0;
        std::size_t second = 0;  // the same string: it counts the wrong way
        double squares = 0.0;    // m^2, sum |Q_k d_hk|^2
        double cross = 0.0;      // m^2, sum r_k.d_hk
        Vec6 explained{};        // c_h
    };
    static constexpr std::size_t kMixUps = kStrings * (kStrings + 1) / 2;

    void add_sample(const StringArray& lengths, const PoseEstimate& estimate, const WireMatrix& wires) HAPTIC_RT;
    void add_mix_up(MixUp& mix_up, const StringArray& lengths, const StringArray& residuals,
                    const Projection& projection) HAPTIC_RT;
    void judge() HAPTIC_RT;
    [[nodiscard]] bool excludes_mix_ups(const Mat6& factor, double unexplained) const HAPTIC_RT;
    /// m^2, largest sum of squares that may remain.
    [[nodiscard]] double tolerated() const HAPTIC_RT;

    PoseProofSettings settings_;
    WireMatrix centre_;     // W_0, columns in units of the limits
    Mat6 information_{};    // H
    Vec6 evidence_{};       // g
    double squares_ = 0.0;  // m^2, sum |r_k|^2
    std::array<MixUp, kMixUps> mix_ups_{};
    StringArray rest_{};  // m, L(0)
    StringArray last_{};  // m, lengths of the last sample
    Vec6 offset_{};
    double uncertainty_ = 1.0;
    std::size_t samples_ = 0;
    Verdict verdict_ = Verdict::Pending;
};

}  // namespace haptic::rt
