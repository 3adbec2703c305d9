#include "dynamics/elastic_bodies.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <limits>

#include "dynamics/rotation.hpp"

namespace haptic::sim {
namespace {

constexpr std::uint32_t kNotElastic = std::numeric_limits<std::uint32_t>::max();
// kappa per largest stress per strain. From 0.75 on the step is stable; 1 never overshoots.
constexpr double kBound = 1.0;
// Steps toward the rotation of an element, from that which its angular velocity predicts.
constexpr int kRotationSteps = 2;
constexpr std::size_t kCorners = 3;
// Ratio of areas: keeps the frame of a triangle without area finite.
constexpr double kSmallestArea = 1e-9;

double trace(const Mat3& m) noexcept {
    return m[0][0] + m[1][1] + m[2][2];
}

Mat3 symmetric_part(const Mat3& m) noexcept {
    return 0.5 * (m + glm::transpose(m));
}

void add_outer(Mat3& sum, const Vec3& x, const Vec3& b) noexcept {
    sum[0] += b.x * x;
    sum[1] += b.y * x;
    sum[2] += b.z * x;
}

}  // namespace

ElasticBodies::ElasticBodies(const ParticleModel& model)
    : first_neighbour_(model.size() + 1, 0), body_of_particle_(model.size(), kNotElastic), mass_(model.mass) {
    const Elasticity& elasticity = model.elasticity;
    // Bodies with elements.
    std::vector<ParticleRange> ranges = model.bodies;
    if (ranges.empty() && model.size() > 0) {
        ranges.push_back({0, static_cast<std::uint32_t>(model.size())});
    }
    std::vector<std::uint8_t> elastic(model.size(), 0);
    for (const ElasticElement& e : elasticity.elements) {
        elements_.push_back({.centre = e.centre,
                             .first = static_cast<std::uint32_t>(members_.size()),
                             .count = static_cast<std::uint32_t>(e.members.size()),
                             .volume = e.volume,
                             .shear = e.shear_modulus,
                             .lame = e.lame_modulus,
                             .damping = e.damping,
                             .spread = e.spread});
        // Axes of a triangle: along its first gradient, and across it.
        const bool triangle = e.members.size() == kCorners;
        const Vec3 along = triangle ? glm::normalize(e.gradient[0]) : Vec3(0.0);
        const Vec3 second = triangle ? e.gradient[1] - glm::dot(e.gradient[1], along) * along : Vec3(0.0);
        const Vec3 across = triangle ? glm::normalize(second) : Vec3(0.0);
        for (std::size_t k = 0; k < e.members.size(); ++k) {
            const Vec3& b = e.gradient[k];
            members_.push_back({e.members[k], triangle ? Vec3(glm::dot(b, along), glm::dot(b, across), 0.0) : b});
            elastic[e.members[k]] = 1;
        }
    }
    for (const ParticleRange& range : ranges) {
        if (elastic[range.begin] == 0) {
            continue;
        }
        Body body{.particles = range};
        for (std::uint32_t i = range.begin; i < range.end; ++i) {
            body_of_particle_[i] = static_cast<std::uint32_t>(bodies_.size());
            if (model.pinned[i] == 0) {
                body.free.push_back(i);
            }
        }
        bodies_.push_back(std::move(body));
    }
    // Pairs by particle: first counted, then filled in.
    for (const ElasticPair& pair : elasticity.pairs) {
        ++first_neighbour_[pair.first + 1];
        ++first_neighbour_[pair.second + 1];
    }
    for (std::size_t i = 0; i < model.size(); ++i) {
        first_neighbour_[i + 1] += first_neighbour_[i];
    }
    neighbours_.resize(2 * elasticity.pairs.size());
    std::vector<std::size_t> next(first_neighbour_.begin(), first_neighbour_.end() - 1);
    for (const ElasticPair& pair : elasticity.pairs) {
        neighbours_[next[pair.first]++] = {pair.second, pair.stiffness, pair.damping * pair.stiffness};
        neighbours_[next[pair.second]++] = {pair.first, pair.stiffness, pair.damping * pair.stiffness};
    }
    at_.resize(model.size());
    velocity_.resize(model.size());
    force_.resize(model.size());
    sides_.resize(model.size());
}

ParticleRange ElasticBodies::body_of(std::uint32_t particle) const noexcept {
    const std::uint32_t body = body_of_particle_[particle];
    return body == kNotElastic ? ParticleRange{} : bodies_[body].particles;
}

void ElasticBodies::prepare(double h) {
    if (h == h_) {
        return;
    }
    for (Body& body : bodies_) {
        factorise(body, h);
    }
    h_ = h;
}

void ElasticBodies::factorise(Body& body, double h) const {
    // Rows of the matrix: the free particles of the body.
    std::vector<std::uint32_t> row(body.particles.end - body.particles.begin, kNotElastic);
    for (std::uint32_t r = 0; r < body.free.size(); ++r) {
        row[body.free[r] - body.particles.begin] = r;
    }
    const auto row_of = [&](std::uint32_t particle) { return row[particle - body.particles.begin]; };
    std::vector<MatrixElement> lower;
    const auto add = [&](std::uint32_t p, std::uint32_t q, double value) {
        const std::uint32_t a = row_of(p);
        const std::uint32_t b = row_of(q);
        if (a != kNotElastic && b != kNotElastic && a >= b) {
            lower.push_back({a, b, value});
        }
    };
    for (const std::uint32_t i : body.free) {
        double diagonal = mass_[i] / (h * h);
        for (std::size_t k = first_neighbour_[i]; k < first_neighbour_[i + 1]; ++k) {
            const double stiffness = neighbours_[k].stiffness + neighbours_[k].viscosity / h;
            diagonal += stiffness;
            add(i, neighbours_[k].particle, -stiffness);
        }
        add(i, i, diagonal);
    }
    for (const Element& e : elements_) {
        if (e.centre < body.particles.begin || e.centre >= body.particles.end) {
            continue;
        }
        const double bulk = 2.0 * e.shear + trace(e.spread) * e.lame;
        const double kappa = kBound * bulk * e.volume * (1.0 + e.damping / h);
        const std::span<const Member> members(&members_[e.first], e.count);
        for (const Member& m : members) {
            for (const Member& other : members) {
                add(m.particle, other.particle, kappa * glm::dot(m.gradient, other.gradient));
            }
        }
    }
    body.factor = std::make_unique<StiffnessFactor>(body.free.size(), lower);
}

void ElasticBodies::add_solid_forces(const Element& element, Row* orientation) noexcept {
    const std::span<const Member> members(&members_[element.first], element.count);
    // F about the centre, so that it does not depend on where the body is.
    const Vec3 centre = at_[element.centre];
    Mat3 gradient(0.0);
    for (const Member& m : members) {
        add_outer(gradient, at_[m.particle] - centre, m.gradient);
    }
    // The rotation nearest to it, which the centre takes.
    Row& kept = orientation[element.centre];
    const Quat turn = extract_rotation(gradient, Quat(kept.number[0], kept.number[1], kept.number[2], kept.number[3]),
                                       kRotationSteps);
    kept = {{turn.w, turn.x, turn.y, turn.z}};
    const Mat3 rotation = to_matrix(turn);
    const Mat3 back = glm::transpose(rotation);
    // Strain and its rate, stress, and the force -V P b_i on each member.
    Mat3 strain = symmetric_part(back * gradient) - element.spread;
    if (element.damping > 0.0) {
        Mat3 rate(0.0);
        for (const Member& m : members) {
            add_outer(rate, velocity_[m.particle] - velocity_[element.centre], m.gradient);
        }
        strain += element.damping * symmetric_part(back * rate);
    }
    const Mat3 stress = 2.0 * element.shear * strain + element.lame * trace(strain) * element.spread;
    const Mat3 pull = -element.volume * rotation * stress;
    for (const Member& m : members) {
        force_[m.particle] += pull * m.gradient;
    }
}

void ElasticBodies::add_triangle_forces(const Element& element) noexcept {
    const std::span<const Member> members(&members_[element.first], element.count);
    // The columns of F along both axes of the triangle at rest; its gradients are in these axes.
    const Vec3 centre = at_[element.centre];
    Vec3 f0(0.0);
    Vec3 f1(0.0);
    for (const Member& m : members) {
        f0 += m.gradient.x * (at_[m.particle] - centre);
        f1 += m.gradient.y * (at_[m.particle] - centre);
    }
    // F = R U: U = (C + det(U) 1) / tr(U), the root of the symmetric 2 x 2 matrix C = F^T F.
    const double c00 = glm::dot(f0, f0);
    const double c01 = glm::dot(f0, f1);
    const double c11 = glm::dot(f1, f1);
    const double area = std::sqrt(std::max(c00 * c11 - c01 * c01, 0.0)) + kSmallestArea;
    const double sum = std::sqrt(c00 + c11 + 2.0 * area);
    const double u00 = (c00 + area) / sum;
    const double u01 = c01 / sum;
    const double u11 = (c11 + area) / sum;
    const double inverse = 1.0 / (u00 * u11 - u01 * u01);
    const Vec3 r0 = inverse * (u11 * f0 - u01 * f1);
    const Vec3 r1 = inverse * (u00 * f1 - u01 * f0);
    // Strain U - 1 and its rate, stress, and forces.
    double e00 = u00 - 1.0;
    double e01 = u01;
    double e11 = u11 - 1.0;
    if (element.damping > 0.0) {
        Vec3 v0(0.0);
        Vec3 v1(0.0);
        for (const Member& m : members) {
            v0 += m.gradient.x * (velocity_[m.particle] - velocity_[element.centre]);
            v1 += m.gradient.y * (velocity_[m.particle] - velocity_[element.centre]);
        }
        e00 += element.damping * glm::dot(r0, v0);
        e11 += element.damping * glm::dot(r1, v1);
        e01 += 0.5 * element.damping * (glm::dot(r0, v1) + glm::dot(r1, v0));
    }
    const double spread = element.lame * (e00 + e11);
    const double s00 = element.volume * (2.0 * element.shear * e00 + spread);
    const double s11 = element.volume * (2.0 * element.shear * e11 + spread);
    const double s01 = element.volume * 2.0 * element.shear * e01;
    const Vec3 p0 = s00 * r0 + s01 * r1;
    const Vec3 p1 = s01 * r0 + s11 * r1;
    for (const Member& m : members) {
        force_[m.particle] -= m.gradient.x * p0 + m.gradient.y * p1;
    }
}

void ElasticBodies::add_pair_forces(const Body& body) noexcept {
    for (const std::uint32_t i : body.free) {
        Vec3 sum(0.0);
        for (std::size_t k = first_neighbour_[i]; k < first_neighbour_[i + 1]; ++k) {
            const Neighbour& other = neighbours_[k];
            sum += other.stiffness * (at_[other.particle] - at_[i]) +
                   other.viscosity * (velocity_[other.particle] - velocity_[i]);
        }
        force_[i] += sum;
    }
}

void ElasticBodies::step(const ParticleModel& start, double drag_factor, Row* position, Row* orientation) noexcept {
    // x0, and M (y - x0) / h^2: the forces that led to the position y given.
    for (const Body& body : bodies_) {
        for (std::uint32_t i = body.particles.begin; i < body.particles.end; ++i) {
            const Vec3 given(position[i].number[0], position[i].number[1], position[i].number[2]);
            const bool pinned = start.pinned[i] != 0;
            velocity_[i] = pinned ? start.velocity[i] : drag_factor * start.velocity[i];
            at_[i] = pinned ? given : start.position[i] + h_ * velocity_[i];
            force_[i] = start.mass[i] / (h_ * h_) * (given - at_[i]);
        }
    }
    for (const Element& element : elements_) {
        if (element.count == kCorners) {
            add_triangle_forces(element);
        } else {
            add_solid_forces(element, orientation);
        }
    }
    for (Body& body : bodies_) {
        add_pair_forces(body);
        for (std::size_t r = 0; r < body.free.size(); ++r) {
            const Vec3& f = force_[body.free[r]];
            sides_[r] = {{f.x, f.y, f.z, 0.0}};
        }
        body.factor->solve({sides_.data(), body.free.size()});
        for (std::size_t r = 0; r < body.free.size(); ++r) {
            const Vec3& from = at_[body.free[r]];
            Row& to = position[body.free[r]];
            to.number[0] = from.x + sides_[r].number[0];
            to.number[1] = from.y + sides_[r].number[1];
            to.number[2] = from.z + sides_[r].number[2];
        }
    }
}

void ElasticBodies::respond(const ParticleRange& body, std::span<Row> columns) noexcept {
    Body& of = bodies_[body_of_particle_[body.begin]];
    for (std::size_t r = 0; r < of.free.size(); ++r) {
        sides_[r] = columns[of.free[r] - body.begin];
    }
    of.factor->solve({sides_.data(), of.free.size()});
    for (Row& column : columns) {
        column = {};
    }
    for (std::size_t r = 0; r < of.free.size(); ++r) {
        columns[of.free[r] - body.begin] = sides_[r];
    }
}

}  // namespace haptic::sim
