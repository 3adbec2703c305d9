#include "model/model_file.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <optional>
#include <span>
#include <stdexcept>
#include <vector>

#include "haptic/numeric.hpp"
#include "haptic/sim/model_builder.hpp"
#include "haptic/sim/skin.hpp"
#include "haptic/text_file.hpp"
#include "model/model_ranges.hpp"

namespace haptic::sim {
namespace {

constexpr const char* kExplanation =
    R"(# Particles of a deformable body, written by host-sim model. A scene reads them with [model] particles = "THIS FILE".
# Units: m, kg, s. Frame: that of the mesh before the scene places it. Particles count from 0, in the order of their tables.
# There are no skinning weights: they are computed from the particles' positions when the file is read.
#
# [[particle]]
#   position     rest position
#   mass         kg
#   radius       of the solid ball with the particle's own inertia: weight of its orientation in shape matching
#   semi_axes    of the ellipsoid with which other bodies collide; [0, 0, 0]: no collisions
#   axes         (w, x, y, z), unit: orientation of the ellipsoid
#   fixed        true: it does not move, except by a [[motion]]
#   neighbours   other members of its shape-matching group; without this key the particle has no group
#   stiffness    0 .. 1 of that group: 0 limp, 1 rigid
#   compliance   s^2 of that group: 0, or displacement of a member from its goal per force per mass (m/s^2)
# [[link]]       particles = [a, b]; stiffness 0 .. 1; compliance in m/N; rest_length: default is their distance
# [[motion]]     particles = [...], all fixed; times = [0.0, ...] in s; offsets = [x, y, z for each time]; repeat

)";

/// Shortest text that reads back as the same double, with a point or exponent, so that TOML reads a float.
std::string to_toml(double value) {
    std::array<char, 40> text{};
    const auto end = std::to_chars(text.data(), text.data() + text.size(), value).ptr;
    std::string result(text.data(), end);
    if (result.find_first_of(".e") == std::string::npos) {
        result += ".0";
    }
    return result;
}

std::string to_toml(std::span<const double> values) {
    std::string text = "[";
    for (const double value : values) {
        text += (text.size() > 1 ? ", " : "") + to_toml(value);
    }
    return text + "]";
}

std::string to_toml(const Vec3& v) {
    return to_toml(std::array{v.x, v.y, v.z});
}

std::string to_toml(std::span<const std::uint32_t> indices) {
    std::string text = "[";
    for (const std::uint32_t index : indices) {
        text += (text.size() > 1 ? ", " : "") + std::to_string(index);
    }
    return text + "]";
}

void write_particle(std::string& out, const ParticleModel& model, std::uint32_t i, const Group* group) {
    const Quat& q = model.axes[i];
    out += "[[particle]]  # " + std::to_string(i) + "\nposition = " + to_toml(model.rest_position[i]) +
           "\nmass = " + to_toml(model.mass[i]) + "\nradius = " + to_toml(model.radius[i]) +
           "\nsemi_axes = " + to_toml(model.semi_axes[i]) + "\naxes = " + to_toml(std::array{q.w, q.x, q.y, q.z}) +
           "\n";
    if (model.pinned[i] != 0) {
        out += "fixed = true\n";
    }
    if (group != nullptr) {
        std::vector<std::uint32_t> neighbours = group->members;
        std::erase(neighbours, i);
        std::sort(neighbours.begin(), neighbours.end());
        out += "neighbours = " + to_toml(neighbours) + "\nstiffness = " + to_toml(group->stiffness) + "\n";
        if (group->compliance > 0.0) {
            out += "compliance = " + to_toml(group->compliance) + "\n";
        }
    }
    out += "\n";
}

class ModelReader {
  public:
    explicit ModelReader(const Config& config) : config_(config) {}

    DeformableBody read() {
        DeformableBody body;
        body.name = config_.text("name", "model");
        count_ = config_.tables("particle");
        if (count_ == 0 || count_ > BuilderSettings::kMaxParticles) {
            config_.fail("particle", "needs 1 to " + std::to_string(BuilderSettings::kMaxParticles) +
                                         " [[particle]] tables, has " + std::to_string(count_));
        }
        for (std::size_t i = 0; i < count_; ++i) {
            read_particle("particle." + std::to_string(i), static_cast<std::uint32_t>(i), body.particles);
        }
        for (std::size_t k = 0; k < config_.tables("link"); ++k) {
            read_link("link." + std::to_string(k), body.particles);
        }
        for (std::size_t k = 0; k < config_.tables("motion"); ++k) {
            body.motions.push_back(read_motion("motion." + std::to_string(k), body.particles));
        }
        config_.reject_unknown();
        return body;
    }

  private:
    void require(const std::string& key, const char* what) const {
        if (!config_.has(key)) {
            config_.fail(key, std::string("is missing: ") + what);
        }
    }

    std::vector<std::uint32_t> read_indices(const std::string& key) const {
        std::vector<std::uint32_t> indices;
        for (const double value : config_.numbers(key, {}, {0.0, static_cast<double>(count_ - 1)})) {
            const auto index = static_cast<std::uint32_t>(value);
            if (static_cast<double>(index) != value) {
                config_.fail(key, "must contain particle indices, 0 to " + std::to_string(count_ - 1));
            }
            if (std::find(indices.begin(), indices.end(), index) != indices.end()) {
                config_.fail(key, "has particle " + std::to_string(index) + " twice");
            }
            indices.push_back(index);
        }
        return indices;
    }

    void read_particle(const std::string& table, std::uint32_t i, ParticleModel& model) const {
        require(table + ".position", "rest position, [x, y, z] in m");
        require(table + ".mass", "in kg");
        model.add(config_.vec3(table + ".position", Vec3(0.0), kPositions),
                  config_.number(table + ".mass", 0.0, kMasses), config_.number(table + ".radius", 0.0, kSizes));
        model.semi_axes[i] = config_.vec3(table + ".semi_axes", Vec3(0.0), kSizes);
        const std::vector<double> q = config_.numbers(table + ".axes", {1.0, 0.0, 0.0, 0.0}, {-1.1, 1.1});
        if (q.size() != 4 || std::abs(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3] - 1.0) > kUnitTolerance) {
            config_.fail(table + ".axes", "must be a unit quaternion (w, x, y, z)");
        }
        model.axes[i] = Quat(q[0], q[1], q[2], q[3]);  // not normalised, which might change a bit
        model.pinned[i] = config_.flag(table + ".fixed", false) ? 1 : 0;
        Group group{i, {i}};
        group.stiffness = config_.number(table + ".stiffness", group.stiffness, kUnitInterval);
        group.compliance = config_.number(table + ".compliance", group.compliance, kCompliances);
        if (!config_.has(table + ".neighbours")) {
            return;
        }
        for (const std::uint32_t neighbour : read_indices(table + ".neighbours")) {
            if (neighbour == i) {
                config_.fail(table + ".neighbours", "contains the particle itself, which is always in its group");
            }
            group.members.push_back(neighbour);
        }
        std::sort(group.members.begin(), group.members.end());
        model.groups.push_back(std::move(group));
    }

    void read_link(const std::string& table, ParticleModel& model) const {
        const std::vector<std::uint32_t> ends = read_indices(table + ".particles");
        if (ends.size() != 2) {
            config_.fail(table + ".particles", "must be the two particles of the link, for example [3, 7]");
        }
        const double distance = glm::length(model.rest_position[ends[1]] - model.rest_position[ends[0]]);
        Link link{ends[0], ends[1], config_.number(table + ".rest_length", distance, kSizes)};
        link.stiffness = config_.number(table + ".stiffness", link.stiffness, kUnitInterval);
        link.compliance = config_.number(table + ".compliance", link.compliance, kCompliances);
        model.links.push_back(link);
    }

    Motion read_motion(const std::string& table, const ParticleModel& model) const {
        Motion motion;
        motion.particles = read_indices(table + ".particles");
        for (const std::uint32_t i : motion.particles) {
            if (model.pinned[i] == 0) {
                config_.fail(table + ".particles", "has particle " + std::to_string(i) +
                                                       ", which is not fixed: particles of a motion need fixed = true");
            }
        }
        motion.times = config_.numbers(table + ".times", {}, {0.0, 1e6});
        const std::vector<double> offsets = config_.numbers(table + ".offsets", {}, kPositions);
        if (motion.times.empty() || motion.times.front() != 0.0 ||
            std::adjacent_find(motion.times.begin(), motion.times.end(), [](double a, double b) { return !(b > a); }) !=
                motion.times.end()) {
            config_.fail(table + ".times", "must start with 0 and increase strictly");
        }
        if (offsets.size() != 3 * motion.times.size()) {
            config_.fail(table + ".offsets", "needs three numbers (x, y, z) for each of the " +
                                                 std::to_string(motion.times.size()) + " times, has " +
                                                 std::to_string(offsets.size()));
        }
        for (std::size_t k = 0; k < motion.times.size(); ++k) {
            motion.offsets.emplace_back(offsets[3 * k], offsets[3 * k + 1], offsets[3 * k + 2]);
        }
        motion.repeat = config_.flag(table + ".repeat", false);
        return motion;
    }

    const Config& config_;
    std::size_t count_ = 0;
};

}  // namespace

std::string model_toml(const DeformableBody& body) {
    const ParticleModel& model = body.particles;
    std::string out = kExplanation;
    out += "name = \"" + body.name + "\"\n\n";
    std::vector<const Group*> group_about(model.size(), nullptr);
    for (const Group& group : model.groups) {
        group_about[group.centre] = &group;
    }
    for (std::uint32_t i = 0; i < model.size(); ++i) {
        write_particle(out, model, i, group_about[i]);
    }
    for (const Link& link : model.links) {
        out += "[[link]]\nparticles = " + to_toml(std::array{link.first, link.second}) +
               "\nrest_length = " + to_toml(link.rest_length) + "\nstiffness = " + to_toml(link.stiffness) + "\n";
        if (link.compliance > 0.0) {
            out += "compliance = " + to_toml(link.compliance) + "\n";
        }
        out += "\n";
    }
    for (const Motion& motion : body.motions) {
        std::vector<double> offsets;
        for (const Vec3& offset : motion.offsets) {
            offsets.insert(offsets.end(), {offset.x, offset.y, offset.z});
        }
        out += "[[motion]]\nparticles = " + to_toml(motion.particles) + "\ntimes = " + to_toml(motion.times) +
               "\noffsets = " + to_toml(offsets) + "\nrepeat = " + (motion.repeat ? "true" : "false") + "\n\n";
    }
    return out;
}

void save_model(const std::filesystem::path& file, const DeformableBody& body) {
    write_text(file, model_toml(body));
}

DeformableBody read_model_file(const Config& config, const TriangleMesh& mesh, double bridge,
                               const Progress& progress) {
    DeformableBody body = ModelReader(config).read();
    body.mesh = mesh;
    const bool one_to_one = body.particles.rest_position == mesh.vertices;
    body.skin =
        one_to_one ? skin_of_particles(mesh.vertices.size()) : build_skin(mesh, body.particles, bridge, progress);
    return body;
}

}  // namespace haptic::sim
