#include "tool_force.hpp"

#include <algorithm>
#include <glm/geometric.hpp>

#include "haptic/sim/contact/friction.hpp"

namespace haptic::sim {
namespace {

/// A particle of the tool as it presses.
class Press {
  public:
    Press(const PressSettings& settings, const PressedBodies& on, std::size_t particles, std::size_t collided)
        : settings_(settings), on_(on) {
        const auto count = static_cast<double>(particles);
        const auto pressing = static_cast<double>(collided);
        stiffness_ = settings.gain * settings.coupling.stiffness / count;
        damping_part_ = count / pressing;
        // All of them may press on one patch, which they must not turn round together.
        mass_part_ = 1.0 / pressing;
        coupling_.stiffness = settings.coupling.stiffness;
        coupling_.loss = settings.coupling.loss;
        coupling_.tied_mass = settings.coupling.tied_mass * mass_part_;
    }

    /// The force on the particle, N; its opposite has been given to the bodies.
    Vec3 by(const ToolParticle& p, double& damping) {
        const SurfacePlanes& contacts = p.contacts;
        const bool whole = coupling_is_whole();
        const Vec3 spring = stiffness_ * ((whole ? p.position : p.held_at) - p.goal);
        const ContactShares shares = divide_force(spring, contacts);
        const auto along = whole || settings_.rough ? divide_friction(spring, contacts, shares) : FrictionParts{};
        Vec3 on_particle(0.0);
        for (std::size_t c = 0; c < contacts.count; ++c) {
            const SurfacePlane& plane = contacts.plane[c];
            PressureMask& mask = on_.masks[plane.touched.object];
            const std::size_t first = on_.bodies[plane.touched.object].first_particle;
            const PressedPatch patch = mask.lay(plane.touched, on_.velocity.subspan(first));
            const double closing = glm::dot(patch.velocity - p.goal_velocity, plane.normal);
            const double held = contact_damping(shares[c], patch.mass * mass_part_, settings_.step, coupling_);
            const double push = contact_push(shares[c], closing, held);
            damping += held * damping_part_;
            Vec3 on_tool = push * plane.normal;
            if (whole) {
                on_tool += along[c];
            } else if (settings_.rough && shares[c] > 0.0) {
                on_tool += along[c] * std::min(1.0, push / shares[c]);  // no more than the normal force can hold
            }
            on_particle += on_tool;
            mask.press(-on_tool, on_.force.subspan(first));
        }
        return on_particle;
    }

  private:
    [[nodiscard]] bool coupling_is_whole() const { return settings_.coupling.multi_rate == MultiRate::Positions; }

    const PressSettings& settings_;
    const PressedBodies& on_;
    Coupling coupling_;
    double stiffness_;     // N/m, of one particle
    double damping_part_;  // of what one contact has, in the mean
    double mass_part_;     // of a patch, that one particle may count on
};

}  // namespace

ToolForce press(const ToolProxies& tool, const PressSettings& settings, const PressedBodies& on) {
    ToolForce result;
    const std::span<const ToolParticle> particles = tool.particles();
    for (const ToolParticle& p : particles) {
        result.collided += p.in_contact() ? 1u : 0u;
    }
    if (result.collided == 0) {
        return result;
    }
    const CouplingSettings& coupling = settings.coupling;
    const double lever = coupling.torque_stiffness > 0.0 && coupling.stiffness > 0.0
                             ? coupling.torque_stiffness / coupling.stiffness
                             : 1.0;
    Press pressing(settings, on, particles.size(), result.collided);
    for (const ToolParticle& p : particles) {
        if (!p.in_contact()) {
            continue;
        }
        const Vec3 force = pressing.by(p, result.damping);
        result.force += force;
        result.torque += lever * glm::cross(p.goal - tool.hip().position, force);
        result.depth = std::max(result.depth, glm::length(p.held_at - p.goal));
    }
    return result;
}

}  // namespace haptic::sim
