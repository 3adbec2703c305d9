#include "haptic/sim/tool_joints.hpp"

#include <algorithm>
#include <stdexcept>
#include <string>

#include "dynamics/rotation.hpp"

namespace haptic::sim {
namespace {

void check(const ToolSkeleton& skeleton) {
    const auto refuse = [](const std::string& why) { throw std::invalid_argument("tool joints: " + why); };
    if (skeleton.joints.empty() || skeleton.bones.empty()) {
        refuse("a skeleton needs at least one joint and one bone");
    }
    // Parents first, so that one pass computes the forward kinematics. Joint 0 is its own parent.
    for (std::size_t j = 0; j < skeleton.joints.size(); ++j) {
        if (skeleton.joints[j].parent >= std::max<std::size_t>(j, 1)) {
            refuse("joint " + std::to_string(j) + " has parent " + std::to_string(skeleton.joints[j].parent) +
                   "; a parent must be an earlier joint");
        }
        if (!(skeleton.joints[j].full_curl > 0.0)) {
            refuse("joint " + std::to_string(j) + ": full_curl must be positive");
        }
    }
    // Bones must refer to existing joints.
    for (const ToolBone& bone : skeleton.bones) {
        if (bone.joint >= skeleton.joints.size()) {
            refuse("a bone refers to joint " + std::to_string(bone.joint) + "; the number of joints is " +
                   std::to_string(skeleton.joints.size()));
        }
    }
}

}  // namespace

ToolJoints::ToolJoints(const ToolSkeleton& skeleton, std::span<const Vec3> positions) : joints_(skeleton.joints) {
    check(skeleton);
    pose_.resize(joints_.size());
    pose_.front().position = joints_.front().position;
    // Bind each position rigidly to the joint of its nearest bone.
    for (const Vec3& p : positions) {
        const auto nearest =
            std::min_element(skeleton.bones.begin(), skeleton.bones.end(),
                             [&](const ToolBone& a, const ToolBone& b) { return distance(p, a) < distance(p, b); });
        joint_of_position_.push_back(nearest->joint);
        offset_.push_back(p - joints_[nearest->joint].position);
    }
}

void ToolJoints::apply_curl(double curl, std::span<Vec3> positions, std::span<Quat> rotations) noexcept {
    // Forward kinematics, parents first: R_j = R_parent R(w_j), p_j = p_parent + R_parent (p_j^0 - p_parent^0).
    for (std::size_t j = 1; j < joints_.size(); ++j) {
        const ToolJoint& joint = joints_[j];
        const JointPose& parent = pose_[joint.parent];
        // A joint's rotation vector grows with the curl up to the joint's full curl.
        const double curl_fraction = std::min(1.0, curl / joint.full_curl);
        pose_[j].rotation = parent.rotation * turned(Quat(1.0, 0.0, 0.0, 0.0), curl_fraction * joint.rotation);
        pose_[j].position =
            parent.position + to_matrix(parent.rotation) * (joint.position - joints_[joint.parent].position);
    }
    // Each position follows its joint rigidly.
    for (std::size_t i = 0; i < joint_of_position_.size(); ++i) {
        const JointPose& joint_pose = pose_[joint_of_position_[i]];
        positions[i] = joint_pose.position + to_matrix(joint_pose.rotation) * offset_[i];
        rotations[i] = joint_pose.rotation;
    }
}

}  // namespace haptic::sim
