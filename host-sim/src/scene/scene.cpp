#include <haptic/sim/scene.hpp>

#include <cmath>
#include <filesystem>
#include <glm/gtc/quaternion.hpp>
#include <utility>

#include <haptic/probe.hpp>
#include <haptic/sim/live_settings.hpp>

namespace haptic::sim {
namespace {

// Beyond any scene that the solver is meant for; keeps a slip of the keyboard from becoming an hour of waiting.
constexpr Range kPositions{-1e4, 1e4};
constexpr Range kUnitInterval{0.0, 1.0};
constexpr double kUnitTolerance = 1e-6;  // as Config::quat
constexpr std::size_t kMostBodies = 256;
// Some 1 GB of meshes, particles and trees.
constexpr std::size_t kMostSceneTriangles = 2'000'000;

SolverSettings read_solver(const Config& config) {
    SolverSettings solver;
    solver.step = config.number("solver.step", solver.step, ranges::kStep);
    solver.substeps = static_cast<int>(config.integer("solver.substeps", solver.substeps, {1.0, 100.0}));
    solver.iterations = static_cast<int>(config.integer("solver.iterations", solver.iterations, ranges::kIterations));
    solver.rotation_iterations =
        static_cast<int>(config.integer("solver.rotation_iterations", solver.rotation_iterations, {1.0, 100.0}));
    solver.gravity = config.vec3("solver.gravity", solver.gravity, {-1e3, 1e3});
    solver.drag = config.number("solver.drag", solver.drag, {0.0, 9.0});
    solver.settling = config.number("solver.settling", solver.settling, {0.0, 10.0});
    solver.keep_angular_momentum = config.flag("solver.keep_angular_momentum", solver.keep_angular_momentum);
    return solver;
}

CollisionSettings read_collisions(const Config& config) {
    CollisionSettings collisions;
    collisions.between_bodies = config.flag("collisions.between_bodies", collisions.between_bodies);
    collisions.ground = config.flag("collisions.ground", collisions.ground);
    collisions.ground_height = config.number("collisions.ground_height", collisions.ground_height, kPositions);
    collisions.static_friction = config.number("collisions.static_friction", collisions.static_friction, {0.0, 10.0});
    collisions.dynamic_friction =
        config.number("collisions.dynamic_friction", collisions.dynamic_friction, {0.0, 10.0});
    collisions.push_out_speed = config.number("collisions.push_out_speed", collisions.push_out_speed, {0.0, 100.0});
    collisions.most_substeps =
        static_cast<int>(config.integer("collisions.most_substeps", collisions.most_substeps, {1.0, 100.0}));
    if (collisions.dynamic_friction > collisions.static_friction) {
        config.fail("collisions.dynamic_friction", "must not exceed collisions.static_friction");
    }
    return collisions;
}

ProxySettings read_proxy(const Config& config) {
    ProxySettings proxy;
    proxy.radius = config.number("proxy.radius", proxy.radius, ranges::kRadius);
    proxy.shrink = config.number("proxy.shrink", proxy.shrink, ranges::kShrink);
    proxy.reach = config.number("proxy.reach", proxy.reach, {0.0, 10.0});
    if (proxy.reach > proxy.radius && !config.has("tool")) {  // those of a tool are known once it is made
        config.fail("proxy.reach", "must not exceed proxy.radius");
    }
    return proxy;
}

ContactSettings read_contact(const Config& config, double shrink) {
    ContactSettings contact;
    contact.shrink = shrink;
    const std::string method = config.choice("contact.method", "complete", {"complete", "thesis"});
    contact.method = method == "thesis" ? CcdMethod::Thesis : CcdMethod::Complete;
    contact.static_friction = config.number("proxy.static_friction", contact.static_friction, ranges::kFriction);
    contact.dynamic_friction = config.number("proxy.dynamic_friction", contact.dynamic_friction, ranges::kFriction);
    if (contact.dynamic_friction > contact.static_friction) {
        config.fail("proxy.dynamic_friction", "must not exceed proxy.static_friction");
    }
    const std::string pop_out = config.choice("contact.pop_out", "order_free", {"order_free", "thesis"});
    contact.pop_out = pop_out == "thesis" ? PopOutMethod::Thesis : PopOutMethod::OrderFree;
    contact.pop_out_limit =
        static_cast<int>(config.integer("contact.pop_out_limit", contact.pop_out_limit, {1.0, 1e5}));
    contact.pop_out_minimum = config.number("contact.pop_out_minimum", contact.pop_out_minimum, kUnitInterval);
    contact.detection_range = config.number("contact.detection_range", contact.detection_range, {1.0, 100.0});
    contact.half_space = config.flag("contact.half_space", contact.half_space);
    return contact;
}

CouplingSettings read_coupling(const Config& config) {
    CouplingSettings coupling;
    coupling.stiffness = config.number("coupling.stiffness", coupling.stiffness, ranges::kStiffness);
    coupling.torque_stiffness =
        config.number("coupling.torque_stiffness", coupling.torque_stiffness, ranges::kStiffness);
    if (coupling.torque_stiffness > 0.0 && coupling.stiffness == 0.0) {
        config.fail("coupling.torque_stiffness", "needs a coupling.stiffness: what makes no force makes no torque");
    }
    const std::string share = config.choice("coupling.share", "all", {"all", "series"});
    coupling.share = share == "series" ? ForceSharing::Series : ForceSharing::All;
    const std::string multi_rate = config.choice("coupling.multi_rate", "planes", {"planes", "positions"});
    coupling.multi_rate = multi_rate == "positions" ? MultiRate::Positions : MultiRate::Planes;
    if (coupling.multi_rate == MultiRate::Positions && coupling.share == ForceSharing::Series) {
        config.fail("coupling.share", "\"series\" needs planes: not with coupling.multi_rate = \"positions\"");
    }
    coupling.loss = config.number("coupling.loss", coupling.loss, {0.0, 10.0});
    coupling.tied_mass = config.number("coupling.tied_mass", coupling.tied_mass, {0.0, 1e3});
    coupling.mask_radius = config.number("coupling.mask_radius", coupling.mask_radius, {0.0, 100.0});
    return coupling;
}

PoseTrack read_hand(const Config& config) {
    const std::vector<double> times = config.numbers("hand.times", {0.0}, {0.0, 1e6});
    const std::vector<double> positions = config.numbers("hand.positions", {0.0, 0.0, 0.0}, kPositions);
    if (times.empty() || positions.size() != 3 * times.size()) {
        config.fail("hand.positions", "needs three numbers (x, y, z) for each of the " + std::to_string(times.size()) +
                                          " elements of hand.times, has " + std::to_string(positions.size()));
    }
    for (std::size_t i = 1; i < times.size(); ++i) {
        if (!(times[i] > times[i - 1])) {
            config.fail("hand.times", "must increase from each element to the next");
        }
    }
    const std::vector<double> turns = config.numbers("hand.orientations", {}, {-1.0, 1.0});
    if (!turns.empty() && turns.size() != 4 * times.size()) {
        config.fail("hand.orientations", "needs four numbers (w, x, y, z) for each of the " +
                                             std::to_string(times.size()) + " elements of hand.times, or none, has " +
                                             std::to_string(turns.size()));
    }
    std::vector<Pose> poses(times.size());
    for (std::size_t i = 0; i < times.size(); ++i) {
        poses[i].position = {positions[3 * i], positions[3 * i + 1], positions[3 * i + 2]};
        if (!turns.empty()) {
            const Quat turn(turns[4 * i], turns[4 * i + 1], turns[4 * i + 2], turns[4 * i + 3]);
            if (std::abs(glm::length(turn) - 1.0) > kUnitTolerance) {
                config.fail("hand.orientations", "(w, x, y, z) number " + std::to_string(i) +
                                                     " is not of unit length but " + std::to_string(glm::length(turn)));
            }
            poses[i].orientation = glm::normalize(turn);
        }
    }
    return {times, std::move(poses)};
}

/// Where the script closes the hand, with as many curls as the hand has times.
CurlTrack read_curl(const Config& config, const std::optional<ToolSettings>& tool) {
    const std::vector<double> times = config.numbers("hand.times", {0.0}, {0.0, 1e6});
    const std::vector<double> curls = config.numbers("hand.curl", {}, kUnitInterval);
    if (curls.empty()) {
        return {};
    }
    if (!tool || tool->shape != ToolShape::Hand || !tool->file.empty()) {
        config.fail("hand.curl",
                    "is for a tool that can close, and only the generated hand can: tool.generator = \"hand\"");
    }
    if (curls.size() != times.size()) {
        config.fail("hand.curl", "needs one number (0 open to 1 closed) for each of the " +
                                     std::to_string(times.size()) + " elements of hand.times, or none, has " +
                                     std::to_string(curls.size()));
    }
    return {times, curls};
}

/// A scene that would fill the memory is refused before any of it is made.
void refuse_too_much(const Config& config, const Scene& scene) {
    std::size_t bodies = scene.model.copies.size();
    std::size_t triangles = expected_triangles(scene.model);
    for (const ModelSettings& object : scene.objects) {
        bodies += object.copies.size();
        triangles += expected_triangles(object);
    }
    if (bodies > kMostBodies) {
        config.fail("model", "and the objects make " + std::to_string(bodies) + " bodies, more than the " +
                                 std::to_string(kMostBodies) + " that are allowed; have fewer copies");
    }
    if (triangles > kMostSceneTriangles) {
        config.fail("model", "and the objects make " + std::to_string(triangles) + " triangles, more than the " +
                                 std::to_string(kMostSceneTriangles) +
                                 " that are allowed; have fewer copies, or coarser ones");
    }
}

}  // namespace

WorkspaceSettings read_workspace(const Config& config, const WorkspaceSettings& otherwise) {
    WorkspaceSettings workspace = otherwise;
    workspace.scale = config.number("workspace.scale", workspace.scale, {1e-3, 10.0});
    workspace.offset = config.vec3("workspace.offset", workspace.offset, {-1.0, 1.0});
    workspace.rotation = config.quat("workspace.rotation", workspace.rotation);
    workspace.force_scale = config.number("workspace.force_scale", workspace.force_scale, {0.0, 100.0});
    workspace.clutch_button =
        static_cast<int>(config.integer("workspace.clutch_button", workspace.clutch_button, {-1.0, 31.0}));
    workspace.clutch_fade = config.number("workspace.clutch_fade", workspace.clutch_fade, {0.0, 10.0});
    return workspace;
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
        return Config::load(which);
    }
    throw ConfigError("unknown scene \"" + which + "\"; built in are: " + known +
                      "; a scene file's name ends in .toml");
}

Scene read_scene(const Config& config, const std::string& name) {
    Scene scene;
    scene.name = name;
    scene.description = config.text("description", "");
    scene.duration_s = config.number("duration", scene.duration_s, {0.0, 1e6});
    scene.model = read_model(config, "model");
    for (std::size_t k = 0; k < config.tables("objects"); ++k) {
        scene.objects.push_back(read_model(config, "objects." + std::to_string(k)));
    }
    refuse_too_much(config, scene);
    scene.solver = read_solver(config);
    scene.collisions = read_collisions(config);
    if (config.has("tool")) {
        scene.tool = read_tool(config);
    }
    scene.proxy = read_proxy(config);
    scene.contact = read_contact(config, scene.proxy.shrink);
    scene.coupling = read_coupling(config);
    scene.workspace = read_workspace(config, {});
    scene.hand = read_hand(config);
    scene.curl = read_curl(config, scene.tool);
    scene.hand_repeats = config.flag("hand.repeat", scene.hand_repeats);
    scene.step_probe = read_probe_line(config, "step", "host-sim");
    scene.step_probe_slowest_edge_ns = read_slowest_edge_ns(config);
    config.reject_unknown();
    return scene;
}

}  // namespace haptic::sim
