#include "haptic/sim/scene.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <glm/gtc/quaternion.hpp>
#include <iterator>
#include <utility>

#include "haptic/setting_documents.hpp"
#include "model/idle_keys.hpp"
#include "model/model_keys.hpp"
#include "model/old_keys.hpp"
#include "scene/scene_tables.hpp"
#include "tool/tool_settings.hpp"

namespace haptic::sim {
namespace {

constexpr double kUnitTolerance = 1e-6;  // as Config::quat
constexpr std::size_t kMaxBodies = 256;
// About 1 GB of meshes, particles and trees.
constexpr std::size_t kMaxSceneTriangles = 2'000'000;

void check_friction(const Config& config, const std::string& table, double static_friction, double dynamic_friction) {
    if (dynamic_friction > static_friction) {
        config.fail(table + ".dynamic_friction", "must not exceed " + table + ".static_friction");
    }
}

/// Checks between keys.
void check(const Config& config, const Scene& scene) {
    check_friction(config, "collisions", scene.collisions.static_friction, scene.collisions.dynamic_friction);
    check_friction(config, "proxy", scene.contact.static_friction, scene.contact.dynamic_friction);
    const CouplingSettings& coupling = scene.coupling;
    if (coupling.torque_stiffness > 0.0 && coupling.stiffness == 0.0) {
        config.fail("coupling.torque_stiffness",
                    "needs a coupling.stiffness above 0: without a force there is no torque");
    }
    if (config.has("coupling.share")) {
        config.fail("coupling.share", "was removed: with tool.material.rigid the number of spheres hardly matters");
    }
    if (config.has("coupling.tied_mass")) {
        config.fail("coupling.tied_mass", "was removed: the damping is implicit and needs no bound");
    }
}

PoseTrack make_hand(const Config& config, const HandScript& script) {
    const std::vector<double>& times = script.times;
    const std::vector<double>& positions = script.positions;
    if (times.empty() || positions.size() != 3 * times.size()) {
        config.fail("hand.positions", "needs three numbers (x, y, z) for each of the " + std::to_string(times.size()) +
                                          " elements of hand.times, has " + std::to_string(positions.size()));
    }
    for (std::size_t i = 1; i < times.size(); ++i) {
        if (!(times[i] > times[i - 1])) {
            config.fail("hand.times", "must increase from each element to the next");
        }
    }
    const std::vector<double>& quaternions = script.orientations;
    if (!quaternions.empty() && quaternions.size() != 4 * times.size()) {
        config.fail("hand.orientations", "needs four numbers (w, x, y, z) for each of the " +
                                             std::to_string(times.size()) + " elements of hand.times, or none, has " +
                                             std::to_string(quaternions.size()));
    }
    std::vector<Pose> poses(times.size());
    for (std::size_t i = 0; i < times.size(); ++i) {
        poses[i].position = {positions[3 * i], positions[3 * i + 1], positions[3 * i + 2]};
        if (!quaternions.empty()) {
            const double* const q = &quaternions[4 * i];
            const Quat orientation(q[0], q[1], q[2], q[3]);
            if (std::abs(glm::length(orientation) - 1.0) > kUnitTolerance) {
                config.fail("hand.orientations", "quaternion " + std::to_string(i) + " must be of unit length, has " +
                                                     std::to_string(glm::length(orientation)));
            }
            poses[i].orientation = glm::normalize(orientation);
        }
    }
    return {times, std::move(poses)};
}

/// The script of the hand's closure, one element for each of its times.
CurlTrack make_curl(const Config& config, const HandScript& script, const std::optional<ToolSettings>& tool) {
    if (script.curl.empty()) {
        return {};
    }
    if (!tool || tool->shape != ToolShape::Hand || !tool->file.empty()) {
        config.fail("hand.curl", "needs a tool that can close: the generated hand, tool.generator = \"hand\"");
    }
    if (script.curl.size() != script.times.size()) {
        config.fail("hand.curl", "needs one number (0 open to 1 closed) for each of the " +
                                     std::to_string(script.times.size()) + " elements of hand.times, or none, has " +
                                     std::to_string(script.curl.size()));
    }
    return {script.times, script.curl};
}

/// Refuses a scene that would fill the memory, before any of it is made.
void refuse_too_much(const Config& config, const Scene& scene) {
    std::size_t bodies = scene.model.copies.size();
    std::size_t triangles = expected_triangles(scene.model);
    for (const ModelSettings& object : scene.objects) {
        bodies += object.copies.size();
        triangles += expected_triangles(object);
    }
    if (bodies > kMaxBodies) {
        config.fail("model", "and the objects make " + std::to_string(bodies) + " bodies, more than the " +
                                 std::to_string(kMaxBodies) + " that are allowed; have fewer copies");
    }
    if (triangles > kMaxSceneTriangles) {
        config.fail("model", "and the objects make " + std::to_string(triangles) + " triangles, more than the " +
                                 std::to_string(kMaxSceneTriangles) +
                                 " that are allowed; have fewer copies, or coarser ones");
    }
}

bool has_material(const ModelSettings& model) {
    return model.material.has_value();
}

/// Whether `is` holds for each body of the scene.
template <class Is>
bool each_body(const Scene& scene, const Is& is) {
    return is(scene.model) && std::ranges::all_of(scene.objects, is);
}

/// Some body has a material, and all that are not rigid.
bool rests_on_materials(const Scene& scene) {
    return !each_body(scene, std::not_fn(has_material)) &&
           each_body(scene, [](const ModelSettings& model) { return has_material(model) || is_rigid(model); });
}

/// Notices on keys that do what another key does better, or nothing.
std::vector<std::string> notices_on(const Config& config, const Scene& scene) {
    std::vector<std::string> notices;
    const auto add = [&](const std::string& table, const ModelSettings& body) {
        std::ranges::move(old_key_notices(config, table, body), std::back_inserter(notices));
        if (std::string notice = idle_key_notice(config, table, body); !notice.empty()) {
            notices.push_back(std::move(notice));
        }
    };
    add("model", scene.model);
    for (std::size_t k = 0; k < scene.objects.size(); ++k) {
        add("objects." + std::to_string(k), scene.objects[k]);
    }
    if (config.has("solver.iterations") && each_body(scene, has_material)) {
        notices.push_back(config.where("solver.iterations") +
                          "has no effect where all bodies have a material; remove it");
    }
    return notices;
}

}  // namespace

WorkspaceSettings read_workspace(const Config& config, const WorkspaceSettings& otherwise) {
    WorkspaceSettings workspace = otherwise;
    workspace_table().read(config, workspace);
    return workspace;
}

std::string scene_name(const std::string& which) {
    const std::filesystem::path path(which);
    return path.extension() == ".toml" ? path.stem().string() : which;
}

Config open_scene(const std::string& which) {
    std::string known;
    for (const BuiltInScene& scene : built_in_scenes()) {
        if (which == scene.name) {
            return Config::parse(scene.toml, std::string(scene.name) + ".toml (built in)");
        }
        known += (known.empty() ? "" : ", ") + std::string(scene.name);
    }
    if (std::filesystem::path(which).has_extension() || which.find('/') != std::string::npos) {
        Config scene = Config::load(which);
        if (!scene.has("model")) {
            throw ConfigError(which + ": has no table [model], so there is nothing to touch; host-sim scenes " +
                              "--reference prints a scene with every key");
        }
        return scene;
    }
    throw ConfigError("unknown scene \"" + which + "\"; built in are: " + known +
                      "; a scene file's name ends in .toml");
}

Scene read_scene(const Config& config, const std::string& name) {
    Scene scene;
    scene.name = name;
    scene.solver.threads = 0;
    top_level_table().read(config, scene);
    scene.model = read_model(config, "model");
    for (std::size_t k = 0; k < config.tables("objects"); ++k) {
        scene.objects.push_back(read_model(config, "objects." + std::to_string(k)));
    }
    refuse_too_much(config, scene);
    // Bodies with a material say how short sub-steps must be, and need no iterations.
    if (rests_on_materials(scene)) {
        scene.solver.substeps = 0;
        scene.solver.iterations = 1;
    }
    if (config.has("tool")) {
        scene.tool = read_tool(config);
    }
    SceneKeys keys;
    visit_tables(scene, keys, [&config](const auto& table, auto& part) { table.read(config, part); });
    check(config, scene);
    scene.contact.shrink = scene.proxy.shrink;
    scene.hand = make_hand(config, keys.hand);
    scene.curl = make_curl(config, keys.hand, scene.tool);
    scene.hand_repeats = keys.hand.repeat;
    scene.step_probe_slowest_edge_ns = keys.probes.slowest_edge_ns;
    config.reject_unknown();
    scene.notices = notices_on(config, scene);
    return scene;
}

const SettingReference& scene_reference() {
    static const SettingReference reference = [] {
        SettingReference all;
        Scene scene;
        SceneKeys keys;
        add_section(all, top_level_table().describe(scene));
        add_model_reference(all);
        add_section(all, tool_section());
        add_section(all, tool_material_section());
        visit_tables(scene, keys,
                     [&all](const auto& table, const auto& part) { add_section(all, table.describe(part)); });
        return all;
    }();
    return reference;
}

std::string default_scene_text() {
    return commented_toml(
        "A scene of host-sim with every key and its default; use it with host-sim run FILE.toml. Every key is "
        "optional. Units: m, kg, s, N; y points up. The manual page is haptic-scene(5).",
        scene_reference());
}

}  // namespace haptic::sim
