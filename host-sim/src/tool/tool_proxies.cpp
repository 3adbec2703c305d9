#include "tool/tool_proxies.hpp"

#include <algorithm>
#include <glm/geometric.hpp>
#include <stdexcept>
#include <string>

#include "contact/hold.hpp"
#include <haptic/sim/contact/planes_in_reach.hpp>
#include "contact/pop_out.hpp"
#include "contact/secure_position.hpp"
#include "contact/virtual_proxy.hpp"
#include "dynamics/rotation.hpp"

namespace haptic::sim {
namespace {

// Steps of the rotation of the tool's pose, from that of the hip.
constexpr int kPoseIterations = 6;
// Of the radius: a particle so near to where the pose has it is there.
constexpr double kInPlace = 1e-6;

/// The body of a tool that can be moved.
DeformableBody body_of(const ToolModel& model, double reach) {
    const std::size_t count = model.body.particles.size();
    const auto refuse = [](const std::string& why) { throw std::invalid_argument("tool: " + why); };
    if (count < 1 || count > ToolSettings::kMostSpheres) {
        refuse("has " + std::to_string(count) + " particles; must be 1 to " +
               std::to_string(ToolSettings::kMostSpheres));
    }
    if (model.radius.size() != count) {
        refuse("has " + std::to_string(count) + " particles, but " + std::to_string(model.radius.size()) + " radii");
    }
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

ToolModel one_sphere(double radius) {
    ToolModel tool;
    tool.body.name = "sphere";
    tool.body.particles.add(Vec3(0.0), 1.0, radius);
    tool.radius = {radius};
    return tool;
}

ToolProxies::ToolProxies(const ToolModel& model, const Settings& settings, const Pose& where, double curl)
    : settings_(settings),
      asked_reach_(settings.reach),
      body_(body_of(model, settings.reach)),
      solver_(body_.particles, settings_of_solver(model, settings.step)),
      joints_(model.joints),
      rest_turn_(body_.particles.size(), Quat(1.0, 0.0, 0.0, 0.0)),
      particles_(body_.particles.size()),
      surroundings_(particles_.size()),
      ahead_(particles_.size()),
      reach_(particles_.size()),
      before_(particles_.size()),
      held_(particles_.size(), 0) {
    if (!body_.mesh.vertices.empty()) {
        skinner_ = std::make_unique<Skinner>(body_.mesh.vertices, body_.particles, body_.skin);
        posed_ = std::make_unique<ParticleModel>(body_.particles);
    }
    for (std::size_t i = 0; i < particles_.size(); ++i) {
        particles_[i].radius = model.radius[i];
    }
    take_rest_shape();
    aim(where, curl);
    aimed_ = false;
    for (std::size_t i = 0; i < particles_.size(); ++i) {
        ToolParticle& p = particles_[i];
        p.position = p.held_at = p.touches_at = before_[i] = body_.particles.position[i] = p.goal;
        body_.particles.orientation[i] = where.orientation;
    }
    pose_ = where;
    if (settings_.closed) {
        find_links();
    }
}

bool ToolProxies::rough() const noexcept {
    return settings_.contact.static_friction > 0.0 || settings_.contact.dynamic_friction > 0.0;
}

ProxyPath* ToolProxies::path_of(std::size_t particle) noexcept {
    return paths_.empty() ? nullptr : &paths_[particle];
}

void ToolProxies::keep_paths(bool on) {
    paths_.resize(on ? particles_.size() : 0);
}

void ToolProxies::change(const ContactSettings& contact, int iterations, double radius) {
    settings_.contact = contact;
    solver_.set_pace(solver_.settings().step, iterations);
    for (ToolParticle& p : particles_) {
        p.radius = radius > 0.0 ? radius : p.radius;
        if (!rough()) {
            p.grip = {};  // what held it once says nothing when surfaces become rough again
        }
    }
    settings_.reach = asked_reach_;
    for (const ToolParticle& p : particles_) {
        settings_.reach = std::min(settings_.reach, p.radius);
    }
}

void ToolProxies::take_rest_shape() {
    rest_centre_ = Vec3(0.0);
    for (std::size_t i = 0; i < particles_.size(); ++i) {
        particles_[i].rest_offset = body_.particles.rest_position[i];
        rest_centre_ += particles_[i].rest_offset;
    }
    rest_centre_ /= static_cast<double>(particles_.size());
}

void ToolProxies::close(double curl) {
    joints_.close(curl, body_.particles.rest_position, rest_turn_);
    take_rest_shape();
    curl_ = curl;
    reshaped_ = true;
}

void ToolProxies::aim(const Pose& hip, double curl) {
    if (curl != curl_ && !joints_.empty()) {
        close(std::clamp(curl, 0.0, 1.0));
    }
    const Mat3 turn = to_matrix(hip.orientation);
    for (ToolParticle& p : particles_) {
        const Vec3 goal = turn * p.rest_offset + hip.position;
        p.goal_velocity = aimed_ ? (goal - p.goal) / settings_.step : Vec3(0.0);
        p.goal = goal;
    }
    hip_ = hip;
    aimed_ = true;
}

void ToolProxies::look_round(std::span<const MovingSurface> surfaces) {
    for (std::size_t i = 0; i < particles_.size(); ++i) {
        const ToolParticle& p = particles_[i];
        reach_[i] = {.position = p.position, .goal = p.goal, .radius = p.radius};
    }
    surroundings_.collect(surfaces, reach_);
    surfaces_ = surfaces;
}

void ToolProxies::secure() {
    effort_ = {};
    for (std::size_t i = 0; i < particles_.size(); ++i) {
        ToolParticle& p = particles_[i];
        before_[i] = p.position;
        if (!paths_.empty()) {
            paths_[i].restart(p.position);
        }
        const SecurePosition secure =
            secure_position(surroundings_.of(i), p.position, p.radius, settings_.contact, path_of(i));
        p.position = secure.position;
        effort_.rides = std::max(effort_.rides, secure.rides);
        effort_.squeezed = effort_.squeezed || secure.squeezed;
        effort_.let_through = effort_.let_through || secure.let_through;
    }
}

void ToolProxies::pop_out() {
    for (std::size_t i = 0; i < particles_.size(); ++i) {
        ToolParticle& p = particles_[i];
        const PopOut popped = sim::pop_out(surroundings_.of(i), p.position, p.radius, settings_.contact, path_of(i));
        p.position = popped.position;
        effort_.pop_out_iterations = std::max(effort_.pop_out_iterations, popped.iterations);
        effort_.squeezed = effort_.squeezed || popped.squeezed;
    }
}

void ToolProxies::move_toward(std::size_t particle, const Vec3& goal) {
    ToolParticle& p = particles_[particle];
    const ProxyMove move =
        move_proxy(surroundings_.of(particle), {.before = before_[particle], .from = p.position, .goal = goal},
                   p.radius, settings_.step, settings_.contact, p.grip, path_of(particle));
    p.position = p.held_at = p.touches_at = move.position;
    p.contacts = move.contacts;
    p.revised = false;
    stopped_ = stopped_ || p.in_contact() || !move.converged;
    turned_aside_ = turned_aside_ || move.iterations > 1;
}

void ToolProxies::approach() {
    stopped_ = false;
    turned_aside_ = false;
    begin_links();
    for (std::size_t i = 0; i < particles_.size(); ++i) {
        move_toward(i, particles_[i].goal);
    }
    if ((stopped_ || turned_aside_) && !links_.empty()) {
        keep_links();
    }
}

void ToolProxies::constrain() {
    ParticleModel& model = body_.particles;
    for (std::size_t i = 0; i < particles_.size(); ++i) {
        model.position[i] = particles_[i].position;
        model.orientation[i] = hip_.orientation;
        held_[i] = rough() && particles_[i].in_contact() ? 1 : 0;
    }
    if (!stopped_) {
        return;
    }
    if (reshaped_) {
        solver_.set_rest_shape(model);
        reshaped_ = false;
    }
    solver_.project(model, held_);
}

void ToolProxies::revise() {
    const bool linked = stopped_ && !links_.empty();
    if (linked) {
        begin_links();
    }
    for (std::size_t i = 0; i < particles_.size(); ++i) {
        ToolParticle& p = particles_[i];
        Vec3& wanted = body_.particles.position[i];
        if (wanted == p.position) {
            continue;
        }
        const NearSurfaces near = surroundings_.of(i);
        const ProxyMove move =
            move_proxy(near, p.position, wanted, p.radius, settings_.step, settings_.contact, path_of(i));
        p.position = wanted = move.position;
        p.revised = move.contacts.count > 0;
        if (!p.in_contact()) {
            if (settings_.count_revised && p.revised) {
                p.contacts = move.contacts;
                p.held_at = p.touches_at = p.position;
            }
            continue;
        }
        Hold hold;
        hold.look(near, p.position, p.goal, p.radius, settings_.contact);
        const SurfacePlanes contacts = hold.planes(near, settings_.step);
        if (contacts.count > 0) {
            p.contacts = contacts;
            p.touches_at = p.position;
            p.held_at = hold.room().at.point;
            if (linked) {
                keep_bars(i);
            }
        }
    }
    while (linked && put_back_what_crosses()) {
    }
    fit_pose();
}

void ToolProxies::fit_pose() {
    if (!stopped_) {
        // At its goals, or as near as moves are made: the shape is the rest shape.
        pose_ = hip_;
    }
    Vec3 centre(0.0);
    for (const ToolParticle& p : particles_) {
        centre += p.position;
    }
    centre /= static_cast<double>(particles_.size());
    if (stopped_) {
        Mat3 moment(0.0);
        for (const ToolParticle& p : particles_) {
            const Vec3 at = p.position - centre;
            const Vec3 rest = p.rest_offset - rest_centre_;
            moment[0] += at * rest.x;
            moment[1] += at * rest.y;
            moment[2] += at * rest.z;
        }
        pose_.orientation = extract_rotation(moment, hip_.orientation, kPoseIterations);
    }
    const Mat3 turn = to_matrix(pose_.orientation);
    pose_.position = centre - turn * rest_centre_;
    in_shape_ = true;
    for (const ToolParticle& p : particles_) {
        const Vec3 away = p.position - (pose_.position + turn * p.rest_offset);
        in_shape_ = in_shape_ && glm::dot(away, away) <= kInPlace * kInPlace * p.radius * p.radius;
    }
}

void ToolProxies::look_ahead() {
    for (std::size_t i = 0; i < particles_.size(); ++i) {
        const ToolParticle& p = particles_[i];
        ahead_[i] = {p.contacts,
                     {.position = p.touches_at, .radius = p.radius, .reach = settings_.reach, .dt = settings_.step},
                     {}};
    }
    planes_in_reach(surroundings_.all(), ahead_);
    for (std::size_t i = 0; i < particles_.size(); ++i) {
        particles_[i].planes = ahead_[i].planes;
    }
}

/// The skin was made at curl 0, from where the present curl has turned each particle.
void ToolProxies::skin(std::span<Vec3> placed) const {
    if (!skinner_) {
        return;
    }
    for (std::size_t i = 0; i < posed_->size(); ++i) {
        posed_->orientation[i] = posed_->orientation[i] * rest_turn_[i];
    }
    skinner_->place(*posed_, placed);
}

void ToolProxies::vertices(std::span<Vec3> placed) const {
    if (posed_) {
        posed_->position = body_.particles.position;
        posed_->orientation = body_.particles.orientation;
    }
    skin(placed);
}

std::vector<Vec3> ToolProxies::vertices() const {
    std::vector<Vec3> placed(body_.mesh.vertices.size());
    vertices(placed);
    return placed;
}

std::vector<Vec3> ToolProxies::goal_vertices() const {
    std::vector<Vec3> placed(body_.mesh.vertices.size());
    for (std::size_t i = 0; posed_ && i < posed_->size(); ++i) {
        posed_->position[i] = particles_[i].goal;
        posed_->orientation[i] = hip_.orientation;
    }
    skin(placed);
    return placed;
}

}  // namespace haptic::sim
