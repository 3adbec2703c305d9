#include "scene/contact_frame_builder.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <glm/geometric.hpp>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "contact/swept_tree.hpp"
#include "few_spheres.hpp"
#include "haptic/config.hpp"
#include "rendering/loaded_tool.hpp"
#include "scene_with.hpp"

namespace haptic::sim {
namespace {

using test::scene_with;

constexpr std::int64_t kStepNs = 10'000'000;

// --- Lead of damped surfaces -----------------------------------------------------------------------------------------

TEST(FrameOfADampedContact, HasTheForceOfTheStepAtItsMiddle) {
    // A cloth of 1 kg meets a still sphere at 2 m/s. The force of a step is the mean over the ends of eight sub-steps,
    // half a sub-step later than its middle, and the lead is half a step late: for changes of up to a third in a step
    // this makes 15 %, and some per cent on average.
    const Scene scene = scene_with(
        "cloth-drop", {"model.height=0.06", "model.velocity=[0.0, -2.0, 0.0]", "model.material=none", "model.mass=1.0",
                       "solver.substeps=8", "solver.iterations=1", "solver.shape_damping=5.0",
                       "coupling.stiffness=100.0", "coupling.hunt_crossley_damping=2.0"});
    Simulation simulation(scene);
    haptic::test::LoadedTool loop;
    int touching = 0;
    int compared = 0;
    double sum_of_errors = 0.0;
    double max_approaching = 0.0;
    double max_receding = 0.0;
    for (int i = 0; i < 40; ++i) {
        const StepInput input = simulation.scripted_input(kStepNs * i);
        const StepResult result = simulation.step(input);
        const ContactFrame& frame = simulation.frame();
        const ProxyContact& sent = frame.proxies[0];
        touching += (sent.in_contact & HAPTIC_PROXY_TOUCHES) != 0 ? 1 : 0;
        if (touching < 2) {
            continue;  // contact begins within the step
        }
        // k times the depth behind the planes. In a fold several planes hold the sphere.
        loop.load(frame);
        const Contact felt =
            loop.render(frame.stiffness, {.pose = input.device, .previous = input.device}, input.time_ns + kStepNs / 2);
        const double force = glm::length(result.hand_force);
        const double error = glm::length(felt.wrench.force - result.hand_force) / force;
        EXPECT_LT(error, 0.15) << i;
        sum_of_errors += error;
        ++compared;
        // The proxy is on the surface itself, which the first plane leads by damping.
        const Vec3 normal = to_vec3(sent.planes[0].normal);
        const double surface = glm::dot(normal, to_vec3(sent.position));
        const double lead = (sent.planes[0].offset - surface) / (surface - glm::dot(normal, input.device.position));
        max_approaching = std::max(max_approaching, lead);
        max_receding = std::max(max_receding, -lead);
    }
    ASSERT_GT(compared, 30);
    EXPECT_LT(sum_of_errors / compared, 0.05);
    EXPECT_GT(max_approaching, 0.5) << "of the depth without damping";
    EXPECT_GT(max_receding, 0.05);
}

// --- Rows and compliance ---------------------------------------------------------------------------------------------

constexpr double kSphereRadius = 0.1;        // m
constexpr double kCouplingStiffness = 50.0;  // N/m, scene

/// A tool in the corner of a room: floor y = 0, walls x = 0 and z = 0. Nothing moves.
class Corner {
  public:
    Corner(const ToolModel& tool, double friction, double torque_stiffness = 0.0) {
        // One triangle for each face; each is seen from the positive octant.
        TriangleMesh mesh;
        for (const std::array<Vec3, 3>& face : {std::array<Vec3, 3>{Vec3(-1, 0, -1), Vec3(-1, 0, 5), Vec3(5, 0, -1)},
                                                std::array<Vec3, 3>{Vec3(0, -1, -1), Vec3(0, 5, -1), Vec3(0, -1, 5)},
                                                std::array<Vec3, 3>{Vec3(-1, -1, 0), Vec3(5, -1, 0), Vec3(-1, 5, 0)}}) {
            const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
            for (const Vec3& corner : face) {
                mesh.vertices.push_back(corner);
                model_.add(corner, 1.0, 0.01);
            }
            mesh.triangles.push_back({first, first + 1, first + 2});
        }
        bodies_ = {{"corner", 0, 0, mesh}};
        tree_ = std::make_unique<SweptTree>(mesh.vertices, mesh.triangles);
        tree_->refit({mesh.vertices, mesh.vertices, mesh.triangles});
        coupling_ = std::make_unique<ContactCoupling>(model_);
        scene_ = scene_with("cloth-drop", {});
        scene_.coupling.stiffness = kCouplingStiffness;
        scene_.coupling.torque_stiffness = torque_stiffness;
        scene_.contact.static_friction = scene_.contact.dynamic_friction = friction;
        ToolProxies::Settings settings;
        settings.contact = scene_.contact;
        settings.reach = 0.95 * kSphereRadius;
        settings.step = scene_.solver.step;
        settings.springs = {kCouplingStiffness, torque_stiffness};
        tool_ = std::make_unique<ToolProxies>(tool, settings, Pose{});
    }

    /// Moves the hand by a translation from the pose in which the tool was made.
    void move(const Vec3& by) {
        const TriangleMesh& mesh = bodies_[0].mesh;
        const std::array<MovingSurface, 1> surfaces{
            MovingSurface{{mesh.vertices, mesh.vertices, mesh.triangles}, tree_.get()}};
        tool_->set_goals({by, Quat(1, 0, 0, 0)});
        tool_->collect(surfaces);
        EXPECT_TRUE(tool_->find_secure_positions());
        tool_->pop_out();
        tool_->find_equilibrium();
        tool_->collect_speculative_planes(scene_.solver.step);
    }

    [[nodiscard]] std::unique_ptr<ContactFrame> frame(const WorkspaceSettings& mapping = {},
                                                      const Clutch& clutch = {}) const {
        auto made = std::make_unique<ContactFrame>();
        const Workspace workspace(mapping);
        const StepInput input;
        const ContactFrameSources sources{.input = input,
                                          .scene = scene_,
                                          .workspace = workspace,
                                          .clutch = clutch,
                                          .tool = *tool_,
                                          .coupling = *coupling_,
                                          .bodies = bodies_,
                                          .start = bodies_[0].mesh.vertices,
                                          .end = bodies_[0].mesh.vertices,
                                          .body_work = 0.25};
        ContactFrameBuilder(sources).build(*made);
        return made;
    }
    [[nodiscard]] const ToolProxies& tool() const { return *tool_; }

  private:
    ParticleModel model_;
    std::vector<SceneBody> bodies_;
    std::unique_ptr<SweptTree> tree_;
    std::unique_ptr<ContactCoupling> coupling_;
    Scene scene_;
    std::unique_ptr<ToolProxies> tool_;
};

/// As many limp spheres as a frame has room for, which touch nothing yet but have the three faces in reach.
ToolModel spheres_near_the_corner() {
    std::mt19937_64 random(11);
    std::uniform_real_distribution<double> distance(1.05 * kSphereRadius, 1.8 * kSphereRadius);
    std::vector<Vec3> where;
    for (std::size_t i = 0; i < kMaxProxies; ++i) {
        const double x = distance(random);
        const double y = distance(random);
        where.emplace_back(x, y, distance(random));
    }
    ToolModel tool = test::loose_spheres(where, kSphereRadius);
    tool.material.young_modulus = 0.0;
    return tool;
}

/// Distances of a proxy from its planes, m, in the order of ToolProxy::planes: those in the frame and those not.
struct Planes {
    std::vector<double> kept;
    std::vector<double> dropped;
};

Planes planes_of(const ToolProxy& proxy, const ProxyContact& sent) {
    Planes planes;
    for (std::size_t k = 0; k < proxy.planes.count; ++k) {
        const SurfacePlane& plane = proxy.planes.plane[k];
        const bool in_frame = std::any_of(sent.planes, sent.planes + sent.plane_count, [&](const ContactPlane& other) {
            return glm::dot(to_vec3(other.normal), plane.normal) > 0.9;
        });
        (in_frame ? planes.kept : planes.dropped).push_back(glm::dot(plane.normal, proxy.position) - plane.offset);
    }
    return planes;
}

TEST(FrameRows, AreAllSentIfThereIsRoom) {
    // 64 proxies with three planes each fill the frame exactly.
    Corner corner(spheres_near_the_corner(), 0.0);
    corner.move({0.0, -0.02, 0.0});
    const auto frame = corner.frame();
    ASSERT_EQ(find_defect(*frame), FrameDefect::None);
    EXPECT_EQ(frame->compliance_rows, kMaxComplianceRows);
    for (std::size_t i = 0; i < kMaxProxies; ++i) {
        EXPECT_EQ(frame->proxies[i].plane_count, 3U) << i;
    }
}

TEST(FrameRows, LoseTheFarthestPlanesOfUntouchedProxiesFirst) {
    // With friction 320 rows are too many; some proxies touch the floor.
    Corner corner(spheres_near_the_corner(), 0.5);
    corner.move({0.0, -0.02, 0.0});
    const auto frame = corner.frame();
    ASSERT_EQ(find_defect(*frame), FrameDefect::None);
    std::size_t touched = 0;
    double farthest_kept = 0.0;
    double nearest_dropped = 1.0;
    for (std::size_t i = 0; i < kMaxProxies; ++i) {
        const ToolProxy& proxy = corner.tool().particles()[i];
        const Planes planes = planes_of(proxy, frame->proxies[i]);
        ASSERT_EQ(proxy.planes.count, 3U) << i;
        if (proxy.in_contact()) {
            ++touched;
            EXPECT_TRUE(planes.dropped.empty()) << i;
            continue;
        }
        for (const double distance : planes.kept) {
            farthest_kept = std::max(farthest_kept, distance);
        }
        for (const double distance : planes.dropped) {
            nearest_dropped = std::min(nearest_dropped, distance);
        }
    }
    EXPECT_GT(touched, 5U);
    EXPECT_LT(touched, 30U);
    EXPECT_LE(farthest_kept, nearest_dropped);
    // The last plane of a proxy takes two tangents along, and no plane more than needed is dropped.
    EXPECT_LE(frame->compliance_rows, kMaxComplianceRows);
    EXPECT_GT(frame->compliance_rows, kMaxComplianceRows - 3);
}

TEST(FrameRows, LoseSpeculativePlanesBeforeContacts) {
    // Every proxy touches the floor: 64 contacts with two tangents each are all that there is room for.
    Corner corner(spheres_near_the_corner(), 0.5);
    corner.move({0.0, -kSphereRadius, 0.0});
    const auto frame = corner.frame();
    ASSERT_EQ(find_defect(*frame), FrameDefect::None);
    EXPECT_EQ(frame->compliance_rows, kMaxComplianceRows);
    for (std::size_t i = 0; i < kMaxProxies; ++i) {
        ASSERT_EQ(corner.tool().particles()[i].planes.count, 3U) << i;
        ASSERT_EQ(frame->proxies[i].plane_count, 1U) << i;
        EXPECT_NEAR(frame->proxies[i].planes[0].normal[1], 1.0, 1e-9) << i;
        EXPECT_NE(frame->proxies[i].in_contact & HAPTIC_PROXY_TANGENTS, 0U) << i;
    }
}

TEST(FrameRows, KeepTheFirstContactOfEveryProxy) {
    // Every proxy is pressed into the corner, with too little friction to stick before it is there.
    Corner corner(spheres_near_the_corner(), 0.01);
    corner.move(Vec3(-kSphereRadius));
    const auto frame = corner.frame();
    ASSERT_EQ(find_defect(*frame), FrameDefect::None);
    EXPECT_EQ(frame->compliance_rows, kMaxComplianceRows);
    for (std::size_t i = 0; i < kMaxProxies; ++i) {
        const SurfacePlanes& contacts = corner.tool().particles()[i].contacts;
        ASSERT_EQ(contacts.count, 3U) << i;
        ASSERT_EQ(frame->proxies[i].plane_count, 1U) << i;
        EXPECT_GT(glm::dot(to_vec3(frame->proxies[i].planes[0].normal), contacts.plane[0].normal), 0.9) << i;
    }
}

/// A few limp spheres, pressed on the floor and near the walls.
ToolModel few_limp_spheres() {
    ToolModel tool = test::loose_spheres({Vec3(0.13), Vec3(0.16, 0.12, 0.14), Vec3(0.6, 0.11, 0.7)}, kSphereRadius);
    tool.material.young_modulus = 0.0;
    return tool;
}

TEST(FrameCompliance, OfALimpToolIsTheNumberOfItsSpheres) {
    // k C_ij = (N k / k_t) delta_ij + 1 - k / k_t, and k_t = k unless it is given.
    for (const double torque_stiffness : {0.0, 4.0 * kCouplingStiffness}) {
        Corner corner(few_limp_spheres(), 0.0, torque_stiffness);
        corner.move({0.0, -0.04, 0.0});
        const auto frame = corner.frame();
        ASSERT_EQ(find_defect(*frame), FrameDefect::None);
        ASSERT_EQ(frame->compliance_rows, 7U) << "three planes of two spheres, and the floor of the third";
        const double of_rotation = torque_stiffness > 0.0 ? kCouplingStiffness / torque_stiffness : 1.0;
        std::size_t r = 0;
        for (std::size_t i = 0; i < 3; ++i) {
            for (std::size_t p = 0; p < frame->proxies[i].plane_count; ++p, ++r) {
                std::size_t s = 0;
                for (std::size_t j = 0; j <= i; ++j) {
                    for (std::size_t q = 0; q < frame->proxies[j].plane_count && s <= r; ++q, ++s) {
                        const double between = (i == j ? 3.0 * of_rotation : 0.0) + 1.0 - of_rotation;
                        const double share = r == s ? 1.0 : 1.0 - kSurfaceShare;
                        const double cosine = glm::dot(to_vec3(frame->proxies[i].planes[p].normal),
                                                       to_vec3(frame->proxies[j].planes[q].normal));
                        // The rounding to float.
                        EXPECT_NEAR(frame->compliance[compliance_index(r, s)], share * between * cosine, 1e-6)
                            << r << ' ' << s << ", k_t " << torque_stiffness;
                    }
                }
            }
        }
    }
}

TEST(FrameCompliance, IsThatOfTheToolWhateverTheWorkspaceAndTheClutch) {
    Corner corner(test::square_of_spheres(4, 0.07, kSphereRadius, {.young_modulus = 1e3}), 0.5);
    corner.move({0.3, 0.5, 0.3});
    corner.move({0.3, 0.09, 0.3});
    const auto whole = corner.frame({.scale = 1.0, .force_scale = 1.0});
    ASSERT_EQ(find_defect(*whole), FrameDefect::None);
    ASSERT_GE(whole->compliance_rows, 16U * 3U);
    EXPECT_NEAR(whole->stiffness, kCouplingStiffness, 1e-12);
    // A clutch whose button was pressed half of the fade ago.
    const WorkspaceSettings mapping{.scale = 0.03, .force_scale = 0.2, .clutch_button = 0, .clutch_fade = 0.1};
    Workspace workspace(mapping);
    Clutch clutch;
    (void)clutch.engage(true, Pose{}, {}, 0.05, workspace);
    ASSERT_NEAR(clutch.gain(), 0.5, 1e-12);
    for (const bool fading : {false, true}) {
        const auto frame = corner.frame(mapping, fading ? clutch : Clutch{});
        EXPECT_NEAR(frame->stiffness, (fading ? 0.5 : 1.0) * kCouplingStiffness * 0.2 / 0.03, 1e-9);
        ASSERT_EQ(frame->compliance_rows, whole->compliance_rows);
        for (std::size_t r = 0; r < frame->compliance_rows; ++r) {
            for (std::size_t s = 0; s <= r; ++s) {
                ASSERT_EQ(frame->compliance[compliance_index(r, s)], whole->compliance[compliance_index(r, s)])
                    << r << ' ' << s;
            }
        }
    }
}

}  // namespace
}  // namespace haptic::sim
