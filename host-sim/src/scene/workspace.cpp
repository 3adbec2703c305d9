#include "haptic/sim/workspace.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <stdexcept>

#include "dynamics/rotation.hpp"

namespace haptic::sim {
namespace {

// s, minimum uncoupled time after a change of the mapping: a 1 kHz loop sees it, and the tool reaches its new pose.
constexpr double kMinUncoupledS = 0.02;

}  // namespace

Workspace::Workspace(const WorkspaceSettings& settings)
    : settings_(settings), requested_offset_(settings.offset), device_from_scene_(to_matrix(settings.rotation)) {
    if (!(settings.scale > 0.0) || !std::isfinite(settings.scale)) {
        throw std::invalid_argument("workspace: scale must be positive");
    }
    if (!(settings.force_scale >= 0.0) || !std::isfinite(settings.force_scale)) {
        throw std::invalid_argument("workspace: force scale must not be negative");
    }
}

Vec3 Workspace::to_scene(const Vec3& device_position) const noexcept {
    return glm::transpose(device_from_scene_) * (device_position - settings_.offset) / settings_.scale;
}

Vec3 Workspace::to_device(const Vec3& scene_position) const noexcept {
    return settings_.offset + device_from_scene_ * (settings_.scale * scene_position);
}

Vec3 Workspace::force_to_device(const Vec3& scene_force) const noexcept {
    return settings_.force_scale * (device_from_scene_ * scene_force);
}

Vec3 Workspace::velocity_to_device(const Vec3& scene_velocity) const noexcept {
    return device_from_scene_ * (settings_.scale * scene_velocity);
}

double Workspace::coupling_to_device(double scene_value) const noexcept {
    return settings_.force_scale * scene_value / settings_.scale;
}

double Workspace::work_to_device(double scene_work) const noexcept {
    return settings_.force_scale * settings_.scale * scene_work;
}

Vec3 Workspace::torque_to_device(const Vec3& scene_torque) const noexcept {
    return settings_.force_scale * settings_.scale * (device_from_scene_ * scene_torque);
}

Vec3 Workspace::force_to_scene(const Vec3& device_force) const noexcept {
    const Vec3 turned = glm::transpose(device_from_scene_) * device_force;
    return settings_.force_scale > 0.0 ? turned / settings_.force_scale : Vec3(0.0);
}

double Workspace::coupling_to_scene(double device_value) const noexcept {
    return settings_.force_scale > 0.0 ? device_value * settings_.scale / settings_.force_scale : 0.0;
}

Pose Workspace::to_scene(const Pose& grip) const noexcept {
    return {to_scene(grip.position), glm::conjugate(settings_.rotation) * grip.orientation * grip_from_tool_};
}

Pose Workspace::to_device(const Pose& tool) const noexcept {
    return {to_device(tool.position), settings_.rotation * tool.orientation * glm::conjugate(grip_from_tool_)};
}

Vec3 Workspace::offset_to_grip(const Vec3& tool_offset) const noexcept {
    return settings_.scale * (to_matrix(grip_from_tool_) * tool_offset);
}

ContactPlane Workspace::to_device(const SurfacePlane& plane) const noexcept {
    // n_s . x_s >= o_s with x_s = R^T (x_d - offset) / scale is (R n_s) . x_d >= scale o_s + (R n_s) . offset.
    const Vec3 normal = device_from_scene_ * plane.normal;
    ContactPlane result{};
    store(normal, result.normal);
    result.offset = settings_.scale * plane.offset + glm::dot(normal, settings_.offset);
    result.velocity = settings_.scale * plane.velocity;
    return result;
}

void Workspace::anchor(const Pose& grip, const Pose& tool) noexcept {
    settings_.offset = grip.position - device_from_scene_ * (settings_.scale * tool.position);
    grip_from_tool_ = glm::normalize(glm::conjugate(grip.orientation) * settings_.rotation * tool.orientation);
}

void Clutch::take_mapping(const Workspace& next, const Pose& grip, const Pose& tool, Workspace& workspace) noexcept {
    const bool moved = next.requested_offset() != workspace.requested_offset();
    workspace = next;
    uncoupled_left_s_ = kMinUncoupledS;
    hip_ = moved ? workspace.to_scene(grip) : tool;
}

Pose Clutch::engage(bool held, const Pose& grip, const Tool& tool, double step_s, Workspace& workspace) noexcept {
    const double fade = workspace.settings().clutch_fade;
    const double change = fade > step_s ? step_s / fade : 1.0;
    // `holds`: the hip does not follow the hand. held_ is last step's value, so the step of the release still anchors.
    const bool holds = held || changing();
    if (holds || held_) {
        if (!held_) {  // the hip stays where it was at the start of the hold
            hip_ = workspace.to_scene(grip);
        }
        if (holds) {
            gain_ = std::max(0.0, gain_ - change);
        }
        // Without coupling the hip can move to the tool unnoticed.
        if (uncoupled()) {
            hip_ = tool.pose;
            uncoupled_left_s_ = std::max(0.0, uncoupled_left_s_ - step_s);
        }
        if (uncoupled() && next_) {
            take_mapping(*next_, grip, tool.pose, workspace);
            next_.reset();
        }
        // The grip's present pose now maps to the hip.
        workspace.anchor(grip, hip_);
        if (!holds && uncoupled() && tool.in_shape) {
            gain_ = 1.0;  // no fade needed: with the hip at the tool the force is zero
        }
    } else {
        gain_ = std::min(1.0, gain_ + change);
        hip_ = workspace.to_scene(grip);
    }
    held_ = holds;
    return hip_;
}

}  // namespace haptic::sim
