#include "reproduce/scene_run.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "haptic/config.hpp"
#include "contact/half_spaces.hpp"
#include "haptic/sim/scene.hpp"

namespace haptic::sim::reproduce {
namespace {

Scene scene_with(const std::string& name, const std::vector<std::string>& assignments) {
    Config config = open_scene(name);
    for (const std::string& assignment : assignments) {
        config.set(assignment);
    }
    return read_scene(config, name);
}

constexpr std::int64_t kTickNs = 1'000'000;
constexpr double kTolerance = 1e-12;  // m

/// The proxy of a frame at a time, in the device's frame.
Vec3 local_proxy(const ContactFrame& frame, const Vec3& hip, std::int64_t time_ns) {
    const ProxyContact& contact = frame.proxies[0];
    std::array<HalfSpace, kMaxSurfacePlanes> half_spaces;
    const std::size_t count = std::min<std::size_t>(contact.plane_count, half_spaces.size());
    const double after_s = seconds(time_ns - frame.plane_time_ns);
    for (std::size_t p = 0; p < count; ++p) {
        const ContactPlane& plane = contact.planes[p];
        half_spaces[p].normal = {plane.normal[0], plane.normal[1], plane.normal[2]};
        half_spaces[p].offset = plane.offset + after_s * plane.velocity;
    }
    return project_onto(std::span(half_spaces).first(count), hip, kTolerance).point;
}

}  // namespace

SceneRun::SceneRun(const std::string& scene, const std::vector<std::string>& assignments, std::int64_t (*clock)())
    : simulation_(scene_with(scene, assignments), clock) {
    simulation_.set_verification(true);
}

bool SceneRun::over() const noexcept {
    const Scene& scene = simulation_.scene();
    return (static_cast<double>(simulation_.steps()) + 0.5) * scene.solver.step > scene.duration_s;
}

const StepResult& SceneRun::step() {
    vertices_ = simulation_.vertices();
    const std::int64_t time_ns =
        static_cast<std::int64_t>(simulation_.steps()) * nanoseconds(simulation_.scene().solver.step);
    time_s_ = seconds(time_ns);
    result_ = simulation_.step(simulation_.scripted_input(time_ns));
    escapes_ += result_.crossed ? 1 : 0;
    return result_;
}

void SceneRun::render(std::vector<HapticSample>& samples) const {
    const ContactFrame& frame = simulation_.frame();
    const Workspace& workspace = simulation_.workspace();
    const double stiffness = simulation_.scene().coupling.stiffness;
    const std::int64_t begin_ns = frame.plane_time_ns;
    // Ticks at whole milliseconds, whatever the step is.
    const std::int64_t first_ns = (begin_ns + kTickNs - 1) / kTickNs * kTickNs;
    for (std::int64_t time_ns = first_ns; time_ns < begin_ns + frame.step_ns; time_ns += kTickNs) {
        const Vec3 device = simulation_.scripted_input(time_ns).device.position;
        HapticSample sample;
        sample.time_s = seconds(time_ns);
        sample.hip = workspace.to_scene(device);
        sample.proxy = workspace.to_scene(local_proxy(frame, device, time_ns));
        sample.force = stiffness * (sample.proxy - sample.hip);
        samples.push_back(sample);
    }
}

PictureScene SceneRun::picture(const std::string& title) const {
    const Scene& scene = simulation_.scene();
    PictureScene picture;
    picture.title = title;
    picture.objects = objects_of(simulation_, vertices_);
    picture.proxy = result_.proxy;
    picture.proxy_radius = scene.proxy.radius;
    picture.hip = result_.hip;
    Vec3 low = result_.proxy;
    Vec3 high = result_.proxy;
    for (const Vec3& v : vertices_) {
        low = glm::min(low, v);
        high = glm::max(high, v);
    }
    const double size = glm::length(high - low);
    picture.floor = scene.collisions.ground ? scene.collisions.ground_height : low.y - 0.6 * size;
    picture.tile = 0.18 * size;
    return picture;
}

double quantile(std::vector<double> values, double part) {
    if (values.empty()) {
        return 0.0;
    }
    const auto at = values.begin() + static_cast<std::ptrdiff_t>(part * static_cast<double>(values.size()));
    std::nth_element(values.begin(), at, values.end());
    return *at;
}

std::string shown(double value, int digits) {
    std::array<char, 64> text{};
    const auto end = std::to_chars(text.data(), text.data() + text.size(), value, std::chars_format::fixed, digits).ptr;
    return {text.data(), end};
}

}  // namespace haptic::sim::reproduce
