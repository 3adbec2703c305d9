// What the tool and the bodies do to one another (thesis, sections 5.2.2 and 5.2.3).
//
// Particle i of N has its goal g_i where the hand has it, and is held at x_i by the planes n_c of the surfaces that it
// touches. What its spring presses along them, k (x_i - g_i) / N = sum s_c n_c with s_c >= 0, gets the loss of
// contact_force.hpp and with friction what acts along the planes; that is f_i, and the surfaces take -f_i. Then
//     F = sum f_i,   T = k_t / k sum r_i x f_i,   r_i = g_i - d
// over the particles in contact: the divisor is the number of all, as the thesis has it. So a plane that the whole tool
// rests on is felt as a spring k, and one that a single particle touches as k / N.
//
// With springs in series (haptic/series_springs.hpp) the strengths s_c are what these make of how far each goal is
// beyond each plane that holds its particle, nothing is divided by N, and what acts along the planes is as much of
// k (x_i - g_i) there as the strengths are of it across.
//
// The thesis' own multi-rate scheme takes x_i - g_i whole, x_i being where the deformed tool has the particle, along
// the surface too, whether that is rough or not.
#pragma once

#include <array>
#include <cstddef>
#include <span>

#include <haptic/series_springs.hpp>
#include <haptic/sim/contact_force.hpp>
#include <haptic/sim/scene.hpp>
#include <haptic/sim/simulation.hpp>
#include "tool/tool_proxies.hpp"
#include <haptic/types.hpp>

namespace haptic::sim {

struct PressSettings {
    CouplingSettings coupling;
    double gain = 1.0;   // of the clutch
    bool rough = false;  // surfaces hold by friction
    double step = 0.01;  // s
};

/// The bodies that can be pressed, and what presses on them.
struct PressedBodies {
    std::span<const SceneBody> bodies;
    std::span<PressureMask> masks;   // per body
    std::span<const Vec3> velocity;  // m/s, per particle of all bodies
    std::span<Vec3> force;           // N, likewise; is added to
};

struct ToolForce {
    Vec3 force{0.0};       // N, on the tool
    Vec3 torque{0.0};      // N*m, on the tool about the hip
    double damping = 0.0;  // N*s/m, as a contact frame has it: of one particle's undivided spring, or in series of all
    double depth = 0.0;    // m, the farthest that a particle in contact is from its goal
    std::size_t collided = 0;  // particles in contact
};

class ToolPress {
  public:
    /// Presses on the bodies. No allocation. The result depends on nothing that was before.
    [[nodiscard]] ToolForce press(const ToolProxies& tool, const PressSettings& settings, const PressedBodies& on);

  private:
    [[nodiscard]] Wrench find_pushes(const ToolProxies& tool, const PressSettings& settings);

    SeriesSprings springs_;
    std::array<SpringRow, kMaxSpringRows> rows_{};  // of the particles in contact, in their order
};

}  // namespace haptic::sim
