#include "haptic/sim/particles.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <stdexcept>
#include <string>

namespace haptic::sim {
namespace {

[[noreturn]] void refuse(const char* what, std::size_t index, const std::string& why) {
    throw std::invalid_argument("particle model: " + std::string(what) + " " + std::to_string(index) + " " + why);
}

bool finite(const Vec3& v) {
    return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

bool in_unit_interval(double value) {
    return value >= 0.0 && value <= 1.0;
}

void check_group(const ParticleModel& model, std::size_t index) {
    const Group& group = model.groups[index];
    std::vector<std::uint32_t> members = group.members;
    std::sort(members.begin(), members.end());
    if (members.empty() || members.back() >= model.size()) {
        refuse("group", index, "has no members, or one that does not exist");
    }
    if (std::adjacent_find(members.begin(), members.end()) != members.end()) {
        refuse("group", index, "has a member twice");
    }
    if (!std::binary_search(members.begin(), members.end(), group.centre)) {
        refuse("group", index, "does not contain its centre");
    }
    if (!in_unit_interval(group.stiffness)) {
        refuse("group", index, "has a stiffness outside 0..1");
    }
}

}  // namespace

void ParticleModel::add(const Vec3& where, double particle_mass, double particle_radius) {
    rest_position.push_back(where);
    mass.push_back(particle_mass);
    radius.push_back(particle_radius);
    pinned.push_back(0);
    position.push_back(where);
    velocity.emplace_back(0.0);
    orientation.emplace_back(1.0, 0.0, 0.0, 0.0);
    angular_velocity.emplace_back(0.0);
}

void ParticleModel::check() const {
    const std::size_t n = size();
    for (const std::size_t other : {rest_position.size(), mass.size(), radius.size(), pinned.size(), velocity.size(),
                                    orientation.size(), angular_velocity.size()}) {
        if (other != n) {
            throw std::invalid_argument("particle model: arrays of different lengths");
        }
    }
    for (std::size_t i = 0; i < n; ++i) {
        if (!(mass[i] > 0.0) || !std::isfinite(mass[i]) || !(radius[i] >= 0.0) || !std::isfinite(radius[i])) {
            refuse("particle", i, "needs a positive mass and a radius of at least 0");
        }
        if (!finite(rest_position[i])) {
            refuse("particle", i, "has a rest position that is not finite");
        }
    }
    if (!is_finite(*this)) {
        throw std::invalid_argument("particle model: state is not finite");
    }
    for (std::size_t g = 0; g < groups.size(); ++g) {
        check_group(*this, g);
    }
    for (std::size_t l = 0; l < links.size(); ++l) {
        const Link& link = links[l];
        if (link.first >= n || link.second >= n || link.first == link.second) {
            refuse("link", l, "does not join two particles");
        }
        if (!(link.rest_length >= 0.0) || !std::isfinite(link.rest_length) || !in_unit_interval(link.stiffness)) {
            refuse("link", l, "needs a rest length of at least 0 and a stiffness in 0..1");
        }
    }
}

Vec3 linear_momentum(const ParticleModel& model) {
    Vec3 sum(0.0);
    for (std::size_t i = 0; i < model.size(); ++i) {
        sum += model.mass[i] * model.velocity[i];
    }
    return sum;
}

Vec3 angular_momentum(const ParticleModel& model) {
    Vec3 sum(0.0);
    for (std::size_t i = 0; i < model.size(); ++i) {
        sum += model.mass[i] * glm::cross(model.position[i], model.velocity[i]);
    }
    return sum;
}

double kinetic_energy(const ParticleModel& model) {
    double sum = 0.0;
    for (std::size_t i = 0; i < model.size(); ++i) {
        sum += 0.5 * model.mass[i] * glm::dot(model.velocity[i], model.velocity[i]);
    }
    return sum;
}

bool is_finite(const ParticleModel& model) {
    // 0 * x is 0 for a finite x and not a number otherwise, so one test at the end serves, and the loop has no branch.
    double sum = 0.0;
    for (std::size_t i = 0; i < model.size(); ++i) {
        const Vec3& x = model.position[i];
        const Vec3& v = model.velocity[i];
        const Vec3& w = model.angular_velocity[i];
        const Quat& q = model.orientation[i];
        sum += 0.0 * x.x + 0.0 * x.y + 0.0 * x.z + 0.0 * v.x + 0.0 * v.y + 0.0 * v.z + 0.0 * w.x + 0.0 * w.y +
               0.0 * w.z + 0.0 * q.w + 0.0 * q.x + 0.0 * q.y + 0.0 * q.z;
    }
    return std::isfinite(sum);
}

}  // namespace haptic::sim
