#include "tool/tool_force.hpp"

#include <algorithm>
#include <glm/geometric.hpp>

#include "contact/friction.hpp"

namespace haptic::sim {
namespace {

/// Spring force of a particle at its contacts, without damping.
struct SpringForce {
    ContactShares normal{};      // N, along each normal
    FrictionParts tangential{};  // N, per contact
};

Vec3 sum_of(const ContactShares& strength, const SurfacePlanes& contacts) {
    Vec3 sum(0.0);
    for (std::size_t c = 0; c < contacts.count; ++c) {
        sum += strength[c] * contacts.plane[c].normal;
    }
    return sum;
}

/// Section 5.2.2, with a spring of `stiffness` (N/m) per particle: k (x_i - g_i), split into normal and tangential
/// parts. `use_positions` keeps the tangential part without friction too.
SpringForce spring_force_of(const ToolProxy& p, double stiffness, bool use_positions, bool has_friction) {
    const Vec3 spring = stiffness * ((use_positions ? p.position : p.constrained_goal) - p.goal);
    SpringForce spring_force{.normal = divide_force(spring, p.contacts)};
    if (use_positions || has_friction) {
        spring_force.tangential = divide_friction(spring, p.contacts, spring_force.normal);
    }
    return spring_force;
}

/// Springs in series: the normal strengths are those of the particle's rows.
SpringForce spring_force_of(const ToolProxy& p, std::span<const SpringRow> rows, bool has_friction) {
    SpringForce spring_force;
    for (std::size_t c = 0; c < p.contacts.count; ++c) {
        spring_force.normal[c] = rows[c].push;
    }
    if (has_friction) {
        // The spring's tangential part, scaled like its normal part: by the pushes over the depth beyond the contacts.
        const Vec3 extension = p.constrained_goal - p.goal;
        const Vec3 beyond = sum_of(divide_force(extension, p.contacts), p.contacts);
        const Vec3 pushed = sum_of(spring_force.normal, p.contacts);
        const double depth = glm::length(beyond);
        const double stiffness = depth > 0.0 ? glm::length(pushed) / depth : 0.0;
        spring_force.tangential =
            divide_friction(pushed + stiffness * (extension - beyond), p.contacts, spring_force.normal);
    }
    return spring_force;
}

/// Data common to all particles in contact.
struct PressContext {
    const PressSettings& settings;
    const PressedBodies& on;
    Coupling coupling;                 // its tied_mass divided among the particles in contact
    double patch_mass_fraction = 1.0;  // part of a patch's mass per particle: if all press on one patch, their damping
                                       // together must not reverse it
    bool use_positions = false;
    bool has_friction = false;  // the surfaces have friction
};

/// Force on the particle (N, returned); its opposite goes to the touched bodies. Adds to `damping` (N*s/m).
Vec3 press_particle(const ToolProxy& p, const SpringForce& spring_force, const PressContext& context, double& damping) {
    const SurfacePlanes& contacts = p.contacts;
    Vec3 on_particle(0.0);
    for (std::size_t c = 0; c < contacts.count; ++c) {
        const SurfacePlane& plane = contacts.plane[c];
        // Eq. 4.1: centre the pressure mask on the touched point; it yields the patch's mean velocity and mass.
        PressureMask& mask = context.on.masks[plane.touched.object];
        const std::size_t first = context.on.bodies[plane.touched.object].first_particle;
        const PressedPatch patch = mask.center_on(plane.touched, context.on.velocity.subspan(first));
        // Hunt-Crossley damping at the velocity at which the patch approaches the goal.
        const double closing = glm::dot(patch.velocity - p.goal_velocity, plane.normal);
        const double coefficient = contact_damping(spring_force.normal[c], patch.mass * context.patch_mass_fraction,
                                                   context.settings.step, context.coupling);
        const double push = contact_push(spring_force.normal[c], closing, coefficient);
        damping += coefficient;
        // Normal push plus friction. Damping may reduce the push, and friction then scales down with it.
        Vec3 on_tool = push * plane.normal;
        if (context.use_positions) {
            on_tool += spring_force.tangential[c];
        } else if (context.has_friction && spring_force.normal[c] > 0.0) {
            on_tool += spring_force.tangential[c] * std::min(1.0, push / spring_force.normal[c]);
        }
        on_particle += on_tool;
        mask.press(-on_tool, context.on.force.subspan(first));
    }
    return on_particle;
}

double torque_stiffness_of(const CouplingSettings& coupling) {
    return coupling.torque_stiffness > 0.0 ? coupling.torque_stiffness : coupling.stiffness;
}

double gyration_of(const ToolProxies& tool) {
    double squares = 0.0;
    for (const ToolProxy& p : tool.particles()) {
        squares += glm::dot(p.rest_offset, p.rest_offset);
    }
    return gyration(squares, tool.particles().size());
}

}  // namespace

Wrench ToolPress::solve_series(const ToolProxies& tool, const PressSettings& settings) {
    // One row per contact plane: arm about the grip, normal, and depth of the goal beyond the plane.
    std::size_t count = 0;
    for (const ToolProxy& p : tool.particles()) {
        for (std::size_t c = 0; c < p.contacts.count; ++c) {
            const SurfacePlane& plane = p.contacts.plane[c];
            rows_[count++] = {.moment_arm = p.goal - tool.hip().position,
                              .normal = plane.normal,
                              .depth = plane.offset - glm::dot(plane.normal, p.goal)};
        }
    }
    springs_ = {};  // no warm start: it would be state, and gains little at the rate of the simulation
    return springs_.solve(std::span(rows_).first(count),
                          {.stiffness = settings.gain * settings.coupling.stiffness,
                           .torque_stiffness = settings.gain * torque_stiffness_of(settings.coupling),
                           .gyration = gyration_of(tool)});
}

ToolForce ToolPress::press(const ToolProxies& tool, const PressSettings& settings, const PressedBodies& on) {
    ToolForce result;
    const std::span<const ToolProxy> particles = tool.particles();
    for (const ToolProxy& p : particles) {
        result.collided += p.in_contact() ? 1u : 0u;
    }
    if (result.collided == 0) {
        return result;
    }
    // Divisors: N for each particle's spring; the particles in contact share the tied mass and the patches.
    const CouplingSettings& coupling = settings.coupling;
    const bool series = coupling.share == ForceSharing::Series;
    const auto particle_count = static_cast<double>(particles.size());
    const auto collided = static_cast<double>(result.collided);
    const PressContext context{
        .settings = settings,
        .on = on,
        .coupling = {coupling.stiffness, coupling.hunt_crossley_damping, coupling.tied_mass / collided},
        .patch_mass_fraction = 1.0 / collided,
        .use_positions = coupling.multi_rate == MultiRate::Positions,
        .has_friction = tool.has_friction()};
    const double stiffness = settings.gain * coupling.stiffness / particle_count;
    // k_t / k. In series solve_series() gives the torque of the normal forces, and the ratio is 1 for the rest.
    const double torque_ratio =
        series || !(coupling.stiffness > 0.0) ? 1.0 : torque_stiffness_of(coupling) / coupling.stiffness;
    if (series) {
        result.torque = solve_series(tool, settings).torque;
    }
    std::size_t row = 0;  // of the particle's first contact
    for (const ToolProxy& p : particles) {
        if (!p.in_contact()) {
            continue;
        }
        const std::span<const SpringRow> rows = std::span<const SpringRow>(rows_).subspan(row, p.contacts.count);
        row += p.contacts.count;
        const SpringForce spring_force =
            series ? spring_force_of(p, rows, context.has_friction)
                   : spring_force_of(p, stiffness, context.use_positions, context.has_friction);
        const Vec3 force = press_particle(p, spring_force, context, result.damping);
        // Section 5.2.2: T += (k_t / k) r_i x f_i; in series only for damping and friction, which the rows lack.
        const Vec3 torque_force = series ? force - sum_of(spring_force.normal, p.contacts) : force;
        result.force += force;
        result.torque += torque_ratio * glm::cross(p.goal - tool.hip().position, torque_force);
        result.depth = std::max(result.depth, glm::length(p.constrained_goal - p.goal));
    }
    // The haptic loop divides the damping of a frame by N, unless in series: report the mean per particle in contact,
    // times N.
    result.damping *= series ? 1.0 : particle_count / collided;
    return result;
}

}  // namespace haptic::sim
