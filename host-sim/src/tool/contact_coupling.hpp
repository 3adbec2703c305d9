// Contact coupling: the force between a tool and the bodies that it touches, solved together with the bodies.
//
// The tool has no mass. Its contact problem (tool_proxies.hpp) has a row r for each normal of a contact plane and, with
// friction, for two tangents of a proxy. l_r (N) is the force on the tool along the row's direction d_r, and the bodies
// receive the opposite through the pressure mask (Eq. 4.1) of the touched point, P (pressed_patches.hpp). In every
// sub-step of length h, after the body's own constraints,
//
//     (W + P^T Y P) l = b,   l_n >= 0,   |l_t| <= mu sum l_n,   x <- x - Y P l
//
// with Y the answer of the bodies, is solved as one exact block (haptic/contact_problem.hpp): an implicit constraint
// with the compliance W (m/N) of tool and coupling, stable for any stiffness. b is what a row lacks where the particles
// would be without it. With g_i the free position of the row's proxy (its goal with MultiRate::Positions), b of a
// normal is the depth of g_i behind the plane, whose offset follows the weighted motion of the particles under the mask
// since the step began; b of a tangent is the distance from g_i to the point where the proxy sticks, which follows the
// same motion. A proxy that presses, or did in the last step, has rows for its speculative planes as well: at an edge
// the surface may swing from one facet to the next within the step. A lone sphere also keeps rows for the points that
// pressed on it in the last step, in the direction to its centre: in the dent of a soft body it rests on flanks all
// round. Its own problem holds three at a time, and without these rows it would tremble, because the other flanks
// answer a step late. The goals' positions are held during the step; their speed counts for the damping. If the solver
// makes several passes in a sub-step, each solves for the whole l and applies its change.
//
// The mean of l over the step is the force on the hand and on the bodies, so both receive the same impulse:
//
//     F = sum l d,   T = sum (g_i + a - p) x l d
//
// with p the hip. Of a normal a is 0. Of a tangent it leads from the centre of the sphere to where it touches: spheres
// of a tool that is not limp turn with it, and roll on what they stick to.
//
// Skin. Forces of the rows that cancel, those of a squeeze, move the whole tool nowhere: only its own elasticity and
// the bodies yield to them. A rigid tool does not, and where it presses a body from two sides, whose masks share
// particles, nothing does: forces of 10^5 N stood against one another, and what friction left of them threw the body
// away. So W gets
//
//     c (I - Q Q^T),   c = max(0, 1 / k - mean compliance of the tool to these forces)
//
// with Q an orthonormal basis of the rows' displacements by the six motions of the whole tool and k the stiffness of
// the coupling: a skin under the spheres, as soft as the coupling and of the order of a fingertip's, some hundred N/m.
// It changes nothing of how the whole tool yields, and a soft tool has none. A single sphere that more planes touch
// than it has directions to yield in has one too: the skin divides its force among them.
//
// MultiRate::Positions, the thesis' own scheme, has independent springs k / N from the goals to the proxies' positions
// instead, also along the surface.
//
// Without damping a spring throws bodies back, and a body that an elastic tool holds swings on it. A damper beside the
// springs of tool and coupling, with the same ratio tau of damping to stiffness everywhere (Kelvin-Voigt), makes the
// force of every row that of the springs at b + tau v, with v the velocity at which the surface approaches the goal. It
// suits soft materials, which lose a part of the energy of each stretch.
//
// Hunt-Crossley damping makes the depth b (1 + c v) (K. Hunt, F. Crossley, "Coefficient of Restitution Interpreted as
// Damping in Vibroimpact", 1975). Unlike the other it begins at zero force. Both are implicit: with tau the sum of
// damping_time and c b at the start of the sub-step and v at its end, the row becomes
//
//     W l + (1 + tau / h) P^T Y P l = b + tau v,   divided by 1 + tau / h.
//
// Rows that W couples have the same tau, so that the block stays symmetric and the forces at rest are those without
// damping; it damps along the surface too. Proxies that displace one another, those of an elastic tool, have no
// Hunt-Crossley damping, since their depths differ.
//
// Lead: a damped row makes the force l of a spring whose plane is tau v ahead of the surface, W l = b + tau v. The
// haptic loop receives the planes with this lead, so it renders the damped force with springs alone. lead() goes
// from the mean over the last step to the mean over this one: it is continuous from step to step, and half a step late.
// A proxy has one lead L, which fits its planes: least squares of l (d . L - tau v)^2. Where a surface recedes so fast
// that damping leaves no force, L leads its planes back to the free position. Damping along the surface is felt only as
// the impulse that the hand is owed.
// @source M. Macklin, M. Müller, N. Chentanez, "XPBD: Position-Based Simulation of Compliant Constrained Dynamics",
// 2016 (compliance and damping of a constraint); C. Duriez et al., "Realistic haptic rendering of interacting
// deformable objects", 2006 (contact space). Differs: the multipliers are forces.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "dynamics/stage_clock.hpp"
#include "haptic/contact_problem.hpp"
#include "haptic/sim/contact.hpp"
#include "haptic/sim/coupling.hpp"
#include "haptic/sim/particles.hpp"
#include "haptic/sim/solver.hpp"
#include "haptic/types.hpp"
#include "simd/projection.hpp"
#include "tool/pressed_patches.hpp"
#include "tool/tool_proxies.hpp"

namespace haptic::sim {

/// Mean force over a step.
struct CoupledForce {
    Vec3 force{0.0};           // N, on the tool; the bodies received its opposite
    Vec3 torque{0.0};          // N*m, on the tool about the hip
    double depth = 0.0;        // m, greatest distance of a constrained goal from its goal
    std::size_t collided = 0;  // particles that a surface keeps from their goals or presses on
};

/// m, that damping adds to the displacement of a proxy by surfaces: tau v.
struct Lead {
    Vec3 start{0.0};  // at the beginning of the step: mean over the last one
    Vec3 end{0.0};    // at its end: mean over the step
};

class ContactCoupling final : public SolverContacts {
  public:
    /// Monotonic clock in ns, for the caller's measurements; the simulation does not depend on it.
    using ClockFunction = StageClock::Function;

    /// Allocates for any tool and for the bodies of this model.
    explicit ContactCoupling(const ParticleModel& model, ClockFunction clock = nullptr);

    struct Step {
        CouplingSettings coupling;
        ContactSettings contact;  // friction
        double gain = 1.0;        // 0..1, part of the stiffness
        Vec3 owed_force{0.0};     // N, on the tool: divided like the contact forces, or those of the last step with any
        double length = 0.01;     // s
    };
    using Bodies = PressedPatches::Bodies;
    /// Takes the tool's contact rows and the particles under their masks, at the beginning of a step. No allocation.
    void begin_step(const ToolProxies& tool, const Step& step, const Bodies& bodies, const ParticleModel& model);
    /// The tool has contact planes, or something is owed: the solver must call this object in the step.
    [[nodiscard]] bool is_active() const noexcept { return !rows_.empty() || step_.owed_force != Vec3(0.0); }
    /// After the solver's step: counts the work of its last sub-step.
    void end_step(const ParticleModel& model) noexcept;
    /// After end_step().
    [[nodiscard]] CoupledForce force() const noexcept;
    /// After end_step(): what touched or pressed, in the order of the proxies.
    [[nodiscard]] std::span<const SurfaceForce> surface_forces() const noexcept { return surface_forces_; }
    /// J, after end_step(): work of the forces on the tool along the displacements of the touched surfaces in the step.
    /// The bodies, and whatever drives them, have lost at least this.
    [[nodiscard]] double work() const noexcept { return work_; }
    /// The lead of a proxy; 0 where nothing damps.
    [[nodiscard]] const Lead& lead(std::size_t proxy) const noexcept { return leads_[proxy]; }
    /// ns spent in this class since the last call; 0 without a clock.
    [[nodiscard]] std::int64_t take_time() noexcept;

    void begin(const ParticleModel& start, ElasticBodies& elastic, const MovingParticles& now, double h) override;
    void project(const ParticleModel& start, const MovingParticles& now, double h) override;
    void finish(const ParticleModel& start, const MovingParticles& now, double h) override;

  private:
    struct CouplingRow {
        std::uint32_t proxy = 0;
        std::uint32_t patch = 0;
        std::uint32_t surface = 0;  // of a normal: index into surface_forces_
        bool normal = true;
        Vec3 direction{0.0};        // unit: d
        Vec3 arm{0.0};              // m, a
        double depth = 0.0;         // m, b at the beginning of the step
        double goal_speed = 0.0;    // m/s, of the goal along d
        double damping_time = 0.0;  // s, tau of the sub-step
        double applied = 0.0;       // N, l of the sub-step so far
        double impulse = 0.0;       // N*s, over the step so far
        Vec3 exerted{0.0};          // N, on the tool in the sub-step: l d, and its part of what is owed
    };

    void keep_pressed() noexcept;
    void keep_last_push() noexcept;
    void add_proxy(const ToolProxies& tool, std::uint32_t index, std::span<const ContactRow> rows, const Bodies& bodies,
                   const ParticleModel& model);
    void find_tool_compliance(const ToolProxies& tool);
    void add_skin(double least) noexcept;
    void find_motions() noexcept;
    void find_damping_times();
    void add_work(const ParticleModel& at) noexcept;
    void add_leads(const MovingParticles& now, double h);
    void build_block(double h);
    [[nodiscard]] Vec3 moment_arm(const CouplingRow& row) const noexcept;
    void pay(const ParticleModel& start, double h, Row* position, Row* pushed);
    void pay_after_contact(double h, Row* position, Row* pushed);

    StageClock clock_;
    Step step_;
    Vec3 hip_{0.0};
    double particle_count_ = 1.0;  // of the tool: N
    double damping_ = 0.0;         // s/m, c; 0 if W couples the proxies
    std::span<const ToolProxy> proxies_;
    std::vector<SurfaceForce> surface_forces_;  // in the order of the proxies
    std::vector<SurfaceForce> pressed_;         // those of the last step that pressed
    PressedPatches patches_;
    std::vector<CouplingRow> rows_;
    std::vector<FrictionRows> friction_;          // per proxy with friction
    std::vector<double> depth_;                   // m, per row: b
    std::vector<Lead> leads_;                     // per proxy
    std::array<std::vector<double>, 6> motions_;  // per row: how far it moves with the whole tool
    ComplianceMatrix tool_compliance_;            // W
    ComplianceMatrix block_;
    ContactSolver solver_{ContactSolver::kMaxStepSweeps};
    bool projected_ = false;  // in this sub-step
    double work_ = 0.0;       // J, over the step so far
    // The last step with contact forces: impulse on the tool (N*s), point at which it acted, relative to the hip (m),
    // and the pressed particles, weighted by the impulses of their rows.
    Vec3 last_push_{0.0};
    Vec3 last_moment_arm_{0.0};
    std::vector<PressedPatches::Pressed> last_pressed_;
    Vec3 last_point_{0.0};          // m, mean of these at the beginning of the sub-step
    Vec3 paid_after_contact_{0.0};  // N, on the tool in this sub-step
    CoupledForce paid_;             // N*s and N*m*s, impulses of owed_force over the step so far
};

}  // namespace haptic::sim
