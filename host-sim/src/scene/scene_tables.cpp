#include "scene/scene_tables.hpp"

namespace haptic::sim {
namespace {

constexpr Range kPositions{-1e4, 1e4};  // m
constexpr Range kTimes{0.0, 1e6};       // s
constexpr Range kUnitInterval{0.0, 1.0};
constexpr Range kFriction{0.0, 10.0};
constexpr Range kStiffness{0.0, 1e5};  // N/m

}  // namespace

const SettingTable<Scene>& top_level_table() {
    using S = Scene;
    using V = SettingValues<S>;
    static const SettingTable<S> table{
        "",
        "",
        {
            {{.key = "description", .meaning = "One sentence about the scene."}, V::text(&S::description)},
            {{.key = "duration", .unit = "s", .meaning = "Simulated time of a run. 0: until it is stopped."},
             V::number(&S::duration_s, kTimes)},
        }};
    return table;
}

const SettingTable<SolverSettings>& solver_table() {
    using S = SolverSettings;
    using V = SettingValues<S>;
    static const SettingTable<S> table{
        "solver",
        "Position-based dynamics.",
        {
            {{.key = "step", .unit = "s", .label = "Simulation rate", .meaning = "Length of a simulation step."},
             V::number(&S::step, {1e-4, 0.1})},
            {{.key = "substeps",
              .default_note = "1, or 0 for a body with a material",
              .meaning = "Equal parts into which each step is divided. 0: as many as the materials need."},
             V::integer(&S::substeps, {0, kMaxSubsteps})},
            {{.key = "iterations",
              .label = "Solver iterations",
              .meaning =
                  "Passes over all constraints and contacts per sub-step. One where all bodies have a material."},
             V::integer(&S::iterations, {0, 1000})},
            {{.key = "rotation_iterations",
              .meaning = "Iterations of the rotation extraction of each shape-matching group."},
             V::integer(&S::rotation_iterations, {1, 100})},
            {{.key = "gravity", .unit = "m/s^2", .meaning = "Gravity; y points up."},
             V::vector(&S::gravity, {-1e3, 1e3})},
            {{.key = "drag", .unit = "1/s", .meaning = "Rate at which all velocities decay."},
             V::number(&S::drag, {0.0, 9.0})},
            {{.key = "shape_damping",
              .unit = "1/s",
              .old_key = "solver.settling",
              .meaning = "Rate at which motion within a body decays. Keeps the momentum of the body."},
             V::number(&S::shape_damping, {0.0, 10.0})},
            {{.key = "keep_angular_momentum",
              .meaning = "Whether to restore the angular momentum that the implicit scheme loses."},
             V::flag(&S::keep_angular_momentum)},
            {{.key = "sleep_after",
              .unit = "s",
              .meaning =
                  "A body with a material sleeps after it has stayed in place for so long, with all that it touches, "
                  "until something comes near. At least 0.2, or 0: never."},
             V::number(&S::sleep_after, {0.0, 1e3})},
            {{.key = "threads",
              .default_note = "0",
              .meaning = "Threads that share the work of a step; the result has the same bits with any number. 0: one "
                         "for each processor that host-sim may use, up to 8; one less beside rt-core."},
             V::integer(&S::threads, {0, 256})},
        }};
    return table;
}

const SettingTable<CollisionSettings>& collisions_table() {
    using S = CollisionSettings;
    using V = SettingValues<S>;
    static const SettingTable<S> table{
        "collisions",
        "Collisions of particles, as ellipsoids, with particles of other bodies and with the ground, and of surfaces.",
        {
            {{.key = "between_bodies",
              .meaning = "Whether different bodies collide, with their particles and their surfaces."},
             V::flag(&S::between_bodies)},
            {{.key = "surfaces",
              .meaning = "Whether surfaces are kept from passing through themselves and, with between_bodies, "
                         "through one another: sheets by contacts, solids by following as far as they can."},
             V::flag(&S::surfaces)},
            {{.key = "thickness",
              .unit = "m",
              .default_note = "a tenth of the mean edge",
              .meaning =
                  "Distance that is kept between sheets that lie on one another. 0: a tenth of their mean edge."},
             V::number(&S::thickness, {0.0, 1.0})},
            {{.key = "ground", .meaning = "Whether particles collide with the ground, a half-space."},
             V::flag(&S::ground)},
            {{.key = "ground_height", .unit = "m", .meaning = "Height of the ground."},
             V::number(&S::ground_height, kPositions)},
            {{.key = "static_friction", .meaning = "Coefficient of static friction."},
             V::number(&S::static_friction, kFriction)},
            {{.key = "dynamic_friction", .meaning = "Coefficient of dynamic friction, at most static_friction."},
             V::number(&S::dynamic_friction, kFriction)},
            {{.key = "push_out_speed",
              .unit = "m/s",
              .meaning =
                  "Largest speed at which particles that overlap at the start are moved apart, and at which surfaces "
                  "of solids follow that other ones held back."},
             V::number(&S::push_out_speed, {0.0, 100.0})},
            {{.key = "max_substeps",
              .old_key = "collisions.most_substeps",
              .meaning = "Maximum number of substeps where bodies approach each other fast."},
             V::integer(&S::max_substeps, {1, 100})},
        }};
    return table;
}

const SettingTable<ProxySettings>& proxy_table() {
    using S = ProxySettings;
    using V = SettingValues<S>;
    static const SettingTable<S> table{
        "proxy",
        "The virtual proxies of the tool.",
        {
            {{.key = "radius",
              .unit = "m",
              .label = "Tool radius",
              .meaning = "Radius of the proxy of a scene without [tool]."},
             V::number(&S::radius, {1e-6, 10.0})},
            {{.key = "shrink",
              .label = "Contact radius factor",
              .meaning = "Contacts are detected with radius times this factor."},
             V::number(&S::shrink, {0.9, 0.99999})},
            {{.key = "reach",
              .unit = "m",
              .meaning = "Surfaces that come nearer than this within a step are sent to rt-core before they touch. A "
                         "radius that is smaller takes its place."},
             V::number(&S::reach, {0.0, 10.0})},
        }};
    return table;
}

const SettingTable<ContactSettings>& proxy_friction_table() {
    using S = ContactSettings;
    using V = SettingValues<S>;
    static const SettingTable<S> table{
        "proxy",
        "",
        {
            {{.key = "static_friction",
              .label = "Static friction",
              .meaning = "Coefficient of static friction of the proxies. 0: smooth."},
             V::number(&S::static_friction, kFriction)},
            {{.key = "dynamic_friction",
              .label = "Dynamic friction",
              .meaning = "Coefficient of dynamic friction of the proxies, at most static_friction."},
             V::number(&S::dynamic_friction, kFriction)},
        }};
    return table;
}

const SettingTable<ContactSettings>& contact_table() {
    using S = ContactSettings;
    using V = SettingValues<S>;
    static const SettingTable<S> table{
        "contact",
        "Contact detection. The keys after pop_out are for pop_out = \"thesis\" only.",
        {
            {{.key = "method",
              .label = "Contact detection",
              .meaning = "Detection of moving surfaces: \"complete\", or \"thesis\" for the thesis' Algorithm 1, which "
                         "misses contacts, for comparison."},
             V::choice(&S::method, {{"complete", CcdMethod::Complete}, {"thesis", CcdMethod::Thesis}})},
            {{.key = "pop_out",
              .label = "Overlap removal",
              .meaning = "Pop-out of a proxy that still intersects surfaces after a step: \"order_free\", or "
                         "\"thesis\" for the thesis' Algorithm 2, for comparison."},
             V::choice(&S::pop_out, {{"order_free", PopOutMethod::OrderFree}, {"thesis", PopOutMethod::Thesis}})},
            {{.key = "pop_out_limit", .meaning = "Maximum number of passes over the triangles in range."},
             V::integer(&S::pop_out_limit, {1.0, 1e5})},
            {{.key = "pop_out_minimum", .meaning = "Minimum length of a pop-out, in radii (thesis, section 4.4.2)."},
             V::number(&S::pop_out_minimum, kUnitInterval)},
            {{.key = "detection_range", .meaning = "Distance, in radii, within which triangles are in range."},
             V::number(&S::detection_range, {1.0, 100.0})},
            {{.key = "half_space",
              .meaning = "Whether to use only triangles that the centre is in front of (thesis, section 4.6.1)."},
             V::flag(&S::half_space)},
        }};
    return table;
}

const SettingTable<CouplingSettings>& coupling_table() {
    using S = CouplingSettings;
    using V = SettingValues<S>;
    static const SettingTable<S> table{
        "coupling",
        "The virtual coupling between tool and hand, in the scene.",
        {
            {{.key = "stiffness",
              .unit = "N/m",
              .label = "Stiffness, hand to tool",
              .meaning = "Stiffness between proxy and hand (thesis: 10 to 20)."},
             V::number(&S::stiffness, kStiffness)},
            {{.key = "torque_stiffness",
              .unit = "N/m",
              .label = "The same in rotation (0: equal)",
              .meaning = "Stiffness of the springs that produce the torque. 0: the same as stiffness."},
             V::number(&S::torque_stiffness, kStiffness)},
            {{.key = "multi_rate",
              .meaning = "What rt-core gets of each contact: its \"planes\", or the \"positions\" of the proxies as in "
                         "the thesis (section 5.4.1), which causes drag, for comparison."},
             V::choice(&S::multi_rate, {{"planes", MultiRate::Planes}, {"positions", MultiRate::Positions}})},
            {{.key = "hunt_crossley_damping",
              .unit = "s/m",
              .old_key = "coupling.loss",
              .meaning = "Hunt-Crossley damping c: force = stiffness * depth * (1 + c * approach speed). Without it "
                         "the spring throws bodies back. Acts where spheres do not displace one another: on a "
                         "single sphere, on a limp tool with one stiffness, and with multi_rate \"positions\"."},
             V::number(&S::hunt_crossley_damping, {0.0, 10.0})},
            {{.key = "damping_time",
              .unit = "s",
              .meaning = "Damping beside the springs of coupling and tool: damping / stiffness, the same for every "
                         "contact. Lets a body that the tool holds come to rest."},
             V::number(&S::damping_time, {0.0, 1.0})},
            {{.key = "mask_radius",
              .unit = "m",
              .meaning = "Radius, in the rest shape, of the patch of vertices that takes the force of a contact."},
             V::number(&S::mask_radius, {0.0, 100.0})},
        }};
    return table;
}

const SettingTable<HandScript>& hand_table() {
    using S = HandScript;
    using V = SettingValues<S>;
    static const SettingTable<S> table{
        "hand",
        "The motion of the hand if neither a device nor --input moves it. Linear between the given times.",
        {
            {{.key = "times", .unit = "s", .meaning = "Times of the script, increasing."},
             V::numbers(&S::times, kTimes)},
            {{.key = "positions", .unit = "m", .meaning = "Position x, y, z in the scene for each time."},
             V::numbers(&S::positions, kPositions)},
            {{.key = "orientations",
              .meaning = "Rotation of the grip in the scene, unit quaternion w, x, y, z for each time. Empty: none."},
             V::numbers(&S::orientations, {-1.0, 1.0})},
            {{.key = "repeat", .meaning = "Whether the script starts again after its last time; else the hand stays."},
             V::flag(&S::repeat)},
            {{.key = "curl",
              .meaning = "Closure of a generated hand for each time, from 0, flat, to 1, a fist. Empty: tool.curl."},
             V::numbers(&S::curl, kUnitInterval)},
        }};
    return table;
}

const SettingTable<WorkspaceSettings>& workspace_table() {
    using S = WorkspaceSettings;
    using V = SettingValues<S>;
    static const SettingTable<S> table{
        "workspace",
        "The mapping between the device, which moves within centimetres, and the scene.",
        {
            {{.key = "scale", .meaning = "Metres at the device per metre in the scene."},
             V::number(&S::scale, {1e-3, 10.0})},
            {{.key = "offset", .unit = "m", .meaning = "Position of the scene's origin in the device frame."},
             V::vector(&S::offset, {-1.0, 1.0})},
            {{.key = "rotation", .meaning = "Rotation of the scene in the device frame (w, x, y, z)."},
             V::rotation(&S::rotation)},
            {{.key = "force_scale", .meaning = "Newtons at the hand per newton in the scene."},
             V::number(&S::force_scale, {0.0, 100.0})},
            {{.key = "clutch_button",
              .meaning = "Button that uncouples the grip from the tool while it is held. -1: none."},
             V::integer(&S::clutch_button, {-1, 31})},
            {{.key = "clutch_fade", .unit = "s", .meaning = "Time in which the force fades out when the clutch opens."},
             V::number(&S::clutch_fade, {0.0, 10.0})},
        }};
    return table;
}

const SettingTable<Scene>& step_probe_table() {
    using S = Scene;
    using V = SettingValues<S>;
    static const SettingTable<S> table{
        "probes",
        "",
        {{{.key = "step",
           .meaning = "Line, by name or offset, that is high while a step is computed and published. Empty: none."},
          V::parsed(
              &S::step_probe, {"text or integer", Range{0, 1023}}, "\"\"",
              [](const Config& config, const std::string&) { return read_probe_line(config, "step", "host-sim"); })}}};
    return table;
}

}  // namespace haptic::sim
