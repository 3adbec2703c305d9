// Random elastic tools in contact, for tests and benchmarks of the contact solver: the compliance of a tool of N
// spheres that a grip holds, and the rows of its contacts.
//
//   E = 1/2 d^T (Cs x I) d + 1/2 kappa |e|^2,    Cs = (k_t / N) I + (k - k_t) / N^2 1 1^T
//
// d is the displacement of the spheres and e the part of it that no rigid motion explains. C is the inverse of this
// energy's Hessian: (N/k) I for kappa = 0 and k_t = k (limp), G (G^T Cs G)^-1 G^T with the rigid motions G for
// kappa = infinity.
#pragma once

#include <Eigen/Dense>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <random>
#include <vector>

#include "haptic/contact_problem.hpp"

namespace haptic::contact_tools {

inline constexpr double kRigid = std::numeric_limits<double>::infinity();

class Random {
  public:
    explicit Random(std::uint64_t seed) : engine_(seed) {}
    double uniform(double min, double max) {
        return min + (max - min) * static_cast<double>(engine_() >> 11) * 0x1p-53;
    }
    int integer(int min, int max) { return min + static_cast<int>(engine_() % static_cast<unsigned>(max - min + 1)); }
    double normal() { return distribution_(engine_); }
    Eigen::Vector3d vector() {
        const double x = normal();
        const double y = normal();
        return {x, y, normal()};
    }
    Eigen::Vector3d direction() { return vector().normalized(); }

  private:
    std::mt19937_64 engine_;
    std::normal_distribution<double> distribution_;
};

/// Spheres at `rest`, held with stiffness k and torque stiffness k_t.
struct Tool {
    double stiffness = 0.0;             // k, N/m
    double torque_stiffness = 0.0;      // k_t, N/m
    std::vector<Eigen::Vector3d> rest;  // m, from the grip
    Eigen::MatrixXd coupling;           // Cs x I, N/m
    Eigen::MatrixXd motions;            // G: displacement of each sphere per unit of the six rigid motions
    Eigen::MatrixXd compliance;         // C, m/N
};

/// kappa: N/m, stiffness of each sphere against deformation.
inline Tool make_tool(std::vector<Eigen::Vector3d> rest, double stiffness, double torque_stiffness, double kappa) {
    const auto count = static_cast<Eigen::Index>(rest.size());
    const auto n = static_cast<double>(count);
    Tool tool{stiffness, torque_stiffness, std::move(rest), {}, {}, {}};
    tool.coupling = Eigen::MatrixXd::Zero(3 * count, 3 * count);
    tool.motions = Eigen::MatrixXd::Zero(3 * count, 6);
    for (Eigen::Index i = 0; i < count; ++i) {
        for (Eigen::Index j = 0; j < count; ++j) {
            const double element = (i == j ? torque_stiffness / n : 0.0) + (stiffness - torque_stiffness) / (n * n);
            tool.coupling.block<3, 3>(3 * i, 3 * j) = element * Eigen::Matrix3d::Identity();
        }
        // u + phi x r, with phi in units of 1 rad / 20 mm.
        const Eigen::Vector3d r = tool.rest[static_cast<std::size_t>(i)] / 0.02;
        tool.motions.block<3, 3>(3 * i, 0).setIdentity();
        tool.motions.block<3, 3>(3 * i, 3) << 0.0, r.z(), -r.y(), -r.z(), 0.0, r.x(), r.y(), -r.x(), 0.0;
    }
    if (std::isinf(kappa)) {
        const Eigen::MatrixXd hessian = tool.motions.transpose() * tool.coupling * tool.motions;
        tool.compliance = tool.motions * hessian.ldlt().solve(tool.motions.transpose());
    } else {
        const Eigen::MatrixXd gram = tool.motions.transpose() * tool.motions;
        const Eigen::MatrixXd rigid = tool.motions * gram.ldlt().solve(tool.motions.transpose());
        const Eigen::MatrixXd identity = Eigen::MatrixXd::Identity(3 * count, 3 * count);
        const Eigen::MatrixXd hessian = tool.coupling + kappa * (identity - rigid);
        tool.compliance = hessian.ldlt().solve(identity);
    }
    tool.compliance = 0.5 * (tool.compliance + tool.compliance.transpose()).eval();
    return tool;
}

inline Tool random_tool(int spheres, double kappa, Random& random) {
    std::vector<Eigen::Vector3d> rest;
    for (int i = 0; i < spheres; ++i) {
        rest.push_back(0.02 * random.vector());
    }
    const double stiffness = random.uniform(100.0, 2000.0);
    return make_tool(std::move(rest), stiffness, stiffness * random.uniform(0.2, 1.0), kappa);
}

inline void write(const Eigen::MatrixXd& compliance, ComplianceMatrix& matrix) {
    matrix.resize(static_cast<std::size_t>(compliance.rows()));
    for (Eigen::Index r = 0; r < compliance.rows(); ++r) {
        for (Eigen::Index s = 0; s <= r; ++s) {
            matrix.set(static_cast<std::size_t>(r), static_cast<std::size_t>(s), compliance(r, s));
        }
    }
}

/// Rows of a contact problem with the directions in which they push.
struct Contacts {
    struct Row {
        std::size_t sphere;
        Eigen::Vector3d direction;
        bool tangential;
    };
    std::vector<Row> rows;
    std::vector<double> depth;  // m, b
    std::vector<FrictionRows> friction;
    Eigen::MatrixXd jacobian;    // J: displacement along each row per displacement of the spheres
    Eigen::MatrixXd compliance;  // W = J C J^T, and that of the surface on the diagonal of normal rows, m/N

    void write(ComplianceMatrix& matrix) const { contact_tools::write(compliance, matrix); }
    [[nodiscard]] ComplianceMatrix matrix() const {
        ComplianceMatrix matrix;
        write(matrix);
        return matrix;
    }
    /// Sets jacobian and compliance from the rows. `surface` is the compliance of each normal row itself, m/N.
    void find_compliance(const Tool& tool, double surface) {
        const auto count = static_cast<Eigen::Index>(rows.size());
        jacobian = Eigen::MatrixXd::Zero(count, tool.compliance.rows());
        for (Eigen::Index r = 0; r < count; ++r) {
            const Row& row = rows[static_cast<std::size_t>(r)];
            jacobian.block<1, 3>(r, 3 * static_cast<Eigen::Index>(row.sphere)) = row.direction.transpose();
        }
        compliance = jacobian * tool.compliance * jacobian.transpose();
        for (Eigen::Index r = 0; r < count; ++r) {
            compliance(r, r) += rows[static_cast<std::size_t>(r)].tangential ? 0.0 : surface;
        }
    }
    /// N, sum of the rows' forces.
    [[nodiscard]] Eigen::Vector3d sum(const Eigen::VectorXd& force) const {
        Eigen::Vector3d total(0.0, 0.0, 0.0);
        for (std::size_t r = 0; r < rows.size(); ++r) {
            total += force[static_cast<Eigen::Index>(r)] * rows[r].direction;
        }
        return total;
    }
    /// Moves the hand by `motion`: the free positions of all spheres follow.
    void move(const Eigen::Vector3d& motion) {
        for (std::size_t r = 0; r < rows.size(); ++r) {
            depth[r] -= motion.dot(rows[r].direction);
        }
    }
};

inline Vec3 to_vec3(const Eigen::Vector3d& v) {
    return {v.x(), v.y(), v.z()};
}
inline Eigen::Vector3d to_eigen(const Vec3& v) {
    return {v.x, v.y, v.z};
}

struct ContactShape {
    double share = 1.0;          // part of the spheres that have planes
    int planes = 1;              // per sphere in contact
    double friction = 0.0;       // coefficient; 0: no tangential rows
    double spread = 0.3;         // of the normals about a common direction
    double depth = 0.004;        // m, mean depth of the grip
    double anchor_error = 1e-4;  // m, of the points at which the spheres stick about those that the tool allows
    double no_room = 0.0;        // m: each second plane faces the previous one, this far beyond
};

/// Planes about a random rigid displacement of the tool, which all of them allow unless there is no room.
inline Contacts random_contacts(const Tool& tool, const ContactShape& shape, Random& random) {
    Contacts contacts;
    const Eigen::Vector3d main = random.direction();
    const Eigen::Vector3d displacement = shape.depth * main + 0.3 * shape.depth * random.vector();
    const Eigen::Vector3d rotation = 0.05 * random.vector();
    const double surface = 1e-3 / tool.stiffness;
    for (std::size_t i = 0; i < tool.rest.size(); ++i) {
        if (random.uniform(0.0, 1.0) >= shape.share) {
            continue;
        }
        const Eigen::Vector3d allowed = displacement + rotation.cross(tool.rest[i]);
        const std::size_t first = contacts.rows.size();
        for (int k = 0; k < shape.planes; ++k) {
            const bool facing = shape.no_room > 0.0 && k % 2 == 1;
            const Eigen::Vector3d normal = facing ? Eigen::Vector3d(-contacts.rows.back().direction)
                                                  : (main + shape.spread * random.vector()).normalized();
            const double slack = random.uniform(0.0, 1.0) < 0.4 ? 0.0 : 0.002 * random.uniform(0.0, 1.0);
            contacts.depth.push_back(facing ? shape.no_room - contacts.depth.back() : normal.dot(allowed) - slack);
            contacts.rows.push_back({i, normal, false});
        }
        if (shape.friction > 0.0) {
            const Eigen::Vector3d anchor = allowed + shape.anchor_error * random.vector();
            for (const Vec3& tangent : contact_tangents(to_vec3(contacts.rows[first].direction))) {
                contacts.depth.push_back(to_eigen(tangent).dot(anchor));
                contacts.rows.push_back({i, to_eigen(tangent), true});
            }
            contacts.friction.push_back(
                {static_cast<std::uint16_t>(first), static_cast<std::uint16_t>(shape.planes), shape.friction});
        }
    }
    contacts.find_compliance(tool, surface);
    return contacts;
}

}  // namespace haptic::contact_tools
