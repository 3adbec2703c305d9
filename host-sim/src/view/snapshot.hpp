// What a viewer is shown of a scene: what stays as it is (SceneDescription), one moment of what moves (SceneSnapshot),
// and what each step came to (StepSample). The simulation fills these, the view's own thread reads them; neither waits
// for the other (live_view.hpp).
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
    std::string key;                   // of the scene file, e.g. "coupling.stiffness"
    std::string label;                 // for a person, e.g. "Stiffness"
    std::string unit;                  // "N/m", "m", "Hz"; empty: none
    double least = 0.0;                // of numbers
    double most = 0.0;                 // likewise
    bool whole = false;                // takes whole numbers only
    bool logarithmic = false;          // a slider wants equal ratios
    std::vector<std::string> choices;  // not empty: the value is an index into these
};

inline constexpr std::size_t kMostParameters = 16;

/// Body k of a scene: its part of the vertices, triangles and particles of all.
struct BodyDescription {
    std::string name;
    std::size_t first_vertex = 0;
    std::size_t vertices = 0;
    std::vector<Triangle> triangles;  // of its own vertices, from 0
    std::size_t first_particle = 0;
    std::size_t particles = 0;
};

/// What does not change until another scene takes its place.
struct SceneDescription {
    std::string name;
    std::string text;                 // the scene's description, one sentence
    std::vector<std::string> scenes;  // that can be had in its place
    std::vector<BodyDescription> bodies;
    std::vector<Vec3> semi_axes;       // m, per particle of all bodies: its ellipsoid; 0: it has none
    std::vector<Quat> ellipsoid_axes;  // per particle: particle_from_ellipsoid
    std::vector<Group> groups;         // of particles of all bodies
    std::vector<Link> links;
    std::vector<Triangle> tool_triangles;  // empty: the tool is its spheres alone
    std::size_t tool_vertices = 0;
    std::vector<double> proxy_radii;               // m, per proxy, at the start
    std::optional<double> ground_height;           // m
    std::vector<ParameterDescription> parameters;  // at most kMostParameters
    double step = 0.01;                            // s, at the start
    double force_scale = 1.0;                      // N at the hand for each N in the scene
    double length = 0.0;                           // s; of a recording that is played; 0: a run
    bool closes = false;                           // the tool is a hand that can close
};

/// A plane that the haptic loop was sent: dot(normal, centre of the proxy) >= offset.
struct PlaneView {
    Vec3 normal{0.0, 1.0, 0.0};  // unit, scene
    double offset = 0.0;         // m, the proxy's radius in it
    double velocity = 0.0;       // m/s, along the normal
    std::uint32_t proxy = 0;
    bool touches = false;  // it holds the proxy; else it is in reach only
};

/// One proxy of the tool.
struct ProxyView {
    Vec3 position{0.0};   // m, scene
    Vec3 goal{0.0};       // m, scene: where the hand has it
    double radius = 0.0;  // m; may change while the scene runs
    bool touches = false;
    bool sticks = false;
};

/// Who moves the hand.
enum class HandSource : std::uint8_t { Script, Device, Mouse, Input, Still };

/// How the run stands, apart from the scene.
struct RunView {
    bool paused = false;
    bool recording = false;
    std::uint64_t recorded_steps = 0;
    HandSource hand = HandSource::Script;
    double speed = 0.0;                                // simulated seconds a second, smoothed
    std::uint64_t late_steps = 0;                      // deadlines missed
    double buffered = 0.0;                             // s, of a recording: computed so far
    bool diverged = false;                             // of a recording: what was computed is not what was recorded
    std::array<double, kMostParameters> parameters{};  // as SceneDescription::parameters
};

/// One moment. The vectors have the lengths that the description says, but for `planes`.
struct SceneSnapshot {
    std::uint64_t step = 0;           // that begins at `time`
    double time = 0.0;                // s, simulated
    std::vector<Vec3> vertices;       // m, scene, of all bodies
    std::vector<Vec3> particles;      // m, scene, of all bodies
    std::vector<Quat> orientations;   // per particle
    std::vector<Vec3> tool_vertices;  // m, scene
    std::vector<ProxyView> proxies;
    std::vector<PlaneView> planes;  // at most 3 a proxy
    Pose tool;                      // scene_from_tool
    Pose hip;                       // likewise, where the device has it
    Vec3 force{0.0};                // N, scene, on the tool
    Vec3 torque{0.0};               // N*m, scene, on the tool about the hip
    Vec3 hand_force{0.0};           // N, device frame
    Vec3 hand_torque{0.0};          // N*m, device frame
    double curl = 0.0;
    double depth = 0.0;  // m, scene
    bool in_contact = false;
    bool squeezed = false;
    RunView run;
};

/// What one step came to, for plots.
struct StepSample {
    double time = 0.0;      // s, simulated
    float force = 0.0F;     // N, at the hand
    float torque = 0.0F;    // N*m, at the hand
    float depth = 0.0F;     // m, scene
    float total_us = 0.0F;  // what follows: durations of the parts of the step
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
