#include "tick/device_proof.hpp"

#include <algorithm>
#include <glm/geometric.hpp>
#include <limits>

#include "haptic/numeric.hpp"

namespace haptic::rt {
namespace {

template <typename Verdict>
Proof proof_of(Verdict verdict) HAPTIC_RT {
    if (verdict == Verdict::Pending) {
        return Proof::Pending;
    }
    return verdict == Verdict::Passed ? Proof::Passed : Proof::Refused;
}

}  // namespace

DeviceProof::DeviceProof(const device::DeviceGeometry& geometry, const DeviceProofSettings& settings, bool required)
    : settings_(settings),
      required_(required),
      wiring_(geometry, settings.wiring),
      pose_(geometry, settings.pose),
      minimum_tension_(geometry.minimum_tension),
      unproven_scale_(settings.tension / std::max(geometry.minimum_tension, settings.tension)) {}

void DeviceProof::begin() HAPTIC_RT {
    wiring_.reset();
    begin_pose();
}

void DeviceProof::begin_pose() HAPTIC_RT {
    pose_.reset();
    risen_ = 0.0;
}

Proof DeviceProof::prove_wiring(const StringArray& lengths, std::int64_t elapsed_ns) HAPTIC_RT {
    return proof_of(wiring_.update(lengths, elapsed_ns));
}

Proof DeviceProof::prove_pose(const StringArray& lengths, const PoseEstimate& estimate,
                              const WireMatrix& wires) HAPTIC_RT {
    return required_ ? proof_of(pose_.update(lengths, estimate, wires)) : Proof::Passed;
}

void DeviceProof::advance(double elapsed_s) HAPTIC_RT {
    if (pose_.verdict() == PoseProof::Verdict::Passed) {
        risen_ = std::min(1.0, risen_ + elapsed_s / seconds(settings_.rise_ns));
    }
}

double DeviceProof::tension_scale() const HAPTIC_RT {
    return limits() ? unproven_scale_ + (1.0 - unproven_scale_) * smooth_step(risen_) : 1.0;
}

double DeviceProof::max_tension() const HAPTIC_RT {
    return limits() && risen_ == 0.0 ? settings_.spread * minimum_tension_ : std::numeric_limits<double>::infinity();
}

double DeviceProof::wrench_scale(const Wrench& wrench) const HAPTIC_RT {
    if (!limits()) {
        return 1.0;
    }
    // The larger of force and torque, in units of their limits.
    const double size =
        std::max(glm::length(wrench.force) / settings_.force, glm::length(wrench.torque) / settings_.torque);
    const double limited = size > 1.0 ? 1.0 / size : 1.0;
    return limited + (1.0 - limited) * smooth_step(risen_);
}

DeviceProofResult DeviceProof::result() const noexcept {
    return {.required = required_,
            .wiring = proof_of(wiring_.verdict()),
            .pose = proof_of(pose_.verdict()),
            .findings = wiring_.findings(),
            .others = wiring_.others(),
            .rounds = wiring_.rounds(),
            .offset = pose_.offset()};
}

}  // namespace haptic::rt
