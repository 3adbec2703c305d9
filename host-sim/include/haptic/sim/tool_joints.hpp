// Tool joints: a kinematic tree that closes a tool's rest shape by one number, the curl.
//
// The curl runs from 0, the shape in which the tool was made, to 1, closed. Joint j rotates its subtree about w_j by
// 2 atan(c |w_j| / 2) (Cayley map, rotation.hpp), c = min(1, curl / full_curl), after its parent's rotation. A curl
// thus gives each particle a rest position and a rest orientation. Nothing is integrated and no earlier curl is
// remembered, as the haptic constraint requires (thesis, Eq. 5.1, with o_i a function of the curl). The thesis' hand
// does not articulate (section 5.7).
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <glm/geometric.hpp>
#include <span>
#include <vector>

#include "haptic/types.hpp"

namespace haptic::sim {

struct ToolJoint {
    std::uint32_t parent = 0;  // an earlier joint; joint 0, the root, is its own parent and fixed
    Vec3 position{0.0};        // m, at curl 0
    Vec3 rotation{0.0};        // w_j, as turned() takes it: 2 tan(angle / 2) about the axis, axes as at curl 0
    double full_curl = 1.0;    // curl, positive, at which the rotation is complete
};

/// Bone moved by a joint: the volume swept by a ball from one end to the other, its radius linear between them.
struct ToolBone {
    std::uint32_t joint = 0;
    Vec3 from{0.0};            // m, at curl 0
    double from_radius = 0.0;  // m
    Vec3 to{0.0};
    double to_radius = 0.0;
};

struct ToolSkeleton {
    std::vector<ToolJoint> joints;
    std::vector<ToolBone> bones;
};

/// m, approximate signed distance of a point from a bone's surface; negative inside.
[[nodiscard]] inline double distance(const Vec3& p, const ToolBone& bone) noexcept {
    const Vec3 along = bone.to - bone.from;
    const double t = std::clamp(glm::dot(p - bone.from, along) / glm::dot(along, along), 0.0, 1.0);
    return glm::length(p - (bone.from + t * along)) - (bone.from_radius + t * (bone.to_radius - bone.from_radius));
}

class ToolJoints {
  public:
    /// No joints: the rest shape is fixed.
    ToolJoints() = default;
    /// Binds each position (m, curl 0) to the bone with the smallest signed distance. Throws std::invalid_argument: no
    /// joint or bone, a parent that is not an earlier joint, an unknown joint.
    ToolJoints(const ToolSkeleton& skeleton, std::span<const Vec3> positions);

    [[nodiscard]] bool empty() const noexcept { return joint_of_position_.empty(); }
    [[nodiscard]] std::size_t joints() const noexcept { return joints_.size(); }
    /// The joint that a position is bound to.
    [[nodiscard]] std::uint32_t joint_of(std::size_t position) const { return joint_of_position_[position]; }

    /// Forward kinematics: positions (m) at a curl of 0..1, and rotations relative to curl 0. Sizes as in the
    /// constructor. No allocation, no libm but sqrt.
    void apply_curl(double curl, std::span<Vec3> positions, std::span<Quat> rotations) noexcept;

  private:
    struct JointPose {
        Vec3 position{0.0};
        Quat rotation{1.0, 0.0, 0.0, 0.0};
    };

    std::vector<ToolJoint> joints_;
    std::vector<std::uint32_t> joint_of_position_;
    std::vector<Vec3> offset_;     // m, per position: relative to its joint, at curl 0
    std::vector<JointPose> pose_;  // per joint; the root's is constant
};

}  // namespace haptic::sim
