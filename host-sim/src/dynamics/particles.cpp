#include "haptic/sim/particles.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <numeric>
#include <stdexcept>
#include <string>
#include <utility>

#include "haptic/numeric.hpp"

namespace haptic::sim {
namespace {

/// 0, or NaN where one of the numbers is not finite: 0 * x is. Without branches, several at a time.
double zero_times(const double* number, std::size_t count) {
    std::array<double, 8> sums{};
    std::size_t k = 0;
    for (; k + sums.size() <= count; k += sums.size()) {
        for (std::size_t j = 0; j < sums.size(); ++j) {
            sums[j] += 0.0 * number[k + j];
        }
    }
    double sum = 0.0;
    for (; k < count; ++k) {
        sum += 0.0 * number[k];
    }
    return std::accumulate(sums.begin(), sums.end(), sum);
}

[[noreturn]] void refuse(const char* what, std::size_t index, const std::string& why) {
    throw std::invalid_argument("particle model: " + std::string(what) + " " + std::to_string(index) + " " + why);
}

bool in_unit_interval(double value) {
    return value >= 0.0 && value <= 1.0;
}

void check_group(const ParticleModel& model, std::size_t index) {
    const Group& group = model.groups[index];
    std::vector<std::uint32_t> members = group.members;
    std::sort(members.begin(), members.end());
    if (members.empty() || members.back() >= model.size()) {
        refuse("group", index, "has no members or a member that does not exist");
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
    if (!(group.compliance >= 0.0) || !std::isfinite(group.compliance)) {
        refuse("group", index, "needs a compliance of at least 0");
    }
}

void check_element(const ParticleModel& model, std::size_t index) {
    const ElasticElement& element = model.elasticity.elements[index];
    const auto& members = element.members;
    if (members.size() != element.gradient.size() ||
        std::any_of(members.begin(), members.end(), [&](std::uint32_t p) { return p >= model.size(); }) ||
        std::find(members.begin(), members.end(), element.centre) == members.end()) {
        refuse("element", index, "needs a gradient per member, members that exist, and its centre among them");
    }
    const bool finite = std::all_of(element.gradient.begin(), element.gradient.end(),
                                    [](const Vec3& gradient) { return haptic::is_finite(gradient); });
    if (!finite || !(element.volume > 0.0) || !(element.shear_modulus > 0.0) || !(element.max_modulus > 0.0) ||
        !std::isfinite(element.volume * element.max_modulus) || !(element.damping >= 0.0)) {
        refuse("element", index, "needs finite gradients, positive volume and moduli, and damping of at least 0");
    }
}

void check_bodies(const ParticleModel& model) {
    std::size_t end = 0;
    for (std::size_t b = 0; b < model.bodies.size(); ++b) {
        if (model.bodies[b].begin != end || model.bodies[b].end <= end) {
            refuse("body", b, "is empty or does not start where the previous one ends");
        }
        end = model.bodies[b].end;
    }
    if (!model.bodies.empty() && end != model.size()) {
        refuse("body", model.bodies.size() - 1, "does not end with the last particle");
    }
}

}  // namespace

void ParticleModel::add(const Vec3& at, double particle_mass, double particle_radius) {
    rest_position.push_back(at);
    mass.push_back(particle_mass);
    radius.push_back(particle_radius);
    semi_axes.emplace_back(0.0);
    axes.emplace_back(1.0, 0.0, 0.0, 0.0);
    pinned.push_back(0);
    position.push_back(at);
    velocity.emplace_back(0.0);
    orientation.emplace_back(1.0, 0.0, 0.0, 0.0);
    angular_velocity.emplace_back(0.0);
    asleep.push_back(0);
}

void ParticleModel::append(const ParticleModel& other) {
    // A model without a list of bodies is one body.
    const auto first = static_cast<std::uint32_t>(size());
    const auto join = [](auto& to, const auto& from) { to.insert(to.end(), from.begin(), from.end()); };
    if (bodies.empty() && first > 0) {
        bodies.push_back({0, first});
    }
    // Per-particle arrays.
    join(rest_position, other.rest_position);
    join(mass, other.mass);
    join(radius, other.radius);
    join(semi_axes, other.semi_axes);
    join(axes, other.axes);
    join(pinned, other.pinned);
    join(position, other.position);
    join(velocity, other.velocity);
    join(orientation, other.orientation);
    join(angular_velocity, other.angular_velocity);
    join(asleep, other.asleep);
    // Indices of groups, links and bodies are shifted by the particles before.
    for (Group group : other.groups) {
        group.centre += first;
        for (std::uint32_t& member : group.members) {
            member += first;
        }
        groups.push_back(std::move(group));
    }
    for (Link link : other.links) {
        link.first += first;
        link.second += first;
        links.push_back(link);
    }
    for (ElasticElement element : other.elasticity.elements) {
        element.centre += first;
        for (std::uint32_t& member : element.members) {
            member += first;
        }
        elasticity.elements.push_back(std::move(element));
    }
    for (ElasticPair pair : other.elasticity.pairs) {
        pair.first += first;
        pair.second += first;
        elasticity.pairs.push_back(pair);
    }
    if (other.bodies.empty()) {
        bodies.push_back({first, static_cast<std::uint32_t>(size())});
    }
    for (const ParticleRange& body : other.bodies) {
        bodies.push_back({body.begin + first, body.end + first});
    }
}

void ParticleModel::check() const {
    // One element per particle in each array.
    const std::size_t n = size();
    for (const std::size_t other :
         {rest_position.size(), mass.size(), radius.size(), semi_axes.size(), axes.size(), pinned.size(),
          velocity.size(), orientation.size(), angular_velocity.size(), asleep.size()}) {
        if (other != n) {
            throw std::invalid_argument("particle model: arrays of different lengths");
        }
    }
    // Constants of the particles, then the state.
    for (std::size_t i = 0; i < n; ++i) {
        if (!(mass[i] > 0.0) || !std::isfinite(mass[i]) || !(radius[i] >= 0.0) || !std::isfinite(radius[i])) {
            refuse("particle", i, "needs a positive mass and a radius of at least 0");
        }
        if (!haptic::is_finite(rest_position[i])) {
            refuse("particle", i, "has a rest position that is not finite");
        }
        const Vec3& axis = semi_axes[i];
        if (!haptic::is_finite(axis) || !(axis.x >= 0.0 && axis.y >= 0.0 && axis.z >= 0.0)) {
            refuse("particle", i, "needs semi-axes of at least 0");
        }
    }
    if (!is_finite(*this)) {
        throw std::invalid_argument("particle model: state is not finite");
    }
    // Bodies and constraints refer to existing particles, with constants in range.
    check_bodies(*this);
    for (std::size_t g = 0; g < groups.size(); ++g) {
        check_group(*this, g);
    }
    for (std::size_t e = 0; e < elasticity.elements.size(); ++e) {
        check_element(*this, e);
    }
    for (std::size_t k = 0; k < elasticity.pairs.size(); ++k) {
        const ElasticPair& pair = elasticity.pairs[k];
        if (pair.first >= n || pair.second >= n || pair.first == pair.second || !std::isfinite(pair.stiffness)) {
            refuse("pair", k, "does not join two particles with a finite stiffness");
        }
    }
    for (std::size_t l = 0; l < links.size(); ++l) {
        const Link& link = links[l];
        if (link.first >= n || link.second >= n || link.first == link.second) {
            refuse("link", l, "does not join two particles");
        }
        if (!(link.rest_length >= 0.0) || !std::isfinite(link.rest_length) || !in_unit_interval(link.stiffness)) {
            refuse("link", l, "needs a rest length of at least 0 and a stiffness in 0..1");
        }
        if (!(link.compliance >= 0.0) || !std::isfinite(link.compliance)) {
            refuse("link", l, "needs a compliance of at least 0");
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

bool is_finite(const ParticleModel& model, std::size_t first, std::size_t count) {
    if (count == 0) {
        return true;
    }
    static_assert(sizeof(Vec3) == 3 * sizeof(double) && sizeof(Quat) == 4 * sizeof(double));
    return std::isfinite(
        zero_times(&model.position[first].x, 3 * count) + zero_times(&model.velocity[first].x, 3 * count) +
        zero_times(&model.angular_velocity[first].x, 3 * count) + zero_times(&model.orientation[first].x, 4 * count));
}

bool is_finite(const ParticleModel& model) {
    return is_finite(model, 0, model.size());
}

}  // namespace haptic::sim
