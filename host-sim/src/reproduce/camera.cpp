#include "reproduce/camera.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>
#include <vector>

#include "simd/aabb.hpp"

namespace haptic::sim {
namespace {

// Tangent of half the vertical field of view: tan(15 deg) * 3/4 at 4:3, less a margin.
constexpr double kHalfHeight = 0.175;

// Directions to choose from, in order of preference. Azimuth is measured from +z toward +x.
constexpr std::array kElevations{18.0, 35.0, 60.0, -8.0};                        // degrees
constexpr std::array kAzimuths{40.0, -40.0, 75.0, -80.0, 115.0, -130.0, 180.0};  // degrees
constexpr double kNearlyAsMuch = 0.08;                                           // of the visible share
constexpr double kAboveGround = 0.04;  // of the camera's distance: its smallest height over the ground

// Share of the way to the camera that is skipped at a point, so that the surface it touches does not hide it.
constexpr double kSkipped = 2e-3;

/// Bounding box of all objects, and of proxy and hip or the tool's spheres.
Aabb bounds(const PictureScene& scene) {
    Aabb box;
    if (scene.proxy_radius > 0.0) {
        box.extend(scene.proxy);
        box.extend(scene.hip);
    }
    for (const PictureSphere& sphere : scene.spheres) {
        box.extend(sphere.centre - sphere.radius);
        box.extend(sphere.centre + sphere.radius);
    }
    for (const PictureObject& object : scene.objects) {
        box.extend(aabb_of(object.vertices));
    }
    return box;
}

/// Whether the segment p + s d, s in [kSkipped, 1], meets the triangle.
/// @source Moller and Trumbore 1997, "Fast, Minimum Storage Ray/Triangle Intersection"
bool hides(const Vec3& p, const Vec3& d, const Vec3& a, const Vec3& b, const Vec3& c) {
    // Solve p + s d = a + u (b - a) + v (c - a) by Cramer's rule.
    const Vec3 ab = b - a;
    const Vec3 ac = c - a;
    const Vec3 h = glm::cross(d, ac);
    const double determinant = glm::dot(ab, h);
    if (determinant == 0.0) {
        return false;
    }
    const Vec3 ap = p - a;
    const double u = glm::dot(ap, h) / determinant;
    const Vec3 q = glm::cross(ap, ab);
    const double v = glm::dot(d, q) / determinant;
    const double s = glm::dot(ac, q) / determinant;
    return u >= 0.0 && v >= 0.0 && u + v <= 1.0 && s >= kSkipped && s <= 1.0;
}

bool is_hidden(const PictureScene& scene, const Vec3& point, const Vec3& camera) {
    const Vec3 way = camera - point;
    return std::any_of(scene.objects.begin(), scene.objects.end(), [&](const PictureObject& object) {
        return !object.tool && std::any_of(object.triangles.begin(), object.triangles.end(), [&](const Triangle& t) {
            return hides(point, way, object.vertices[t[0]], object.vertices[t[1]], object.vertices[t[2]]);
        });
    });
}

Vec3 direction_of(double azimuth, double elevation) {
    const double level = std::cos(glm::radians(elevation));
    return {level * std::sin(glm::radians(azimuth)), std::sin(glm::radians(elevation)),
            level * std::cos(glm::radians(azimuth))};
}

}  // namespace

Camera camera_for(const PictureScene& scene, const Vec3& direction) {
    const auto [low, high] = scene.view ? *scene.view : bounds(scene);
    // Horizontal extent, scaled to the height of a 4:3 picture.
    const double across = std::hypot(high.x - low.x, high.z - low.z) * 0.75;
    Camera camera;
    camera.look_at = 0.5 * (low + high);
    camera.distance = 0.5 * std::max(high.y - low.y, across) / kHalfHeight + 0.35 * across;
    camera.position = camera.look_at + camera.distance * glm::normalize(direction);
    return camera;
}

double visible_share(const PictureScene& scene, const Camera& camera, std::span<const Vec3> points) {
    const auto hidden = std::count_if(points.begin(), points.end(),
                                      [&](const Vec3& point) { return is_hidden(scene, point, camera.position); });
    return points.empty() ? 1.0 : 1.0 - static_cast<double>(hidden) / static_cast<double>(points.size());
}

Vec3 clearest_direction(std::span<const Subject> subjects) {
    struct Candidate {
        Vec3 direction;
        double visible = 0.0;  // sum of the shares over the moments
    };
    std::vector<Candidate> candidates;
    double best = 0.0;
    for (const double elevation : kElevations) {
        for (const double azimuth : kAzimuths) {
            Candidate candidate{direction_of(azimuth, elevation)};
            const bool above_ground = std::all_of(subjects.begin(), subjects.end(), [&](const Subject& subject) {
                const Camera camera = camera_for(*subject.picture, candidate.direction);
                return camera.position.y > subject.picture->floor + kAboveGround * camera.distance;
            });
            if (!above_ground) {
                continue;
            }
            for (const auto& [picture, points] : subjects) {
                candidate.visible += visible_share(*picture, camera_for(*picture, candidate.direction), points);
            }
            best = std::max(best, candidate.visible);
            candidates.push_back(candidate);
        }
    }
    // The first one in order of preference that shows nearly as much as the best one.
    const double enough = best - kNearlyAsMuch * static_cast<double>(subjects.size());
    const auto chosen = std::find_if(candidates.begin(), candidates.end(),
                                     [&](const Candidate& candidate) { return candidate.visible >= enough; });
    return chosen != candidates.end() ? chosen->direction : direction_of(kAzimuths[0], kElevations[2]);
}

}  // namespace haptic::sim
