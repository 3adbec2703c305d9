#include "haptic/sim/solver.hpp"

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <stdexcept>
#include <string>

#include "haptic/sim/rotation.hpp"

namespace haptic::sim {
namespace {

void check(const SolverSettings& s) {
    const auto refuse = [](const std::string& why) { throw std::invalid_argument("solver: " + why); };
    if (!(s.step > 0.0) || !std::isfinite(s.step)) {
        refuse("step must be positive");
    }
    if (s.substeps < 1 || s.iterations < 0 || s.rotation_iterations < 1) {
        refuse("needs at least one sub-step and one rotation iteration, and no negative number of iterations");
    }
    if (!(s.drag >= 0.0) || !(s.drag * s.step < 1.0)) {
        refuse("drag must be at least 0 and less than 1 / step");
    }
    if (!(s.settling >= 0.0) || !(s.settling * s.step <= 1.0)) {
        refuse("settling must be at least 0 and at most 1 / step");
    }
}

constexpr std::size_t kMostColours = 4096;

/// Greedy colouring: constraints in order, each with the first colour that none of its particles has.
/// @return the order in which to project, colour by colour, and the number of colours.
struct Colouring {
    std::vector<std::uint32_t> order;
    std::size_t colours = 0;
};

template <class Particles>
Colouring colour(std::size_t constraints, std::size_t particles, const Particles& for_each_particle) {
    std::vector<std::vector<bool>> used;  // per colour, per particle
    std::vector<std::vector<std::uint32_t>> of_colour;
    for (std::uint32_t c = 0; c < constraints; ++c) {
        std::size_t choice = 0;
        for (; choice < used.size(); ++choice) {
            bool clash = false;
            for_each_particle(c, [&](std::uint32_t p) { clash = clash || used[choice][p]; });
            if (!clash) {
                break;
            }
        }
        if (choice == used.size()) {
            if (choice == kMostColours) {
                throw std::invalid_argument("solver: a particle is in too many constraints");
            }
            used.emplace_back(particles, false);
            of_colour.emplace_back();
        }
        for_each_particle(c, [&](std::uint32_t p) { used[choice][p] = true; });
        of_colour[choice].push_back(c);
    }
    Colouring result;
    result.colours = used.size();
    for (const std::vector<std::uint32_t>& same : of_colour) {
        result.order.insert(result.order.end(), same.begin(), same.end());
    }
    return result;
}

/// a += scale * p q^T, where the matrix is stored by columns.
void add_outer(Mat3& a, double scale, const Vec3& p, const Vec3& q) {
    const Vec3 sp = scale * p;
    a[0] += sp * q.x;
    a[1] += sp * q.y;
    a[2] += sp * q.z;
}

Vec3 centre_of_mass(const ParticleModel& model) {
    double mass = 0.0;
    Vec3 sum(0.0);
    for (std::size_t i = 0; i < model.size(); ++i) {
        mass += model.mass[i];
        sum += model.mass[i] * model.position[i];
    }
    return sum / mass;
}

/// sum m p x (T q), given A = sum m p q^T: the axial vector of A T^T.
Vec3 torque_of(const Mat3& a, const Mat3& t) {
    const Mat3 b = a * glm::transpose(t);
    return {b[2][1] - b[1][2], b[0][2] - b[2][0], b[1][0] - b[0][1]};
}

}  // namespace

ParticleSolver::ParticleSolver(const ParticleModel& model, const SolverSettings& settings) : settings_(settings) {
    check(settings);
    model.check();
    for (const std::uint8_t pin : model.pinned) {
        free_ = free_ && pin == 0;
    }
    order_groups(model);
    order_links(model);
    next_.resize(model.size());
    predicted_.resize(model.size());
    previous_.resize(model.size());
    rotation_.resize(model.size());
}

void ParticleSolver::order_groups(const ParticleModel& model) {
    const Colouring colouring = colour(model.groups.size(), model.size(), [&](std::uint32_t g, const auto& visit) {
        for (const std::uint32_t p : model.groups[g].members) {
            visit(p);
        }
    });
    group_colours_ = colouring.colours;
    for (const std::uint32_t g : colouring.order) {
        const Group& group = model.groups[g];
        double mass = 0.0;
        Vec3 centroid(0.0);
        for (const std::uint32_t p : group.members) {
            mass += model.mass[p];
            centroid += model.mass[p] * model.rest_position[p];
        }
        centroid /= mass;
        groups_.push_back({group.centre, static_cast<std::uint32_t>(members_.size()),
                           static_cast<std::uint32_t>(group.members.size()), group.stiffness, 1.0 / mass});
        for (const std::uint32_t p : group.members) {
            members_.push_back({p, model.mass[p], 0.2 * model.mass[p] * model.radius[p] * model.radius[p],
                                model.rest_position[p] - centroid});
        }
    }
}

void ParticleSolver::order_links(const ParticleModel& model) {
    const Colouring colouring = colour(model.links.size(), model.size(), [&](std::uint32_t l, const auto& visit) {
        visit(model.links[l].first);
        visit(model.links[l].second);
    });
    link_colours_ = colouring.colours;
    const auto inverse_mass = [&](std::uint32_t p) { return model.pinned[p] != 0 ? 0.0 : 1.0 / model.mass[p]; };
    for (const std::uint32_t l : colouring.order) {
        const Link& link = model.links[l];
        const double first = inverse_mass(link.first);
        const double second = inverse_mass(link.second);
        if (first + second > 0.0) {
            links_.push_back({link.first, link.second, link.rest_length, link.stiffness * first / (first + second),
                              link.stiffness * second / (first + second)});
        }
    }
}

void ParticleSolver::step(ParticleModel& model, std::span<const Vec3> force) {
    const double h = settings_.step / settings_.substeps;
    for (int s = 0; s < settings_.substeps; ++s) {
        predict(model, force, h);
        for (int i = 0; i < settings_.iterations; ++i) {
            sweep(model, i % 2 == 0);  // there and back, so that no direction of the order is preferred
        }
        update(model, h);
    }
}

void ParticleSolver::predict(ParticleModel& model, std::span<const Vec3> force, double h) {
    const double keep = 1.0 - h * settings_.drag;
    for (std::size_t i = 0; i < model.size(); ++i) {
        previous_[i] = model.orientation[i];
        if (model.pinned[i] != 0) {
            predicted_[i] = Vec3(0.0);
            next_[i] = model.position[i];
            rotation_[i] = to_matrix(model.orientation[i]);
            continue;
        }
        Vec3 v = keep * model.velocity[i] + h * settings_.gravity;
        if (!force.empty()) {
            v += (h / model.mass[i]) * force[i];
        }
        predicted_[i] = v;
        next_[i] = model.position[i] + h * v;
        model.orientation[i] = turned(model.orientation[i], h * keep * model.angular_velocity[i]);
        rotation_[i] = to_matrix(model.orientation[i]);
    }
}

void ParticleSolver::sweep(ParticleModel& model, bool forward) {
    const std::size_t links = links_.size();
    for (std::size_t k = 0; k < links; ++k) {
        project_link(links_[forward ? k : links - 1 - k]);
    }
    const std::size_t groups = groups_.size();
    for (std::size_t k = 0; k < groups; ++k) {
        project_group(model, groups_[forward ? k : groups - 1 - k]);
    }
}

void ParticleSolver::project_link(const OrderedLink& link) {
    Vec3& a = next_[link.first];
    Vec3& b = next_[link.second];
    const Vec3 between = b - a;
    const double length = std::sqrt(glm::dot(between, between));
    if (length > 0.0) {  // two particles in one place have no direction in which to part
        const Vec3 correction = between * (1.0 - link.rest_length / length);
        a += link.first_share * correction;
        b -= link.second_share * correction;
    }
}

void ParticleSolver::project_group(ParticleModel& model, const OrderedGroup& group) {
    const std::span<const Member> members(&members_[group.first], group.count);
    Vec3 centroid(0.0);
    for (const Member& m : members) {
        centroid += m.mass * next_[m.particle];
    }
    centroid *= group.inverse_mass;

    Mat3 moment(0.0);   // sum m p q^T
    Mat3 spin(0.0);     // sum m r^2 / 5 R
    Mat3 scatter(0.0);  // sum m p p^T
    for (const Member& m : members) {
        const Vec3 p = next_[m.particle] - centroid;
        add_outer(moment, m.mass, p, m.rest_offset);
        add_outer(scatter, m.mass, p, p);
        spin += m.spin_mass * rotation_[m.particle];
    }
    const Quat fit = extract_rotation(moment + spin, model.orientation[group.centre], settings_.rotation_iterations);
    const Mat3 rotation = to_matrix(fit);
    const Vec3 turn = solve_inertia(scatter, torque_of(moment, rotation));
    for (const Member& m : members) {
        if (model.pinned[m.particle] == 0) {
            const Vec3 p = next_[m.particle] - centroid;
            next_[m.particle] += group.stiffness * (rotation * m.rest_offset - p - glm::cross(turn, p));
        }
    }
    if (model.pinned[group.centre] == 0) {
        model.orientation[group.centre] = fit;
        rotation_[group.centre] = rotation;
    }
}

void ParticleSolver::update(ParticleModel& model, double h) {
    for (std::size_t i = 0; i < model.size(); ++i) {
        if (model.pinned[i] != 0) {
            model.velocity[i] = Vec3(0.0);
            model.angular_velocity[i] = Vec3(0.0);
            continue;
        }
        model.velocity[i] = (next_[i] - model.position[i]) / h;
        model.angular_velocity[i] = turn_between(previous_[i], model.orientation[i]) / h;
    }
    if (free_ && settings_.keep_angular_momentum) {
        restore_angular_momentum(model, h);
    }
    model.position.swap(next_);
    if (settings_.settling > 0.0) {
        settle(model, h);
    }
}

void ParticleSolver::restore_angular_momentum(ParticleModel& model, double h) {
    const Vec3 centre = centre_of_mass(model);
    Vec3 lost(0.0);
    Mat3 scatter(0.0);
    for (std::size_t i = 0; i < model.size(); ++i) {
        const Vec3 p = model.position[i] - centre;
        lost += model.mass[i] * glm::cross(p, predicted_[i] - model.velocity[i]);
        add_outer(scatter, model.mass[i], p, p);
    }
    const Vec3 rate = solve_inertia(scatter, lost);
    for (std::size_t i = 0; i < model.size(); ++i) {
        const Vec3 dv = glm::cross(rate, model.position[i] - centre);
        model.velocity[i] += dv;
        next_[i] += h * dv;
    }
}

void ParticleSolver::settle(ParticleModel& model, double h) const {
    const Vec3 centre = centre_of_mass(model);
    double mass = 0.0;
    Vec3 linear(0.0);
    Vec3 angular(0.0);
    Mat3 scatter(0.0);
    for (std::size_t i = 0; i < model.size(); ++i) {
        const Vec3 p = model.position[i] - centre;
        mass += model.mass[i];
        linear += model.mass[i] * model.velocity[i];
        angular += model.mass[i] * glm::cross(p, model.velocity[i]);
        add_outer(scatter, model.mass[i], p, p);
    }
    linear /= mass;
    const Vec3 rate = solve_inertia(scatter, angular);
    const double part = h * settings_.settling;
    for (std::size_t i = 0; i < model.size(); ++i) {
        if (model.pinned[i] == 0) {
            const Vec3 rigid = linear + glm::cross(rate, model.position[i] - centre);
            model.velocity[i] += part * (rigid - model.velocity[i]);
        }
    }
}

}  // namespace haptic::sim
