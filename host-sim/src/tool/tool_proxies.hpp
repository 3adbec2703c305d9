// The tool in motion: as many proxies as it has particles, and the constraints that hold them together (thesis, chapter
// 5, Algorithm 4, lines 4 to 19). One sphere without constraints is the tool of chapter 4.
//
// A step knows where the hand has the tool (the hip) and moves each particle i
//   1. out of the way of the surfaces that moved (CCD and pop-out);
//   2. toward its goal g_i = Q o_i + d, as far as surfaces let it: p_start (haptic constraint, equation 5.1);
//   3. by the tool's own constraints, which begin at p_start with every orientation Q: p;
//   4. from p_start toward p, again as far as surfaces let it (half-CCD, section 5.3.2).
// Nothing is integrated: no particle has a velocity, masses only say who yields to whom. What comes out depends on the
// hip, the surfaces, and the side of them on which the particles were, so the tool has no inertia that could be felt.
// Where no particle was stopped on its way to its goal, the tool is in its rest shape and steps 3 and 4 change nothing;
// they are left out, and a particle that step 3 leaves where it is, is left out of step 4.
//
// A particle is in contact if a surface stopped it in step 2: that is, if its goal is beyond a surface. The planes that
// hold it are those at its final place, so that they follow the deformed tool; if the constraints have lifted it off
// all of them, those of p_start. So the force, k times what its goal lacks to these planes, does not come and go with
// the last micrometre between particle and surface, and the haptic loop, which knows planes and goals, makes the same.
// With friction, a particle in contact stays where it was held, and the other ones are fitted to it.
//
// The rest shape may change from step to step (tool_joints.hpp): then o_i and the groups are those of the present curl,
// and a particle that closes is on its way to its goal like one that the hand moves, swept as that is. So a hand that
// closes stops on what is between its fingers, from all sides, and friction holds that.
//
// Algorithm 4 prints lines 8 and 11 the wrong way round: p_start is recorded from p.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <haptic/sim/contact.hpp>
#include "contact/friction.hpp"
#include "contact/link_guard.hpp"
#include <haptic/sim/contact/planes_in_reach.hpp>
#include "contact/proxy_path.hpp"
#include <haptic/sim/contact/surroundings.hpp>
#include "contact/swept_tree.hpp"
#include <haptic/sim/mesh.hpp>
#include <haptic/sim/skin.hpp>
#include <haptic/sim/solver.hpp>
#include <haptic/sim/tool_model.hpp>
#include <haptic/types.hpp>

namespace haptic::sim {

/// One proxy of the tool, after a step.
struct ToolParticle {
    Vec3 rest_offset{0.0};    // m, tool's frame, at the present curl
    double radius = 0.0;      // m
    Vec3 goal{0.0};           // m, scene: where the hand has it
    Vec3 goal_velocity{0.0};  // m/s, mean of the step that ends there
    Vec3 position{0.0};       // m, scene
    Vec3 touches_at{0.0};     // m, scene: on its way, where `contacts` touch it; `position` unless it was lifted off
    Vec3 held_at{0.0};        // m, scene: the point nearest to its goal that `contacts` allow
    SurfacePlanes contacts;   // that keep it from its goal
    SurfacePlanes planes;     // that the haptic loop gets: the contacts, and surfaces in reach
    ProxyGrip grip;           // of the surfaces, if they are rough
    bool revised = false;     // the tool's constraints ran it into a surface
    [[nodiscard]] bool in_contact() const noexcept { return contacts.count > 0; }
    /// Friction holds it to what it touches.
    [[nodiscard]] bool sticks() const noexcept { return grip.held_by.count > 0 && !grip.slides; }
};

/// What a step took, over all particles.
struct ToolEffort {
    int rides = 0;               // most of any particle
    int pop_out_iterations = 0;  // likewise
    bool squeezed = false;       // some particle has less room than its radius
    bool let_through = false;    // a surface passed through some particle, which had no room at all
};

/// A tool of one sphere without constraints, nothing to skin.
[[nodiscard]] ToolModel one_sphere(double radius);

class ToolProxies {
  public:
    struct Settings {
        ContactSettings contact;
        double reach = 0.0;  // m, beyond each radius, below all of them
        double step = 0.01;  // s
        /// A particle is in contact also if its goal is free, but the constraints ran it into a surface: thesis, 5.4.1.
        bool count_revised = false;
        /// Nothing gets between two spheres that overlap in the rest shape, however thin it is.
        bool closed = false;
    };

    /// Puts the tool in its rest shape, that of a curl, where it is. Throws std::invalid_argument: no particle or more
    /// than ToolSettings::kMostSpheres, a radius for not every particle, one not above `reach`, or what the solver
    /// refuses.
    ToolProxies(const ToolModel& model, const Settings& settings, const Pose& where, double curl = 0.0);

    /// From the next step on. A particle whose radius grows is moved clear of what it then clips like one that a
    /// surface has come upon; `radius` (m) 0 leaves the radii as they are. What is sent ahead never reaches farther
    /// than a radius. No allocation.
    void change(const ContactSettings& contact, int iterations, double radius = 0.0);
    /// s, between the hip of the last step and that of the next one.
    void set_step(double step) { settings_.step = step; }

    /// The stages of a step, in this order. No allocation. `surfaces` are refitted to the step, and have to stay.
    void aim(const Pose& hip) { aim(hip, curl_); }
    /// With the rest shape of a curl of 0..1; a tool that cannot close has one shape.
    void aim(const Pose& hip, double curl);
    void look_round(std::span<const MovingSurface> surfaces);
    void secure();
    void pop_out();
    void approach();
    void constrain();
    void revise();
    void look_ahead();

    /// From the next step on: keeps the way of each particle, for the verification.
    void keep_paths(bool on);
    [[nodiscard]] const ProxyPath& path(std::size_t particle) const { return paths_[particle]; }

    [[nodiscard]] std::span<const ToolParticle> particles() const noexcept { return particles_; }
    [[nodiscard]] const Pose& hip() const noexcept { return hip_; }
    /// 0..1; 0 for a tool that cannot close.
    [[nodiscard]] double curl() const noexcept { return curl_; }
    /// scene_from_tool that fits the particles best.
    [[nodiscard]] const Pose& pose() const noexcept { return pose_; }
    /// No particle is away from where that pose would have it.
    [[nodiscard]] bool in_shape() const noexcept { return in_shape_; }
    [[nodiscard]] const ToolEffort& effort() const noexcept { return effort_; }
    /// Positions and orientations of the particles, scene; its rest shape is in the tool's frame, at the present curl.
    [[nodiscard]] const ParticleModel& model() const noexcept { return body_.particles; }
    /// Rest mesh, tool's frame, at curl 0; empty for one_sphere().
    [[nodiscard]] const TriangleMesh& mesh() const noexcept { return body_.mesh; }
    /// The mesh's vertices in the scene now.
    [[nodiscard]] std::vector<Vec3> vertices() const;
    /// The same into as many as the mesh has. No allocation.
    void vertices(std::span<Vec3> placed) const;
    /// Where they would be with every particle at its goal: in the rest shape of the present curl, where the hand is.
    [[nodiscard]] std::vector<Vec3> goal_vertices() const;

  private:
    [[nodiscard]] bool rough() const noexcept;
    [[nodiscard]] ProxyPath* path_of(std::size_t particle) noexcept;
    void take_rest_shape();
    void close(double curl);
    void skin(std::span<Vec3> placed) const;
    void fit_pose();
    void move_toward(std::size_t particle, const Vec3& goal);
    // Closed links: tool_links.cpp.
    void find_links();
    void begin_links();
    void keep_links();
    [[nodiscard]] bool put_back_what_crosses();
    void bar(std::size_t particle, const SurfacePlane& plane);
    void put_back(std::size_t particle);
    void keep_bars(std::size_t particle);

    Settings settings_;
    double asked_reach_;   // m, of which settings_.reach is what the radii allow
    DeformableBody body_;  // in motion
    ParticleSolver solver_;
    std::unique_ptr<Skinner> skinner_;      // if there is a mesh
    std::unique_ptr<ParticleModel> posed_;  // likewise: the particles as the skin is laid on them
    ToolJoints joints_;                     // none: one rest shape
    std::vector<Quat> rest_turn_;           // per particle, tool's frame: how the present curl has turned it
    double curl_ = 0.0;                     // 0..1
    bool reshaped_ = false;                 // the solver knows an older rest shape
    std::vector<ToolParticle> particles_;
    Surroundings surroundings_;
    std::vector<ReachTask> ahead_;    // per particle, what the haptic loop gets
    std::vector<ProxyReach> reach_;   // per particle, what is collected for
    std::vector<Vec3> before_;        // per particle: at the end of the last step
    std::vector<std::uint8_t> held_;  // per particle: by friction
    std::vector<ProxyPath> paths_;    // per particle; empty if not kept
    /// Two spheres that overlap in the rest shape, and the way between them is closed.
    struct ClosedLink {
        std::uint32_t first;
        std::uint32_t second;
    };
    /// A particle as it was before a stage, and what bars its way there.
    struct Start {
        ToolParticle particle;
        std::size_t knots = 0;  // of its path
        SurfacePlanes bars;
    };
    std::span<const MovingSurface> surfaces_;  // of this step
    std::vector<ClosedLink> links_;            // none, unless gaps are closed
    std::vector<Start> starts_;                // per particle, if there are links
    Vec3 rest_centre_{0.0};                    // of the rest offsets
    Pose hip_;
    Pose pose_;
    ToolEffort effort_;
    bool aimed_ = false;         // there was a hip before
    bool stopped_ = false;       // some particle on its way to its goal
    bool turned_aside_ = false;  // some particle met a surface on its way, even if it got round it
    bool in_shape_ = true;
};

}  // namespace haptic::sim
