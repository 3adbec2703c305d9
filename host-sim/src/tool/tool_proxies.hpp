// Tool proxies: the tool in motion, one virtual proxy per particle, joined by the tool's own constraints (thesis,
// chapter 5, Algorithm 4, lines 4 to 19). A single sphere without constraints is the tool of chapter 4.
//
// Each step takes the hip, the pose at which the hand holds the tool, and moves every particle i
//   1. out of the way of surfaces that moved (CCD, pop-out);
//   2. toward its goal g_i = Q o_i + d, stopped by surfaces: p_start (haptic constraint, Eq. 5.1, stiffness 1);
//   3. by the tool's constraints, starting at p_start with every orientation Q: p;
//   4. from p_start toward p, again stopped by surfaces (half-CCD, section 5.3.2).
// Nothing is integrated (zero-order dynamics): particles have no velocity, and masses only weight the constraints. The
// result depends on the hip, the surfaces, and the side of them that each particle was on, so the hand feels no inertia
// of the tool. If no particle was stopped in 2, the tool is in its rest shape and 3 and 4 are skipped; 4 also skips
// particles that 3 did not move.
//
// A particle is in contact if a surface stopped it in 2, that is, if its goal lies beyond a surface. Its contact planes
// are those at its final position, so that they follow the deformed tool; if the constraints lifted it off all of them,
// those at p_start. The force, k times the distance from the goal to these planes, therefore does not depend on the
// last micrometre between particle and surface, and the haptic loop computes the same force from planes and goals. With
// friction, particles in contact stay fixed in 3 and the constraints move the others.
//
// The rest shape may change between steps (tool_joints.hpp): o_i and the groups are then those of the current curl, and
// a particle that closes is swept toward its goal like one that the hand moves. A closing hand therefore stops on the
// object between its fingers, and friction can hold it.
//
// Algorithm 4 prints line 11 the wrong way round: p_start is recorded from p.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "contact/contact_candidates.hpp"
#include "contact/friction.hpp"
#include "contact/link_guard.hpp"
#include "contact/proxy_path.hpp"
#include "contact/speculative_planes.hpp"
#include "contact/swept_tree.hpp"
#include "haptic/sim/contact.hpp"
#include "haptic/sim/mesh.hpp"
#include "haptic/sim/skin.hpp"
#include "haptic/sim/solver.hpp"
#include "haptic/sim/tool_model.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

/// Proxy of one particle, after a step.
struct ToolProxy {
    Vec3 rest_offset{0.0};    // m, tool frame, at the current curl
    double radius = 0.0;      // m
    Vec3 goal{0.0};           // m, scene: g_i of Eq. 5.1
    Vec3 goal_velocity{0.0};  // m/s, scene: mean over the step that ends at the goal
    Vec3 position{0.0};       // m, scene
    /// m, scene: its centre where `contacts` touch it; `position`, or p_start if the constraints lifted it off.
    Vec3 contact_position{0.0};
    Vec3 constrained_goal{0.0};        // m, scene: the point nearest to the goal that `contacts` allow
    SurfacePlanes contacts;            // the planes that keep it from its goal
    SurfacePlanes planes;              // sent to the haptic loop: the contacts, then speculative planes in reach
    FrictionState friction;            // empty without friction
    bool stopped_by_half_ccd = false;  // a surface stopped it in the half-CCD
    [[nodiscard]] bool in_contact() const noexcept { return contacts.count > 0; }
    /// Static friction holds it.
    [[nodiscard]] bool sticks() const noexcept { return friction.active_planes.count > 0 && !friction.slides; }
};

/// Effort and failures of a step, over all particles.
struct ToolEffort {
    int advances = 0;              // maximum over the particles
    int pop_out_iterations = 0;    // maximum over the particles
    bool overconstrained = false;  // a particle has less room than its radius
    bool passed_through = false;   // a surface passed through a particle that had no room at all
};

class ToolProxies {
  public:
    struct Settings {
        ContactSettings contact;
        double reach = 0.0;  // m, of speculative planes beyond each radius; not more than any radius
        double step = 0.01;  // s
        /// Also counts particles with a free goal that the constraints ran into a surface (thesis, section 5.4.1).
        bool count_revised = false;
        /// Keeps objects of any thickness from passing between two spheres that overlap in the rest shape.
        bool closed = false;
    };

    /// Places the tool at `where` in the rest shape of `curl`. Throws std::invalid_argument: no particle, or more than
    /// ToolSettings::kMaxSpheres; not one radius per particle; a radius below `reach`; constraints that the solver
    /// rejects.
    ToolProxies(const ToolModel& model, const Settings& settings, const Pose& where, double curl = 0.0);

    /// Takes effect in the next step. A sphere that grows into a surface is moved clear by the next
    /// find_secure_positions(). `radius` in m; 0 leaves the radii unchanged. The reach of speculative planes is limited
    /// to the smallest radius. No allocation.
    void change(const ContactSettings& contact, int iterations, double radius = 0.0);
    /// s, from the hip of the last step to that of the next.
    void set_step(double step) { settings_.step = step; }

    /// The parts of a step, to be called in this order. No allocation. `surfaces` must be refitted to the step and
    /// outlive it.
    void set_goals(const Pose& hip) { set_goals(hip, curl_); }
    /// `curl` in 0..1; ignored by a tool without joints.
    void set_goals(const Pose& hip, double curl);
    void collect(std::span<const MovingSurface> surfaces);
    void find_secure_positions();
    void pop_out();
    void move_to_goals();
    void project_constraints();
    void revise();
    void collect_speculative_planes();

    /// From the next step on, records the path of each particle, for verification. Allocates.
    void keep_paths(bool on);
    [[nodiscard]] const ProxyPath& path(std::size_t particle) const { return paths_[particle]; }

    [[nodiscard]] std::span<const ToolProxy> particles() const noexcept { return particles_; }
    [[nodiscard]] const Pose& hip() const noexcept { return hip_; }
    /// 0..1; 0 for a tool without joints.
    [[nodiscard]] double curl() const noexcept { return curl_; }
    /// scene_from_tool: least-squares fit of the rest shape to the particles.
    [[nodiscard]] const Pose& pose() const noexcept { return pose_; }
    /// Every particle is where pose() puts it, to 1e-6 of its radius.
    [[nodiscard]] bool in_shape() const noexcept { return in_shape_; }
    /// The surfaces have friction.
    [[nodiscard]] bool has_friction() const noexcept;
    [[nodiscard]] const ToolEffort& effort() const noexcept { return effort_; }
    /// Particle positions and orientations, scene; rest positions in the tool frame, at the current curl.
    [[nodiscard]] const ParticleModel& model() const noexcept { return body_.particles; }
    /// Rest mesh, tool frame, at curl 0; empty for one_sphere().
    [[nodiscard]] const TriangleMesh& mesh() const noexcept { return body_.mesh; }
    /// m, scene: current positions of the mesh vertices.
    [[nodiscard]] std::vector<Vec3> vertices() const;
    /// Writes them to `out`, one element per mesh vertex. No allocation.
    void vertices(std::span<Vec3> out) const;
    /// m, scene: the mesh vertices with every particle at its goal.
    [[nodiscard]] std::vector<Vec3> goal_vertices() const;

  private:
    [[nodiscard]] ProxyPath* path_of(std::size_t particle) noexcept;
    void update_rest_offsets();
    void apply_curl(double curl);
    void skin(std::span<Vec3> out) const;
    void fit_pose();
    void move_toward(std::size_t particle, const Vec3& goal);
    // Closed links; in tool_links.cpp.
    void find_closed_links();
    void record_starts();
    void block_crossing_links();
    [[nodiscard]] bool restore_crossing_links();
    void block(std::size_t particle, const SurfacePlane& plane);
    void restore_start(std::size_t particle);
    void add_barriers(std::size_t particle);

    Settings settings_;
    double requested_reach_;  // m; settings_.reach is this, limited by the radii
    DeformableBody body_;     // rest shape and current state
    ParticleSolver solver_;
    std::unique_ptr<Skinner> skinner_;      // null without a mesh
    std::unique_ptr<ParticleModel> posed_;  // scratch: particles that the skin is evaluated for; null without a mesh
    ToolJoints joints_;                     // empty: the rest shape is fixed
    std::vector<Quat> rest_rotation_;       // per particle, tool frame: rotation by the current curl
    double curl_ = 0.0;                     // 0..1
    bool rest_shape_changed_ = false;       // the solver still has an older rest shape
    std::vector<ToolProxy> particles_;
    ContactCandidates contact_candidates_;
    std::vector<SpeculativeTask> speculative_tasks_;  // per particle: query for speculative planes
    std::vector<ProxyReach> candidate_queries_;       // per particle: swept region to collect candidates for
    std::vector<Vec3> last_position_;                 // per particle, m, scene: at the end of the last step
    std::vector<std::uint8_t> fixed_;                 // per particle: fixed by friction in the constraints
    std::vector<ProxyPath> paths_;                    // per particle; empty if not recorded
    /// Two spheres that overlap in the rest shape; surfaces must not pass between them.
    struct ClosedLink {
        std::uint32_t first;
        std::uint32_t second;
    };
    /// State of a particle before a move, and the planes that block links of it in that move.
    struct Start {
        ToolProxy particle;
        std::size_t knots = 0;  // of its path, before the move
        SurfacePlanes barriers;
    };
    std::span<const MovingSurface> surfaces_;  // of the current step
    std::vector<ClosedLink> links_;            // empty unless Settings::closed
    std::vector<Start> starts_;                // per particle; empty without links
    Vec3 rest_centre_{0.0};                    // mean of the rest offsets
    Pose hip_;
    Pose pose_;
    ToolEffort effort_;
    bool has_goals_ = false;  // goals of an earlier step exist
    bool stopped_ = false;    // a surface stopped a particle short of its goal
    bool deflected_ = false;  // a particle met a surface, even if it reached its goal
    bool in_shape_ = true;
};

}  // namespace haptic::sim
