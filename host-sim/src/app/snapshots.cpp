#include "app/snapshots.hpp"

#include <algorithm>
#include <array>
#include <glm/geometric.hpp>

#include "reproduce/camera.hpp"
#include "reproduce/povray.hpp"
#include "simd/aabb.hpp"
#include "tool/tool_proxies.hpp"

namespace haptic::sim {
namespace {

struct After {
    const char* name;
    double delay_s;  // since the first contact
};
constexpr std::array<After, 2> kAfter{{{"2-soon-after", 0.25}, {"3-later", 1.0}}};

constexpr double kAboveFloor = 0.1;  // of the size of the framed box: clearance of the vertices
constexpr double kTile = 0.15;       // of that size, of the floor's tiles
// Bodies and the hip are framed as far as they are this close to the tool: in tool sizes, or in radii for a tool
// without a mesh.
constexpr double kNearTool = 0.12;
constexpr double kNearSphere = 12.0;
// Open surfaces are nearly opaque where at least this share of the tool is visible, and transparent otherwise.
constexpr double kVisible = 0.5;
constexpr double kTransparent = 0.4;
// Points of the tool that the choice of the camera takes into account, at most.
constexpr std::size_t kTestedPoints = 60;

/// Box of the tool, and of bodies and hip near it.
Aabb framed_box(const reproduce::ToolMoment& tool, const Vec3& hip, const std::vector<Vec3>& vertices) {
    Aabb box = aabb_of(tool.skin);
    for (const PictureSphere& sphere : tool.spheres) {
        box.extend(sphere.centre - sphere.radius);
        box.extend(sphere.centre + sphere.radius);
    }
    const double near =
        tool.skin.empty() ? kNearSphere * tool.spheres.front().radius : kNearTool * glm::length(box.size());
    Aabb around = aabb_of(vertices);
    around.extend(hip);
    return {glm::min(box.min, glm::max(around.min, box.min - near)),
            glm::max(box.max, glm::min(around.max, box.max + near))};
}

/// Points of the tool's skin, or of its spheres without one, and its contacts.
std::vector<Vec3> points_to_see(const reproduce::ToolMoment& tool) {
    std::vector<Vec3> points;
    const std::size_t stride = tool.skin.size() / kTestedPoints + 1;
    for (std::size_t k = 0; k < tool.skin.size(); k += stride) {
        points.push_back(tool.skin[k]);
    }
    for (const PictureSphere& contact : tool.contacts) {
        points.push_back(contact.centre);
    }
    if (!tool.skin.empty()) {
        return points;
    }
    for (const PictureSphere& sphere : tool.spheres) {
        for (Vec3::length_type axis = 0; axis < 3; ++axis) {
            for (const double side : {-1.0, 1.0}) {
                points.push_back(sphere.centre);
                points.back()[axis] += side * sphere.radius;
            }
        }
    }
    return points;
}

}  // namespace

Snapshots::Snapshots(const Simulation& simulation) : simulation_(&simulation) {
    present_.vertices = simulation.vertices();
    kept_.reserve(kAfter.size() + 1);
}

void Snapshots::before_step() {
    const std::vector<Vec3>& now = simulation_->vertices();
    std::copy(now.begin(), now.end(), present_.vertices.begin());
    present_.time_s = simulation_->time();
}

void Snapshots::keep(const char* name, const Moment& moment) {
    kept_.push_back(moment);
    kept_.back().name = name;
}

void Snapshots::after_step(const StepResult& result) {
    reproduce::capture(simulation_->tool(), present_.tool);
    present_.hip = result.hip;
    // Moments about the first contact.
    if (first_contact_s_ < 0.0 && result.in_contact) {
        first_contact_s_ = result.time;
        keep("1-contact", present_);
    }
    if (first_contact_s_ >= 0.0 && later_ < kAfter.size() && result.time >= first_contact_s_ + kAfter[later_].delay_s) {
        keep(kAfter[later_++].name, present_);
    }
    // Largest force.
    const double force = glm::length(result.hand_force);
    if (force > peak_force_) {
        peak_force_ = force;
        peak_ = present_;
        peak_.name = "4-peak-force";
    }
}

std::vector<std::filesystem::path> Snapshots::write(const std::filesystem::path& folder) const {
    std::filesystem::create_directories(folder);
    const Scene& scene = simulation_->scene();
    const ToolProxies& tool = simulation_->tool();
    std::vector<const Moment*> moments;
    moments.reserve(kept_.size() + 1);
    for (const Moment& moment : kept_) {
        moments.push_back(&moment);
    }
    if (!peak_.name.empty()) {
        moments.push_back(&peak_);
    }
    // Bodies and tool of each moment.
    std::vector<PictureScene> pictures(moments.size());
    std::vector<std::vector<Vec3>> points(moments.size());
    std::vector<Subject> subjects(moments.size());
    for (std::size_t k = 0; k < moments.size(); ++k) {
        const Moment& moment = *moments[k];
        PictureScene& picture = pictures[k];
        picture.title = scene.name + " at " + std::to_string(moment.time_s) + " s";
        picture.objects = objects_of(*simulation_, moment.vertices);
        picture.contacts = moment.tool.contacts;
        picture.proxy_radius = 0.0;
        if (!moment.tool.skin.empty()) {
            picture.objects.push_back(reproduce::skin_object(tool, moment.tool.skin));
        } else if (moment.tool.spheres.size() == 1) {
            picture.proxy = moment.tool.spheres.front().centre;
            picture.proxy_radius = moment.tool.spheres.front().radius;
            picture.hip = moment.hip;
        } else {
            picture.spheres = moment.tool.spheres;
        }
        // Frame, and a floor below all vertices unless the scene has a ground.
        picture.view = framed_box(moment.tool, moment.hip, moment.vertices);
        const double size = glm::length(picture.view->size());
        picture.tile = kTile * size;
        picture.floor = scene.collisions.ground
                            ? scene.collisions.ground_height
                            : std::min(aabb_of(moment.vertices).min.y, picture.view->min.y) - kAboveFloor * size;
        points[k] = points_to_see(moment.tool);
        subjects[k] = {&picture, points[k]};
    }
    // One direction of the camera for all of them.
    const Vec3 direction = clearest_direction(subjects);
    std::vector<std::filesystem::path> files;
    for (std::size_t k = 0; k < moments.size(); ++k) {
        PictureScene& picture = pictures[k];
        picture.camera = direction;
        if (visible_share(picture, camera_for(picture, direction), points[k]) < kVisible) {
            for (PictureObject& object : picture.objects) {
                object.transmit = kTransparent;
            }
        }
        files.push_back(folder / (scene.name + "-" + moments[k]->name + ".pov"));
        write_picture_scene(files.back(), picture);
    }
    return files;
}

}  // namespace haptic::sim
