#include "reproduce/scene_run.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <glm/geometric.hpp>

#include "haptic/config.hpp"
#include "haptic/sim/scene.hpp"
#include "simd/aabb.hpp"

namespace haptic::sim::reproduce {
namespace {

Scene scene_with(const std::string& name, const std::vector<std::string>& assignments) {
    Config config = open_scene(name);
    for (const std::string& assignment : thesis_assignments(name)) {
        config.set(assignment);
    }
    for (const std::string& assignment : assignments) {
        config.set(assignment);
    }
    return read_scene(config, name);
}

}  // namespace

std::vector<std::string> thesis_assignments(std::string_view scene) {
    if (scene == "cloth-drop") {
        return {"model.material=none",       "model.mass=0.1",
                "model.group_stiffness=0.3", "model.link_stiffness=1",
                "solver.substeps=8",         "solver.iterations=1",
                "solver.shape_damping=5",    "workspace.force_scale=0.15",
                "collisions.surfaces=false"};
    }
    if (scene == "curtain-hand") {
        return {"model.material=none",
                "model.mass=0.2",
                "model.group_stiffness=0.05",
                "model.link_stiffness=1",
                "solver.substeps=1",
                "solver.iterations=2",
                "solver.drag=0",
                "solver.shape_damping=5",
                "workspace.force_scale=0.5",
                "collisions.surfaces=false"};
    }
    // The fish: stiffness 0.9 for the head and 0.6 for the rest, five iterations (section 4.4.3).
    const std::string head = "{low = [0.06, -1, -1], high = [1, 1, 1], stiffness = 0.9}";
    const std::string belly = "{low = [-0.03, -1, -1], high = [0.05, 1, -0.005], fixed = true}";
    std::string regions;
    if (scene == "fish-hold") {
        const std::string shake = ", motion_times = [0, 0.1, 0.2, 0.3, 0.4, 1.2], motion_repeat = true";
        const auto up = [](const std::string& z) {
            return ", motion_offsets = [0, 0, 0, 0, 0, " + z + ", 0, 0, 0, 0, 0, " + z + ", 0, 0, 0, 0, 0, 0]}";
        };
        regions = head + ", " + belly + ", {low = [0.065, -1, -1], high = [0.085, 1, 1], stiffness = 0.9" + shake +
                  up("0.015") + ", {low = [-0.085, -1, -1], high = [-0.065, 1, 1]" + shake + up("0.025");
    } else if (scene == "fish-slide") {
        regions = head + ", " + belly;
    } else if (scene == "four-fish") {
        regions = head;
    } else {
        return {};
    }
    std::vector<std::string> assignments{"model.material=none",
                                         "model.neighbours=8",
                                         "model.mass=0.36",
                                         "model.group_stiffness=0.6",
                                         "model.regions=[" + regions + "]",
                                         "solver.substeps=1",
                                         "solver.iterations=5",
                                         "solver.shape_damping=5"};
    if (scene == "four-fish") {
        assignments.back() = "solver.shape_damping=2";
        // The heap is lower.
        assignments.push_back(
            "hand.positions=[0, 0.4, 0, 0, 0.3, 0, 0, 0.03, 0, 0.08, 0.03, 0.05, -0.08, 0.03, -0.05, 0, 0.05, 0, 0, "
            "0.4, "
            "0]");
    }
    return assignments;
}

SceneRun::SceneRun(const std::string& scene, const std::vector<std::string>& assignments, std::int64_t (*clock)())
    : simulation_(with_progress_bar(
          "building " + scene,
          [&](const Progress& progress) { return Simulation(scene_with(scene, assignments), clock, progress); })),
      progress_("running " + scene) {
    simulation_.set_verification(true);
}

bool SceneRun::finished() const noexcept {
    const Scene& scene = simulation_.scene();
    return (static_cast<double>(simulation_.steps() - settled_steps_) + 0.5) * scene.solver.step > scene.duration_s;
}

double SceneRun::settle(double speed, double at_most_s) {
    const double step = simulation_.scene().solver.step;
    const double farthest = speed * step;  // m, motion of a vertex at rest in one step
    for (bool resting = false; !resting && simulation_.time() < at_most_s;) {
        vertices_ = simulation_.vertices();
        simulation_.step(simulation_.scripted_input(0));
        resting = std::equal(vertices_.begin(), vertices_.end(), simulation_.vertices().begin(),
                             [&](const Vec3& a, const Vec3& b) { return glm::length(b - a) <= farthest; });
    }
    settled_steps_ = simulation_.steps();
    return simulation_.time();
}

const StepResult& SceneRun::step() {
    return step(simulation_.scripted_input(script_time_ns()));
}

const StepResult& SceneRun::step(const Pose& device) {
    StepInput input = simulation_.scripted_input(script_time_ns());
    input.device = device;
    return step(input);
}

const StepResult& SceneRun::step(const StepInput& input) {
    vertices_ = simulation_.vertices();
    time_s_ = seconds(script_time_ns());
    progress_.show(time_s_ / simulation_.scene().duration_s);
    result_ = simulation_.step(input);
    escapes_ += result_.crossed ? 1 : 0;
    return result_;
}

std::int64_t SceneRun::script_time_ns() const {
    return static_cast<std::int64_t>(simulation_.steps() - settled_steps_) *
           nanoseconds(simulation_.scene().solver.step);
}

PictureScene SceneRun::picture(const std::string& title) const {
    const Scene& scene = simulation_.scene();
    PictureScene picture;
    picture.title = title;
    picture.objects = objects_of(simulation_, vertices_);
    // The proxy of this step, and the hip that pulls it.
    picture.proxy = result_.proxy;
    picture.proxy_radius = scene.proxy.radius;
    picture.hip = result_.hip;
    // Bounds of proxy and bodies: they give the height of a floor and the size of its tiles.
    Aabb box = aabb_of(vertices_);
    box.extend(result_.proxy);
    const double size = glm::length(box.size());
    picture.floor = scene.collisions.ground ? scene.collisions.ground_height : box.min.y - 0.6 * size;
    picture.tile = 0.18 * size;
    return picture;
}

double quantile(std::vector<double> values, double fraction) {
    if (values.empty()) {
        return 0.0;
    }
    const auto at = values.begin() + static_cast<std::ptrdiff_t>(fraction * static_cast<double>(values.size()));
    std::nth_element(values.begin(), at, values.end());
    return *at;
}

std::string format_fixed(double value, int digits) {
    std::array<char, 64> text{};
    const auto end = std::to_chars(text.data(), text.data() + text.size(), value, std::chars_format::fixed, digits).ptr;
    return {text.data(), end};
}

std::string with_separators(std::size_t count) {
    std::string digits = std::to_string(count);
    for (auto at = static_cast<std::ptrdiff_t>(digits.size()) - 3; at > 0; at -= 3) {
        digits.insert(static_cast<std::size_t>(at), ",");
    }
    return digits;
}

}  // namespace haptic::sim::reproduce
