#include "app/snapshots.hpp"

#include <algorithm>
#include <utility>

#include "reproduce/povray.hpp"

namespace haptic::sim {
namespace {

constexpr std::uint64_t kSoonAfter = 7;  // steps
constexpr std::uint64_t kLater = 100;
constexpr double kAboveFloor = 0.1;  // m, clearance of the vertices
constexpr double kFloor = -1.6;      // m; lowered below all vertices if necessary

}  // namespace

Snapshots::Snapshots(const Simulation& simulation) : simulation_(&simulation) {
    last_.vertices = present_.vertices = simulation.vertices();
    kept_.reserve(4);
}

void Snapshots::before_step() {
    std::swap(last_, present_);
    const std::vector<Vec3>& now = simulation_->vertices();
    std::copy(now.begin(), now.end(), present_.vertices.begin());
    present_.time_s = static_cast<double>(simulation_->steps()) * simulation_->scene().solver.step;
}

void Snapshots::keep(const char* name, const StepResult& result) {
    kept_.push_back(present_);
    kept_.back().name = name;
    kept_.back().proxy = result.proxy;
    kept_.back().hip = result.hip;
}

void Snapshots::after_step(const StepResult& result) {
    present_.proxy = result.proxy;
    present_.hip = result.hip;
    const std::uint64_t step = simulation_->steps();
    if (first_contact_ == 0) {
        if (result.in_contact) {
            first_contact_ = step;
            last_.name = "1-before";
            kept_.push_back(last_);
            kept_.back().from_below = true;
            keep("2-contact", result);
            kept_.back().from_below = true;
        }
    } else if (step == first_contact_ + kSoonAfter) {
        keep("3-soon-after", result);
    } else if (step == first_contact_ + kLater) {
        keep("4-later", result);
    }
}

std::vector<std::filesystem::path> Snapshots::write(const std::filesystem::path& folder) const {
    std::filesystem::create_directories(folder);
    const Scene& scene = simulation_->scene();
    std::vector<std::filesystem::path> files;
    for (const Moment& moment : kept_) {
        PictureScene picture;
        picture.title = scene.name + " at " + std::to_string(moment.time_s) + " s";
        picture.objects = objects_of(*simulation_, moment.vertices);
        picture.proxy = moment.proxy;
        picture.proxy_radius = scene.proxy.radius;
        picture.hip = moment.hip;
        picture.camera.y = moment.from_below ? -0.12 : 0.2;
        picture.floor = kFloor;
        for (const Vec3& v : moment.vertices) {
            picture.floor = std::min(picture.floor, v.y - kAboveFloor);
        }
        if (scene.collisions.ground) {
            picture.floor = scene.collisions.ground_height;
        }
        files.push_back(folder / (scene.name + "-" + moment.name + ".pov"));
        write_picture_scene(files.back(), picture);
    }
    return files;
}

}  // namespace haptic::sim
