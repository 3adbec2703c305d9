// Tool contact with many particles, stiff or limp; tests of a single particle are in renderer_test.cpp.
#include "rendering/tool_contact.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <limits>
#include <memory>
#include <numbers>
#include <span>
#include <vector>

#include "random.hpp"
#include "rendering/floor_frame.hpp"
#include "rendering/loaded_tool.hpp"
#include "rendering/renderer.hpp"

namespace haptic::rt {
namespace {

using test::floor_frame;
using test::Random;
using test::render_once;

constexpr double kToolStiffness = 300.0;  // N/m

/// `count` particles spread over a ball of 25 mm about the grip, each with the floor y = 0 as its plane.
ContactFrame ball(std::size_t count, std::uint32_t flags = 0) {
    Random random(7);
    ContactFrame frame = floor_frame(0.0, kToolStiffness, 0);
    frame.flags = flags;
    frame.proxy_count = static_cast<std::uint32_t>(count);
    for (std::size_t i = 0; i < count; ++i) {
        frame.proxies[i] = frame.proxies[0];
        store(0.025 * random.direction(), frame.proxies[i].rest_offset);
    }
    return frame;
}

/// One particle 20 mm to the side of the grip.
ContactFrame arm() {
    ContactFrame frame = floor_frame(0.0, kToolStiffness, 0);
    store(Vec3(0.02, 0.0, 0.0), frame.proxies[0].rest_offset);
    return frame;
}

Pose level(double y) {
    return {Vec3(0.0, y, 0.0), Quat(1, 0, 0, 0)};
}

Pose random_pose(Random& random, double size) {
    return {size * random.normal(), glm::angleAxis(random.uniform(-0.5, 0.5), random.direction())};
}

// --- Compliances for tests -------------------------------------------------------------------------------------------

constexpr std::size_t kGrip = 6;  // unknowns of a rigid tool: displacement and small rotation
using GripVector = std::array<double, kGrip>;
using GripMatrix = std::array<GripVector, kGrip>;

/// Solution of a x = b by elimination with pivots. False if a is singular.
bool solve(GripMatrix a, GripVector b, GripVector& x) {
    for (std::size_t c = 0; c < kGrip; ++c) {
        std::size_t pivot = c;
        for (std::size_t r = c + 1; r < kGrip; ++r) {
            pivot = std::fabs(a[r][c]) > std::fabs(a[pivot][c]) ? r : pivot;
        }
        if (!(std::fabs(a[pivot][c]) > 0.0)) {
            return false;
        }
        std::swap(a[c], a[pivot]);
        std::swap(b[c], b[pivot]);
        for (std::size_t r = c + 1; r < kGrip; ++r) {
            const double factor = a[r][c] / a[c][c];
            for (std::size_t k = c; k < kGrip; ++k) {
                a[r][k] -= factor * a[c][k];
            }
            b[r] -= factor * b[c];
        }
    }
    for (std::size_t c = kGrip; c-- > 0;) {
        x[c] = b[c];
        for (std::size_t k = c + 1; k < kGrip; ++k) {
            x[c] -= a[c][k] * x[k];
        }
        x[c] /= a[c][c];
    }
    return true;
}

double dot(const GripVector& a, const GripVector& b) {
    double sum = 0.0;
    for (std::size_t k = 0; k < kGrip; ++k) {
        sum += a[k] * b[k];
    }
    return sum;
}

/// Displacement along n of a point at `arm` per displacement and rotation of a rigid tool.
GripVector row_of(const Vec3& arm, const Vec3& n) {
    const Vec3 moment = glm::cross(arm, n);
    return {n.x, n.y, n.z, moment.x, moment.y, moment.z};
}

/// Stiffness of the hand's springs for the tool as a rigid body: k for each particle's share of its displacement.
GripMatrix grip_stiffness(const ContactFrame& frame) {
    GripMatrix sum{};
    for (std::size_t i = 0; i < frame.proxy_count; ++i) {
        for (const Vec3& axis : {Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(0, 0, 1)}) {
            const GripVector row = row_of(to_vec3(frame.proxies[i].rest_offset), axis);
            for (std::size_t a = 0; a < kGrip; ++a) {
                for (std::size_t b = 0; b < kGrip; ++b) {
                    sum[a][b] += frame.stiffness / frame.proxy_count * row[a] * row[b];
                }
            }
        }
    }
    return sum;
}

/// All rows of a frame, in the frame's order.
struct TestRow {
    std::size_t proxy;
    Vec3 direction;
};
std::vector<TestRow> rows_of(const ContactFrame& frame) {
    std::vector<TestRow> rows;
    for (std::size_t i = 0; i < frame.proxy_count; ++i) {
        const ProxyContact& proxy = frame.proxies[i];
        for (std::size_t k = 0; k < proxy.plane_count; ++k) {
            rows.push_back({i, to_vec3(proxy.planes[k].normal)});
        }
        if ((proxy.in_contact & HAPTIC_PROXY_TANGENTS) != 0) {
            for (const Vec3& tangent : contact_tangents(to_vec3(proxy.planes[0].normal))) {
                rows.push_back({i, tangent});
            }
        }
    }
    return rows;
}

/// Sends k W_rs = k d_r . C_ij d_s, less the surface's share. between(i, j, d) is C_ij d.
template <class Between>
void send_compliance(ContactFrame& frame, const Between& between) {
    const std::vector<TestRow> rows = rows_of(frame);
    frame.compliance_rows = static_cast<std::uint32_t>(rows.size());
    for (std::size_t r = 0; r < rows.size(); ++r) {
        for (std::size_t s = 0; s <= r; ++s) {
            const double element =
                frame.stiffness * glm::dot(rows[r].direction, between(rows[r].proxy, rows[s].proxy, rows[s].direction));
            frame.compliance[compliance_index(r, s)] =
                static_cast<float>(r == s ? element : (1.0 - kSurfaceShare) * element);
        }
    }
}

/// Sends the compliance of a rigid tool: C_ij = G_i (grip stiffness)^-1 G_j^T.
void make_rigid(ContactFrame& frame) {
    const GripMatrix stiffness = grip_stiffness(frame);
    send_compliance(frame, [&](std::size_t i, std::size_t j, const Vec3& d) {
        GripVector moved{};
        EXPECT_TRUE(solve(stiffness, row_of(to_vec3(frame.proxies[j].rest_offset), d), moved));
        return Vec3(moved[0], moved[1], moved[2]) +
               glm::cross(Vec3(moved[3], moved[4], moved[5]), to_vec3(frame.proxies[i].rest_offset));
    });
}

/// Sends the compliance of some elastic tool: rigid, plus a random positive one.
void make_elastic(ContactFrame& frame, Random& random) {
    make_rigid(frame);
    const std::vector<TestRow> rows = rows_of(frame);
    for (int rank = 0; rank < 40; ++rank) {
        std::vector<double> factor(rows.size());
        for (double& value : factor) {
            value = random.uniform(-1.0, 1.0) * std::sqrt(0.1 / frame.stiffness);
        }
        for (std::size_t r = 0; r < rows.size(); ++r) {
            for (std::size_t s = 0; s <= r; ++s) {
                frame.compliance[compliance_index(r, s)] += static_cast<float>(frame.stiffness * factor[r] * factor[s]);
            }
        }
    }
}

/// `count` particles with one random plane each, some behind it and some in front.
ContactFrame random_tool(Random& random, std::size_t count) {
    ContactFrame frame = floor_frame(0.0, random.uniform(20.0, 1000.0), 0);
    frame.step_ns = kNanosecondsPerSecond;
    frame.proxy_count = static_cast<std::uint32_t>(count);
    for (ProxyContact& proxy : std::span(frame.proxies).first(count)) {
        const Vec3 offset = 0.02 * random.normal();
        const Vec3 n = random.direction();
        store(offset, proxy.rest_offset);
        proxy.plane_count = 1;
        store(n, proxy.planes[0].normal);
        proxy.planes[0].offset = glm::dot(n, offset) + random.uniform(-0.004, 0.004);
    }
    return frame;
}

double difference(const Wrench& a, const Wrench& b, double arm = 0.02) {
    return glm::length(a.force - b.force) + glm::length(a.torque - b.torque) / arm;
}

// --- The tool's elasticity -------------------------------------------------------------------------------------------

TEST(ToolContact, IsTheClosedFormOfTheThesisForALimpTool) {
    Random random(1);
    for (int trial = 0; trial < 500; ++trial) {
        const ContactFrame frame = random_tool(random, 1 + static_cast<std::size_t>(trial) % 64);
        const Pose grip = random_pose(random, 0.003);
        // Section 5.2.2: F = sum k d / N over the particles in contact, T = sum r x k d / N.
        Wrench expected;
        double stored = 0.0;
        std::uint32_t in_contact = 0;
        for (const ProxyContact& proxy : std::span(frame.proxies).first(frame.proxy_count)) {
            const Vec3 moment_arm = grip.orientation * to_vec3(proxy.rest_offset);
            const Vec3 n = to_vec3(proxy.planes[0].normal);
            const double depth = std::max(0.0, proxy.planes[0].offset - glm::dot(n, grip.position + moment_arm));
            const Vec3 force = frame.stiffness / frame.proxy_count * depth * n;
            expected.force += force;
            expected.torque += glm::cross(moment_arm, force);
            stored += 0.5 * glm::dot(force, depth * n);
            in_contact += depth > 0.0 ? 1U : 0U;
        }
        const Contact contact = render_once(frame, grip);
        ASSERT_LT(difference(contact.wrench, expected), 1e-12) << trial;
        ASSERT_NEAR(contact.stored, stored, 1e-15);
        ASSERT_EQ(contact.in_contact, in_contact);
    }
}

TEST(ToolContact, GivesALimpToolTheSameWrenchWithAndWithoutACompliance) {
    Random random(2);
    for (int trial = 0; trial < 100; ++trial) {
        ContactFrame frame = random_tool(random, 1 + static_cast<std::size_t>(trial) % 20);
        const double n = frame.proxy_count;
        // k_t and k: (N / k_t) delta_ij + 1 / k - 1 / k_t inverts (k_t / N) 1 + (k - k_t) / N^2 1 1^T.
        frame.torque_stiffness = trial % 2 == 0 ? 0.0 : frame.stiffness * random.uniform(0.2, 5.0);
        const double k_t = trial % 2 == 0 ? frame.stiffness : frame.torque_stiffness;
        const double shared = 1.0 / frame.stiffness - 1.0 / k_t;
        const Pose grip = random_pose(random, 0.003);
        const Contact implied = render_once(frame, grip);
        send_compliance(frame, [&](std::size_t i, std::size_t j, const Vec3& d) {
            return (shared + (i == j ? n / k_t : 0.0)) * d;
        });
        ASSERT_EQ(find_defect(frame), FrameDefect::None);
        // The elements are floats.
        ASSERT_LT(difference(render_once(frame, grip).wrench, implied.wrench), 1e-5 * (1.0 + frame.stiffness * 0.004));
    }
}

/// The same tool twice, once with its compliance as the general solver takes it.
TEST(ToolContact, GivesALimpToolTheSameFrictionWithAndWithoutACompliance) {
    Random random(22);
    int slid = 0;
    for (int trial = 0; trial < 100; ++trial) {
        ContactFrame frame = random_tool(random, 8);
        frame.static_friction = 0.6;
        frame.dynamic_friction = 0.4;
        for (ProxyContact& proxy : std::span(frame.proxies).first(8)) {
            // One to three planes, of which only the first is touched: friction in a corner is what sweeps leave of it.
            proxy.in_contact = HAPTIC_PROXY_TANGENTS;
            proxy.plane_count = 1U + static_cast<std::uint32_t>(trial) % std::uint32_t{kMaxPlanes};
            for (std::size_t k = 1; k < proxy.plane_count; ++k) {
                const Vec3 n = glm::normalize(to_vec3(proxy.planes[0].normal) + random.direction());
                store(n, proxy.planes[k].normal);
                proxy.planes[k].offset = glm::dot(n, to_vec3(proxy.rest_offset)) - 0.03;
            }
        }
        ContactFrame elastic = frame;
        send_compliance(elastic, [&](std::size_t i, std::size_t j, const Vec3& d) {
            return i == j ? 8.0 / frame.stiffness * d : Vec3(0.0);
        });
        ASSERT_EQ(find_defect(elastic), FrameDefect::None);
        haptic::test::LoadedTool alone;
        haptic::test::LoadedTool together;
        alone.load(frame);
        together.load(elastic);
        Pose grip = random_pose(random, 0.002);
        const Vec3 velocity = random.uniform(0.0, 2e-4) * random.direction();
        for (int tick = 0; tick < 30; ++tick) {
            const GripMotion motion{grip, {grip.position - velocity, grip.orientation}, 1e-3};
            const Contact a = alone.render(frame.stiffness, motion, 0);
            const Contact b = together.render(frame.stiffness, motion, 0);
            // The elements are floats.
            const double size = frame.stiffness * 0.004;
            const double tolerance = 1e-6 * size;
            ASSERT_LT(difference(a.wrench, b.wrench), tolerance) << trial << ' ' << tick;
            ASSERT_NEAR(a.stored, b.stored, tolerance * 0.004) << trial << ' ' << tick;
            ASSERT_EQ(a.in_contact, b.in_contact);
            ASSERT_NEAR(a.displacement, b.displacement, 1e-12);
            for (std::size_t i = 0; i < 8; ++i) {
                slid += alone.friction(i).sliding ? 1 : 0;
            }
            grip.position += velocity;
        }
    }
    EXPECT_GT(slid, 1000);
}

struct RigidOracle {
    Wrench wrench;
    double pushes = 0.0;  // N, sum
};

/// Wrench of a rigid tool in the hand's springs, by trying all sets of touching planes: unknown are the six coordinates
/// of its displacement. Each plane yields by its share of the row's compliance.
RigidOracle rigid_oracle(const ContactFrame& frame, const Pose& grip) {
    GripMatrix springs = grip_stiffness(frame);
    const std::size_t count = frame.proxy_count;
    std::vector<GripVector> rows(count);
    std::vector<double> depths(count);
    std::vector<double> yields(count);  // m/N, of the surface
    for (std::size_t i = 0; i < count; ++i) {
        const Vec3 n = to_vec3(frame.proxies[i].planes[0].normal);
        rows[i] = row_of(to_vec3(frame.proxies[i].rest_offset), n);
        const Vec3 free = grip.position + grip.orientation * to_vec3(frame.proxies[i].rest_offset);
        depths[i] = frame.proxies[i].planes[0].offset - glm::dot(n, free);
        GripVector moved{};
        EXPECT_TRUE(solve(springs, rows[i], moved));
        yields[i] = kSurfaceShare * dot(rows[i], moved);
    }
    for (GripVector& row : springs) {
        for (double& element : row) {
            element /= 1.0 - kSurfaceShare;
        }
    }
    for (unsigned set = 0; set < 1U << count; ++set) {
        // Minimum of the springs' energy with the planes of this set: (S + sum J^T J / y) x = sum J^T b / y.
        GripMatrix a = springs;
        GripVector b{};
        for (std::size_t i = 0; i < count; ++i) {
            for (std::size_t r = 0; (set >> i & 1U) != 0 && r < kGrip; ++r) {
                b[r] += rows[i][r] * depths[i] / yields[i];
                for (std::size_t c = 0; c < kGrip; ++c) {
                    a[r][c] += rows[i][r] * rows[i][c] / yields[i];
                }
            }
        }
        GripVector x{};
        EXPECT_TRUE(solve(a, b, x));
        // Consistent: the planes of the set push, the others do not touch.
        RigidOracle result;
        bool consistent = true;
        for (std::size_t i = 0; i < count; ++i) {
            const double push = (depths[i] - dot(rows[i], x)) / yields[i];
            consistent = consistent && (push > 0.0) == ((set >> i & 1U) != 0);
            if ((set >> i & 1U) != 0) {
                const Vec3 force = push * to_vec3(frame.proxies[i].planes[0].normal);
                result.pushes += push;
                result.wrench.force += force;
                result.wrench.torque += glm::cross(grip.orientation * to_vec3(frame.proxies[i].rest_offset), force);
            }
        }
        if (consistent) {
            return result;
        }
    }
    ADD_FAILURE() << "no set of planes is consistent";
    return {};
}

TEST(ToolContact, IsTheSixDegreeOfFreedomProxyForARigidTool) {
    Random random(3);
    double largest = 0.0;
    for (int trial = 0; trial < 300; ++trial) {
        ContactFrame frame = random_tool(random, 3 + static_cast<std::size_t>(trial) % 5);
        make_rigid(frame);
        ASSERT_EQ(find_defect(frame), FrameDefect::None);
        const Pose grip = random_pose(random, 0.002);
        const RigidOracle expected = rigid_oracle(frame, grip);
        // W has the precision of floats, 6e-8, which the surfaces' share of a thousandth amplifies.
        ASSERT_LE(difference(render_once(frame, grip).wrench, expected.wrench), 1e-4 * expected.pushes) << trial;
        largest = std::max(largest, expected.pushes);
    }
    EXPECT_GT(largest, 0.5);
}

TEST(ToolContact, FeelsTheToolsElasticity) {
    // Four particles at the corners (+-a, +-a) of a square. With one on the floor, a limp tool yields at that particle
    // alone, with k / 4. A rigid one translates (1 / k) and turns about two axes (a^2 / (k a^2) each): k / 3.
    constexpr double a = 0.02;  // m
    constexpr double whole = kToolStiffness * 0.004;
    ContactFrame frame = ball(4);
    for (std::size_t i = 0; i < 4; ++i) {
        store(Vec3(i % 2 == 0 ? a : -a, 0.0, i < 2 ? a : -a), frame.proxies[i].rest_offset);
        frame.proxies[i].plane_count = i == 0 ? 1 : 0;
    }
    const auto felt = [](const ContactFrame& sent) { return render_once(sent, level(-0.004)); };
    ContactFrame rigid = frame;
    make_rigid(rigid);
    ASSERT_EQ(find_defect(rigid), FrameDefect::None);
    EXPECT_NEAR(felt(frame).wrench.force.y, whole / 4.0, 1e-12);
    EXPECT_NEAR(felt(rigid).wrench.force.y, whole / 3.0, 1e-6 * whole);
    EXPECT_NEAR(felt(rigid).share, 1.0 / 3.0, 1e-6);
    // All on the floor: the whole k, limp or rigid. The surface's share weakens the coupling of each rigid row with the
    // three others, 1 / k together: 4 k / 3.999.
    for (ProxyContact& proxy : std::span(frame.proxies).first(4)) {
        proxy.plane_count = 1;
    }
    rigid = frame;
    make_rigid(rigid);
    ASSERT_EQ(find_defect(rigid), FrameDefect::None);
    EXPECT_NEAR(felt(frame).wrench.force.y, whole, 1e-12);
    EXPECT_NEAR(felt(rigid).wrench.force.y, 4.0 * whole / (4.0 - kSurfaceShare), 1e-6 * whole);
    EXPECT_NEAR(felt(frame).share, 1.0, 1e-12);
    EXPECT_NEAR(felt(rigid).share, 1.0, 1e-12);
}

TEST(ToolContact, IsNotStifferThanTheCouplingWhateverTheDiagonalSays) {
    for (const float relative : {1.5e-3F, 0.5F, 1.0F, 3.0F}) {
        ContactFrame frame = floor_frame(0.0, 500.0, 0);
        frame.compliance_rows = 1;
        frame.compliance[0] = relative;
        ASSERT_EQ(find_defect(frame), FrameDefect::None);
        const double k = 500.0 / std::max(1.0, double{relative});
        EXPECT_NEAR(render_once(frame, level(-0.004)).wrench.force.y, k * 0.004, 1e-12) << relative;
    }
    // Tangential rows too, but those of exactly 0 have no friction.
    for (const float relative : {0.0F, 1.5e-3F}) {
        ContactFrame frame = floor_frame(0.0, 500.0, 0);
        frame.static_friction = frame.dynamic_friction = 1.0;
        frame.proxies[0].in_contact = HAPTIC_PROXY_TANGENTS;
        frame.compliance_rows = 3;
        frame.compliance[compliance_index(0, 0)] = 1.0F;
        frame.compliance[compliance_index(1, 1)] = frame.compliance[compliance_index(2, 2)] = relative;
        ASSERT_EQ(find_defect(frame), FrameDefect::None);
        haptic::test::LoadedTool tool;
        tool.load(frame);
        const auto push = [&](double x) {
            const Pose grip{Vec3(x, -0.004, 0.0), Quat(1, 0, 0, 0)};
            return tool.render(frame.stiffness, {grip, grip, 1e-3}, 0).wrench.force;
        };
        (void)push(0.0);
        EXPECT_NEAR(push(0.001).x, relative > 0.0F ? -500.0 * 0.001 : 0.0, 1e-6) << relative;
    }
}

TEST(ToolContact, DoesNotStartFromTheForcesOfOtherRows) {
    // Two tools with as many rows, in other places: the second gives the same bits as without the first.
    Random random(9);
    std::uint32_t pushed = 0;
    for (int trial = 0; trial < 50; ++trial) {
        std::array<ContactFrame, 2> frames{};
        for (std::size_t f = 0; f < 2; ++f) {
            frames[f] = random_tool(random, 12);
            for (std::size_t i = 0; i < 12; ++i) {
                ProxyContact& proxy = frames[f].proxies[i];
                proxy.plane_count = i % 2 == f ? 2 : 1;
                proxy.planes[1] = proxy.planes[0];
                store(random.direction(), proxy.planes[1].normal);
            }
            make_elastic(frames[f], random);
            ASSERT_EQ(find_defect(frames[f]), FrameDefect::None);
        }
        haptic::test::LoadedTool tool;
        tool.load(frames[0]);
        (void)tool.preview(kToolStiffness, level(-0.002), 0);
        tool.load(frames[1]);
        const Contact after = tool.preview(kToolStiffness, level(-0.002), 0);
        haptic::test::LoadedTool fresh;
        fresh.load(frames[1]);
        const Contact alone = fresh.preview(kToolStiffness, level(-0.002), 0);
        pushed += alone.in_contact;
        ASSERT_EQ(after.wrench.force, alone.wrench.force) << trial;
        ASSERT_EQ(after.wrench.torque, alone.wrench.torque) << trial;
    }
    EXPECT_GT(pushed, 150U) << "three a trial, or this proves little";
}

TEST(ToolContact, IsTheGradientOfTheStoredEnergy) {
    Random random(4);
    for (int trial = 0; trial < 60; ++trial) {
        ContactFrame frame = random_tool(random, 12);
        if (trial % 3 == 1) {
            make_elastic(frame, random);
            ASSERT_EQ(find_defect(frame), FrameDefect::None);
        } else if (trial % 3 == 2) {
            frame.torque_stiffness = 0.3 * frame.stiffness;
        }
        const Pose grip = random_pose(random, 0.003);
        const Contact contact = render_once(frame, grip);
        ASSERT_GT(contact.in_contact, 0U);
        constexpr double kStep = 1e-7;  // m; rad
        const auto slope = [&](const Pose& ahead, const Pose& behind) {
            return (render_once(frame, ahead).stored - render_once(frame, behind).stored) / (2.0 * kStep);
        };
        for (const Vec3& axis : {Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(0, 0, 1)}) {
            const double along = slope({grip.position + kStep * axis, grip.orientation},
                                       {grip.position - kStep * axis, grip.orientation});
            ASSERT_NEAR(-along, glm::dot(contact.wrench.force, axis), 1e-6 * frame.stiffness * 0.004) << trial;
            const double about = slope({grip.position, glm::angleAxis(kStep, axis) * grip.orientation},
                                       {grip.position, glm::angleAxis(-kStep, axis) * grip.orientation});
            ASSERT_NEAR(-about, glm::dot(contact.wrench.torque, axis), 1e-6 * frame.stiffness * 0.004 * 0.05) << trial;
        }
    }
}

TEST(ToolContact, GivesNoEnergyOverAClosedPath) {
    // Down while level, tilted while down, up while tilted, level again: a mean over the touching particles would give
    // energy on this path.
    for (const double torque_stiffness : {0.0, 0.25 * kToolStiffness}) {
        ContactFrame frame = ball(37);
        frame.torque_stiffness = torque_stiffness;
        constexpr int steps = 4000;
        double given = 0.0;
        double taken = 0.0;
        haptic::test::LoadedTool tool;
        tool.load(frame);
        for (int i = 0; i < steps; ++i) {
            const double angle = 2.0 * std::numbers::pi * (i + 0.5) / steps;
            const double step = 2.0 * std::numbers::pi / steps;
            const Pose grip{Vec3(0.0, 0.012 - 0.012 * std::cos(angle), 0.0),
                            glm::angleAxis(0.4 * std::sin(angle), Vec3(0, 0, 1))};
            const Wrench wrench = tool.preview(kToolStiffness, grip, 0).wrench;
            const double work =
                wrench.force.y * 0.012 * std::sin(angle) * step + wrench.torque.z * 0.4 * std::cos(angle) * step;
            given += work;
            taken += std::max(0.0, -work);
        }
        EXPECT_GT(taken, 1e-4);
        EXPECT_LT(std::fabs(given), 1e-5 * taken) << torque_stiffness;
    }
}

TEST(ToolContact, ChangesNoFasterThanTheCouplingsStiffnessTimesTheMotion) {
    Random random(5);
    double largest = 0.0;
    for (int trial = 0; trial < 200; ++trial) {
        ContactFrame frame = random_tool(random, 16);
        if (trial % 2 == 0) {
            make_elastic(frame, random);
        }
        const Pose grip = random_pose(random, 0.003);
        const double travel = std::pow(10.0, random.uniform(-6.0, -2.0));
        const Pose moved{grip.position + travel * random.direction(), grip.orientation};
        const Vec3 change = render_once(frame, moved).wrench.force - render_once(frame, grip).wrench.force;
        ASSERT_LE(glm::length(change), frame.stiffness * travel * (1.0 + 1e-5)) << trial;
        largest = std::max(largest, glm::length(change) / (frame.stiffness * travel));
    }
    EXPECT_GT(largest, 0.5) << "the bound must be tight, or this proves little";
}

TEST(ToolContact, IsLinearInTheRenderedStiffness) {
    Random random(6);
    ContactFrame frame = random_tool(random, 12);
    make_elastic(frame, random);
    haptic::test::LoadedTool tool;
    tool.load(frame);
    const Contact whole = tool.preview(frame.stiffness, level(0.0), 0);
    const Contact half = tool.preview(0.5 * frame.stiffness, level(0.0), 0);
    ASSERT_GT(whole.in_contact, 2U);
    // The second solution starts from the first, which changes its rounding.
    EXPECT_LT(glm::length(half.wrench.force - 0.5 * whole.wrench.force), 1e-12);
    EXPECT_LT(glm::length(half.wrench.torque - 0.5 * whole.wrench.torque), 1e-13);
    EXPECT_NEAR(half.stored, 0.5 * whole.stored, 1e-15);
}

TEST(ToolContact, MakesExactlyNoWrenchInFreeMotionHoweverStiffTheToolIs) {
    Random random(7);
    ContactFrame frame = random_tool(random, 20);
    for (ProxyContact& proxy : std::span(frame.proxies).first(20)) {
        proxy.planes[0].offset -= 0.02;
        proxy.in_contact = HAPTIC_PROXY_TANGENTS;
    }
    frame.static_friction = frame.dynamic_friction = 0.5;
    make_rigid(frame);
    ASSERT_EQ(find_defect(frame), FrameDefect::None);
    for (int i = 0; i < 100; ++i) {
        const Pose grip = random_pose(random, 1e-3);
        const Contact contact = render_once(frame, {grip.position, Quat(1, 0, 0, 0)});
        ASSERT_EQ(contact.wrench.force, Vec3(0.0));
        ASSERT_EQ(contact.wrench.torque, Vec3(0.0));
        ASSERT_EQ(contact.stored, 0.0);
        ASSERT_EQ(contact.proxy, grip.position + to_vec3(frame.proxies[0].rest_offset));
    }
}

// --- Motion of rest offsets ------------------------------------------------------------------------------------------

TEST(ToolContact, ExtrapolatesTheRestOffsetsOfAClosingHand) {
    ContactFrame frame = arm();
    store(Vec3(0.0, -0.1, 0.0), frame.proxies[0].rest_velocity);
    const auto at = [&frame](std::int64_t time_ns) { return render_once(frame, level(-0.001), time_ns); };
    EXPECT_NEAR(at(0).wrench.force.y, kToolStiffness * 0.001, 1e-12);
    EXPECT_NEAR(at(7'000'000).wrench.force.y, kToolStiffness * 0.0017, 1e-12);
    EXPECT_NEAR(at(80'000'000).wrench.force.y, kToolStiffness * 0.0025, 1e-12) << "a step and a half of 10 ms";
    // The fingers put l v into the springs, like a surface that rises.
    EXPECT_NEAR(at(7'000'000).surface_power, 0.1 * kToolStiffness * 0.0017, 1e-12);
    EXPECT_EQ(at(80'000'000).surface_power, 0.0);
}

TEST(ToolContact, GivesNoPowerToPlanesThatAreDatedAhead) {
    ContactFrame frame = arm();
    frame.proxies[0].planes[0].velocity = 0.1;
    frame.plane_time_ns = 5'000'000;
    EXPECT_EQ(render_once(frame, level(-0.001), 0).surface_power, 0.0) << "they rest until then";
    EXPECT_NEAR(render_once(frame, level(-0.001), 5'000'000).surface_power, 0.1 * kToolStiffness * 0.001, 1e-12);
    // Times whose difference overflows.
    constexpr std::int64_t kLatest = std::numeric_limits<std::int64_t>::max();
    frame.plane_time_ns = kLatest;
    const Contact ahead = render_once(frame, level(-0.001), -2);
    EXPECT_EQ(ahead.surface_power, 0.0);
    EXPECT_NEAR(ahead.wrench.force.y, kToolStiffness * 0.001, 1e-12);
    frame.plane_time_ns = -2;
    const Contact behind = render_once(frame, level(-0.001), kLatest);
    EXPECT_EQ(behind.surface_power, 0.0);
    EXPECT_NEAR(behind.wrench.force.y, kToolStiffness * (0.001 + 0.1 * 0.015), 1e-7) << "a step and a half, and 2 ns";
}

// --- Friction --------------------------------------------------------------------------------------------------------

constexpr double kDepth = 0.004;  // m
constexpr double kStatic = 0.8;
constexpr double kDynamic = 0.5;

/// One sphere on rough planes, tick after tick.
class RoughPlanes {
  public:
    explicit RoughPlanes(const std::vector<HalfSpace>& planes) {
        ContactFrame frame = floor_frame(0.0, kToolStiffness, 0);
        frame.step_ns = kNanosecondsPerSecond;
        frame.static_friction = kStatic;
        frame.dynamic_friction = kDynamic;
        frame.proxies[0].plane_count = static_cast<std::uint32_t>(planes.size());
        for (std::size_t k = 0; k < planes.size(); ++k) {
            store(planes[k].normal, frame.proxies[0].planes[k].normal);
            frame.proxies[0].planes[k].offset = planes[k].offset;
        }
        tool_.load(frame);
    }
    Contact tick(const Vec3& position) {
        const Pose grip{position, Quat(1, 0, 0, 0)};
        return tool_.render(kToolStiffness, {grip, grip, 1e-3}, 0);
    }
    [[nodiscard]] bool sliding() const { return tool_.friction(0).sliding; }
    [[nodiscard]] ContactFrame& frame() { return tool_.frame(); }

  private:
    haptic::test::LoadedTool tool_;
};

TEST(ToolFriction, SticksInTheStaticConeAndSlidesOnTheDynamicOneUntilItRests) {
    RoughPlanes floor({{Vec3(0, 1, 0), 0.0}});
    const Vec3 direction(0.6, 0.0, 0.8);
    const auto under = [&](double x) { return x * direction + Vec3(0, -kDepth, 0); };
    const Vec3 landed = floor.tick(under(0.0)).proxy;
    EXPECT_LT(glm::length(landed), 1e-12);
    double x = 0.0;
    while (x < 0.999 * kStatic * kDepth) {
        ASSERT_LT(glm::length(floor.tick(under(x)).proxy - landed), 1e-12);
        x += 1e-4;
    }
    for (x = 1.001 * kStatic * kDepth; x < 0.02; x += 1e-4) {
        const Contact contact = floor.tick(under(x));
        ASSERT_NEAR(x - glm::dot(contact.proxy, direction), kDynamic * kDepth, 1e-12);
        ASSERT_NEAR(glm::dot(contact.wrench.force, direction), -kDynamic * contact.wrench.force.y, 1e-11);
        ASSERT_TRUE(floor.sliding());
    }
    const Vec3 rest = floor.tick(under(x)).proxy;
    (void)floor.tick(under(x));
    EXPECT_FALSE(floor.sliding());
    x += 0.9 * (kStatic - kDynamic) * kDepth;
    EXPECT_LT(glm::length(floor.tick(under(x)).proxy - rest), 1e-12) << "the static coefficient applies again";
}

TEST(ToolFriction, SlidesOnTheStaticConeIfTheDynamicOneIsWider) {
    RoughPlanes floor({{Vec3(0, 1, 0), 0.0}});
    floor.frame().static_friction = kDynamic;
    floor.frame().dynamic_friction = kStatic;
    (void)floor.tick({0.0, -kDepth, 0.0});
    for (double x = 1.001 * kDynamic * kDepth; x < 0.02; x += 1e-4) {
        const Contact contact = floor.tick({x, -kDepth, 0.0});
        ASSERT_NEAR(contact.wrench.force.x, -kDynamic * contact.wrench.force.y, 1e-11);
        ASSERT_TRUE(floor.sliding());
    }
}

TEST(ToolFriction, EndsWithTheContact) {
    RoughPlanes floor({{Vec3(0, 1, 0), 0.0}});
    (void)floor.tick({0.0, -kDepth, 0.0});
    EXPECT_LT(floor.tick({0.001, -kDepth, 0.0}).wrench.force.x, -0.1);
    EXPECT_EQ(floor.tick({0.001, kDepth, 0.0}).wrench.force, Vec3(0.0));
    EXPECT_EQ(floor.tick({0.001, -kDepth, 0.0}).wrench.force.x, 0.0) << "it sticks where it touches again";
}

TEST(ToolFriction, MovesWithTheSurfaceUntilTheGoalLeavesTheCone) {
    RoughPlanes floor({{Vec3(0, 1, 0), 0.0}});
    store(Vec3(0.1, 0.03, 0.0), floor.frame().proxies[0].surface_velocity);  // the normal component is ignored
    const Vec3 goal(0, -kDepth, 0);
    (void)floor.tick(goal);
    double gone = 0.0;
    for (int k = 0; k < 100; ++k) {
        gone += 1e-4;
        const Vec3 at = floor.tick(goal).proxy;
        ASSERT_NEAR(at.y, 0.0, 1e-12);
        if (gone < kStatic * kDepth - 1e-9) {
            ASSERT_NEAR(at.x, gone, 1e-12);
        } else if (gone > kStatic * kDepth + 2e-4) {
            ASSERT_NEAR(at.x, kDynamic * kDepth, 1e-12);
        }
    }
}

TEST(ToolFriction, AddsTheForcesOfBothWallsOfAGroove) {
    const double h = std::sqrt(0.5);
    RoughPlanes groove({{Vec3(h, h, 0), 0.0}, {Vec3(-h, h, 0), 0.0}});
    (void)groove.tick({0, -kDepth, 0});
    const double load = std::sqrt(2.0) * kDepth;  // two walls, each with depth / sqrt(2)
    EXPECT_NEAR(groove.tick({0, -kDepth, 0.99 * kStatic * load}).proxy.z, 0.0, 1e-9);
    const double z = 3.0 * load;
    EXPECT_NEAR(z - groove.tick({0, -kDepth, z}).proxy.z, kDynamic * load, 1e-9);
}

TEST(ToolFriction, StaysInTheConeForAnyTool) {
    Random random(8);
    for (int trial = 0; trial < 20; ++trial) {
        ContactFrame frame = ball(16);
        frame.static_friction = kStatic;
        frame.dynamic_friction = kDynamic;
        for (ProxyContact& proxy : std::span(frame.proxies).first(16)) {
            proxy.in_contact = HAPTIC_PROXY_TANGENTS;
        }
        if (trial % 2 == 0) {
            make_rigid(frame);
        }
        haptic::test::LoadedTool tool;
        tool.load(frame);
        const auto push = [&](const Vec3& position) {
            const Pose grip{position, Quat(1, 0, 0, 0)};
            return tool.render(kToolStiffness, {grip, grip, 1e-3}, 0).wrench.force;
        };
        EXPECT_NEAR(push({0.0, -0.02, 0.0}).x, 0.0, 1e-12);
        const Vec3 direction = glm::normalize(Vec3(random.uniform(-1.0, 1.0), 0.0, random.uniform(-1.0, 1.0)));
        const Vec3 stuck = push(1e-3 * direction + Vec3(0.0, -0.02, 0.0));
        EXPECT_LT(glm::dot(stuck, direction), -0.45 * kToolStiffness * 1e-3);
        const Vec3 slides = push(0.2 * direction + Vec3(0.0, -0.02, 0.0));
        EXPECT_LE(std::hypot(slides.x, slides.z), kDynamic * slides.y * (1.0 + 1e-9));
        // A limp tool slides without rotating, so that the frictions add up.
        EXPECT_GT(-glm::dot(slides, direction), (trial % 2 == 0 ? 0.5 : 1.0 - 1e-9) * kDynamic * slides.y);
    }
}

/// A sphere beside the grip that sticks to a floor while the grip turns.
class RollingSphere {
  public:
    RollingSphere() {
        ContactFrame frame = floor_frame(0.0, kToolStiffness, 0);
        frame.step_ns = kNanosecondsPerSecond;
        frame.static_friction = frame.dynamic_friction = kStatic;
        store(kOffset, frame.proxies[0].rest_offset);
        frame.proxies[0].radius = kRadius;
        frame.proxies[0].in_contact = HAPTIC_PROXY_TANGENTS;
        frame.compliance_rows = 3;
        for (std::size_t r = 0; r < 3; ++r) {
            frame.compliance[compliance_index(r, r)] = 1.0F;
        }
        tool_.load(frame);
    }
    /// With the centre of the sphere where its springs have it, after that many turns of the grip.
    Contact tick(const Vec3& centre, int turns) {
        const Quat orientation = glm::angleAxis(turns * kTurn, kAxis);
        const Pose grip{centre - orientation * kOffset, orientation};
        const Contact contact = tool_.render(kToolStiffness, {grip, last_, 1e-3}, 0);
        last_ = grip;
        return contact;
    }
    [[nodiscard]] const Pose& grip() const { return last_; }

    /// m, along the floor, by which the sphere rolls in `ticks` of a turn each.
    static Vec3 rolled(int ticks) {
        const Vec3 once = glm::angleAxis(kTurn, kAxis) * (kRadius * kNormal) - kRadius * kNormal;
        return static_cast<double>(ticks) * (once - once.y * kNormal);
    }

    static constexpr double kRadius = 0.006;  // m
    static constexpr double kTurn = 1e-3;     // rad
    static constexpr Vec3 kAxis{0.36, 0.48, 0.8};
    static constexpr Vec3 kUnder{0.0, -kDepth, 0.0};
    static constexpr Vec3 kNormal{0.0, 1.0, 0.0};

  private:
    static constexpr Vec3 kOffset{0.02, -0.01, 0.005};
    Pose last_{kUnder - kOffset, Quat(1, 0, 0, 0)};
    haptic::test::LoadedTool tool_;
};

TEST(ToolFriction, OfASphereThatTurnsActsWhereItTouchesAndStoresTheWorkOfTheHand) {
    using R = RollingSphere;
    R sphere;
    Contact before = sphere.tick(R::kUnder, 0);
    Pose grip = sphere.grip();
    double work = 0.0;
    const double stored = before.stored;
    for (int k = 1; k <= 200; ++k) {
        const Contact contact = sphere.tick(R::kUnder, k);
        const Vec3 friction = kToolStiffness * R::rolled(k);
        ASSERT_LT(glm::length(contact.wrench.force - friction - kToolStiffness * kDepth * R::kNormal), 1e-9);
        const Vec3 arm = R::kUnder - sphere.grip().position;
        const Vec3 torque = glm::cross(arm, contact.wrench.force) - R::kRadius * glm::cross(R::kNormal, friction);
        ASSERT_LT(glm::length(contact.wrench.torque - torque), 1e-11);
        const Vec3 moved = sphere.grip().position - grip.position;
        work -= 0.5 * (glm::dot(before.wrench.force + contact.wrench.force, moved) +
                       R::kTurn * glm::dot(before.wrench.torque + contact.wrench.torque, R::kAxis));
        before = contact;
        grip = sphere.grip();
    }
    EXPECT_GT(before.stored, 1.01 * stored);
    EXPECT_NEAR(work, before.stored - stored, 1e-3 * (before.stored - stored));
}

TEST(ToolFriction, LetsASphereThatTurnsRollWithoutAForceAlongTheFloor) {
    using R = RollingSphere;
    R sphere;
    for (int k = 0; k <= 200; ++k) {
        const Contact contact = sphere.tick(R::kUnder + R::rolled(k), k);
        ASSERT_LT(glm::length(contact.wrench.force - kToolStiffness * kDepth * R::kNormal), 1e-9);
    }
}

TEST(ToolFriction, SurvivesAPositionThatIsNotFinite) {
    RoughPlanes floor({{Vec3(0, 1, 0), 0.0}});
    (void)floor.tick({0, -kDepth, 0});
    (void)floor.tick(Vec3(std::numeric_limits<double>::quiet_NaN()));
    EXPECT_NEAR(floor.tick({0.001, -kDepth, 0}).wrench.force.y, kToolStiffness * kDepth, 1e-9);
}

TEST(ToolFriction, ConvergesToTheStickingPositionOfTheSimulation) {
    ContactFrame frame = floor_frame(0.0, kToolStiffness, 0);
    frame.static_friction = frame.dynamic_friction = kStatic;
    frame.step_ns = kNanosecondsPerSecond;
    const Pose grip{Vec3(0.0, -kDepth, 0.0), Quat(1, 0, 0, 0)};
    for (const std::uint32_t bits : {std::uint32_t{HAPTIC_PROXY_TOUCHES},
                                     std::uint32_t{HAPTIC_PROXY_TOUCHES} | std::uint32_t{HAPTIC_PROXY_STICKS}}) {
        frame.proxies[0].in_contact = bits;
        store(Vec3(0.002, 0.0, 0.0), frame.proxies[0].position);
        haptic::test::LoadedTool tool;
        tool.load(frame);
        Contact contact;
        double before = 0.0;
        for (int i = 0; i < 1500; ++i) {
            contact = tool.render(kToolStiffness, {grip, grip, 1e-3}, std::int64_t{1'000'000} * i);
            ASSERT_LE(contact.wrench.force.x - before, kToolStiffness * 0.002 / 100.0 + 1e-12)
                << "pulled gradually, without a step";
            before = contact.wrench.force.x;
        }
        const bool sticks = (bits & HAPTIC_PROXY_STICKS) != 0;
        EXPECT_NEAR(contact.wrench.force.x, sticks ? kToolStiffness * 0.002 : 0.0, 1e-5);
    }
}

// --- Frames that are evaluated ahead of the tick ---------------------------------------------------------------------

/// A tool whose planes move, appear and vanish from frame to frame.
class ChangingTool {
  public:
    ChangingTool(Random& random, bool elastic, double friction) : random_(random), elastic_(elastic) {
        frame_ = random_tool(random, 12);
        frame_.static_friction = frame_.dynamic_friction = friction;
        frame_.step_ns = 10'000'000;
    }
    ContactFrame next(std::int64_t time_ns) {
        ++frame_.sequence;
        frame_.plane_time_ns = frame_.publish_time_ns = time_ns;
        for (ProxyContact& proxy : std::span(frame_.proxies).first(12)) {
            proxy.planes[0].offset += random_.uniform(-1e-4, 1e-4);
            proxy.planes[0].velocity = random_.uniform(-0.01, 0.01);
        }
        // Another layout of the rows, now and then.
        frame_.proxies[frame_.sequence % 12].plane_count = frame_.sequence % 7 == 0 ? 0 : 1;
        ContactFrame sent = frame_;
        if (elastic_) {
            make_elastic(sent, random_);
        }
        return sent;
    }

  private:
    Random& random_;
    bool elastic_;
    ContactFrame frame_;
};

TEST(FrameRendererOfATool, RendersTheSameBitsFromAPreviewMadeAheadAsWithoutOne) {
    Random random(11);
    int previews = 0;
    for (int trial = 0; trial < 12; ++trial) {
        ChangingTool tool(random, trial % 3 != 0, trial % 4 == 3 ? 0.5 : 0.0);
        const auto in_tick = std::make_unique<FrameRenderer>(FrameSettings{});
        const auto ahead = std::make_unique<FrameRenderer>(FrameSettings{});
        const auto previewer = std::make_unique<ToolContact>();
        Pose grip = random_pose(random, 0.002);
        FrameStart start;
        for (int tick = 0; tick < 200; ++tick) {
            const std::int64_t now_ns = std::int64_t{1'000'000} * (tick + 1);
            if (tick % 5 == 0) {
                const ContactFrame frame = tool.next(now_ns);
                ASSERT_EQ(in_tick->accept(frame, now_ns), FrameDefect::None);
                ahead->inbox()->frame = frame;
                ahead->inbox()->prepare();
                // From the end of the last tick; sometimes that of an earlier one has to do.
                if (tick % 15 != 0) {
                    start = ahead->next_start();
                }
                previewer->preview_ahead(*ahead->inbox(), start);
                ASSERT_EQ(ahead->accept(now_ns), FrameDefect::None);
            }
            grip.position += 1e-4 * random.normal();
            const FrameRenderer::Result a = in_tick->render(grip, now_ns, 1'000'000);
            const FrameRenderer::Result b = ahead->render(grip, now_ns, 1'000'000);
            ASSERT_EQ(a.contact.wrench.force, b.contact.wrench.force) << trial << ' ' << tick;
            ASSERT_EQ(a.contact.wrench.torque, b.contact.wrench.torque) << trial << ' ' << tick;
            ASSERT_EQ(a.contact.stored, b.contact.stored) << trial << ' ' << tick;
            previews += b.contact.in_contact > 0 ? 1 : 0;
        }
    }
    EXPECT_GT(previews, 2000);
}

TEST(FrameRendererOfATool, TakesThePreviewThatAFrameBrings) {
    // Guard of the test above. The floor jumps while the hand moves along it: the force follows at a bounded rate,
    // which is larger if the preview says that the motion itself changes the force.
    ContactFrame frame = ball(20);
    ContactFrame jumped = frame;
    for (ProxyContact& proxy : std::span(jumped.proxies).first(20)) {
        proxy.planes[0].offset += 0.005;
    }
    std::array<double, 2> rendered{};
    for (std::size_t i = 0; i < 2; ++i) {
        const auto renderer = std::make_unique<FrameRenderer>(FrameSettings{});
        const auto previewer = std::make_unique<ToolContact>();
        EXPECT_EQ(renderer->accept(frame, 0), FrameDefect::None);
        for (std::int64_t now_ns = 1'000'000; now_ns < 70'000'000; now_ns += 1'000'000) {
            (void)renderer->render(level(0.015), now_ns, 1'000'000);
        }
        const FrameStart start = renderer->next_start();
        PreparedFrame& next = *renderer->inbox();
        next.frame = jumped;
        next.prepare();
        EXPECT_EQ(next.preview_from(start), nullptr);
        previewer->preview_ahead(next, start);
        ASSERT_NE(next.preview_from(start), nullptr);
        FramePreview preview = *next.preview_from(start);
        preview.wrench.force.y += static_cast<double>(i);
        next.set_preview(preview);
        EXPECT_EQ(renderer->accept(69'000'000), FrameDefect::None);
        const Pose moved{Vec3(0.001, 0.015, 0.0), Quat(1, 0, 0, 0)};
        rendered[i] = renderer->render(moved, 70'000'000, 1'000'000).contact.wrench.force.y;
    }
    EXPECT_GT(rendered[1], rendered[0]);
}

// --- The thesis' scheme, limits --------------------------------------------------------------------------------------

TEST(ToolContact, WithHeldPositionsUsesTheFramesPositionsAndIgnoresPlanes) {
    ContactFrame frame = ball(37, HAPTIC_FRAME_HOLD_POSITIONS);
    const Pose below = level(-0.05);
    EXPECT_EQ(render_once(frame, below).wrench.force, Vec3(0.0)) << "the frame reports no touching particle";
    frame.proxies[4].in_contact = HAPTIC_PROXY_TOUCHES;
    const Vec3 goal = below.position + to_vec3(frame.proxies[4].rest_offset);
    store(goal + Vec3(-0.002, 0.003, 0.0), frame.proxies[4].position);
    const Contact contact = render_once(frame, below);
    EXPECT_EQ(contact.in_contact, 1u);
    EXPECT_NEAR(contact.wrench.force.x, -kToolStiffness * 0.002 / 37.0, 1e-12) << "the held position drags";
    EXPECT_NEAR(contact.wrench.force.y, kToolStiffness * 0.003 / 37.0, 1e-12);
}

TEST(FrameRendererOfATool, LowersTheStiffnessToTheRotationalLimit) {
    FrameSettings settings;
    settings.max_rotational_stiffness = 0.05;
    const auto felt = [&](double torque_stiffness) {
        const auto renderer = std::make_unique<FrameRenderer>(settings);
        ContactFrame frame = arm();
        frame.torque_stiffness = torque_stiffness;
        EXPECT_EQ(renderer->accept(frame, 0), FrameDefect::None);
        FrameRenderer::Result result;
        for (int i = 0; i < 60; ++i) {
            result = renderer->render(level(-0.004), 0, 1'000'000);
        }
        return result;
    };
    const double squared_arm = 0.02 * 0.02;  // m^2
    const FrameRenderer::Result within = felt(0.05 / squared_arm * 0.99);
    EXPECT_FALSE(within.stiffness_limited);
    EXPECT_EQ(within.stiffness, kToolStiffness);
    EXPECT_EQ(within.scale, 1.0);
    const FrameRenderer::Result more = felt(4.0 * 0.05 / squared_arm);
    EXPECT_TRUE(more.stiffness_limited);
    EXPECT_NEAR(more.stiffness, kToolStiffness / 4.0, 1e-12);
    EXPECT_NEAR(more.contact.wrench.force.y, within.contact.wrench.force.y / 4.0, 1e-12);
    EXPECT_NEAR(more.contact.wrench.torque.z, within.contact.wrench.torque.z / 4.0, 1e-12);
}

}  // namespace
}  // namespace haptic::rt
