// Scene: everything that a simulation is made of, as read from a scene file (TOML). scene_reference() describes each
// key.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "haptic/config.hpp"
#include "haptic/pose_track.hpp"
#include "haptic/probe.hpp"
#include "haptic/setting_documents.hpp"
#include "haptic/sim/collisions.hpp"
#include "haptic/sim/contact.hpp"
#include "haptic/sim/coupling.hpp"
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
    CurlTrack curl;             // scripted closure of a hand; not known if the tool's own settings apply
    bool hand_repeats = false;  // starts again after its last time, else stays
    double duration_s = 2.0;
    std::optional<GpioLine> step_probe;  // high while a step is computed and published
    std::int64_t step_probe_slowest_edge_ns = Probe::kSlowestEdgeNs;
    std::vector<std::string> notices;  // on keys that others have replaced, one line each, with file and line
};

struct BuiltInScene {
    std::string_view name;
    std::string_view toml;
};

/// The scenes that are built into the library.
[[nodiscard]] const std::vector<BuiltInScene>& built_in_scenes();

/// Opens a built-in scene by its name, or a scene file. Throws ConfigError, which lists the built-in scenes for an
/// unknown name.
[[nodiscard]] Config open_scene(const std::string& which);

/// Name of a scene that open_scene() opens: that of the built-in scene, or the file's without folder and ending.
[[nodiscard]] std::string scene_name(const std::string& which);

/// Reads the table [workspace]; missing keys are as in `otherwise`. Throws ConfigError.
[[nodiscard]] WorkspaceSettings read_workspace(const Config& config, const WorkspaceSettings& otherwise);

/// Reads a scene. Throws ConfigError: unknown key, wrong value, contradicting values.
[[nodiscard]] Scene read_scene(const Config& config, const std::string& name);

/// The descriptions of all keys of a scene file.
[[nodiscard]] const SettingReference& scene_reference();

/// A commented scene file with every key and its default.
[[nodiscard]] std::string default_scene_text();

}  // namespace haptic::sim
