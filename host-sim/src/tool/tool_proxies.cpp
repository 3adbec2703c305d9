#include "tool/tool_proxies.hpp"

#include <algorithm>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <stdexcept>
#include <string>

#include "contact/pop_out.hpp"
#include "contact/secure_position.hpp"
#include "contact/speculative_planes.hpp"
#include "dynamics/rotation.hpp"

namespace haptic::sim {
namespace {

// Iterations of extract_rotation() for the tool's pose, starting at the hip's orientation.
constexpr int kPoseIterations = 6;
// Iterations of extract_rotation() for a particle's orientation, starting at the hip's.
constexpr int kOrientationIterations = 4;
// Part of the radius: a particle this near to its position in the fitted pose counts as in shape.
constexpr double kShapeTolerance = 1e-6;

/// Checks the model and returns its body. Throws std::invalid_argument.
DeformableBody body_of(const ToolModel& model) {
    const std::size_t count = model.body.particles.size();
    const auto refuse = [](const std::string& why) { throw std::invalid_argument("tool: " + why); };
    if (count < 1 || count > ToolSettings::kMaxSpheres) {
        refuse("has " + std::to_string(count) + " particles; must be 1 to " +
               std::to_string(ToolSettings::kMaxSpheres));
    }
    if (model.radius.size() != count) {
        refuse("has " + std::to_string(count) + " particles, but " + std::to_string(model.radius.size()) + " radii");
    }
    for (std::size_t i = 0; i < count; ++i) {
        if (!(model.radius[i] > 0.0)) {
            refuse("sphere " + std::to_string(i) + " has a radius of " + std::to_string(model.radius[i]) +
                   " m; must be positive");
        }
    }
    return model.body;
}

}  // namespace

ToolProxies::ToolProxies(const ToolModel& model, const Settings& settings, const Pose& where, double curl)
    : settings_(settings),
      requested_reach_(settings.reach),
      body_(body_of(model)),
      joints_(model.joints),
      rest_rotation_(body_.particles.size(), Quat(1.0, 0.0, 0.0, 0.0)),
      elasticity_({.rest_offset = body_.particles.rest_position,
                   .volume = model.volume,
                   .radius = model.radius,
                   .groups = body_.particles.groups},
                  model.material, settings.springs),
      particles_(body_.particles.size()),
      force_(particles_.size(), Vec3(0.0)),
      plane_force_(particles_.size()),
      target_(particles_.size()),
      grips_(particles_.size()),
      barriers_(particles_.size()),
      barrier_rows_(particles_.size()),
      row_depth_(kMaxContactRows),
      displacement_(particles_.size()),
      free_way_(particles_.size()),
      free_shift_(particles_.size()),
      contact_candidates_(particles_.size()),
      speculative_tasks_(particles_.size()),
      candidate_queries_(particles_.size()),
      secure_(particles_.size()) {
    in_the_way_.reserve(particles_.size());
    rows_.reserve(kMaxContactRows);
    friction_rows_.reserve(particles_.size());
    // The skin is for display only; it follows its own copy of the particles.
    if (!body_.mesh.vertices.empty()) {
        skinner_ = std::make_unique<Skinner>(body_.mesh.vertices, body_.particles, body_.skin);
        posed_ = std::make_unique<ParticleModel>(body_.particles);
    }
    // Place the tool in its rest shape at the given pose, without goal velocity.
    for (std::size_t i = 0; i < particles_.size(); ++i) {
        particles_[i].radius = model.radius[i];
    }
    limit_reach();
    if (!joints_.empty()) {
        std::vector<Quat> rotation(particles_.size());
        elasticity_.tabulate(
            [&](double at_curl, std::span<Vec3> rest_offset) { joints_.apply_curl(at_curl, rest_offset, rotation); });
    }
    update_rest_offsets();
    set_goals(where, curl);
    has_goals_ = false;
    for (std::size_t i = 0; i < particles_.size(); ++i) {
        ToolProxy& p = particles_[i];
        p.position = p.constrained_goal = p.goal;
    }
    pose_ = where;
    // Links between overlapping spheres, which must not let surfaces through.
    if (settings_.closed) {
        find_closed_links();
    }
}

bool ToolProxies::has_friction() const noexcept {
    return settings_.contact.static_friction > 0.0 || settings_.contact.dynamic_friction > 0.0;
}

Mat3 ToolProxies::compliance(std::size_t i, std::size_t j) const {
    const Mat3 rotation = to_matrix(hip_.orientation * turn_);
    return rotation * elasticity_.compliance(i, j) * glm::transpose(rotation);
}

ProxyPath* ToolProxies::path_of(std::size_t particle) noexcept {
    return paths_.empty() ? nullptr : &paths_[particle];
}

void ToolProxies::keep_paths(bool on) {
    paths_.resize(on ? particles_.size() : 0);
}

void ToolProxies::change(const ContactSettings& contact, const ToolElasticity::Springs& springs, double radius) {
    // Contact settings, the coupling's springs and, for a single sphere, its radius.
    settings_.contact = contact;
    if (springs != elasticity_.springs()) {
        elasticity_.set_springs(springs);
    }
    for (ToolProxy& p : particles_) {
        p.radius = radius > 0.0 ? radius : p.radius;
        if (!has_friction()) {
            p.friction = {};  // stale contacts must not hold it when friction returns
        }
    }
    limit_reach();
}

/// Speculative planes must not reach farther than the smallest radius.
void ToolProxies::limit_reach() {
    settings_.reach = requested_reach_;
    for (const ToolProxy& p : particles_) {
        settings_.reach = std::min(settings_.reach, p.radius);
    }
}

void ToolProxies::update_rest_offsets() {
    rest_centre_ = Vec3(0.0);
    for (std::size_t i = 0; i < particles_.size(); ++i) {
        particles_[i].rest_offset = body_.particles.rest_position[i];
        rest_centre_ += particles_[i].rest_offset;
    }
    rest_centre_ /= static_cast<double>(particles_.size());
}

void ToolProxies::apply_curl(double curl) {
    joints_.apply_curl(curl, body_.particles.rest_position, rest_rotation_);
    update_rest_offsets();
    elasticity_.set_curl(curl, body_.particles.rest_position);
    curl_ = curl;
}

void ToolProxies::set_goals(const Pose& hip, double curl) {
    effort_ = {};
    // Rest offsets at the new curl, and their velocity.
    for (ToolProxy& p : particles_) {
        p.rest_velocity = -p.rest_offset;
    }
    if (curl != curl_ && !joints_.empty()) {
        apply_curl(std::clamp(curl, 0.0, 1.0));
    }
    for (ToolProxy& p : particles_) {
        p.rest_velocity = (p.rest_velocity + p.rest_offset) / settings_.step;
    }
    // Eq. 5.1: g_i = Q o_i + d. The first step has no previous goal, so its goal velocity is 0.
    const Mat3 rotation = to_matrix(hip.orientation);
    hip_turn_ = has_goals_ ? rotation * glm::transpose(to_matrix(hip_.orientation)) : Mat3(1.0);
    for (ToolProxy& p : particles_) {
        const Vec3 goal = rotation * p.rest_offset + hip.position;
        p.goal_velocity = has_goals_ ? (goal - p.goal) / settings_.step : Vec3(0.0);
        p.goal = p.free_position = goal;
        p.free_offset = p.rest_offset;
    }
    hip_ = hip;
    has_goals_ = true;
}

void ToolProxies::collect(std::span<const MovingSurface> surfaces) {
    // One query for all phases of the step: triangles near the path from position to goal.
    for (std::size_t i = 0; i < particles_.size(); ++i) {
        const ToolProxy& p = particles_[i];
        candidate_queries_[i] = {.position = p.position, .goal = p.goal, .radius = p.radius};
    }
    contact_candidates_.collect(surfaces, candidate_queries_);
    surfaces_ = surfaces;
}

bool ToolProxies::find_secure_positions() {
    in_the_way_.clear();
    for (std::size_t i = 0; i < particles_.size(); ++i) {
        const ToolProxy& p = particles_[i];
        if (!paths_.empty()) {
            paths_[i].restart(p.position);
        }
        // Section 4.2.2: secure position after the surfaces have moved through the step.
        const SecurePosition secure =
            secure_position(contact_candidates_.of(i), p.position, p.radius, settings_.contact, path_of(i));
        secure_[i] = secure.position;
        if (secure.no_room) {
            in_the_way_.push_back(secure.in_the_way.object);
        }
        // Report the worst particle.
        effort_.advances = std::max(effort_.advances, secure.advances);
        effort_.overconstrained = effort_.overconstrained || secure.overconstrained;
    }
    if (!in_the_way_.empty()) {
        return false;
    }
    for (std::size_t i = 0; i < particles_.size(); ++i) {
        particles_[i].position = secure_[i];
    }
    return true;
}

void ToolProxies::pop_out() {
    for (std::size_t i = 0; i < particles_.size(); ++i) {
        ToolProxy& p = particles_[i];
        // Section 4.2.4: remove the overlap that the CCD left.
        const PopOut popped =
            sim::pop_out(contact_candidates_.of(i), p.position, p.radius, settings_.contact, path_of(i));
        p.position = popped.position;
        effort_.pop_out_iterations = std::max(effort_.pop_out_iterations, popped.iterations);
        effort_.overconstrained = effort_.overconstrained || popped.overconstrained;
    }
}

void ToolProxies::fit_pose() {
    if (!stopped_) {
        // All particles are at their goals, to the tolerance of a move.
        pose_ = hip_;
    }
    // Centre c of the particles.
    Vec3 centre(0.0);
    for (const ToolProxy& p : particles_) {
        centre += p.position;
    }
    centre /= static_cast<double>(particles_.size());
    if (stopped_) {
        const Mat3 moment = moment_about(centre, [this](std::size_t i) { return particles_[i].position; });
        pose_.orientation = extract_rotation(moment, hip_.orientation, kPoseIterations);
    }
    // Translation that maps the rest centre to the centre: t = c - R o_c.
    const Mat3 rotation = to_matrix(pose_.orientation);
    pose_.position = centre - rotation * rest_centre_;
    // In shape: no particle deviates from R o_i + t by more than the tolerance.
    in_shape_ = true;
    for (const ToolProxy& p : particles_) {
        const Vec3 deviation = p.position - (pose_.position + rotation * p.rest_offset);
        in_shape_ =
            in_shape_ && glm::dot(deviation, deviation) <= kShapeTolerance * kShapeTolerance * p.radius * p.radius;
    }
}

void ToolProxies::collect_speculative_planes(double step) {
    // Query at the position where the contact planes touch the particle; they come first in the result.
    for (std::size_t i = 0; i < particles_.size(); ++i) {
        const ToolProxy& p = particles_[i];
        // The planes expire 1.5 steps from now; the surfaces' velocities are those of the last step.
        SpeculativeQuery query{
            .position = p.position, .radius = p.radius, .reach = settings_.reach, .dt = settings_.step};
        query.horizon *= step / settings_.step;
        speculative_tasks_[i] = {p.contacts, query, {}};
    }
    // All particles share one traversal of each tree.
    speculative_planes(contact_candidates_.all(), speculative_tasks_);
    for (std::size_t i = 0; i < particles_.size(); ++i) {
        particles_[i].planes = speculative_tasks_[i].planes;
    }
}

/// Evaluates the skin for the particles in posed_. The skin was bound at curl 0, so the rotation by the current curl is
/// added to each particle's orientation.
void ToolProxies::skin(std::span<Vec3> out) const {
    if (!skinner_) {
        return;
    }
    for (std::size_t i = 0; i < posed_->size(); ++i) {
        posed_->orientation[i] = posed_->orientation[i] * rest_rotation_[i];
    }
    skinner_->skin_vertices(*posed_, out);
}

void ToolProxies::vertices(std::span<Vec3> out) const {
    if (posed_) {
        pose_particles();
    }
    skin(out);
}

/// Present positions for the skin; the orientation of every particle is that of its group, by shape matching from the
/// pose's orientation.
void ToolProxies::pose_particles() const {
    for (std::size_t i = 0; i < particles_.size(); ++i) {
        posed_->position[i] = particles_[i].position;
        posed_->orientation[i] = pose_.orientation;
    }
    if (!stopped_) {
        return;
    }
    const Mat3 rotation = to_matrix(pose_.orientation);
    for (const Group& group : body_.particles.groups) {
        // Means of the members, now and in the rest shape.
        Vec3 centre(0.0);
        Vec3 rest_centre(0.0);
        for (const std::uint32_t member : group.members) {
            centre += particles_[member].position;
            rest_centre += particles_[member].rest_offset;
        }
        const double count = static_cast<double>(group.members.size());
        centre /= count;
        rest_centre /= count;
        // Moment matrix; each member counts as a ball, so that a row has a rotation too.
        Mat3 moment(0.0);
        for (const std::uint32_t member : group.members) {
            const Vec3 offset = particles_[member].position - centre;
            const Vec3 rest = particles_[member].rest_offset - rest_centre;
            const double ball = particles_[member].radius * particles_[member].radius / 5.0;
            moment += Mat3(offset * rest.x, offset * rest.y, offset * rest.z) + ball * rotation;
        }
        posed_->orientation[group.centre] = extract_rotation(moment, pose_.orientation, kOrientationIterations);
    }
}

std::vector<Vec3> ToolProxies::vertices() const {
    std::vector<Vec3> out(body_.mesh.vertices.size());
    vertices(out);
    return out;
}

std::vector<Vec3> ToolProxies::goal_vertices() const {
    std::vector<Vec3> out(body_.mesh.vertices.size());
    // Skin of the undeformed tool at the hip: every particle at its goal.
    for (std::size_t i = 0; posed_ && i < posed_->size(); ++i) {
        posed_->position[i] = particles_[i].goal;
        posed_->orientation[i] = hip_.orientation;
    }
    skin(out);
    return out;
}

}  // namespace haptic::sim
