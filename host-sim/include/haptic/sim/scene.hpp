// Scene files: what is simulated, with what, for how long. TOML; scenes/cloth-drop.toml names every key.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "haptic/config.hpp"
#include "haptic/pose_track.hpp"
#include "haptic/probe.hpp"
#include "haptic/sim/collisions.hpp"
#include <haptic/sim/contact.hpp>
#include "haptic/sim/contact_force.hpp"
#include "haptic/sim/curl_track.hpp"
#include "haptic/sim/model_settings.hpp"
#include "haptic/sim/solver.hpp"
#include "haptic/sim/tool_model.hpp"
#include "haptic/sim/workspace.hpp"

namespace haptic::sim {

struct ProxySettings {
    double radius = 0.03;  // m, scene
    double shrink = 0.999;
    double reach = 0.025;  // m, scene: planes nearer than radius + reach are sent before they touch
};

/// What the haptic loop is told of particles that are in contact.
enum class MultiRate : std::uint8_t {
    Planes,    // the surfaces that hold them, and those in reach
    Positions  // where they are, as the thesis has it (section 5.4.1), to compare with: drags
};

/// How the particles of a tool share the force.
enum class ForceSharing : std::uint8_t {
    All,    // each has the spring divided by the number of all, as the thesis has it (section 5.2.2)
    Series  // in series with springs of the grip, so that their number matters little: haptic/series_springs.hpp
};

struct CouplingSettings : Coupling {
    double torque_stiffness = 0.0;  // N/m, of the springs that make the torque; 0: those that make the force
    ForceSharing share = ForceSharing::All;
    MultiRate multi_rate = MultiRate::Planes;
    double mask_radius = 0.1;  // m, rest shape: about the contact, where the surface takes the force
};

struct Scene {
    std::string name;
    std::string description;
    ModelSettings model;
    std::vector<ModelSettings> objects;  // further bodies: tables [[objects]] with the keys of [model]
    SolverSettings solver;
    CollisionSettings collisions;
    std::optional<ToolSettings> tool;  // table [tool]; without it the tool is one sphere of proxy.radius
    ProxySettings proxy;
    ContactSettings contact;  // shrink is the proxy's
    CouplingSettings coupling;
    WorkspaceSettings workspace;
    PoseTrack hand;             // scripted, positions in the scene
    CurlTrack curl;             // scripted, of a hand that can close; unknown if the script leaves that to the tool
    bool hand_repeats = false;  // begins again after its last time, else stays
    double duration_s = 2.0;
    std::optional<GpioLine> step_probe;  // up while a step is made and published
    std::int64_t step_probe_slowest_edge_ns = Probe::kSlowestEdgeNs;
};

struct BuiltInScene {
    std::string_view name;
    std::string_view toml;
};

/// The scenes that need no file, as built into the library.
[[nodiscard]] const std::vector<BuiltInScene>& built_in_scenes();

/// Opens a scene file, or a built-in scene where `which` is its name. Throws ConfigError; for an unknown name it lists
/// the known ones.
[[nodiscard]] Config open_scene(const std::string& which);

/// Reads the table [workspace]; what it does not say is as in `otherwise`. Throws ConfigError.
[[nodiscard]] WorkspaceSettings read_workspace(const Config& config, const WorkspaceSettings& otherwise);

/// Reads the scene from a configuration. Throws ConfigError: unknown key, value out of range.
[[nodiscard]] Scene read_scene(const Config& config, const std::string& name);

}  // namespace haptic::sim
