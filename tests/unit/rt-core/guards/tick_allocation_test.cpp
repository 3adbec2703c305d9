// No tick allocates or frees memory, in any situation.
#include <gtest/gtest.h>

#include <cstdlib>
#include <glm/geometric.hpp>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "../tick_rig.hpp"
#include "allocation_guard.hpp"
#include "haptic/contact_problem.hpp"

namespace haptic::rt {
namespace {

using haptic::test::AllocationGuard;
using test::floor_frame;
using test::TickRig;

/// Keeps the compiler from removing an unused allocation.
void look_at(const void* memory) {
    __asm__ volatile("" : : "g"(memory) : "memory");
}

TEST(AllocationGuard, CountsNothingWhereNothingIsAllocated) {
    const AllocationGuard guard;
    EXPECT_EQ(guard.calls(), 0u);
}

TEST(AllocationGuard, CountsEveryWayToAllocate) {
    const auto counts = [](void (*act)()) {
        const AllocationGuard guard;
        act();
        return guard.calls();
    };
    EXPECT_EQ(counts([] {
                  void* const memory = std::malloc(40);
                  look_at(memory);
                  std::free(memory);
              }),
              2u);
    EXPECT_GE(counts([] { look_at(std::make_unique<int>(3).get()); }), 2u);
    EXPECT_GE(counts([] { look_at(std::vector<int>(100).data()); }), 2u);
    EXPECT_GE(counts([] { look_at(std::string(100, 'x').data()); }), 2u);
    EXPECT_GE(counts([] {
                  struct alignas(128) Wide {
                      char bytes[128];
                  };
                  look_at(std::make_unique<Wide>().get());
              }),
              2u);
    EXPECT_GE(counts([] {
                  void* const memory = std::calloc(3, 40);
                  look_at(memory);
                  void* const more = std::realloc(memory, 4000);
                  look_at(more);
                  std::free(more);
              }),
              3u);
}

TEST(AllocationGuard, CountsItsOwnThreadOnly) {
    std::thread other;
    {
        const AllocationGuard guard;
        std::size_t before = 0;
        other = std::thread([] { look_at(std::vector<int>(1000).data()); });
        before = guard.calls();  // starting a thread allocates here
        other.join();
        EXPECT_LE(guard.calls(), before + 1);
        EXPECT_GT(before, 0u);
    }
}

class TickAllocations : public testing::Test {
  protected:
    TickAllocations()
        : rig(PoseTrack({0.0, 1.0, 1.5, 2.0, 2.5, 60.0},
                        {Pose{}, Pose{}, Pose{{0, -0.02, 0}, Quat(1, 0, 0, 0)}, Pose{},
                         Pose{{0.01, -0.02, 0}, {1, 0, 0, 0}}, Pose{{0.01, -0.02, 0}, {1, 0, 0, 0}}})) {
        rig.tick.record_to(&recorder);
        frame = floor_frame(-0.01, 400.0, 0);
        frame.proxy_count = 37;
        for (std::size_t i = 0; i < 37; ++i) {
            ProxyContact& particle = frame.proxies[i];
            particle = frame.proxies[0];
            particle.rest_offset[0] = 1e-4 * static_cast<double>(i);
            particle.plane_count = 3;
            particle.planes[1].normal[0] = 1.0;
            particle.planes[1].offset = -0.005;
            particle.planes[2].normal[2] = -1.0;
            particle.planes[2].offset = -0.005;
        }
        make_elastic();
    }

    /// Friction and the compliance of a tool each of whose particles yields alone, and all with the grip:
    /// k C_ij = (1 + 4 delta_ij) 1.
    void make_elastic() {
        frame.static_friction = 0.6;
        frame.dynamic_friction = 0.4;
        std::vector<std::pair<std::size_t, Vec3>> rows;  // particle and direction
        for (std::size_t i = 0; i < frame.proxy_count; ++i) {
            ProxyContact& particle = frame.proxies[i];
            particle.in_contact = HAPTIC_PROXY_TANGENTS;
            for (const ContactPlane& plane : particle.planes) {
                rows.emplace_back(i, to_vec3(plane.normal));
            }
            for (const Vec3& tangent : contact_tangents(to_vec3(particle.planes[0].normal))) {
                rows.emplace_back(i, tangent);
            }
        }
        elastic_rows = static_cast<std::uint32_t>(rows.size());
        for (std::size_t r = 0; r < rows.size(); ++r) {
            for (std::size_t s = 0; s <= r; ++s) {
                const double between =
                    (rows[r].first == rows[s].first ? 5.0 : 1.0) * (r == s ? 1.0 : 1.0 - kSurfaceShare);
                frame.compliance[compliance_index(r, s)] =
                    static_cast<float>(between * glm::dot(rows[r].second, rows[s].second));
            }
        }
    }

    /// Allocations in a number of ticks, with a frame every tenth: of an elastic tool for half a second, of a limp one
    /// for the next.
    std::size_t calls_in(int ticks, bool with_frames = true) {
        const AllocationGuard guard;
        for (int i = 0; i < ticks; ++i) {
            if (with_frames && i % 10 == 0) {
                frame.plane_time_ns = rig.now_ns;
                frame.publish_time_ns = rig.now_ns;
                frame.compliance_rows = i / 500 % 2 == 0 ? elastic_rows : 0;
                rig.frames_out.publish(frame, rig.now_ns);
            }
            rig.step();
        }
        return guard.calls();
    }

    TickRig rig;
    Recorder recorder{1024};  // never drained: dropping must not allocate either
    ContactFrame frame{};
    std::uint32_t elastic_rows = 0;
};

TEST_F(TickAllocations, AreZeroFromArmingThroughContactToTheStop) {
    rig.tick.arm();
    EXPECT_EQ(calls_in(5000), 0u);
    EXPECT_GT(rig.tick.instruments().contact_ticks, 1000u);
    EXPECT_EQ(rig.tick.instruments().frames_received, 500u);
    EXPECT_EQ(rig.tick.instruments().frames_rejected, 0u);
    EXPECT_EQ(calls_in(500, false), 0u) << "while the force of a stale frame fades";
    rig.tick.stop();
    EXPECT_EQ(calls_in(1000), 0u);
    EXPECT_EQ(rig.tick.safety_state(), SafetyState::Disarmed);
}

TEST_F(TickAllocations, AreZeroWhenEverythingGoesWrong) {
    rig.tick.arm();
    EXPECT_EQ(calls_in(1500), 0u);
    frame.proxies[3].planes[0].normal[1] = 7.0;  // rejected
    EXPECT_EQ(calls_in(100), 0u);
    rig.faulty.added[1] = 9000;  // a jump
    EXPECT_EQ(calls_in(100), 0u);
    rig.faulty.failing = true;
    EXPECT_EQ(calls_in(1000), 0u);
    EXPECT_NE(rig.tick.faults(), 0u);
}

}  // namespace
}  // namespace haptic::rt
