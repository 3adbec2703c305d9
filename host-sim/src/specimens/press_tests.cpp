#include "specimens/press_tests.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <stdexcept>
#include <string>

#include "dynamics/elastic_bodies.hpp"
#include "dynamics/rows.hpp"
#include "haptic/contact_problem.hpp"
#include "haptic/sim/block.hpp"
#include "haptic/sim/elasticity.hpp"
#include "haptic/sim/model_builder.hpp"
#include "haptic/sim/solver.hpp"
#include "simd/projection.hpp"
#include "specimens/relaxation.hpp"

namespace haptic::sim {
namespace {

// Vertices of the face per spacing of the particles. Fewer leave the face free to bulge into the sphere between them.
constexpr double kFaceVertices = 2.0;
// Contact radius, at most, per sqrt(R d): 1 on a half-space, 1.2 on a layer as thick as two contact radii, and that of
// the circle in which the sphere cuts the face at rest on a thin one.
constexpr double kWidestContactRadius = 1.4142;

/// A vertex of the upper face as a weighted mean of particles: x = offset + sum of weight times position.
struct FaceVertex {
    std::vector<std::uint32_t> particle;
    std::vector<double> weight;  // sums to 1
    Vec3 offset{0.0};            // m
    std::vector<double> answer;  // m/N, of all particles to a force on this vertex in a sub-step
};

/// The layer, from y = 0, where it is held, to its thickness.
struct Layer {
    ParticleModel model;
    std::vector<FaceVertex> face;
};

/// Precondition: a solid without flat elements, one about each particle.
FaceVertex face_vertex(const DeformableBody& body, const Elasticity& elasticity, std::size_t vertex) {
    std::vector<double> weight(body.particles.size(), 0.0);
    const SkinVertex& skin = body.skin[vertex];
    for (std::size_t k = 0; k < SkinVertex::kMax; ++k) {
        const ElasticElement& element =
            *std::find_if(elasticity.elements.begin(), elasticity.elements.end(),
                          [&](const ElasticElement& e) { return e.centre == skin.particle[k]; });
        const Vec3 arm = body.mesh.vertices[vertex] - body.particles.rest_position[skin.particle[k]];
        weight[skin.particle[k]] += skin.weight[k];
        for (std::size_t m = 0; m < element.members.size(); ++m) {
            weight[element.members[m]] += skin.weight[k] * glm::dot(element.gradient[m], arm);
        }
    }
    FaceVertex result;
    result.offset = body.mesh.vertices[vertex];
    for (std::uint32_t i = 0; i < weight.size(); ++i) {
        if (weight[i] != 0.0) {
            result.particle.push_back(i);
            result.weight.push_back(weight[i]);
            result.offset -= weight[i] * body.particles.rest_position[i];
        }
    }
    return result;
}

/// `reach`: m, vertices of the face up to this distance from its middle may touch the sphere.
Layer make_layer(const PressTest& test, double reach) {
    // The lowest particles are held. Half their spacing is below them.
    const double thickness = test.contact.thickness;
    const double spacing = std::cbrt(test.side * test.side * thickness / static_cast<double>(test.particles));
    const Vec3 size(test.side, thickness + 0.5 * spacing, test.side);
    const double cells = std::round(kFaceVertices * test.side / spacing);
    DeformableBody body;
    body.mesh = make_block_mesh({.size = size, .cells = static_cast<std::uint32_t>(cells)});
    for (Vec3& p : body.mesh.vertices) {
        p.y += thickness - 0.5 * size.y;
    }
    BuilderSettings settings;
    settings.particles =
        static_cast<std::size_t>(std::lround(static_cast<double>(test.particles) * size.y / thickness));
    settings.neighbours = test.neighbours;
    settings.mass = test.contact.material.density * size.x * size.y * size.z;
    body = build_body(body.mesh, settings);
    ParticleModel& model = body.particles;
    model.elasticity = make_solid(model, std::vector<SolidMaterial>(model.size(), test.contact.material));
    balance_surface(model, body.mesh, model.elasticity);
    model.groups.clear();
    for (std::size_t i = 0; i < model.size(); ++i) {
        model.pinned[i] = model.rest_position[i].y < 0.5 * spacing ? 1 : 0;
    }
    Layer layer;
    for (std::size_t j = 0; j < body.mesh.vertices.size(); ++j) {
        const Vec3& p = body.mesh.vertices[j];
        if (p.y > thickness - 0.25 * spacing && std::hypot(p.x, p.z) < reach) {
            layer.face.push_back(face_vertex(body, model.elasticity, j));
        }
    }
    layer.model = model;
    return layer;
}

/// The sphere, as contacts of the solver.
class RigidSphere final : public SolverContacts {
  public:
    RigidSphere(std::vector<FaceVertex>& face, double radius) : face_(face), radius_(radius) {}

    void move_to(const Vec3& centre) noexcept { centre_ = centre; }
    [[nodiscard]] std::size_t touching() const noexcept { return touching_; }
    /// N, on the sphere, at the end of the last sub-step.
    [[nodiscard]] const Vec3& force() const noexcept { return force_; }

    void begin(const ParticleModel& start, ElasticBodies& elastic, const MovingParticles& now, double h) override;
    void project(const ParticleModel& /*start*/, const MovingParticles& /*now*/, double /*h*/) override {}
    void finish(const ParticleModel& start, const MovingParticles& now, double h) override;

  private:
    std::vector<FaceVertex>& face_;
    double radius_;
    Vec3 centre_{0.0};
    Vec3 force_{0.0};
    std::size_t touching_ = 0;
    double answered_step_ = 0.0;  // s
    std::vector<double> answer_;  // m/N, of vertex to vertex
    std::vector<Vec3> normal_;    // per vertex, away from the sphere
    std::vector<double> depth_;   // m, per vertex, in the sphere
    ComplianceMatrix block_;
    ContactSolver solver_;
};

void RigidSphere::begin(const ParticleModel& start, ElasticBodies& elastic, const MovingParticles& /*now*/, double h) {
    if (answered_step_ == h) {
        return;
    }
    answered_step_ = h;
    // Displacements of all particles by a force on each vertex, four vertices at a time. A acts on x, y and z alike.
    const ParticleRange body{0, static_cast<std::uint32_t>(start.size())};
    std::vector<Row> columns;
    for (std::size_t first = 0; first < face_.size(); first += 4) {
        const std::size_t count = std::min<std::size_t>(4, face_.size() - first);
        columns.assign(start.size(), Row{});
        for (std::size_t k = 0; k < count; ++k) {
            const FaceVertex& vertex = face_[first + k];
            for (std::size_t m = 0; m < vertex.particle.size(); ++m) {
                columns[vertex.particle[m]].number[k] = vertex.weight[m];
            }
        }
        elastic.respond(body, columns);
        for (std::size_t k = 0; k < count; ++k) {
            std::vector<double>& answer = face_[first + k].answer;
            answer.resize(start.size());
            for (std::size_t i = 0; i < start.size(); ++i) {
                answer[i] = columns[i].number[k];
            }
        }
    }
    // Of each vertex to a force on each other one.
    answer_.assign(face_.size() * face_.size(), 0.0);
    for (std::size_t j = 0; j < face_.size(); ++j) {
        for (std::size_t k = 0; k < face_.size(); ++k) {
            for (std::size_t m = 0; m < face_[j].particle.size(); ++m) {
                answer_[j * face_.size() + k] += face_[j].weight[m] * face_[k].answer[face_[j].particle[m]];
            }
        }
    }
}

void RigidSphere::finish(const ParticleModel& start, const MovingParticles& now, double /*h*/) {
    // Depths and normals where the vertices would be without contact.
    normal_.resize(face_.size());
    depth_.resize(face_.size());
    for (std::size_t j = 0; j < face_.size(); ++j) {
        const FaceVertex& vertex = face_[j];
        Vec3 at = vertex.offset;
        for (std::size_t m = 0; m < vertex.particle.size(); ++m) {
            at += vertex.weight[m] * vector_of(now.position[vertex.particle[m]]);
        }
        const double distance = glm::length(at - centre_);
        normal_[j] = (at - centre_) / distance;
        depth_[j] = radius_ - distance;
    }
    // Forces that push every vertex out of the sphere, at least.
    block_.resize(face_.size());
    for (std::size_t j = 0; j < face_.size(); ++j) {
        for (std::size_t k = 0; k <= j; ++k) {
            block_.set(j, k, glm::dot(normal_[j], normal_[k]) * answer_[j * face_.size() + k]);
        }
    }
    solver_.solve(block_, depth_);
    force_ = Vec3(0.0);
    touching_ = 0;
    for (std::size_t j = 0; j < face_.size(); ++j) {
        const Vec3 force = solver_.force()[j] * normal_[j];
        if (force == Vec3(0.0)) {
            continue;
        }
        ++touching_;
        force_ -= force;
        for (std::size_t i = 0; i < start.size(); ++i) {
            Row& p = now.position[i];
            for (int k = 0; k < 3; ++k) {
                p.number[static_cast<std::size_t>(k)] += face_[j].answer[i] * force[k];
            }
        }
    }
}

}  // namespace

std::vector<PressMeasured> measure_press(const PressTest& test, std::span<const double> depths) {
    if (depths.empty() || *std::min_element(depths.begin(), depths.end()) <= 0.0) {
        throw std::invalid_argument("press test: depths must be positive");
    }
    const double deepest = *std::max_element(depths.begin(), depths.end());
    const double radius = test.contact.radius;
    Layer layer = make_layer(test, kWidestContactRadius * std::sqrt(radius * deepest));
    if (layer.face.size() > kMaxContactRows) {
        throw std::invalid_argument("press test: " + std::to_string(layer.face.size()) +
                                    " vertices may touch the sphere, more than " + std::to_string(kMaxContactRows) +
                                    "; press less deep or with fewer particles");
    }
    RigidSphere sphere(layer.face, radius);
    std::vector<PressMeasured> result;
    for (const double depth : depths) {
        sphere.move_to(Vec3(0.0, test.contact.thickness + radius - depth, 0.0));
        RelaxationSettings settings;
        settings.step = test.step;
        settings.substeps = test.substeps;
        settings.contacts = &sphere;
        const Relaxed relaxed = relax(layer.model, {}, settings);
        result.push_back({.depth = depth,
                          .force = sphere.force().y,
                          .requested = layer_force(test.contact, depth),
                          .touching = sphere.touching(),
                          .substeps = relaxed.substeps,
                          .simulated_s = relaxed.simulated_s,
                          .at_rest = relaxed.at_rest});
    }
    return result;
}

double fitted_modulus(const PressTest& test, std::span<const PressMeasured> measured) {
    // Forces are proportional to the modulus; all depths count alike.
    double sum = 0.0;
    for (const PressMeasured& m : measured) {
        sum += m.force / m.requested;
    }
    return test.contact.material.young_modulus * sum / static_cast<double>(measured.size());
}

}  // namespace haptic::sim
