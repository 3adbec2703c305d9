#include "tool/tool_force.hpp"

#include <algorithm>
#include <glm/geometric.hpp>

#include "contact/friction.hpp"

namespace haptic::sim {
namespace {

/// What the spring of a particle does at its contacts, before any loss.
struct Pull {
    ContactShares across{};  // N, along each normal
    FrictionParts along{};   // N, per contact
};

Vec3 sum_of(const ContactShares& strength, const SurfacePlanes& contacts) {
    Vec3 sum(0.0);
    for (std::size_t c = 0; c < contacts.count; ++c) {
        sum += strength[c] * contacts.plane[c].normal;
    }
    return sum;
}

/// With the spring of one particle, N/m; `whole` keeps what is along the surfaces though these are smooth.
Pull pull_of(const ToolParticle& p, double stiffness, bool whole, bool rough) {
    const Vec3 spring = stiffness * ((whole ? p.position : p.held_at) - p.goal);
    Pull pull{.across = divide_force(spring, p.contacts)};
    if (whole || rough) {
        pull.along = divide_friction(spring, p.contacts, pull.across);
    }
    return pull;
}

/// With springs in series, from the rows of the particle's contacts.
Pull pull_of(const ToolParticle& p, std::span<const SpringRow> rows, bool rough) {
    Pull pull;
    for (std::size_t c = 0; c < p.contacts.count; ++c) {
        pull.across[c] = rows[c].push;
    }
    if (rough) {
        const Vec3 lacking = p.held_at - p.goal;
        const Vec3 beyond = sum_of(divide_force(lacking, p.contacts), p.contacts);
        const Vec3 pushed = sum_of(pull.across, p.contacts);
        const double depth = glm::length(beyond);
        const double stiffness = depth > 0.0 ? glm::length(pushed) / depth : 0.0;
        pull.along = divide_friction(pushed + stiffness * (lacking - beyond), p.contacts, pull.across);
    }
    return pull;
}

/// What all particles in contact have in common.
struct Pressing {
    const PressSettings& settings;
    const PressedBodies& on;
    Coupling coupling;       // with the part of tied_mass that one particle may count on
    double mass_part = 1.0;  // of a patch, likewise: all may press on one, which they must not turn round together
    bool whole = false;
};

/// Gives the bodies the opposite of the force on the particle, N, that is returned. Adds to the damping, N*s/m.
Vec3 press_with(const ToolParticle& p, const Pull& pull, const Pressing& by, double& damping) {
    const SurfacePlanes& contacts = p.contacts;
    Vec3 on_particle(0.0);
    for (std::size_t c = 0; c < contacts.count; ++c) {
        const SurfacePlane& plane = contacts.plane[c];
        PressureMask& mask = by.on.masks[plane.touched.object];
        const std::size_t first = by.on.bodies[plane.touched.object].first_particle;
        const PressedPatch patch = mask.lay(plane.touched, by.on.velocity.subspan(first));
        const double closing = glm::dot(patch.velocity - p.goal_velocity, plane.normal);
        const double held = contact_damping(pull.across[c], patch.mass * by.mass_part, by.settings.step, by.coupling);
        const double push = contact_push(pull.across[c], closing, held);
        damping += held;
        Vec3 on_tool = push * plane.normal;
        if (by.whole) {
            on_tool += pull.along[c];
        } else if (by.settings.rough && pull.across[c] > 0.0) {
            on_tool += pull.along[c] * std::min(1.0, push / pull.across[c]);  // no more than the normal force can hold
        }
        on_particle += on_tool;
        mask.press(-on_tool, by.on.force.subspan(first));
    }
    return on_particle;
}

double torque_stiffness_of(const CouplingSettings& coupling) {
    return coupling.torque_stiffness > 0.0 ? coupling.torque_stiffness : coupling.stiffness;
}

double gyration_of(const ToolProxies& tool) {
    double squares = 0.0;
    for (const ToolParticle& p : tool.particles()) {
        squares += glm::dot(p.rest_offset, p.rest_offset);
    }
    return gyration(squares, tool.particles().size());
}

}  // namespace

Wrench ToolPress::find_pushes(const ToolProxies& tool, const PressSettings& settings) {
    std::size_t count = 0;
    for (const ToolParticle& p : tool.particles()) {
        for (std::size_t c = 0; c < p.contacts.count; ++c) {
            const SurfacePlane& plane = p.contacts.plane[c];
            rows_[count++] = {.lever = p.goal - tool.hip().position,
                              .normal = plane.normal,
                              .depth = plane.offset - glm::dot(plane.normal, p.goal)};
        }
    }
    springs_ = {};  // what it begins with is worth little at this rate, and would be state
    return springs_.solve(std::span(rows_).first(count),
                          {.stiffness = settings.gain * settings.coupling.stiffness,
                           .torque_stiffness = settings.gain * torque_stiffness_of(settings.coupling),
                           .gyration = gyration_of(tool)});
}

ToolForce ToolPress::press(const ToolProxies& tool, const PressSettings& settings, const PressedBodies& on) {
    ToolForce result;
    const std::span<const ToolParticle> particles = tool.particles();
    for (const ToolParticle& p : particles) {
        result.collided += p.in_contact() ? 1u : 0u;
    }
    if (result.collided == 0) {
        return result;
    }
    const CouplingSettings& coupling = settings.coupling;
    const bool series = coupling.share == ForceSharing::Series;
    const auto all = static_cast<double>(particles.size());
    const auto collided = static_cast<double>(result.collided);
    const Pressing by{.settings = settings,
                      .on = on,
                      .coupling = {coupling.stiffness, coupling.loss, coupling.tied_mass / collided},
                      .mass_part = 1.0 / collided,
                      .whole = coupling.multi_rate == MultiRate::Positions};
    const double stiffness = settings.gain * coupling.stiffness / all;
    // In series the attitude's spring makes the torque, and what levers do while they turn is in it already.
    const double lever =
        series || !(coupling.stiffness > 0.0) ? 1.0 : torque_stiffness_of(coupling) / coupling.stiffness;
    if (series) {
        result.torque = find_pushes(tool, settings).torque;
    }
    std::size_t row = 0;
    for (const ToolParticle& p : particles) {
        if (!p.in_contact()) {
            continue;
        }
        const std::span<const SpringRow> rows = std::span<const SpringRow>(rows_).subspan(row, p.contacts.count);
        row += p.contacts.count;
        const Pull pull = series ? pull_of(p, rows, settings.rough) : pull_of(p, stiffness, by.whole, settings.rough);
        const Vec3 force = press_with(p, pull, by, result.damping);
        const Vec3 turning = series ? force - sum_of(pull.across, p.contacts) : force;
        result.force += force;
        result.torque += lever * glm::cross(p.goal - tool.hip().position, turning);
        result.depth = std::max(result.depth, glm::length(p.held_at - p.goal));
    }
    // What the haptic loop divides by the number of all, if it does.
    result.damping *= series ? 1.0 : all / collided;
    return result;
}

}  // namespace haptic::sim
