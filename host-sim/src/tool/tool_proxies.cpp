#include "tool/tool_proxies.hpp"

#include <algorithm>
#include <glm/geometric.hpp>
#include <stdexcept>
#include <string>

#include "contact/active_contacts.hpp"
#include "contact/pop_out.hpp"
#include "contact/secure_position.hpp"
#include "contact/speculative_planes.hpp"
#include "contact/virtual_proxy.hpp"
#include "dynamics/rotation.hpp"

namespace haptic::sim {
namespace {

// Iterations of extract_rotation() for the tool's pose, starting at the hip's orientation.
constexpr int kPoseIterations = 6;
// Part of the radius: a particle this near to its position in the fitted pose counts as in shape.
constexpr double kShapeTolerance = 1e-6;

/// Checks the model and returns its body. Throws std::invalid_argument.
DeformableBody body_of(const ToolModel& model, double reach) {
    const std::size_t count = model.body.particles.size();
    const auto refuse = [](const std::string& why) { throw std::invalid_argument("tool: " + why); };
    if (count < 1 || count > ToolSettings::kMaxSpheres) {
        refuse("has " + std::to_string(count) + " particles; must be 1 to " +
               std::to_string(ToolSettings::kMaxSpheres));
    }
    if (model.radius.size() != count) {
        refuse("has " + std::to_string(count) + " particles, but " + std::to_string(model.radius.size()) + " radii");
    }
    // The reach of speculative planes must not exceed any radius.
    for (std::size_t i = 0; i < count; ++i) {
        if (!(model.radius[i] > 0.0) || model.radius[i] < reach) {
            refuse("sphere " + std::to_string(i) + " has a radius of " + std::to_string(model.radius[i]) +
                   " m; must be positive and not below proxy.reach, which is " + std::to_string(reach) + " m");
        }
    }
    return model.body;
}

SolverSettings settings_of_solver(const ToolModel& model, double step) {
    SolverSettings settings;
    settings.step = step;
    settings.iterations = model.iterations;
    return settings;
}

}  // namespace

ToolProxies::ToolProxies(const ToolModel& model, const Settings& settings, const Pose& where, double curl)
    : settings_(settings),
      requested_reach_(settings.reach),
      body_(body_of(model, settings.reach)),
      solver_(body_.particles, settings_of_solver(model, settings.step)),
      joints_(model.joints),
      rest_rotation_(body_.particles.size(), Quat(1.0, 0.0, 0.0, 0.0)),
      particles_(body_.particles.size()),
      contact_candidates_(particles_.size()),
      speculative_tasks_(particles_.size()),
      candidate_queries_(particles_.size()),
      last_position_(particles_.size()),
      fixed_(particles_.size(), 0) {
    // The skin is for display only; it follows its own copy of the particles.
    if (!body_.mesh.vertices.empty()) {
        skinner_ = std::make_unique<Skinner>(body_.mesh.vertices, body_.particles, body_.skin);
        posed_ = std::make_unique<ParticleModel>(body_.particles);
    }
    // Place the tool in its rest shape at the given pose, without goal velocity.
    for (std::size_t i = 0; i < particles_.size(); ++i) {
        particles_[i].radius = model.radius[i];
    }
    update_rest_offsets();
    set_goals(where, curl);
    has_goals_ = false;
    for (std::size_t i = 0; i < particles_.size(); ++i) {
        ToolProxy& p = particles_[i];
        p.position = p.constrained_goal = p.contact_position = last_position_[i] = body_.particles.position[i] = p.goal;
        body_.particles.orientation[i] = where.orientation;
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

ProxyPath* ToolProxies::path_of(std::size_t particle) noexcept {
    return paths_.empty() ? nullptr : &paths_[particle];
}

void ToolProxies::keep_paths(bool on) {
    paths_.resize(on ? particles_.size() : 0);
}

void ToolProxies::change(const ContactSettings& contact, int iterations, double radius) {
    // Contact settings, solver iterations and, for a single sphere, its radius.
    settings_.contact = contact;
    solver_.set_step_and_iterations(solver_.settings().step, iterations);
    for (ToolProxy& p : particles_) {
        p.radius = radius > 0.0 ? radius : p.radius;
        if (!has_friction()) {
            p.friction = {};  // stale contacts must not hold it when friction returns
        }
    }
    // Speculative planes must not reach farther than the smallest radius.
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
    curl_ = curl;
    rest_shape_changed_ = true;
}

void ToolProxies::set_goals(const Pose& hip, double curl) {
    if (curl != curl_ && !joints_.empty()) {
        apply_curl(std::clamp(curl, 0.0, 1.0));
    }
    // Eq. 5.1: g_i = Q o_i + d. The first step has no previous goal, so its goal velocity is 0.
    const Mat3 rotation = to_matrix(hip.orientation);
    for (ToolProxy& p : particles_) {
        const Vec3 goal = rotation * p.rest_offset + hip.position;
        p.goal_velocity = has_goals_ ? (goal - p.goal) / settings_.step : Vec3(0.0);
        p.goal = goal;
    }
    // Later phases start the constraints at the hip's orientation.
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

void ToolProxies::find_secure_positions() {
    effort_ = {};
    for (std::size_t i = 0; i < particles_.size(); ++i) {
        ToolProxy& p = particles_[i];
        // Start of the step, from which the surfaces carry a sticking particle (friction).
        last_position_[i] = p.position;
        if (!paths_.empty()) {
            paths_[i].restart(p.position);
        }
        // Section 4.2.2: secure position after the surfaces have moved through the step.
        const SecurePosition secure =
            secure_position(contact_candidates_.of(i), p.position, p.radius, settings_.contact, path_of(i));
        p.position = secure.position;
        // Report the worst particle.
        effort_.advances = std::max(effort_.advances, secure.advances);
        effort_.overconstrained = effort_.overconstrained || secure.overconstrained;
        effort_.passed_through = effort_.passed_through || secure.passed_through;
    }
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

/// Traditional proxy method (Ruspini 1997) from the current position to a goal, with friction. A move of more than one
/// iteration met a surface and slid along it.
void ToolProxies::move_toward(std::size_t particle, const Vec3& goal) {
    ToolProxy& p = particles_[particle];
    const ProxyMove move = move_proxy(contact_candidates_.of(particle),
                                      {.before = last_position_[particle], .from = p.position, .goal = goal}, p.radius,
                                      settings_.step, settings_.contact, p.friction, path_of(particle));
    // revise() may replace these contacts once the constraints have moved the particle.
    p.position = p.constrained_goal = p.contact_position = move.position;
    p.contacts = move.contacts;
    p.stopped_by_half_ccd = false;
    stopped_ = stopped_ || p.in_contact() || !move.converged;
    deflected_ = deflected_ || move.iterations > 1;
}

void ToolProxies::move_to_goals() {
    stopped_ = false;
    deflected_ = false;
    record_starts();
    for (std::size_t i = 0; i < particles_.size(); ++i) {
        move_toward(i, particles_[i].goal);
    }
    // Links can only cross a surface if one of their particles met a surface.
    if ((stopped_ || deflected_) && !links_.empty()) {
        block_crossing_links();
    }
}

void ToolProxies::project_constraints() {
    // Start at p_start. Particles in contact under friction are fixed, so that the constraints fit the others to them.
    ParticleModel& model = body_.particles;
    for (std::size_t i = 0; i < particles_.size(); ++i) {
        model.position[i] = particles_[i].position;
        model.orientation[i] = hip_.orientation;
        fixed_[i] = has_friction() && particles_[i].in_contact() ? 1 : 0;
    }
    // All particles reached their goals: the tool is in its rest shape and all constraints are satisfied.
    if (!stopped_) {
        return;
    }
    if (rest_shape_changed_) {
        solver_.set_rest_shape(model);
        rest_shape_changed_ = false;
    }
    // Algorithm 4, lines 13 to 16, without prediction (zero-order dynamics).
    solver_.project(model, fixed_);
}

void ToolProxies::revise() {
    const bool linked = stopped_ && !links_.empty();
    // Links are checked against the state before the half-CCD.
    if (linked) {
        record_starts();
    }
    for (std::size_t i = 0; i < particles_.size(); ++i) {
        ToolProxy& p = particles_[i];
        // A particle that the constraints did not move needs no half-CCD.
        Vec3& constrained = body_.particles.position[i];  // p: result of the constraints
        if (constrained == p.position) {
            continue;
        }
        // Section 5.3.2: half-CCD from p_start to p, without friction.
        const NearSurfaces near = contact_candidates_.of(i);
        const ProxyMove move =
            move_proxy(near, p.position, constrained, p.radius, settings_.step, settings_.contact, path_of(i));
        p.position = constrained = move.position;
        p.stopped_by_half_ccd = move.contacts.count > 0;

        // A particle whose goal is free counts as in contact only in the thesis' own scheme.
        if (!p.in_contact()) {
            if (settings_.count_revised && p.stopped_by_half_ccd) {
                p.contacts = move.contacts;
                p.constrained_goal = p.contact_position = p.position;
            }
            continue;
        }
        // Recompute the contact planes at the final position: those that keep the particle from its goal there. If the
        // constraints lifted it off every surface, the planes at p_start remain.
        ActiveContacts active;
        active.update(near, p.position, p.goal, p.radius, settings_.contact);
        const SurfacePlanes contacts = active.planes(near, settings_.step);
        if (contacts.count > 0) {
            p.contacts = contacts;
            p.contact_position = p.position;
            p.constrained_goal = active.fit().projection.point;
            if (linked) {
                add_barriers(i);
            }
        }
    }
    // Restoring one link may make another one cross; each round restores at least one more particle.
    while (linked && restore_crossing_links()) {
    }
    fit_pose();
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
        // Shape matching (Mueller 2005): R is the rotation of the moment matrix sum (p_i - c) (o_i - o_c)^T, without
        // mass weights.
        Mat3 moment(0.0);
        for (const ToolProxy& p : particles_) {
            const Vec3 offset = p.position - centre;
            const Vec3 rest = p.rest_offset - rest_centre_;
            moment[0] += offset * rest.x;
            moment[1] += offset * rest.y;
            moment[2] += offset * rest.z;
        }
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

void ToolProxies::collect_speculative_planes() {
    // Query at the position where the contact planes touch the particle; they come first in the result.
    for (std::size_t i = 0; i < particles_.size(); ++i) {
        const ToolProxy& p = particles_[i];
        speculative_tasks_[i] = {
            p.contacts,
            {.position = p.contact_position, .radius = p.radius, .reach = settings_.reach, .dt = settings_.step},
            {}};
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
        posed_->position = body_.particles.position;
        posed_->orientation = body_.particles.orientation;
    }
    skin(out);
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
