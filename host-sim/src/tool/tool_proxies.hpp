// Tool proxies: the tool in equilibrium, one virtual proxy per particle, joined by the tool's elasticity (thesis,
// chapter 5; its Algorithm 4 joins them by constraints that the hand does not feel). A single sphere is the tool of
// chapter 4.
//
// Nothing is integrated (zero-order dynamics): the tool has no mass at the hand. Its shape minimises the elastic energy
// of material and coupling (tool_elasticity.hpp) among the half-spaces of its contacts. Let p be the hip, Q its
// orientation, g_i = Q o_i + p the goals (Eq. 5.1), C the compliance in the tool's frame R, and f_j the forces of the
// surfaces. The particles are at
//     x_i = free_i + R sum_j C_ij R^T f_j,   free_i = p + R (o_i + [C Cs (R^T Q - 1) o]_i),
// and the f_j follow from one small problem over the contact planes and, with friction, the tangents at the proxies
// (haptic/contact_problem.hpp): forces press, stay in the Coulomb cone, and are 0 where a proxy is off its plane. C is
// linear in the displacements from R o_i, so R is the rotation that fits the x_i best (co-rotated elasticity), found
// by turns with the forces; without contact R = Q and free_i = g_i. The torque about the hip is sum (free_i - p) x f_i.
//
// Each step takes the hip, the pose (d, Q) at which the hand holds the tool, and
//   1. moves every particle out of the way of surfaces that moved (CCD, pop-out);
//   2. carries particles that stick along with their surface;
//   3. solves the contact problem for the planes that the proxies touch, and moves all proxies toward their x_i by one
//      fraction of their ways, up to the first contact (half-CCD, section 5.3.2; the god-object of Ortega, Redon,
//      Coquillart 2007), so that the tool keeps its shape. Planes that stop a proxy on its own way join the problem;
//      planes that press stay in it, at the points of their triangles nearest to the proxy, those of the last step too.
//      R and free_i follow in each round. This repeats until every proxy is at its x_i and R has settled, or kMaxRounds
//      times; ToolEffort::equilibrium_error is the distance that is left, which the next steps remove. Independent
//      proxies move on their own.
// In free air there are no rows: the tool is in its rest shape and all forces are exactly 0. For independent springs
// without friction 3 is the virtual proxy of chapter 4 for each particle.
//
// Friction: the force along the planes is limited by the cone of the contact problem. A proxy sticks to its anchor, the
// point where it first touched, which the surface carries; one that slides is drawn after x_i, and its new position
// becomes the anchor of the next step. Spheres of a tool that is not limp turn with R: friction acts where the first
// plane touches them, at a = -r n from the centre, and one that sticks rolls: its anchor moves by (dR - 1) r n. The
// torque about the hip is then sum (free_i + a - p) x f_i.
//
// A particle is in contact if a surface presses on it. The haptic loop computes the same forces from planes, goals and
// compliance, so they do not depend on the last micrometre between particle and surface.
//
// The rest shape may change between steps (tool_joints.hpp): o_i, groups and compliance are then those of the current
// curl, and a particle that closes is swept toward its goal like one that the hand moves.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "contact/active_contacts.hpp"
#include "contact/contact_candidates.hpp"
#include "contact/friction.hpp"
#include "contact/link_guard.hpp"
#include "contact/proxy_path.hpp"
#include "contact/speculative_planes.hpp"
#include "contact/swept_tree.hpp"
#include "dynamics/rotation.hpp"
#include "haptic/contact_problem.hpp"
#include "haptic/sim/contact.hpp"
#include "haptic/sim/mesh.hpp"
#include "haptic/sim/skin.hpp"
#include "haptic/sim/tool_model.hpp"
#include "haptic/types.hpp"
#include "tool/tool_elasticity.hpp"

namespace haptic::sim {

/// Proxy of one particle, after a step.
struct ToolProxy {
    Vec3 rest_offset{0.0};    // m, tool frame, at the current curl
    Vec3 rest_velocity{0.0};  // m/s, tool frame: of the rest offset in the last step, in which the curl changed
    double radius = 0.0;      // m
    Vec3 free_offset{0.0};  // m, grip frame: where the contact problem has it without contact; in free air rest_offset
    Vec3 free_position{0.0};     // m, scene: the same; in free air the goal
    Vec3 goal{0.0};              // m, scene: g_i of Eq. 5.1
    Vec3 goal_velocity{0.0};     // m/s, scene: mean over the step that ends at the goal
    Vec3 position{0.0};          // m, scene
    Vec3 constrained_goal{0.0};  // m, scene: the point nearest to the goal that `contacts` allow
    SurfacePlanes contacts;      // the planes that hold it back from its unloaded position
    SurfacePlanes planes;        // sent to the haptic loop: the contacts, then speculative planes in reach
    FrictionState friction;      // empty without friction
    [[nodiscard]] bool in_contact() const noexcept { return contacts.count > 0; }
    /// Static friction holds it.
    [[nodiscard]] bool sticks() const noexcept { return friction.active_planes.count > 0 && !friction.slides; }
};

/// Effort and failures of a step, over all particles.
struct ToolEffort {
    int advances = 0;  // maximum over the particles
    int rounds = 0;    // solutions of the contact problem
    double equilibrium_error =
        0.0;  // m, largest distance of a particle from its x_i; of an elastic tool before its last move
    int pop_out_iterations = 0;    // maximum over the particles
    bool overconstrained = false;  // a particle has less room than its radius
};

/// Row of the contact problem (haptic/contact_problem.hpp): a direction in which a proxy is pushed. In the order of the
/// proxies; the rows of one proxy are its contact planes, then two tangents if the surfaces have friction.
struct ContactRow {
    std::uint32_t proxy = 0;
    std::uint32_t plane = 0;  // normal row: index into ToolProxy::contacts; tangential row: 0 or 1
    bool tangential = false;
    bool slides = false;  // the proxy's tangential force is at the limit of friction
    Vec3 direction{0.0};  // unit, scene: on the proxy
    Vec3 arm{0.0};  // m, scene: from the centre of the proxy to where the force acts on it, if it turns with the tool
    double depth = 0.0;  // m: b of the problem
    double force = 0.0;  // N: l of the problem, with the whole stiffness of the coupling
};

class ToolProxies {
  public:
    struct Settings {
        ContactSettings contact;
        double reach = 0.0;                 // m, of speculative planes beyond each radius; at most the smallest radius
        double step = 0.01;                 // s
        ToolElasticity::Springs springs{};  // of the coupling
        /// Keeps objects of any thickness from passing between two spheres that overlap in the rest shape.
        bool closed = false;
    };

    /// Places the tool at `where` in the rest shape of `curl`. Throws std::invalid_argument: no particle, or more than
    /// ToolSettings::kMaxSpheres; not one positive radius per particle; a material out of range.
    ToolProxies(const ToolModel& model, const Settings& settings, const Pose& where, double curl = 0.0);

    /// Takes effect in the next step. A sphere that grows into a surface is moved clear by the next
    /// find_secure_positions(). `radius` in m; 0 leaves the radii unchanged. The reach of speculative planes is limited
    /// to the smallest radius. No allocation.
    void change(const ContactSettings& contact, const ToolElasticity::Springs& springs, double radius = 0.0);
    /// s, from the hip of the last step to that of the next.
    void set_step(double step) { settings_.step = step; }

    /// The parts of a step, to be called in this order. No allocation. `surfaces` must be refitted to the step and
    /// outlive it.
    void set_goals(const Pose& hip) { set_goals(hip, curl_); }
    /// `curl` in 0..1; ignored by a tool without joints.
    void set_goals(const Pose& hip, double curl);
    void collect(std::span<const MovingSurface> surfaces);
    /// False: a particle has no room, and none has moved. Then the surfaces that are in the way have to stand still,
    /// and both parts to be called again.
    [[nodiscard]] bool find_secure_positions();
    [[nodiscard]] std::span<const std::uint32_t> in_the_way() const noexcept { return in_the_way_; }
    void pop_out();
    void find_equilibrium();
    void collect_speculative_planes(double step);  // s, of the step that begins

    /// From the next step on, records the path of each particle, for verification. Allocates.
    void keep_paths(bool on);
    [[nodiscard]] const ProxyPath& path(std::size_t particle) const { return paths_[particle]; }

    [[nodiscard]] std::span<const ToolProxy> particles() const noexcept { return particles_; }
    [[nodiscard]] const Pose& hip() const noexcept { return hip_; }
    /// scene_from_tool: the frame R of the elasticity. In free air the hip's orientation.
    [[nodiscard]] Quat elastic_frame() const noexcept { return hip_.orientation * turn_; }
    /// m, of a sphere that turns with the tool, and so rolls on what it sticks to: friction acts at this distance from
    /// its centre, along the normal of its first plane. 0: it turns freely, as spheres of a limp tool and a single one.
    [[nodiscard]] double rolling_radius(const ToolProxy& proxy) const noexcept {
        return particles_.size() > 1 && !elasticity_.material().limp() ? proxy.radius : 0.0;
    }
    /// m/s, scene: mean over the step of the end of an arm that turns with the hip about a proxy's goal.
    [[nodiscard]] Vec3 goal_velocity_at(const ToolProxy& proxy, const Vec3& arm) const noexcept {
        return proxy.goal_velocity + (hip_turn_ * arm - arm) / settings_.step;
    }
    /// m, scene: where a point of a surface is at the end of the surface's last motion.
    [[nodiscard]] Vec3 place_of(const SurfacePoint& point) const noexcept;
    /// m, scene: where a proxy that sticks would be if its sphere had turned with the hip, not with R.
    [[nodiscard]] Vec3 unturned_position(const ToolProxy& proxy) const noexcept;
    /// What the tool feels of a row's force, in its frame R.
    [[nodiscard]] ToolElasticity::Push push(std::size_t proxy, const Vec3& direction, const Vec3& arm) const noexcept {
        const Mat3 to_tool = glm::transpose(to_matrix(elastic_frame()));
        return {proxy, to_tool * direction, to_tool * glm::cross(arm, direction)};
    }
    /// 0..1; 0 for a tool without joints.
    [[nodiscard]] double curl() const noexcept { return curl_; }
    /// scene_from_tool: least-squares fit of the rest shape to the particles.
    [[nodiscard]] const Pose& pose() const noexcept { return pose_; }
    /// Every particle is where pose() puts it, to 1e-6 of its radius.
    [[nodiscard]] bool in_shape() const noexcept { return in_shape_; }
    /// The surfaces have friction.
    [[nodiscard]] bool has_friction() const noexcept;
    [[nodiscard]] const ToolEffort& effort() const noexcept { return effort_; }
    /// The contact problem of the last step, solved; empty while nothing touches.
    [[nodiscard]] std::span<const ContactRow> rows() const noexcept { return rows_; }
    /// N, scene: force of the surfaces on a proxy in the last step.
    [[nodiscard]] const Vec3& force_on(std::size_t particle) const noexcept { return force_[particle]; }
    /// Compliance of tool and coupling at the current curl.
    [[nodiscard]] const ToolElasticity& elasticity() const noexcept { return elasticity_; }
    /// m/N, scene: displacement of proxy i per force on proxy j, the hand held still.
    [[nodiscard]] Mat3 compliance(std::size_t i, std::size_t j) const;
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
    void limit_reach();
    void update_rest_offsets();
    void apply_curl(double curl);
    void pose_particles() const;
    void skin(std::span<Vec3> out) const;
    void fit_pose();
    /// m^2, moment matrix sum (x_i - c) (o_i - o_c)^T of shape matching (Mueller 2005) without mass weights, whose
    /// rotation fits the rest shape to positions x_i with the centre c.
    template <class Position>
    [[nodiscard]] Mat3 moment_about(const Vec3& centre, const Position& position) const {
        Mat3 moment(0.0);
        for (std::size_t i = 0; i < particles_.size(); ++i) {
            const Vec3 offset = position(i) - centre;
            const Vec3 rest = particles_[i].rest_offset - rest_centre_;
            moment += Mat3(offset * rest.x, offset * rest.y, offset * rest.z);
        }
        return moment;
    }
    // The equilibrium; in tool_equilibrium.cpp.
    void carry_sticking();
    void carry_planes(std::size_t particle);
    void set_free_positions();
    [[nodiscard]] double fit_turn();
    void solve_contacts();
    void write_rows();
    [[nodiscard]] Vec3 rolled(const Quat& frame, const Vec3& arm) const noexcept;
    /// m, scene: from the centre of a proxy in contact to where friction acts on it.
    [[nodiscard]] Vec3 friction_arm(const ToolProxy& proxy) const noexcept {
        return -rolling_radius(proxy) * proxy.contacts.plane[0].normal;
    }
    void solve_rows();
    void set_targets();
    [[nodiscard]] double distance_to_targets();
    void move_apart();
    [[nodiscard]] double move_together();
    void find_planes(double fraction);
    void move_toward(std::size_t particle, const Vec3& target);
    [[nodiscard]] SurfacePlanes pressing_planes(std::size_t particle) const;
    void collect_contacts(std::size_t particle, const SurfacePlanes& stopped_by);
    void store_contacts();
    // Closed links; in tool_links.cpp.
    void find_closed_links();
    void record_starts();
    void restore_crossing_links();
    [[nodiscard]] bool restore_if_link_crosses();
    void restore_start(std::size_t particle);
    void add_barrier(std::size_t particle, const SurfacePlane& plane);
    void put_barriers_first(std::size_t particle);

    Settings settings_;
    double requested_reach_;                // m; settings_.reach is this, limited by the radii
    DeformableBody body_;                   // rest shape
    std::unique_ptr<Skinner> skinner_;      // null without a mesh
    std::unique_ptr<ParticleModel> posed_;  // scratch: particles that the skin is evaluated for; null without a mesh
    ToolJoints joints_;                     // empty: the rest shape is fixed
    std::vector<Quat> rest_rotation_;       // per particle, tool frame: rotation by the current curl
    double curl_ = 0.0;                     // 0..1
    ToolElasticity elasticity_;
    std::vector<ToolProxy> particles_;
    std::vector<ContactRow> rows_;
    std::vector<Vec3> force_;                                         // per particle, N, scene
    std::vector<std::array<double, kMaxSurfacePlanes>> plane_force_;  // per particle and contact plane, N
    std::vector<Vec3> target_;                                        // per particle, m, scene: x_i
    /// Friction of a particle within a step.
    struct Grip {
        Vec3 anchor{0.0};       // m, scene: where it sticks
        bool anchored = false;  // it has touched a surface
        bool slides = false;    // the dynamic coefficient applies
    };
    std::vector<Grip> grips_;                  // per particle
    std::vector<SurfacePlanes> barriers_;      // per particle: planes that block links of it in this step
    std::vector<std::uint32_t> barrier_rows_;  // per particle: barriers among the planes of the last solution
    ContactSolver contact_solver_{ContactSolver::kMaxStepSweeps};
    ComplianceMatrix row_compliance_;  // W, m/N
    std::vector<double> row_depth_;    // m, per row
    std::vector<FrictionRows> friction_rows_;
    std::vector<Vec3> displacement_;  // scratch: per particle, m, tool frame
    std::vector<double> free_way_;    // scratch: per particle, fraction of the way to its target without contact
    std::vector<Vec3> free_shift_;    // scratch: per particle, m, tool frame
    ContactCandidates contact_candidates_;
    std::vector<SpeculativeTask> speculative_tasks_;  // per particle: query for speculative planes
    std::vector<ProxyReach> candidate_queries_;       // per particle: swept region to collect candidates for
    std::vector<ProxyPath> paths_;                    // per particle; empty if not recorded
    std::vector<Vec3> secure_;                        // m, scene: per particle
    std::vector<std::uint32_t> in_the_way_;           // surfaces
    /// Two spheres that overlap in the rest shape; surfaces must not pass between them.
    struct ClosedLink {
        std::uint32_t first;
        std::uint32_t second;
    };
    /// State of a particle before a move.
    struct Start {
        ToolProxy particle;
        Grip grip;
        std::size_t knots = 0;  // of its path
    };
    std::span<const MovingSurface> surfaces_;  // of the current step
    std::vector<ClosedLink> links_;            // empty unless Settings::closed
    std::vector<Start> starts_;                // per particle; empty without links
    Vec3 rest_centre_{0.0};                    // mean of the rest offsets
    Pose hip_;
    Mat3 hip_turn_{1.0};                    // since the last step
    Quat last_frame_{1.0, 0.0, 0.0, 0.0};   // R at the end of the last step, in which anchors are known
    Quat turn_{1.0, 0.0, 0.0, 0.0};         // grip frame: rotation of the tool in the grip, about which C is linear
    Quat fitted_turn_{1.0, 0.0, 0.0, 0.0};  // the same, fitted to the last solution
    Vec3 last_change_{0.0};                 // rad, tool frame: of turn_ in the last round; 0 in the first
    double remaining_ = 0.0;                // part of a change of turn_ that the next round adds
    Pose pose_;
    ToolEffort effort_;
    bool has_goals_ = false;  // goals of an earlier step exist
    bool stopped_ = false;    // a surface stopped a particle in this step
    bool in_shape_ = true;
};

}  // namespace haptic::sim
