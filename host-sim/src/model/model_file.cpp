#include "model/model_file.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <glm/geometric.hpp>
#include <optional>
#include <span>
#include <stdexcept>
#include <vector>

#include <haptic/sim/model_builder.hpp>
#include <haptic/sim/skin.hpp>

namespace haptic::sim {
namespace {

constexpr Range kPositions{-1e4, 1e4};
constexpr Range kSizes{0.0, 1e4};
constexpr Range kMasses{1e-12, 1e6};
constexpr Range kUnitInterval{0.0, 1.0};
constexpr Range kCompliances{0.0, 1e6};
constexpr double kUnitTolerance = 1e-6;

constexpr const char* kExplanation =
    R"(# Particles of a deformable body: host-sim model wrote this, and a scene reads it: [model] particles = "THIS FILE".
# Units: m, kg, s. The frame is that of the mesh before the scene puts it in its place. Particles count from 0, in the
# order of their tables. Skinning weights are not here: they are made from the particles' places when this is read.
#
# [[particle]]
#   position     where it rests
#   mass         kg
#   radius       of the solid ball that has its own inertia: how much its orientation counts in a fit
#   semi_axes    of the ellipsoid that other bodies collide with; [0, 0, 0]: nothing does
#   axes         (w, x, y, z), unit: how the ellipsoid lies
#   fixed        true: nothing moves it, unless a [[motion]] does
#   neighbours   those that are matched to their rest shape together with it; a particle without this key has no group
#   stiffness    0 .. 1 of that group: 0 limp, 1 rigid
#   compliance   s^2 of that group: 0, or how far a force per mass (m/s^2) takes a member from its place
# [[link]]       particles = [a, b]; stiffness 0 .. 1; compliance in m/N; rest_length: their distance if left out
# [[motion]]     particles = [...], all fixed; times = [0.0, ...] in s; offsets = [x, y, z for each time]; repeat

)";

/// The shortest text that reads back to the same double, with a point or an exponent so that TOML takes it for one.
std::string shown(double value) {
    std::array<char, 40> text{};
    const auto end = std::to_chars(text.data(), text.data() + text.size(), value).ptr;
    std::string result(text.data(), end);
    if (result.find_first_of(".e") == std::string::npos) {
        result += ".0";
    }
    return result;
}

std::string shown(std::span<const double> values) {
    std::string text = "[";
    for (const double value : values) {
        text += (text.size() > 1 ? ", " : "") + shown(value);
    }
    return text + "]";
}

std::string shown(const Vec3& v) {
    return shown(std::array{v.x, v.y, v.z});
}

std::string shown(std::span<const std::uint32_t> indices) {
    std::string text = "[";
    for (const std::uint32_t index : indices) {
        text += (text.size() > 1 ? ", " : "") + std::to_string(index);
    }
    return text + "]";
}

void write_particle(std::string& out, const ParticleModel& model, std::uint32_t i, const Group* group) {
    const Quat& q = model.axes[i];
    out += "[[particle]]  # " + std::to_string(i) + "\nposition = " + shown(model.rest_position[i]) +
           "\nmass = " + shown(model.mass[i]) + "\nradius = " + shown(model.radius[i]) +
           "\nsemi_axes = " + shown(model.semi_axes[i]) + "\naxes = " + shown(std::array{q.w, q.x, q.y, q.z}) + "\n";
    if (model.pinned[i] != 0) {
        out += "fixed = true\n";
    }
    if (group != nullptr) {
        std::vector<std::uint32_t> neighbours = group->members;
        std::erase(neighbours, i);
        std::sort(neighbours.begin(), neighbours.end());
        out += "neighbours = " + shown(neighbours) + "\nstiffness = " + shown(group->stiffness) + "\n";
        if (group->compliance > 0.0) {
            out += "compliance = " + shown(group->compliance) + "\n";
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
        if (count_ == 0 || count_ > BuilderSettings::kMostParticles) {
            config_.fail("particle", "needs 1 to " + std::to_string(BuilderSettings::kMostParticles) +
                                         " tables, each headed [[particle]], has " + std::to_string(count_));
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
                config_.fail(key, "must hold numbers of particles, 0 to " + std::to_string(count_ - 1));
            }
            if (std::find(indices.begin(), indices.end(), index) != indices.end()) {
                config_.fail(key, "has particle " + std::to_string(index) + " twice");
            }
            indices.push_back(index);
        }
        return indices;
    }

    void read_particle(const std::string& table, std::uint32_t i, ParticleModel& model) const {
        require(table + ".position", "where the particle rests, [x, y, z] in m");
        require(table + ".mass", "in kg");
        model.add(config_.vec3(table + ".position", Vec3(0.0), kPositions),
                  config_.number(table + ".mass", 0.0, kMasses), config_.number(table + ".radius", 0.0, kSizes));
        model.semi_axes[i] = config_.vec3(table + ".semi_axes", Vec3(0.0), kSizes);
        const std::vector<double> q = config_.numbers(table + ".axes", {1.0, 0.0, 0.0, 0.0}, {-1.1, 1.1});
        if (q.size() != 4 || std::abs(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3] - 1.0) > kUnitTolerance) {
            config_.fail(table + ".axes", "must be a unit quaternion (w, x, y, z)");
        }
        model.axes[i] = Quat(q[0], q[1], q[2], q[3]);  // as it stands: normalising might change a bit
        model.pinned[i] = config_.flag(table + ".fixed", false) ? 1 : 0;
        Group group{i, {i}};
        group.stiffness = config_.number(table + ".stiffness", group.stiffness, kUnitInterval);
        group.compliance = config_.number(table + ".compliance", group.compliance, kCompliances);
        if (!config_.has(table + ".neighbours")) {
            return;
        }
        for (const std::uint32_t neighbour : read_indices(table + ".neighbours")) {
            if (neighbour == i) {
                config_.fail(table + ".neighbours", "has the particle itself, which is in its group anyway");
            }
            group.members.push_back(neighbour);
        }
        std::sort(group.members.begin(), group.members.end());
        model.groups.push_back(std::move(group));
    }

    void read_link(const std::string& table, ParticleModel& model) const {
        const std::vector<std::uint32_t> ends = read_indices(table + ".particles");
        if (ends.size() != 2) {
            config_.fail(table + ".particles", "must be the two particles that keep their distance, as in [3, 7]");
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
                config_.fail(table + ".particles",
                             "has particle " + std::to_string(i) +
                                 ", which is not fixed: a particle that is led needs fixed = true");
            }
        }
        motion.times = config_.numbers(table + ".times", {}, {0.0, 1e6});
        const std::vector<double> offsets = config_.numbers(table + ".offsets", {}, kPositions);
        if (motion.times.empty() || motion.times.front() != 0.0 ||
            std::adjacent_find(motion.times.begin(), motion.times.end(), [](double a, double b) { return !(b > a); }) !=
                motion.times.end()) {
            config_.fail(table + ".times", "must begin with 0 and increase from each element to the next");
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
        out += "[[link]]\nparticles = " + shown(std::array{link.first, link.second}) +
               "\nrest_length = " + shown(link.rest_length) + "\nstiffness = " + shown(link.stiffness) + "\n";
        if (link.compliance > 0.0) {
            out += "compliance = " + shown(link.compliance) + "\n";
        }
        out += "\n";
    }
    for (const Motion& motion : body.motions) {
        std::vector<double> offsets;
        for (const Vec3& offset : motion.offsets) {
            offsets.insert(offsets.end(), {offset.x, offset.y, offset.z});
        }
        out += "[[motion]]\nparticles = " + shown(motion.particles) + "\ntimes = " + shown(motion.times) +
               "\noffsets = " + shown(offsets) + "\nrepeat = " + (motion.repeat ? "true" : "false") + "\n\n";
    }
    return out;
}

void save_model(const std::filesystem::path& file, const DeformableBody& body) {
    std::ofstream out(file, std::ios::binary);
    out << model_toml(body);
    out.close();
    if (!out) {
        throw std::runtime_error(file.string() + ": cannot be written");
    }
}

DeformableBody read_model_file(const Config& config, const TriangleMesh& mesh, double bridge) {
    DeformableBody body = ModelReader(config).read();
    body.mesh = mesh;
    const bool one_to_one = body.particles.rest_position == mesh.vertices;
    body.skin = one_to_one ? skin_of_particles(mesh.vertices.size()) : build_skin(mesh, body.particles, bridge);
    return body;
}

}  // namespace haptic::sim
