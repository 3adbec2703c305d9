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

#include "haptic/numeric.hpp"

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

/// Appends the header of a part. end_part() fills in its length.
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

/// Maps [-1, 1] to an integer in [-largest, largest].
template <class Integer>
Integer to_fixed_point(double number) noexcept {
    constexpr double largest = std::numeric_limits<Integer>::max();
    // NaN fails the comparison and becomes -1.
    const double bounded = number > -1.0 ? std::min(number, 1.0) : -1.0;
    return static_cast<Integer>(std::lround(bounded * largest));
}

/// Bounding box in single precision of all finite vertices, so that page and encoder decode against the same box.
struct Box {
    std::array<float, 3> origin{};
    std::array<float, 3> size{};
};

Box bounding_box(std::span<const Vec3> vertices) {
    constexpr float infinity = std::numeric_limits<float>::infinity();
    Vec3 low(std::numeric_limits<double>::max());
    Vec3 high(std::numeric_limits<double>::lowest());
    bool any = false;
    for (const Vec3& vertex : vertices) {
        if (haptic::is_finite(vertex)) {
            low = glm::min(low, vertex);
            high = glm::max(high, vertex);
            any = true;
        }
    }
    Box box;
    for (int axis = 0; any && axis < 3; ++axis) {
        const auto k = static_cast<std::size_t>(axis);
        // Round outwards: rounding to float must not exclude a vertex on the boundary.
        box.origin[k] = std::nextafter(static_cast<float>(low[axis]), -infinity);
        box.size[k] = std::nextafter(static_cast<float>(high[axis] - static_cast<double>(box.origin[k])), infinity);
    }
    return box;
}

/// A coordinate as a fraction of the box's size, in 1/65535.
std::uint16_t quantize(double coordinate, float origin, float size) noexcept {
    constexpr double largest = 65535.0;
    const double fraction = (coordinate - static_cast<double>(origin)) / static_cast<double>(size);
    // NaN, or a box of size zero, gives 0.
    return static_cast<std::uint16_t>(fraction > 0.0 ? std::lround(std::min(fraction, 1.0) * largest) : 0L);
}

/// Area-weighted vertex normals: sums of the face normals, each of length twice the face's area.
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

nlohmann::json parameter_json(const ParameterDescription& parameter) {
    return {{"key", parameter.key},         {"label", parameter.label},
            {"unit", parameter.unit},       {"least", parameter.min},
            {"most", parameter.max},        {"whole", parameter.whole},
            {"choices", parameter.choices}, {"logarithmic", parameter.logarithmic},
            {"meaning", parameter.meaning}};
}

std::uint32_t flags_of(const SceneSnapshot& snapshot) noexcept {
    const auto flag = [](bool set, std::uint32_t bit) { return set ? bit : 0U; };
    return flag(snapshot.in_contact, 1) | flag(snapshot.overconstrained, 2) | flag(snapshot.run.paused, 4) |
           flag(snapshot.run.recording, 8) | flag(snapshot.run.diverged, 16);
}

void append_hand(Bytes& bytes, const SceneSnapshot& snapshot, std::size_t viewers) {
    const std::size_t begin = begin_part(bytes, PartKind::Hand, 0, 1);
    // Poses of tool and hip, then the wrenches in the scene and at the hand.
    for (const Pose* pose : {&snapshot.tool, &snapshot.hip}) {
        append_f32(bytes, pose->position);
        append_f32(bytes, pose->orientation);
    }
    for (const Vec3* vector : {&snapshot.force, &snapshot.torque, &snapshot.hand_force, &snapshot.hand_torque}) {
        append_f32(bytes, *vector);
    }
    // Scalars of the run, all as f32 (PROTOCOL.md, part 6).
    const RunView& run = snapshot.run;
    for (const double number :
         {snapshot.curl, snapshot.depth, run.speed, run.buffered, static_cast<double>(run.hand),
          static_cast<double>(run.late_steps), static_cast<double>(run.recorded_steps), static_cast<double>(viewers)}) {
        append_f32(bytes, number);
    }
    end_part(bytes, begin);
}

void append_forces(Bytes& bytes, std::span<const ForceView> forces) {
    const std::size_t begin = begin_part(bytes, PartKind::ContactForces, 0, forces.size());
    for (const ForceView& force : forces) {
        append_f32(bytes, force.point);
        append_f32(bytes, force.force);
        append_u32(bytes, force.body);
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
                              {"mask_radius", description.mask_radius},
                              {"force_scale", description.force_scale},
                              {"ground", nullptr},
                              {"version", HAPTIC_VERSION},
                              {"groups", description.groups.size()},
                              {"links", description.links.size()},
                              {"bodies", nlohmann::json::array()},
                              {"parameters", nlohmann::json::array()}};
    // Members that need a loop or a condition.
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
        message["parameters"].push_back(parameter_json(parameter));
    }
    // Names from a scene file need not be valid UTF-8.
    return message.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

Bytes geometry_message(const SceneDescription& description, std::uint32_t scene) {
    Bytes bytes;
    append_u32(bytes, static_cast<std::uint32_t>(MessageKind::Geometry));
    append_u32(bytes, scene);
    // Triangles of the bodies, then of the tool.
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
    // Per particle: the ellipsoid's semi-axes, then its orientation.
    for (const Vec3& semi_axes : description.semi_axes) {
        append_f32(bytes, semi_axes);
    }
    for (const Quat& axes : description.ellipsoid_axes) {
        append_f32(bytes, axes);
    }
    // Shape-matching groups and links.
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
    // Sort the triangles by their sorted vertices, so that repetitions become neighbours; ties keep the original order.
    std::vector<std::pair<Triangle, std::size_t>> sorted;
    sorted.reserve(triangles.size());
    for (std::size_t k = 0; k < triangles.size(); ++k) {
        Triangle vertices = triangles[k];
        std::sort(vertices.begin(), vertices.end());
        sorted.emplace_back(vertices, k);
    }
    std::sort(sorted.begin(), sorted.end());
    // Mark all but the first of each run of equal triangles.
    std::vector<bool> repeats(triangles.size(), false);
    for (std::size_t k = 1; k < sorted.size(); ++k) {
        repeats[sorted[k].second] = sorted[k].first == sorted[k - 1].first;
    }
    // Keep the others in their original order.
    std::vector<Triangle> faces;
    for (std::size_t k = 0; k < triangles.size(); ++k) {
        if (!repeats[k]) {
            faces.push_back(triangles[k]);
        }
    }
    return faces;
}

std::array<std::int8_t, 2> octahedral(const Vec3& normal) noexcept {
    const double norm = std::abs(normal.x) + std::abs(normal.y) + std::abs(normal.z);
    // Project onto the octahedron |x| + |y| + |z| = 1 and drop z.
    if (!(norm > 0.0) || !std::isfinite(norm)) {
        return {0, 0};
    }
    // u and v are the projected coordinates.
    double u = normal.x / norm;
    double v = normal.y / norm;
    // Fold the lower half over the upper one.
    if (normal.z < 0.0) {
        const double folded = std::copysign(1.0 - std::abs(v), u);
        v = std::copysign(1.0 - std::abs(u), v);
        u = folded;
    }
    return {to_fixed_point<std::int8_t>(u), to_fixed_point<std::int8_t>(v)};
}

void append_frame_header(Bytes& message, const EncodedSnapshot& snapshot, std::uint32_t scene, std::uint32_t parts) {
    append_u32(message, static_cast<std::uint32_t>(MessageKind::Frame));
    append_u32(message, scene);
    append(message, snapshot.time);
    append(message, static_cast<double>(snapshot.step));
    append_u32(message, snapshot.flags);
    append_u32(message, parts);
}

SnapshotEncoder::SnapshotEncoder(const SceneDescription& description) : parameters_(description.parameters.size()) {
    for (const BodyDescription& body : description.bodies) {
        // Each body has a surface and particles of its own.
        surfaces_.push_back({body.first_vertex, body.vertices, single_faces(body.triangles), {}});
        particles_.push_back({body.first_particle, body.particles, {}, {}});
    }
    surfaces_.push_back({0, description.tool_vertices, single_faces(description.tool_triangles), {}});
    encoded_.surfaces.resize(surfaces_.size());
    encoded_.particles.resize(particles_.size());
}

void SnapshotEncoder::encode(const SceneSnapshot& snapshot, bool particles_watched, std::size_t viewers) {
    encoded_.time = snapshot.time;
    encoded_.step = snapshot.step;
    encoded_.flags = flags_of(snapshot);
    // Surfaces: the bodies, then the tool.
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
    encode_remaining(snapshot, viewers);
}

void SnapshotEncoder::encode_surface(std::size_t k, PartKind kind, std::span<const Vec3> vertices) {
    Surface& surface = surfaces_[k];
    EncodedPart& part = encoded_.surfaces[k];
    // An unchanged surface keeps its version and its bytes.
    if (vertices.empty() || std::equal(vertices.begin(), vertices.end(), surface.encoded_vertices.begin(),
                                       surface.encoded_vertices.end())) {
        return;
    }
    surface.encoded_vertices.assign(vertices.begin(), vertices.end());
    // Normals and the box that the positions are quantized in.
    add_face_normals(surface.faces, vertices, normals_);
    const Box box = bounding_box(vertices);
    // Write the box, then 8 bytes per vertex: u16 x 3 position, i8 x 2 normal.
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
            append(part.bytes, quantize(vertices[v][axis], box.origin[a], box.size[a]));
        }
        for (const std::int8_t number : octahedral(normals_[v])) {
            append(part.bytes, number);
        }
    }
    end_part(part.bytes, begin);
}

void SnapshotEncoder::encode_particles(std::size_t k, std::span<const Vec3> positions,
                                       std::span<const Quat> orientations) {
    Particles& body = particles_[k];
    EncodedPart& part = encoded_.particles[k];
    if (positions.empty() ||
        (std::equal(positions.begin(), positions.end(), body.encoded_positions.begin(), body.encoded_positions.end()) &&
         std::equal(orientations.begin(), orientations.end(), body.encoded_orientations.begin(),
                    body.encoded_orientations.end()))) {
        return;
    }
    body.encoded_positions.assign(positions.begin(), positions.end());
    body.encoded_orientations.assign(orientations.begin(), orientations.end());
    // Write 20 bytes per particle: f32 x 3 position, i16 x 4 orientation.
    ++part.version;
    part.bytes.clear();
    const std::size_t begin = begin_part(part.bytes, PartKind::Particles, k, positions.size());
    for (std::size_t p = 0; p < positions.size(); ++p) {
        append_f32(part.bytes, positions[p]);
        const Quat& q = orientations[p];
        for (const double number : {q.w, q.x, q.y, q.z}) {
            append(part.bytes, to_fixed_point<std::int16_t>(number));
        }
    }
    end_part(part.bytes, begin);
}

void SnapshotEncoder::encode_remaining(const SceneSnapshot& snapshot, std::size_t viewers) {
    // Contact planes, sent only to subscribed viewers.
    encoded_.planes.clear();
    std::size_t begin = begin_part(encoded_.planes, PartKind::Planes, 0, snapshot.planes.size());
    for (const PlaneView& plane : snapshot.planes) {
        append_f32(encoded_.planes, plane.normal);
        append_f32(encoded_.planes, plane.offset);
        append_f32(encoded_.planes, plane.velocity);
        append_u32(encoded_.planes, plane.proxy);
        append_u32(encoded_.planes, plane.touches ? 1 : 0);
    }
    end_part(encoded_.planes, begin);

    // Proxies, hand, parameters and contact forces, which go to every viewer.
    encoded_.remaining.clear();
    begin = begin_part(encoded_.remaining, PartKind::Proxies, 0, snapshot.proxies.size());
    for (const ProxyView& proxy : snapshot.proxies) {
        append_f32(encoded_.remaining, proxy.position);
        append_f32(encoded_.remaining, proxy.goal);
        append_u32(encoded_.remaining, (proxy.touches ? 1U : 0U) | (proxy.sticks ? 2U : 0U));
        append_f32(encoded_.remaining, proxy.radius);
    }
    end_part(encoded_.remaining, begin);
    append_hand(encoded_.remaining, snapshot, viewers);
    begin = begin_part(encoded_.remaining, PartKind::Parameters, 0, parameters_);
    for (std::size_t k = 0; k < parameters_; ++k) {
        append_f32(encoded_.remaining, snapshot.run.parameters[k]);
    }
    end_part(encoded_.remaining, begin);
    append_forces(encoded_.remaining, snapshot.forces);
}

}  // namespace haptic::sim::view
