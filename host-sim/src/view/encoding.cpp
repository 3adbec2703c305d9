#include "view/encoding.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <limits>
#include <nlohmann/json.hpp>
#include <type_traits>
#include <utility>

namespace haptic::sim::view {
namespace {

static_assert(std::endian::native == std::endian::little, "the messages are little-endian");

template <class Number>
void append(Bytes& bytes, Number number) {
    static_assert(std::is_arithmetic_v<Number>);
    std::array<std::byte, sizeof(Number)> raw{};
    std::memcpy(raw.data(), &number, sizeof(Number));
    bytes.insert(bytes.end(), raw.begin(), raw.end());
}

void append_f32(Bytes& bytes, double number) {
    append(bytes, static_cast<float>(number));
}

void append_f32(Bytes& bytes, const Vec3& v) {
    append_f32(bytes, v.x);
    append_f32(bytes, v.y);
    append_f32(bytes, v.z);
}

void append_f32(Bytes& bytes, const Quat& q) {
    append_f32(bytes, q.w);
    append_f32(bytes, q.x);
    append_f32(bytes, q.y);
    append_f32(bytes, q.z);
}

void append_u32(Bytes& bytes, std::size_t number) {
    append(bytes, static_cast<std::uint32_t>(number));
}

/// Begins a part; its length is filled in by end_part().
std::size_t begin_part(Bytes& bytes, PartKind kind, std::size_t index, std::size_t count) {
    append_u32(bytes, static_cast<std::uint32_t>(kind));
    append_u32(bytes, index);
    append_u32(bytes, count);
    append_u32(bytes, 0);
    return bytes.size();
}

void end_part(Bytes& bytes, std::size_t begin) {
    const auto length = static_cast<std::uint32_t>(bytes.size() - begin);
    std::memcpy(bytes.data() + begin - sizeof(length), &length, sizeof(length));
}

/// A number in [-1, 1] as a whole one in [-largest, largest].
template <class Whole>
Whole scaled(double number) noexcept {
    constexpr double largest = std::numeric_limits<Whole>::max();
    // What is no number compares as false and becomes -1.
    const double bounded = number > -1.0 ? std::min(number, 1.0) : -1.0;
    return static_cast<Whole>(std::lround(bounded * largest));
}

bool is_finite(const Vec3& v) noexcept {
    return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

/// A box in float that holds all that is finite, so that page and encoder mean the same one.
struct Box {
    std::array<float, 3> origin{};
    std::array<float, 3> size{};
};

Box box_of(std::span<const Vec3> vertices) {
    constexpr float infinity = std::numeric_limits<float>::infinity();
    Vec3 least(std::numeric_limits<double>::max());
    Vec3 most(std::numeric_limits<double>::lowest());
    bool any = false;
    for (const Vec3& vertex : vertices) {
        if (is_finite(vertex)) {
            least = glm::min(least, vertex);
            most = glm::max(most, vertex);
            any = true;
        }
    }
    Box box;
    for (int axis = 0; any && axis < 3; ++axis) {
        const auto k = static_cast<std::size_t>(axis);
        // Rounded to float it must not lose what lies at its rim.
        box.origin[k] = std::nextafter(static_cast<float>(least[axis]), -infinity);
        box.size[k] = std::nextafter(static_cast<float>(most[axis] - static_cast<double>(box.origin[k])), infinity);
    }
    return box;
}

std::uint16_t in_box(double coordinate, float origin, float size) noexcept {
    constexpr double largest = 65535.0;
    const double part = (coordinate - static_cast<double>(origin)) / static_cast<double>(size);
    // What is no number, or lies in a box without size, becomes 0.
    return static_cast<std::uint16_t>(part > 0.0 ? std::lround(std::min(part, 1.0) * largest) : 0L);
}

/// Sums of the faces' normals, each as long as twice its area.
void add_face_normals(std::span<const Triangle> faces, std::span<const Vec3> vertices, std::vector<Vec3>& normals) {
    normals.assign(vertices.size(), Vec3(0.0));
    for (const Triangle& face : faces) {
        const Vec3& a = vertices[face[0]];
        const Vec3 normal = glm::cross(vertices[face[1]] - a, vertices[face[2]] - a);
        for (const std::uint32_t vertex : face) {
            normals[vertex] += normal;
        }
    }
}

nlohmann::json described(const ParameterDescription& parameter) {
    return {{"key", parameter.key},         {"label", parameter.label},
            {"unit", parameter.unit},       {"least", parameter.least},
            {"most", parameter.most},       {"whole", parameter.whole},
            {"choices", parameter.choices}, {"logarithmic", parameter.logarithmic}};
}

std::uint32_t flags_of(const SceneSnapshot& snapshot) noexcept {
    const auto flag = [](bool set, std::uint32_t bit) { return set ? bit : 0U; };
    return flag(snapshot.in_contact, 1) | flag(snapshot.squeezed, 2) | flag(snapshot.run.paused, 4) |
           flag(snapshot.run.recording, 8) | flag(snapshot.run.diverged, 16);
}

void append_hand(Bytes& bytes, const SceneSnapshot& snapshot, std::size_t viewers) {
    const std::size_t begin = begin_part(bytes, PartKind::Hand, 0, 1);
    for (const Pose* pose : {&snapshot.tool, &snapshot.hip}) {
        append_f32(bytes, pose->position);
        append_f32(bytes, pose->orientation);
    }
    for (const Vec3* vector : {&snapshot.force, &snapshot.torque, &snapshot.hand_force, &snapshot.hand_torque}) {
        append_f32(bytes, *vector);
    }
    const RunView& run = snapshot.run;
    for (const double number :
         {snapshot.curl, snapshot.depth, run.speed, run.buffered, static_cast<double>(run.hand),
          static_cast<double>(run.late_steps), static_cast<double>(run.recorded_steps), static_cast<double>(viewers)}) {
        append_f32(bytes, number);
    }
    end_part(bytes, begin);
}

}  // namespace

std::string scene_message(const SceneDescription& description, std::uint32_t scene, bool control) {
    nlohmann::json message = {{"type", "scene"},
                              {"protocol", 1},
                              {"scene", scene},
                              {"name", description.name},
                              {"text", description.text},
                              {"scenes", description.scenes},
                              {"control", control},
                              {"mode", description.length > 0.0 ? "play" : "run"},
                              {"length", description.length},
                              {"step", description.step},
                              {"closes", description.closes},
                              {"force_scale", description.force_scale},
                              {"ground", nullptr},
                              {"version", HAPTIC_VERSION},
                              {"groups", description.groups.size()},
                              {"links", description.links.size()},
                              {"bodies", nlohmann::json::array()},
                              {"parameters", nlohmann::json::array()}};
    if (description.ground_height) {
        message["ground"] = *description.ground_height;
    }
    for (const BodyDescription& body : description.bodies) {
        message["bodies"].push_back({{"name", body.name},
                                     {"vertices", body.vertices},
                                     {"triangles", single_faces(body.triangles).size()},
                                     {"first_particle", body.first_particle},
                                     {"particles", body.particles}});
    }
    message["tool"] = {{"vertices", description.tool_vertices},
                       {"triangles", single_faces(description.tool_triangles).size()},
                       {"radii", description.proxy_radii}};
    for (const ParameterDescription& parameter : description.parameters) {
        message["parameters"].push_back(described(parameter));
    }
    // A name from a scene file need not be UTF-8.
    return message.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

Bytes geometry_message(const SceneDescription& description, std::uint32_t scene) {
    Bytes bytes;
    append_u32(bytes, static_cast<std::uint32_t>(MessageKind::Geometry));
    append_u32(bytes, scene);
    const auto append_faces = [&](std::span<const Triangle> triangles) {
        for (const Triangle& triangle : single_faces(triangles)) {
            for (const std::uint32_t vertex : triangle) {
                append_u32(bytes, vertex);
            }
        }
    };
    for (const BodyDescription& body : description.bodies) {
        append_faces(body.triangles);
    }
    append_faces(description.tool_triangles);
    for (const Vec3& semi_axes : description.semi_axes) {
        append_f32(bytes, semi_axes);
    }
    for (const Quat& axes : description.ellipsoid_axes) {
        append_f32(bytes, axes);
    }
    for (const Group& group : description.groups) {
        append_u32(bytes, group.centre);
        append_u32(bytes, group.members.size());
        for (const std::uint32_t member : group.members) {
            append_u32(bytes, member);
        }
    }
    for (const Link& link : description.links) {
        append_u32(bytes, link.first);
        append_u32(bytes, link.second);
    }
    return bytes;
}

Bytes samples_message(std::span<const StepSample> samples, std::uint32_t scene, std::uint32_t dropped) {
    Bytes bytes;
    const double first = samples.empty() ? 0.0 : samples.front().time;
    append_u32(bytes, static_cast<std::uint32_t>(MessageKind::Samples));
    append_u32(bytes, scene);
    append(bytes, first);
    append_u32(bytes, samples.size());
    append_u32(bytes, dropped);
    for (const StepSample& s : samples) {
        append_f32(bytes, s.time - first);
        for (const float number : {s.force, s.torque, s.depth, s.total_us, s.ccd_us, s.popout_us, s.proxy_us, s.tool_us,
                                   s.collide_us, s.deform_us, s.skin_us}) {
            append(bytes, number);
        }
    }
    return bytes;
}

std::vector<Triangle> single_faces(std::span<const Triangle> triangles) {
    std::vector<std::pair<Triangle, std::size_t>> sorted;
    sorted.reserve(triangles.size());
    for (std::size_t k = 0; k < triangles.size(); ++k) {
        Triangle vertices = triangles[k];
        std::sort(vertices.begin(), vertices.end());
        sorted.emplace_back(vertices, k);
    }
    std::sort(sorted.begin(), sorted.end());
    std::vector<bool> repeats(triangles.size(), false);
    for (std::size_t k = 1; k < sorted.size(); ++k) {
        repeats[sorted[k].second] = sorted[k].first == sorted[k - 1].first;
    }
    std::vector<Triangle> faces;
    for (std::size_t k = 0; k < triangles.size(); ++k) {
        if (!repeats[k]) {
            faces.push_back(triangles[k]);
        }
    }
    return faces;
}

std::array<std::int8_t, 2> octahedral(const Vec3& normal) noexcept {
    const double sum = std::abs(normal.x) + std::abs(normal.y) + std::abs(normal.z);
    if (!(sum > 0.0) || !std::isfinite(sum)) {
        return {0, 0};
    }
    double u = normal.x / sum;
    double v = normal.y / sum;
    if (normal.z < 0.0) {
        const double turned_over = std::copysign(1.0 - std::abs(v), u);
        v = std::copysign(1.0 - std::abs(u), v);
        u = turned_over;
    }
    return {scaled<std::int8_t>(u), scaled<std::int8_t>(v)};
}

void append_frame_header(Bytes& message, const EncodedMoment& moment, std::uint32_t scene, std::uint32_t parts) {
    append_u32(message, static_cast<std::uint32_t>(MessageKind::Frame));
    append_u32(message, scene);
    append(message, moment.time);
    append(message, static_cast<double>(moment.step));
    append_u32(message, moment.flags);
    append_u32(message, parts);
}

MomentEncoder::MomentEncoder(const SceneDescription& description) : parameters_(description.parameters.size()) {
    for (const BodyDescription& body : description.bodies) {
        surfaces_.push_back({body.first_vertex, body.vertices, single_faces(body.triangles), {}});
        particles_.push_back({body.first_particle, body.particles, {}, {}});
    }
    surfaces_.push_back({0, description.tool_vertices, single_faces(description.tool_triangles), {}});
    moment_.surfaces.resize(surfaces_.size());
    moment_.particles.resize(particles_.size());
}

void MomentEncoder::encode(const SceneSnapshot& snapshot, bool particles_watched, std::size_t viewers) {
    moment_.time = snapshot.time;
    moment_.step = snapshot.step;
    moment_.flags = flags_of(snapshot);
    const std::span<const Vec3> vertices(snapshot.vertices);
    for (std::size_t k = 0; k + 1 < surfaces_.size(); ++k) {
        encode_surface(k, PartKind::BodySurface, vertices.subspan(surfaces_[k].first, surfaces_[k].count));
    }
    encode_surface(surfaces_.size() - 1, PartKind::ToolSurface, snapshot.tool_vertices);
    if (particles_watched) {
        for (std::size_t k = 0; k < particles_.size(); ++k) {
            const auto [first, count] = std::pair(particles_[k].first, particles_[k].count);
            encode_particles(k, std::span(snapshot.particles).subspan(first, count),
                             std::span(snapshot.orientations).subspan(first, count));
        }
    }
    encode_rest(snapshot, viewers);
}

void MomentEncoder::encode_surface(std::size_t k, PartKind kind, std::span<const Vec3> vertices) {
    Surface& surface = surfaces_[k];
    EncodedPart& part = moment_.surfaces[k];
    if (vertices.empty() || std::equal(vertices.begin(), vertices.end(), surface.shown.begin(), surface.shown.end())) {
        return;
    }
    surface.shown.assign(vertices.begin(), vertices.end());
    add_face_normals(surface.faces, vertices, normals_);
    const Box box = box_of(vertices);
    ++part.version;
    part.bytes.clear();
    const std::size_t begin = begin_part(part.bytes, kind, kind == PartKind::BodySurface ? k : 0, vertices.size());
    for (const auto& corner : {box.origin, box.size}) {
        for (const float number : corner) {
            append(part.bytes, number);
        }
    }
    for (std::size_t v = 0; v < vertices.size(); ++v) {
        for (int axis = 0; axis < 3; ++axis) {
            const auto a = static_cast<std::size_t>(axis);
            append(part.bytes, in_box(vertices[v][axis], box.origin[a], box.size[a]));
        }
        for (const std::int8_t number : octahedral(normals_[v])) {
            append(part.bytes, number);
        }
    }
    end_part(part.bytes, begin);
}

void MomentEncoder::encode_particles(std::size_t k, std::span<const Vec3> places, std::span<const Quat> orientations) {
    Particles& body = particles_[k];
    EncodedPart& part = moment_.particles[k];
    if (places.empty() || (std::equal(places.begin(), places.end(), body.shown.begin(), body.shown.end()) &&
                           std::equal(orientations.begin(), orientations.end(), body.shown_orientations.begin(),
                                      body.shown_orientations.end()))) {
        return;
    }
    body.shown.assign(places.begin(), places.end());
    body.shown_orientations.assign(orientations.begin(), orientations.end());
    ++part.version;
    part.bytes.clear();
    const std::size_t begin = begin_part(part.bytes, PartKind::Particles, k, places.size());
    for (std::size_t p = 0; p < places.size(); ++p) {
        append_f32(part.bytes, places[p]);
        const Quat& q = orientations[p];
        for (const double number : {q.w, q.x, q.y, q.z}) {
            append(part.bytes, scaled<std::int16_t>(number));
        }
    }
    end_part(part.bytes, begin);
}

void MomentEncoder::encode_rest(const SceneSnapshot& snapshot, std::size_t viewers) {
    moment_.planes.clear();
    std::size_t begin = begin_part(moment_.planes, PartKind::Planes, 0, snapshot.planes.size());
    for (const PlaneView& plane : snapshot.planes) {
        append_f32(moment_.planes, plane.normal);
        append_f32(moment_.planes, plane.offset);
        append_f32(moment_.planes, plane.velocity);
        append_u32(moment_.planes, plane.proxy);
        append_u32(moment_.planes, plane.touches ? 1 : 0);
    }
    end_part(moment_.planes, begin);

    moment_.rest.clear();
    begin = begin_part(moment_.rest, PartKind::Proxies, 0, snapshot.proxies.size());
    for (const ProxyView& proxy : snapshot.proxies) {
        append_f32(moment_.rest, proxy.position);
        append_f32(moment_.rest, proxy.goal);
        append_u32(moment_.rest, (proxy.touches ? 1U : 0U) | (proxy.sticks ? 2U : 0U));
        append_f32(moment_.rest, proxy.radius);
    }
    end_part(moment_.rest, begin);
    append_hand(moment_.rest, snapshot, viewers);
    begin = begin_part(moment_.rest, PartKind::Parameters, 0, parameters_);
    for (std::size_t k = 0; k < parameters_; ++k) {
        append_f32(moment_.rest, snapshot.run.parameters[k]);
    }
    end_part(moment_.rest, begin);
}

}  // namespace haptic::sim::view
