#include "haptic/contact_problem.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <bit>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <memory>
#include <utility>
#include <vector>

#include "contact_tools.hpp"

namespace haptic {
namespace {

using contact_tools::Contacts;
using contact_tools::ContactShape;
using contact_tools::kRigid;
using contact_tools::make_tool;
using contact_tools::Random;
using contact_tools::random_contacts;
using contact_tools::random_tool;
using contact_tools::Tool;

using LongMatrix = Eigen::Matrix<long double, Eigen::Dynamic, Eigen::Dynamic>;
using LongVector = Eigen::Matrix<long double, Eigen::Dynamic, 1>;

ComplianceMatrix matrix_of(const Eigen::MatrixXd& compliance) {
    ComplianceMatrix matrix;
    contact_tools::write(compliance, matrix);
    return matrix;
}

Eigen::VectorXd vector_of(std::span<const double> values) {
    return Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
}

/// Forces without a warm start. Solver and matrix are kept because they allocate a megabyte each.
Eigen::VectorXd cold_forces(const Contacts& contacts) {
    static ContactSolver solver;
    static ComplianceMatrix matrix;
    solver.restart();
    contacts.write(matrix);
    std::vector<FrictionRows> friction = contacts.friction;
    solver.solve(matrix, contacts.depth, friction);
    return vector_of(solver.force());
}

/// Largest difference, relative to the largest element of `expected`.
double relative_error(const Eigen::VectorXd& actual, const Eigen::VectorXd& expected) {
    if (expected.size() == 0) {
        return 0.0;
    }
    const double difference = (actual - expected).cwiseAbs().maxCoeff();
    return difference == 0.0 ? 0.0 : difference / expected.cwiseAbs().maxCoeff();
}

double median(std::vector<double> values) {
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
}

using Rows = std::vector<Eigen::Index>;

/// The solution with exactly the rows of `active` pushing: W_SS l_S = b_S.
LongVector forces_of_active(const LongMatrix& w, const LongVector& b, const Rows& active) {
    const auto count = static_cast<Eigen::Index>(active.size());
    LongMatrix part(count, count);
    LongVector right(count);
    for (Eigen::Index i = 0; i < count; ++i) {
        right[i] = b[active[static_cast<std::size_t>(i)]];
        for (Eigen::Index j = 0; j < count; ++j) {
            part(i, j) = w(active[static_cast<std::size_t>(i)], active[static_cast<std::size_t>(j)]);
        }
    }
    const LongVector solution = part.ldlt().solve(right);
    LongVector force = LongVector::Zero(b.size());
    for (Eigen::Index i = 0; i < count; ++i) {
        force[active[static_cast<std::size_t>(i)]] = solution[i];
    }
    return force;
}

/// Oracle for few rows: tries all sets of pushing rows; exactly one satisfies the conditions of the minimum.
LongVector forces_by_enumeration(const LongMatrix& w, const LongVector& b) {
    for (unsigned set = 0; set < 1u << b.size(); ++set) {
        Rows active;
        for (Eigen::Index r = 0; r < b.size(); ++r) {
            if ((set >> r & 1u) != 0) {
                active.push_back(r);
            }
        }
        const LongVector force = forces_of_active(w, b, active);
        const LongVector deficit = b - w * force;
        const bool none_violated = (deficit.array() <= 0.0L || force.array() != 0.0L).all();
        if (none_violated && force.minCoeff() >= 0.0L) {
            return force;
        }
    }
    ADD_FAILURE() << "no set of rows solves the problem";
    return LongVector::Zero(b.size());
}

/// Oracle for many rows: primal-dual interior points until the pushing rows are evident, then their exact solution.
/// @source S. Wright, Primal-Dual Interior-Point Methods, 1997
LongVector forces_by_interior_points(const LongMatrix& w, const LongVector& b) {
    const Eigen::Index rows = b.size();
    const long double displacement = b.cwiseAbs().maxCoeff();
    LongVector force = LongVector::Constant(rows, displacement / w.diagonal().maxCoeff());
    LongVector gap = LongVector::Constant(rows, displacement);  // W l - b, nonnegative at the solution
    for (int i = 0;
         i < 200 && force.dot(gap) > 1e-16L * static_cast<long double>(rows) * displacement * force.maxCoeff(); ++i) {
        const long double target = 0.1L * force.dot(gap) / static_cast<long double>(rows);
        const LongVector mismatch = w * force - b - gap;
        LongMatrix system = w;
        system.diagonal() += LongVector(gap.cwiseQuotient(force));
        const LongVector right = -mismatch - gap + (target * force.cwiseInverse());
        const LongVector force_step = system.llt().solve(right);
        const LongVector gap_step = mismatch + w * force_step;
        long double length = 1.0L;
        for (Eigen::Index r = 0; r < rows; ++r) {
            length = force_step[r] < 0.0L ? std::min(length, -0.99L * force[r] / force_step[r]) : length;
            length = gap_step[r] < 0.0L ? std::min(length, -0.99L * gap[r] / gap_step[r]) : length;
        }
        force += length * force_step;
        gap += length * gap_step;
    }
    Rows active;
    for (Eigen::Index r = 0; r < rows; ++r) {
        if (force[r] * w(r, r) > gap[r]) {
            active.push_back(r);
        }
    }
    LongVector exact = forces_of_active(w, b, active);
    EXPECT_GE(exact.minCoeff(), 0.0L);
    EXPECT_LE((b - w * exact).maxCoeff(), 1e-15L * displacement);
    return exact;
}

struct Problem {
    Eigen::MatrixXd compliance;
    Eigen::VectorXd depth;
};

/// Symmetric positive definite W of order 1e-3 m/N with a condition of about 1e4, b of 1 mm.
Problem random_problem(Eigen::Index rows, Random& random) {
    Eigen::MatrixXd factor(rows, rows);
    for (double& element : factor.reshaped()) {
        element = random.normal();
    }
    Problem problem;
    problem.compliance = 1e-3 * (factor * factor.transpose()) / static_cast<double>(rows);
    problem.compliance.diagonal().array() += 1e-6;
    problem.depth.resize(rows);
    for (double& element : problem.depth) {
        element = 1e-3 * random.normal();
    }
    return problem;
}

double error_of(const Problem& problem, const LongVector& expected) {
    const std::vector<double> depth(problem.depth.begin(), problem.depth.end());
    ContactSolver solver;
    const ContactSolver::Result result = solver.solve(matrix_of(problem.compliance), depth);
    EXPECT_LE(result.residual, 1e-12 * problem.depth.cwiseAbs().maxCoeff());
    return relative_error(vector_of(solver.force()), expected.cast<double>());
}

TEST(ContactTangents, FormARightHandedFrameThatIsContinuousExceptAtOnePole) {
    Random random(1);
    const double small = 1e-9;
    for (int i = 0; i < 10000; ++i) {
        // Every second normal is close to the pole.
        const double x = random.normal() * (i % 2 == 0 ? 1.0 : small);
        const double y = random.normal() * (i % 2 == 0 ? 1.0 : small);
        const Vec3 n = glm::normalize(Vec3(x, y, i % 2 == 0 ? random.normal() : -1.0));
        const auto [t1, t2] = contact_tangents(n);
        EXPECT_LE(glm::length(glm::cross(t1, t2) - n), 1e-14);
        EXPECT_NEAR(glm::length(t1), 1.0, 1e-14);
        EXPECT_NEAR(glm::dot(t1, t2), 0.0, 1e-14);
        if (n.z > -0.99) {
            const Vec3 near = glm::normalize(n + 1e-7 * Vec3(random.normal(), random.normal(), random.normal()));
            EXPECT_LE(glm::length(contact_tangents(near)[0] - t1), 1e-4);
        }
    }
    for (const Vec3& n : {Vec3(0, 0, -1), Vec3(0, 0, 1), Vec3(1, 0, 0), Vec3(0, 1, -0.0)}) {
        const auto [t1, t2] = contact_tangents(n);
        EXPECT_EQ(glm::cross(t1, t2), n);
    }
}

TEST(ContactSolver, EqualsAnEnumerationOfAllActiveSets) {
    Random random(2);
    for (int i = 0; i < 600; ++i) {
        const Problem problem = random_problem(random.integer(1, 8), random);
        const LongVector expected =
            forces_by_enumeration(problem.compliance.cast<long double>(), problem.depth.cast<long double>());
        EXPECT_LE(error_of(problem, expected), 1e-9);
    }
}

TEST(ContactSolver, EqualsInteriorPointsInLongDouble) {
    Random random(3);
    for (const int rows : {9, 16, 33, 64, 65, 100, 150, 192}) {
        const Problem problem = random_problem(rows, random);
        const LongVector expected =
            forces_by_interior_points(problem.compliance.cast<long double>(), problem.depth.cast<long double>());
        EXPECT_LE(error_of(problem, expected), 1e-9) << rows;
    }
}

/// Oracle of the rigid tool, in its six unknowns z: min 1/2 z^T M z + sum max(0, b - a z)^2 / (2 c), where c is the
/// compliance of the surfaces. Tries all sets of rows that push with (b - a z) / c.
Eigen::VectorXd rigid_forces(const Tool& tool, const Contacts& contacts) {
    const LongMatrix motions = tool.motions.cast<long double>();
    const LongMatrix stiffness = motions.transpose() * tool.coupling.cast<long double>() * motions;
    const LongMatrix a = contacts.jacobian.cast<long double>() * motions;
    const LongVector b = vector_of(contacts.depth).cast<long double>();
    const long double c = 1e-3L / static_cast<long double>(tool.stiffness);
    for (unsigned set = 0; set < 1u << b.size(); ++set) {
        LongVector pushes(b.size());
        for (Eigen::Index r = 0; r < b.size(); ++r) {
            pushes[r] = static_cast<long double>(set >> r & 1u);
        }
        const LongMatrix hessian = stiffness + a.transpose() * pushes.asDiagonal() * a / c;
        const LongVector z = hessian.llt().solve(LongVector(a.transpose() * pushes.cwiseProduct(b) / c));
        const LongVector depth = b - a * z;
        if (((depth.array() > 0.0L) == (pushes.array() > 0.0L)).all()) {
            return (depth.cwiseMax(0.0L) / c).cast<double>();
        }
    }
    ADD_FAILURE() << "no set of rows solves the problem";
    return {};
}

TEST(ContactSolver, EqualsAQuadraticProgrammeInSixUnknownsForARigidTool) {
    Random random(4);
    for (int i = 0; i < 5000; ++i) {
        const Tool tool = random_tool(random.integer(3, 7), kRigid, random);
        const Contacts contacts = random_contacts(tool, {.planes = tool.rest.size() > 3 ? 1 : 2}, random);
        EXPECT_LE(relative_error(cold_forces(contacts), rigid_forces(tool, contacts)), 1e-6);
    }
}

TEST(ContactSolver, EqualsTheClosedFormForALimpTool) {
    Random random(5);
    for (int i = 0; i < 5000; ++i) {
        const int spheres = random.integer(1, 20);
        std::vector<Eigen::Vector3d> rest;
        for (int k = 0; k < spheres; ++k) {
            rest.push_back(0.02 * random.vector());
        }
        const double stiffness = random.uniform(100.0, 2000.0);
        const Tool tool = make_tool(rest, stiffness, stiffness, 0.0);
        const Contacts contacts = random_contacts(tool, {}, random);
        const double compliance = (spheres + 1e-3) / stiffness;
        EXPECT_LE(relative_error(cold_forces(contacts), vector_of(contacts.depth).cwiseMax(0.0) / compliance), 1e-6);
    }
}

/// Oracle with friction: up to 200,000 sweeps of Gauss-Seidel over the rows, tangential pairs by projected gradients.
Eigen::VectorXd forces_by_sweeps(const Contacts& contacts) {
    const Eigen::MatrixXd& w = contacts.compliance;
    Eigen::VectorXd force = Eigen::VectorXd::Zero(w.rows());
    Eigen::VectorXd deficit = vector_of(contacts.depth);
    double change = 1.0;
    for (int sweep = 0; sweep < 200'000 && change > 1e-15; ++sweep) {
        change = 0.0;
        for (const FrictionRows& friction : contacts.friction) {
            const Eigen::Index tangent = friction.first_normal + friction.normals;
            const Eigen::VectorXd before = force.segment(friction.first_normal, friction.normals + 2);
            for (Eigen::Index r = friction.first_normal; r < tangent; ++r) {
                const double next = std::max(0.0, force[r] + deficit[r] / w(r, r));
                deficit -= (next - force[r]) * w.col(r);
                force[r] = next;
            }
            const double limit = friction.coefficient * force.segment(friction.first_normal, friction.normals).sum();
            const double step = 1.0 / (w(tangent, tangent) + w(tangent + 1, tangent + 1));
            Eigen::Vector2d next = force.segment<2>(tangent) + step * deficit.segment<2>(tangent);
            next *= next.norm() > limit ? limit / next.norm() : 1.0;
            deficit -= w.middleCols<2>(tangent) * (next - force.segment<2>(tangent));
            force.segment<2>(tangent) = next;
            const Eigen::VectorXd moved = force.segment(friction.first_normal, friction.normals + 2) - before;
            change = std::max(change, moved.cwiseAbs().maxCoeff() * w(tangent, tangent));
        }
    }
    return force;
}

void expect_forces_in_cones(const Contacts& contacts, std::span<const double> force) {
    for (const FrictionRows& friction : contacts.friction) {
        double normal_force = 0.0;
        for (std::size_t i = 0; i < friction.normals; ++i) {
            EXPECT_GE(force[friction.first_normal + i], 0.0);
            normal_force += force[friction.first_normal + i];
        }
        const std::size_t tangent = std::size_t{friction.first_normal} + friction.normals;
        EXPECT_LE(std::hypot(force[tangent], force[tangent + 1]), friction.coefficient * normal_force);
    }
}

TEST(ContactSolver, ApproachesTheForcesOfManySweepsWithFrictionInsideTheCones) {
    Random random(6);
    std::vector<double> errors;
    for (int i = 0; i < 120; ++i) {
        const double kappa = std::vector{0.0, 1e2, 1e4, kRigid}[static_cast<std::size_t>(i % 4)];
        const Tool tool = random_tool(random.integer(3, 16), kappa, random);
        const ContactShape shape{.planes = random.integer(1, 2), .friction = random.uniform(0.2, 0.8)};
        Contacts contacts = random_contacts(tool, shape, random);
        const Eigen::Vector3d expected = contacts.sum(forces_by_sweeps(contacts));
        // Cold start at a pose 0.3 mm away, then warm.
        const ComplianceMatrix matrix = contacts.matrix();
        const Eigen::Vector3d motion = 3e-4 * random.direction();
        ContactSolver solver;
        contacts.move(motion);
        solver.solve(matrix, contacts.depth, contacts.friction);
        expect_forces_in_cones(contacts, solver.force());
        contacts.move(-motion);
        solver.solve(matrix, contacts.depth, contacts.friction);
        expect_forces_in_cones(contacts, solver.force());
        errors.push_back((contacts.sum(vector_of(solver.force())) - expected).norm() / expected.norm());
    }
    EXPECT_LE(median(errors), 1e-3);
}

TEST(ContactSolver, TakesNoMoreEnergyThanIsOfferedHoweverFewSweepsItHas) {
    Random random(8);
    int unfinished = 0;
    for (int i = 0; i < 2'000; ++i) {
        const Tool tool = random_tool(random.integer(3, 16), i % 2 == 0 ? 1e4 : kRigid, random);
        Contacts contacts = random_contacts(tool, {.planes = random.integer(1, 3), .friction = 1.2}, random);
        ContactSolver solver(1 + i % 5);
        // From forces of another place, as in a step after a jump of the hand.
        const Eigen::Vector3d motion = 0.01 * random.direction();
        contacts.move(motion);
        solver.solve(contacts.matrix(), contacts.depth, contacts.friction);
        contacts.move(-motion);
        const ContactSolver::Result result = solver.solve(contacts.matrix(), contacts.depth, contacts.friction);
        const Eigen::VectorXd force = vector_of(solver.force());
        const double offered = force.dot(vector_of(contacts.depth));
        const double taken = force.dot(contacts.compliance * force);
        EXPECT_LE(taken, offered + 1e-12 * std::abs(offered)) << i;
        EXPECT_GE(result.stored, 0.0) << i;
        expect_forces_in_cones(contacts, solver.force());
        const double largest = vector_of(contacts.depth).cwiseAbs().maxCoeff();
        unfinished += result.residual > 0.1 * largest ? 1 : 0;
    }
    EXPECT_GT(unfinished, 100) << "the sweeps were too many to prove anything";
}

TEST(ContactSolver, HoldsASphereAtItsAnchorUntilItSlides) {
    // One sphere, 1 mm deep and 1 mm beside its anchor: the tangential force sticks up to mu times the normal force.
    for (const double friction : {0.5, 0.999, 1.001, 2.0}) {
        Contacts contacts;
        contacts.depth = {1e-3, 0.6e-3, -0.8e-3};
        const ComplianceMatrix matrix = matrix_of(2e-3 * Eigen::MatrixXd::Identity(3, 3));
        std::vector<FrictionRows> rows = {{0, 1, friction}};
        ContactSolver solver;
        const ContactSolver::Result result = solver.solve(matrix, contacts.depth, rows);
        const double tangential = std::min(friction, 1.0) * 0.5;
        EXPECT_NEAR(solver.force()[0], 0.5, 1e-12);
        EXPECT_NEAR(solver.force()[1], 0.6 * tangential, 1e-6);
        EXPECT_NEAR(solver.force()[2], -0.8 * tangential, 1e-6);
        EXPECT_EQ(rows[0].slides, friction < 1.0);
        EXPECT_NEAR(result.stored, 0.5 * 0.5e-3 + tangential * (1e-3 - 0.5 * tangential * 2e-3), 1e-9);
    }
}

TEST(ContactSolver, SlidesOnAConeOfAnyWidth) {
    for (const double friction : {1e-3, 1e-100, 1e-200, 1e-300}) {
        const std::vector<double> depth = {1e-3, 0.6e-3, -0.8e-3};
        const ComplianceMatrix matrix = matrix_of(2e-3 * Eigen::MatrixXd::Identity(3, 3));
        std::vector<FrictionRows> rows = {{0, 1, friction}};
        ContactSolver solver;
        const ContactSolver::Result result = solver.solve(matrix, depth, rows);
        ASSERT_LT(result.residual, 1e-9) << friction;
        EXPECT_NEAR(solver.force()[0], 0.5, 1e-12);
        // Relative to the limit.
        EXPECT_NEAR(solver.force()[1] / (0.5 * friction), 0.6, 1e-6) << friction;
        EXPECT_NEAR(solver.force()[2] / (0.5 * friction), -0.8, 1e-6) << friction;
        EXPECT_TRUE(rows[0].slides);
    }
}

/// Without friction; of a rigid tool where i is even.
Contacts rigid_or_soft_contacts(int i, Random& random) {
    const Tool tool = random_tool(random.integer(3, 40), i % 2 == 0 ? kRigid : 1e3, random);
    return random_contacts(tool, {.share = 0.8, .planes = random.integer(1, 3)}, random);
}

TEST(ContactSolver, GivesTheSameForcesWarmAndCold) {
    Random random(7);
    for (int i = 0; i < 100; ++i) {
        Contacts contacts = rigid_or_soft_contacts(i, random);
        const ComplianceMatrix matrix = contacts.matrix();
        const Eigen::Vector3d motion = 5e-4 * random.direction();
        ContactSolver warm;
        for (int k = 0; k < 10; ++k) {
            contacts.move(motion);
            warm.solve(matrix, contacts.depth);
            EXPECT_LE(relative_error(vector_of(warm.force()), cold_forces(contacts)), 1e-9);
        }
    }
}

TEST(ContactSolver, GivesTheSameForcesWithAFactorThatItKeeps) {
    Random random(17);
    for (int i = 0; i < 30; ++i) {
        Contacts contacts = rigid_or_soft_contacts(i, random);
        const ComplianceMatrix matrix = contacts.matrix();
        ContactSolver keeping;
        keeping.solve(matrix, contacts.depth);
        // Back and forth, so that rows begin and cease to push: a factor is built again after a hundred that left.
        const Eigen::Vector3d motion = 2e-3 * random.direction();
        for (int k = 0; k < 60; ++k) {
            contacts.move((k / 4 % 2 == 0 ? 1.0 : -1.0) * motion);
            const ContactSolver::Result result =
                keeping.solve(matrix, contacts.depth, {}, ContactSolver::Elements::Unchanged);
            EXPECT_LE(relative_error(vector_of(keeping.force()), cold_forces(contacts)), 1e-9) << i << ' ' << k;
            EXPECT_LE(result.residual, 1e-12);
        }
    }
}

TEST(ContactSolver, StartsFromTheRowsThatPushAsFromTheLastSolution) {
    Random random(19);
    for (int i = 0; i < 30; ++i) {
        Contacts contacts = rigid_or_soft_contacts(i, random);
        const ComplianceMatrix matrix = contacts.matrix();
        ContactSolver solved;
        solved.solve(matrix, contacts.depth);
        const RowSet pushing = solved.pushing();
        for (std::size_t r = 0; r < contacts.depth.size(); ++r) {
            EXPECT_EQ(pushing.contains(r), solved.force()[r] > 0.0);
        }
        RowFactor factor;
        factor.make(matrix, pushing);
        RowFactor same_factor;
        same_factor.make(matrix, pushing);
        ContactSolver started;
        started.start(contacts.depth.size(), pushing);
        started.borrow(&factor);
        solved.borrow(&same_factor);
        for (int k = 0; k < 20; ++k) {
            contacts.move((k / 4 % 2 == 0 ? 1.0 : -1.0) * 5e-4 * random.direction());
            const auto unchanged = ContactSolver::Elements::Unchanged;
            solved.solve(matrix, contacts.depth, {}, unchanged);
            started.solve(matrix, contacts.depth, {}, unchanged);
            EXPECT_EQ(vector_of(started.force()), vector_of(solved.force())) << i << ' ' << k;
            EXPECT_LE(relative_error(vector_of(started.force()), cold_forces(contacts)), 1e-9) << i << ' ' << k;
        }
    }
}

TEST(ContactSolver, ReadsOtherElementsAgain) {
    // The same number of rows, but another matrix: what it kept is of no use.
    Random random(18);
    const Tool tool = random_tool(20, 1e3, random);
    ContactSolver solver;
    for (int i = 0; i < 20; ++i) {
        Contacts contacts = random_contacts(tool, {.share = 1.0, .planes = 2}, random);
        solver.solve(contacts.matrix(), contacts.depth);
        EXPECT_LE(relative_error(vector_of(solver.force()), cold_forces(contacts)), 1e-9);
    }
}

TEST(ContactSolver, TakesFewerStepsWarm) {
    Random random(8);
    const Tool tool = random_tool(64, 1e3, random);
    Contacts contacts = random_contacts(tool, {}, random);
    const ComplianceMatrix matrix = contacts.matrix();
    ContactSolver solver;
    const int cold = solver.solve(matrix, contacts.depth).steps;
    contacts.move({0.0, 0.0, 1e-4});
    const int warm = solver.solve(matrix, contacts.depth).steps;
    EXPECT_LT(4 * warm, cold);
    solver.restart();
    EXPECT_TRUE(solver.force().empty());
    EXPECT_GT(solver.solve(matrix, contacts.depth).steps, 2 * warm);
}

TEST(ContactSolver, TakesFewStepsWhereRowsAreNearlyTheSame) {
    // Faces of one nearly flat surface: each sphere has three planes that differ by less than W could tell in single
    // precision, and their depths by tens of nanometres.
    Random random(12);
    ContactSolver solver;
    for (int i = 0; i < 300; ++i) {
        const Tool tool = random_tool(random.integer(2, 8), i % 2 == 0 ? 1e3 : 1e5, random);
        Contacts contacts;
        const Eigen::Vector3d displacement = 0.004 * random.direction();
        for (std::size_t sphere = 0; sphere < tool.rest.size(); ++sphere) {
            const Eigen::Vector3d normal = (displacement.normalized() + 0.3 * random.vector()).normalized();
            const double depth = normal.dot(displacement) - 0.001 * random.uniform(0.0, 1.0);
            for (int plane = 0; plane < 3; ++plane) {
                contacts.rows.push_back({sphere, (normal + 3e-4 * random.vector()).normalized(), false});
                contacts.depth.push_back(depth + 2e-8 * random.uniform(-1.0, 1.0));
            }
        }
        contacts.find_compliance(tool, 0.0);
        solver.restart();
        const ContactSolver::Result result = solver.solve(contacts.matrix(), contacts.depth);
        EXPECT_LE(result.steps, 3 * static_cast<int>(contacts.rows.size())) << "problem " << i;
        EXPECT_LE(result.residual, 1e-8) << "problem " << i;
    }
}

TEST(ContactSolver, StaysBoundedWhereSurfacesLeaveNoRoom) {
    Random random(9);
    for (int i = 0; i < 300; ++i) {
        const Tool tool =
            random_tool(random.integer(3, 30), std::vector{0.0, 1e4, kRigid}[static_cast<std::size_t>(i % 3)], random);
        const Contacts contacts =
            random_contacts(tool, {.planes = 2, .friction = i % 2 == 0 ? 0.0 : 0.5, .no_room = 0.002}, random);
        ContactSolver solver;
        std::vector<FrictionRows> friction = contacts.friction;
        const ContactSolver::Result result = solver.solve(contacts.matrix(), contacts.depth, friction);
        // V <= sum max(0, b)^2 / (2 c) over the rows, because W >= c I. With friction the tangential rows have no c.
        const double surface = 1e-3 / tool.stiffness;
        const double bound = vector_of(contacts.depth).cwiseMax(0.0).squaredNorm() / (2.0 * surface);
        for (const double force : solver.force()) {
            ASSERT_TRUE(std::isfinite(force));
            EXPECT_LE(std::abs(force), std::sqrt(2.0 * bound / surface));
        }
        if (friction.empty()) {
            EXPECT_LE(result.stored, bound);
            EXPECT_LE(result.residual, 1e-11);
        }
    }
}

TEST(ContactSolver, ReportsWhatContradictingPlanesLeave) {
    // Two planes of one sphere that face each other, 2 mm beyond each other, and no compliance between them.
    Eigen::MatrixXd w(2, 2);
    w << 1e-3, -1e-3, -1e-3, 1e-3;
    ContactSolver solver;
    const std::vector<double> depth = {1e-3, 1e-3};
    const ContactSolver::Result result = solver.solve(matrix_of(w), depth);
    EXPECT_GE(result.residual, 1e-3);
    EXPECT_LE(result.residual, 2e-3);
    EXPECT_LE(vector_of(solver.force()).maxCoeff(), 1.0 + 1e-15);  // a rounding
    // The same plane three times: any split is exact, the sum is not ambiguous.
    const std::vector<double> thrice = {1e-3, 1e-3, 1e-3};
    EXPECT_LE(solver.solve(matrix_of(Eigen::MatrixXd::Constant(3, 3, 1e-3)), thrice).residual, 1e-15);
    EXPECT_NEAR(vector_of(solver.force()).sum(), 1.0, 1e-12);
    // The deepest of parallel planes holds all.
    const std::vector<double> parallel = {1e-3, 3e-3, 2e-3};
    solver.solve(matrix_of(Eigen::MatrixXd::Constant(3, 3, 1e-3)), parallel);
    EXPECT_NEAR(solver.force()[1], 3.0, 1e-12);
    EXPECT_NEAR(vector_of(solver.force()).sum(), 3.0, 1e-12);
}

TEST(ContactSolver, HasAResidualThatBoundsEveryViolation) {
    Random random(10);
    for (int i = 0; i < 300; ++i) {
        const Tool tool = random_tool(random.integer(3, 30), kRigid, random);
        const ContactShape shape{.planes = 2, .friction = i % 2 == 0 ? 0.0 : 0.7, .no_room = i % 3 == 0 ? 0.001 : 0.0};
        Contacts contacts = random_contacts(tool, shape, random);
        if (i % 5 == 0) {
            contacts.compliance = contacts.jacobian * tool.compliance * contacts.jacobian.transpose();
        }
        ContactSolver solver;
        std::vector<FrictionRows> friction = contacts.friction;
        const ContactSolver::Result result = solver.solve(contacts.matrix(), contacts.depth, friction);
        const Eigen::VectorXd force = vector_of(solver.force());
        const Eigen::VectorXd deficit = vector_of(contacts.depth) - contacts.compliance * force;
        for (std::size_t r = 0; r < contacts.rows.size(); ++r) {
            if (!contacts.rows[r].tangential) {
                const double lacks = deficit[static_cast<Eigen::Index>(r)];
                EXPECT_LE(solver.force()[r] > 0.0 ? std::abs(lacks) : lacks, result.residual + 1e-10);
            }
        }
        const double stored = force.dot(vector_of(contacts.depth)) - 0.5 * force.dot(contacts.compliance * force);
        EXPECT_NEAR(result.stored, stored, 1e-9 * (1.0 + std::abs(stored)));
    }
}

TEST(ContactSolver, HasForcesThatAreTheGradientOfTheStoredEnergy) {
    Random random(11);
    constexpr double kStep = 1e-9;  // m
    for (int i = 0; i < 30; ++i) {
        const Tool tool = random_tool(random.integer(3, 12), i % 2 == 0 ? kRigid : 1e3, random);
        Contacts contacts = random_contacts(tool, {}, random);
        const ComplianceMatrix matrix = contacts.matrix();
        const Eigen::VectorXd force = cold_forces(contacts);
        Eigen::VectorXd gradient(force.size());
        for (std::size_t r = 0; r < contacts.depth.size(); ++r) {
            ContactSolver solver;
            const double depth = std::exchange(contacts.depth[r], contacts.depth[r] + kStep);
            const double above = solver.solve(matrix, contacts.depth).stored;
            contacts.depth[r] = depth - kStep;
            const double below = solver.solve(matrix, contacts.depth).stored;
            contacts.depth[r] = depth;
            gradient[static_cast<Eigen::Index>(r)] = (above - below) / (2.0 * kStep);
        }
        // V of about 1e-2 J is rounded to 1e-18 J, which the step of 1e-9 m turns into 1e-9 N.
        EXPECT_LE(relative_error(gradient, force), 1e-5);
    }
}

TEST(ContactSolver, StaysCloseWithAComplianceRoundedToSinglePrecision) {
    Random random(12);
    for (int i = 0; i < 20; ++i) {
        const Tool tool = random_tool(64, 1e6, random);
        const Contacts contacts = random_contacts(tool, {.planes = 3}, random);
        Contacts rounded = contacts;
        for (double& element : rounded.compliance.reshaped()) {
            element = static_cast<double>(static_cast<float>(element));
        }
        const Eigen::Vector3d expected = contacts.sum(cold_forces(contacts));
        const Eigen::Vector3d actual = rounded.sum(cold_forces(rounded));
        EXPECT_LE((actual - expected).norm(), 1e-4 * expected.norm());
        // Without the surfaces' compliance, W of rank 6 is indefinite after rounding: bounded, and not far from that.
        for (Eigen::Index r = 0; r < rounded.compliance.rows(); ++r) {
            rounded.compliance(r, r) =
                static_cast<double>(static_cast<float>(contacts.compliance(r, r) - 1e-3 / tool.stiffness));
        }
        const Eigen::Vector3d stiff = rounded.sum(cold_forces(rounded));
        EXPECT_LE((stiff - expected).norm(), 0.1 * expected.norm());
    }
}

TEST(ContactSolver, ScalesWithItsUnits) {
    // Powers of four are exact in every operation, the square root included: the same bits, scaled.
    Random random(13);
    const Tool tool = random_tool(10, 1e4, random);
    const Contacts contacts = random_contacts(tool, {.planes = 2, .friction = 0.5}, random);
    const Eigen::VectorXd reference = cold_forces(contacts);
    for (const double compliance : {0x1p-40, 0x1p-20, 0x1p20, 0x1p60}) {
        for (const double depth : {0x1p-60, 0x1p-20, 0x1p40}) {
            Contacts scaled = contacts;
            scaled.compliance *= compliance;
            for (double& element : scaled.depth) {
                element *= depth;
            }
            EXPECT_EQ(cold_forces(scaled), reference * (depth / compliance));
        }
    }
}

TEST(ContactSolver, ReturnsTheSameBitsForTheSameCalls) {
    Random random(14);
    const Tool tool = random_tool(30, 1e4, random);
    Contacts contacts = random_contacts(tool, {.planes = 2, .friction = 0.5}, random);
    const ComplianceMatrix matrix = contacts.matrix();
    ContactSolver first;
    ContactSolver second;
    second.solve(matrix, contacts.depth);  // another past, which restart() forgets
    second.restart();
    for (int i = 0; i < 20; ++i) {
        contacts.move({1e-4, 0.0, 2e-4});
        first.solve(matrix, contacts.depth, contacts.friction);
        second.solve(matrix, contacts.depth, contacts.friction);
        EXPECT_TRUE(std::ranges::equal(first.force(), second.force(), [](double a, double b) {
            return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b);
        }));
    }
}

TEST(ContactSolver, HasNoForceWithoutRowsDepthOrCompliance) {
    ContactSolver solver;
    ComplianceMatrix matrix;
    EXPECT_EQ(solver.solve(matrix, {}).residual, 0.0);
    EXPECT_TRUE(solver.force().empty());
    // In front of its plane.
    matrix.resize(1);
    matrix.set(0, 0, 1e-3);
    EXPECT_EQ(solver.solve(matrix, std::vector{-1e-3}).residual, 0.0);
    EXPECT_EQ(solver.force()[0], 0.0);
    EXPECT_LE(solver.solve(matrix, std::vector{2e-3}).residual, 1e-18);  // a rounding
    EXPECT_DOUBLE_EQ(solver.force()[0], 2.0);
    // A row that nothing can move keeps its depth as the residual.
    matrix.set(0, 0, 0.0);
    EXPECT_EQ(solver.solve(matrix, std::vector{2e-3}).residual, 2e-3);
    EXPECT_EQ(solver.force()[0], 0.0);
}

TEST(ContactSolver, StaysFiniteForAnyFiniteRows) {
    Random random(15);
    const auto element = [&random] {
        const double magnitude = std::ldexp(1.0, random.integer(-1000, 1000));
        return random.integer(0, 3) == 0 ? 0.0 : random.normal() * magnitude;
    };
    for (int i = 0; i < 300; ++i) {
        const int rows = random.integer(1, 24);
        ComplianceMatrix matrix;
        matrix.resize(static_cast<std::size_t>(rows));
        std::vector<double> depth;
        for (int r = 0; r < rows; ++r) {
            depth.push_back(element());
            for (int s = 0; s <= r; ++s) {
                matrix.set(static_cast<std::size_t>(r), static_cast<std::size_t>(s), element());
            }
        }
        // Pairs that overlap or have no rows count as none.
        std::vector<FrictionRows> friction(3);
        for (FrictionRows& pair : friction) {
            pair = {static_cast<std::uint16_t>(random.integer(0, 20)), static_cast<std::uint16_t>(random.integer(0, 2)),
                    0.5};
        }
        ContactSolver solver;
        for (int k = 0; k < 2; ++k) {
            const ContactSolver::Result result = solver.solve(matrix, depth, friction);
            EXPECT_TRUE(std::isfinite(result.residual) && std::isfinite(result.stored));
            for (const double force : solver.force()) {
                EXPECT_TRUE(std::isfinite(force));
            }
        }
    }
}

}  // namespace
}  // namespace haptic
