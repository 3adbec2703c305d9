#include <haptic/sim/tool_joints.hpp>

#include <algorithm>
#include <stdexcept>
#include <string>

#include "dynamics/rotation.hpp"

namespace haptic::sim {
namespace {

void check(const ToolSkeleton& skeleton) {
    const auto refuse = [](const std::string& why) { throw std::invalid_argument("tool joints: " + why); };
    if (skeleton.joints.empty() || skeleton.bones.empty()) {
        refuse("a skeleton needs a joint and a bone");
    }
    for (std::size_t j = 0; j < skeleton.joints.size(); ++j) {
        if (skeleton.joints[j].parent >= std::max<std::size_t>(j, 1)) {
            refuse("joint " + std::to_string(j) + " hangs on joint " + std::to_string(skeleton.joints[j].parent) +
                   ", which does not come before it");
        }
        if (!(skeleton.joints[j].done_at > 0.0)) {
            refuse("joint " + std::to_string(j) + " is done turning at a curl that is not positive");
        }
    }
    for (const ToolBone& bone : skeleton.bones) {
        if (bone.joint >= skeleton.joints.size()) {
            refuse("a bone hangs on joint " + std::to_string(bone.joint) + ", but there are " +
                   std::to_string(skeleton.joints.size()));
        }
    }
}

}  // namespace

ToolJoints::ToolJoints(const ToolSkeleton& skeleton, std::span<const Vec3> places) : joints_(skeleton.joints) {
    check(skeleton);
    moved_.resize(joints_.size());
    moved_.front().place = joints_.front().place;
    for (const Vec3& p : places) {
        const auto nearest =
            std::min_element(skeleton.bones.begin(), skeleton.bones.end(),
                             [&](const ToolBone& a, const ToolBone& b) { return distance(p, a) < distance(p, b); });
        of_place_.push_back(nearest->joint);
        lever_.push_back(p - joints_[nearest->joint].place);
    }
}

void ToolJoints::close(double curl, std::span<Vec3> places, std::span<Quat> turns) noexcept {
    for (std::size_t j = 1; j < joints_.size(); ++j) {
        const ToolJoint& joint = joints_[j];
        const Moved& parent = moved_[joint.parent];
        const double part = std::min(1.0, curl / joint.done_at);
        moved_[j].turn = parent.turn * turned(Quat(1.0, 0.0, 0.0, 0.0), part * joint.turn);
        moved_[j].place = parent.place + to_matrix(parent.turn) * (joint.place - joints_[joint.parent].place);
    }
    for (std::size_t i = 0; i < of_place_.size(); ++i) {
        const Moved& by = moved_[of_place_[i]];
        places[i] = by.place + to_matrix(by.turn) * lever_[i];
        turns[i] = by.turn;
    }
}

}  // namespace haptic::sim
