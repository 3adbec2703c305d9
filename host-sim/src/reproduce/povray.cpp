#include "reproduce/povray.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <glm/geometric.hpp>
#include <iterator>
#include <sstream>
#include <stdexcept>
#include <string>
#include <system_error>
#include <vector>

#include "haptic/text_file.hpp"
#include "reproduce/camera.hpp"

namespace haptic::sim {
namespace {

// Preamble of every picture. POV-Ray is left-handed; a camera whose right vector is -x shows our right-handed scene
// correctly.
constexpr std::string_view kPreamble = R"(
#version 3.7;
global_settings { assumed_gamma 1.0 max_trace_level 8 }

#declare ProxyBall = texture {
    pigment { rgb <0.16, 0.36, 0.68> }
    finish { ambient 0.12 diffuse 0.70 specular 0.55 roughness 0.02 }
}
#declare TouchingBall = texture {
    pigment { rgb <0.93, 0.50, 0.10> }
    finish { ambient 0.14 diffuse 0.72 specular 0.45 roughness 0.03 }
}
#declare Hip = texture {
    pigment { rgb <0.98, 0.98, 0.98> }
    finish { ambient 0.45 diffuse 0.6 specular 0.3 }
}
)";

/// A number or a vector in POV-Ray's syntax; values below 1e-9 become 0.
std::string pov(double value) {
    std::array<char, 32> digits{};
    const double rounded = std::fabs(value) < 1e-9 ? 0.0 : value;
    const auto end =
        std::to_chars(digits.data(), digits.data() + digits.size(), rounded, std::chars_format::general, 7).ptr;
    return {digits.data(), end};
}

std::string pov(const Vec3& v) {
    std::string text = pov(v.x);
    text.insert(0, 1, '<').append(", ").append(pov(v.y)).append(", ").append(pov(v.z)).push_back('>');
    return text;
}

/// Area-weighted mean of the face normals at each vertex.
std::vector<Vec3> vertex_normals(const PictureObject& object) {
    std::vector<Vec3> normals(object.vertices.size(), Vec3(0.0));
    for (const auto& [a, b, c] : object.triangles) {
        const Vec3 n = glm::cross(object.vertices[b] - object.vertices[a], object.vertices[c] - object.vertices[a]);
        normals[a] += n;
        normals[b] += n;
        normals[c] += n;
    }
    for (Vec3& n : normals) {
        const double length = glm::length(n);
        n = length > 0.0 ? n / length : Vec3(0.0, 1.0, 0.0);
    }
    return normals;
}

void write_list(std::ostream& out, const char* name, std::span<const Vec3> vectors) {
    out << "    " << name << " {\n        " << vectors.size();
    for (std::size_t i = 0; i < vectors.size(); ++i) {
        out << (i % 3 == 0 ? ",\n        " : ", ") << pov(vectors[i]);
    }
    out << "\n    }\n";
}

std::string skin_texture(const std::array<double, 3>& colour, double transmit) {
    return "texture {\n        pigment { rgb " + pov(Vec3(colour[0], colour[1], colour[2])) + " transmit " +
           pov(transmit) + " }\n        finish { ambient 0.14 diffuse 0.75 specular 0.12 roughness 0.08 }\n    }";
}

constexpr double kGhostTransmit = 0.7;
constexpr std::array kBackColour{0.96, 0.83, 0.55};
constexpr std::array kGhostColour{0.5, 0.5, 0.5};

void write_mesh(std::ostream& out, const PictureObject& object) {
    out << "mesh2 {\n";
    write_list(out, "vertex_vectors", object.vertices);
    if (!object.faceted) {
        write_list(out, "normal_vectors", vertex_normals(object));
    }
    out << "    face_indices {\n        " << object.triangles.size();
    // Reversed winding: POV-Ray derives the interior side from the winding in its left-handed frame.
    for (std::size_t t = 0; t < object.triangles.size(); ++t) {
        const auto& [a, b, c] = object.triangles[t];
        out << (t % 8 == 0 ? ",\n        " : ", ") << "<" << a << ", " << c << ", " << b << ">";
    }
    out << "\n    }\n    ";
    // Material: ghosts transparent, closed surfaces opaque, open surfaces with a second colour for the back.
    if (object.ghost) {
        out << skin_texture(kGhostColour, kGhostTransmit) << " no_shadow";
    } else if (object.closed) {
        out << skin_texture(object.colour, 0.0);
    } else {
        out << skin_texture(object.colour, object.transmit) << "\n    interior_"
            << skin_texture(kBackColour, object.transmit);
    }
    out << "\n}\n";
}

void write_ground(std::ostream& out, const PictureScene& scene) {
    out << "plane {\n    y, " << pov(scene.floor)
        << "\n    pigment { checker rgb <0.84, 0.86, 0.88> rgb <0.80, 0.82, 0.845> scale " << pov(scene.tile)
        << " }\n    finish { ambient 0.25 diffuse 0.7 }\n}\n\n";
}

constexpr double kLampRange =
    8.0;  // m, distance of the camera up to which the lamps at their base positions light the scene well
constexpr Vec3 kLampsFor{0.45, 0.2, 1.0};  // direction of the camera that the lamps' base positions are meant for

void write_camera(std::ostream& out, const Camera& camera) {
    out << "camera {\n    location " << pov(camera.position)
        << "\n    up y\n    right -x * image_width / image_height\n"
        << "    angle " << pov(kCameraAngle) << "\n    look_at " << pov(camera.look_at) << "\n}\n\n";
}

/// Background, fog and lamps. The lamps turn with the camera about what it looks at; those of a large scene are
/// farther away.
void write_light(std::ostream& out, const Camera& camera) {
    // Rotation about y that takes the direction of kLampsFor to the camera's.
    const Vec3 direction = camera.position - camera.look_at;
    const double turn = std::atan2(direction.x, direction.z) - std::atan2(kLampsFor.x, kLampsFor.z);
    const double size = std::max(1.0, camera.distance / kLampRange);
    const auto turned = [&](const Vec3& v) {
        return Vec3(std::cos(turn) * v.x + std::sin(turn) * v.z, v.y, std::cos(turn) * v.z - std::sin(turn) * v.x);
    };
    // One area light with soft shadows, and two fill lights without.
    const auto lamp = [&](const Vec3& position) {
        return "light_source {\n    " + pov(camera.look_at + size * turned(position));
    };
    out << "background { rgb <0.90, 0.93, 0.97> }\nfog { fog_type 1 distance " << pov(45.0 * size)
        << " rgb <0.90, 0.93, 0.97> }\n"
        << lamp({-3.5, 6.0, 5.0}) << " rgb <1.0, 0.97, 0.92>\n    area_light " << pov(size * Vec3(1.2, 0.0, 0.0))
        << ", " << pov(size * Vec3(0.0, 0.0, 1.2)) << ", 5, 5 adaptive 1 jitter\n}\n"
        << lamp({5.0, 3.0, 3.5}) << " rgb <0.30, 0.33, 0.40> shadowless\n}\n"
        << lamp({0.0, -2.0, 4.0}) << " rgb <0.34, 0.32, 0.31> shadowless\n}\n\n";
}

void write_tool(std::ostream& out, const PictureScene& scene) {
    for (const PictureSphere& sphere : scene.spheres) {
        out << "sphere { " << pov(sphere.centre) << ", " << pov(sphere.radius) << " texture { "
            << (sphere.touching ? "TouchingBall" : "ProxyBall") << " } }\n";
    }
    for (const PictureSphere& contact : scene.contacts) {
        out << "sphere { " << pov(contact.centre) << ", " << pov(contact.radius)
            << " texture { TouchingBall } no_shadow }\n";
    }
    if (!(scene.proxy_radius > 0.0)) {
        return;
    }
    out << "sphere { " << pov(scene.proxy) << ", " << pov(scene.proxy_radius) << " texture { ProxyBall } }\n";
    out << "sphere { " << pov(scene.hip) << ", " << pov(0.4 * scene.proxy_radius) << " texture { Hip } }\n";
    if (glm::length(scene.hip - scene.proxy) > scene.proxy_radius) {
        out << "cylinder { " << pov(scene.hip) << ", " << pov(scene.proxy) << ", " << pov(0.08 * scene.proxy_radius)
            << " texture { Hip } no_shadow }  // the coupling\n";
    }
}

void write_all(std::ostream& out, const PictureScene& scene) {
    out << "// " << scene.title << "\n// Render with: povray +A +W1600 +H1200 +IFILE.pov\n" << kPreamble << '\n';
    const Camera camera = camera_for(scene, scene.camera);
    write_light(out, camera);
    write_camera(out, camera);
    write_ground(out, scene);
    write_tool(out, scene);
    out << '\n';
    for (const PictureObject& object : scene.objects) {
        write_mesh(out, object);
    }
}

// Colours of the bodies in turn; the first is that of cloth-drop.
constexpr std::array<std::array<double, 3>, 4> kColours{
    {{0.78, 0.16, 0.14}, {0.90, 0.55, 0.13}, {0.20, 0.50, 0.58}, {0.45, 0.56, 0.22}}};

}  // namespace

std::vector<PictureObject> objects_of(const Simulation& simulation, std::span<const Vec3> vertices) {
    std::vector<PictureObject> objects;
    for (const SceneBody& body : simulation.bodies()) {
        const std::vector<Triangle>& all = body.mesh.triangles;
        // The second half of a double-faced mesh repeats the same surface.
        const auto count = static_cast<std::ptrdiff_t>(body.mesh.double_faced ? all.size() / 2 : all.size());
        objects.push_back({.vertices = vertices.subspan(body.first_vertex, body.mesh.vertices.size()),
                           .triangles = {all.begin(), all.begin() + count},
                           .closed = body.mesh.closed,
                           .colour = kColours[objects.size() % kColours.size()]});
    }
    return objects;
}

void write_picture_scene(const std::filesystem::path& file, const PictureScene& scene) {
    std::ostringstream out;
    write_all(out, scene);
    write_text(file, out.str());
}

}  // namespace haptic::sim
