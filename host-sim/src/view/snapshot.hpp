// Scene description and snapshot: the constant part of a scene (SceneDescription), its state at one instant
// (SceneSnapshot), and the plotted quantities of a step (StepSample). The simulation fills them and the view's thread
// reads them; neither waits for the other (live_view.hpp).
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "haptic/sim/mesh.hpp"
#include "haptic/sim/particles.hpp"
#include "haptic/types.hpp"

namespace haptic::sim::view {

/// A setting that a viewer may change while the scene runs.
struct ParameterDescription {
    std::string key;                   // in the scene file, e.g. "coupling.stiffness"
    std::string label;                 // shown to the user, e.g. "Stiffness"
    std::string unit;                  // "N/m", "m", "Hz"; empty: none
    double min = 0.0;                  // lower limit of a number
    double max = 0.0;                  // upper limit of a number
    bool whole = false;                // integers only
    bool logarithmic = false;          // slider with a logarithmic scale
    std::vector<std::string> choices;  // if not empty, the value is an index into these
    std::string meaning;               // one or two sentences
};

inline constexpr std::size_t kMaxParameters = 16;

/// Body k of a scene and its ranges of the vertices and particles of all bodies.
struct BodyDescription {
    std::string name;
    std::size_t first_vertex = 0;
    std::size_t vertices = 0;
    std::vector<Triangle> triangles;  // indices into its own vertices
    std::size_t first_particle = 0;
    std::size_t particles = 0;
};

/// The constant part of a scene.
struct SceneDescription {
    std::string name;
    std::string text;                 // the scene's description, one sentence
    std::vector<std::string> scenes;  // that a viewer may load instead
    std::vector<BodyDescription> bodies;
    std::vector<Vec3> semi_axes;       // m, of each particle's ellipsoid; 0: it has none
    std::vector<Quat> ellipsoid_axes;  // per particle: particle_from_ellipsoid
    std::vector<Group> groups;         // shape-matching groups
    std::vector<Link> links;
    std::vector<Triangle> tool_triangles;  // empty: the tool consists of its spheres only
    std::size_t tool_vertices = 0;
    std::vector<double> proxy_radii;               // m, at the start
    std::optional<double> ground_height;           // m
    std::vector<ParameterDescription> parameters;  // at most kMaxParameters
    double step = 0.01;                            // s, at the start
    double mask_radius = 0.0;                      // m, over which a contact's force is spread on the surface
    double force_scale = 1.0;                      // N at the hand per N in the scene
    double length = 0.0;                           // s, of the recording that is played; 0: a live run
    bool closes = false;                           // the tool is a hand that can close
};

/// A contact plane that was sent to the haptic loop: dot(normal, proxy centre) >= offset.
struct PlaneView {
    Vec3 normal{0.0, 1.0, 0.0};  // unit, scene
    double offset = 0.0;         // m, includes the proxy's radius
    double velocity = 0.0;       // m/s, along the normal
    std::uint32_t proxy = 0;
    bool touches = false;  // the proxy is in contact with it; otherwise it is speculative
};

/// What pressed on the tool in the last step.
struct ForceView {
    Vec3 point{0.0};             // m, scene: of the surface
    Vec3 normal{0.0, 1.0, 0.0};  // unit, scene, from the surface to the proxy
    double force = 0.0;          // N, scene: normal force on the body
    std::uint32_t body = 0;
    std::uint32_t proxy = 0;
};

/// One proxy of the tool.
struct ProxyView {
    Vec3 position{0.0};   // m, scene
    Vec3 goal{0.0};       // m, scene: the position that the hand prescribes
    double radius = 0.0;  // m; may change while the scene runs
    bool touches = false;
    bool sticks = false;
};

/// The source of the hand's motion.
enum class HandSource : std::uint8_t { Script, Device, Mouse, Input, Still };

/// State of the run rather than of the scene.
struct RunView {
    bool paused = false;
    bool recording = false;
    std::uint64_t recorded_steps = 0;
    HandSource hand = HandSource::Script;
    double speed = 0.0;                               // simulated seconds per second, smoothed
    std::uint64_t late_steps = 0;                     // deadlines missed
    double buffered = 0.0;                            // s, of a recording, simulated so far
    bool diverged = false;                            // of a recording: the replay differs from it
    std::array<double, kMaxParameters> parameters{};  // as SceneDescription::parameters
};

/// The device in the scene: maps the device frame to the scene, scene_from_device.
struct DeviceInScene {
    Vec3 centre{0.0};                      // m, scene
    Quat orientation{1.0, 0.0, 0.0, 0.0};  // scene_from_device
    double scale = 1.0;                    // m in the scene per m at the device
};

/// State of the scene at one instant. All vectors but `planes` and `forces` have the lengths given by the description.
struct SceneSnapshot {
    std::uint64_t step = 0;           // number of the step that starts at `time`
    double time = 0.0;                // s, simulated
    std::vector<Vec3> vertices;       // m, scene, of all bodies
    std::vector<Vec3> particles;      // m, scene, of all bodies
    std::vector<Quat> orientations;   // per particle
    std::vector<Vec3> tool_vertices;  // m, scene
    std::vector<ProxyView> proxies;
    std::vector<PlaneView> planes;  // at most 3 per proxy
    std::vector<ForceView> forces;
    DeviceInScene device;   // the clutch moves it
    Pose tool;              // scene_from_tool
    Pose hip;               // scene_from_tool, as the device has it
    Vec3 force{0.0};        // N, scene, on the tool
    Vec3 torque{0.0};       // N*m, scene, on the tool about the hip
    Vec3 hand_force{0.0};   // N, device frame
    Vec3 hand_torque{0.0};  // N*m, device frame
    double curl = 0.0;
    double depth = 0.0;  // m, scene
    bool in_contact = false;
    bool overconstrained = false;
    RunView run;
};

/// Plotted quantities of one step.
struct StepSample {
    double time = 0.0;      // s, simulated
    float force = 0.0F;     // N, at the hand
    float torque = 0.0F;    // N*m, at the hand
    float depth = 0.0F;     // m, scene
    float total_us = 0.0F;  // from here on: durations of the stages of the step
    float ccd_us = 0.0F;
    float popout_us = 0.0F;
    float proxy_us = 0.0F;
    float tool_us = 0.0F;
    float collide_us = 0.0F;
    float deform_us = 0.0F;
    float skin_us = 0.0F;
    float reserved = 0.0F;
};

}  // namespace haptic::sim::view
