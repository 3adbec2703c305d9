// Soak test: ten million ticks in virtual time, almost three hours of a 1 kHz loop, through contact, lost frames, stops
// and re-arming. None of them allocates, frees or takes a page fault.
#include <gtest/gtest.h>
#include <malloc.h>
#include <sys/mman.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

#include "../tick_rig.hpp"
#include "allocation_guard.hpp"
#include "fake_lines.hpp"
#include "tick/tick_syscalls.hpp"

namespace haptic::rt {
namespace {

using haptic::test::AllocationGuard;
using haptic::test::FakeOutput;
using haptic::test::FakeWire;
using test::floor_frame;
using test::TickRig;

constexpr std::int64_t kTicks = 10'000'000;
constexpr std::int64_t kWarmTicks = 20'000;
constexpr std::int64_t kPhaseTicks = 20'000;     // each begins with arming and ends with a stop
constexpr std::int64_t kStopTicks = 1'500;       // in which force and tension fade
constexpr std::int64_t kHoldNs = 2'000'000'000;  // for which the hand holds still in each phase, for the calibration

/// At rest at the centre at the beginning of each phase, then in and out of the floor while rotating.
PoseTrack restless_hand() {
    const std::int64_t phases = (kTicks + kWarmTicks) / kPhaseTicks + 1;
    std::vector<double> times_s;
    std::vector<Pose> poses;
    for (std::int64_t phase = 0; phase < phases; ++phase) {
        const double begin_s = 1.0 + seconds(phase * kPhaseTicks * 1'000'000);
        times_s.push_back(begin_s);
        poses.emplace_back();
        for (int i = 0; i < 150; ++i) {
            const double t = seconds(kHoldNs) + 0.1 * i;
            times_s.push_back(begin_s + t);
            const double angle = 2.0 * t + static_cast<double>(phase);
            const double away = std::min(1.0, 2.0 * (t - seconds(kHoldNs)));
            poses.push_back({away * Vec3(0.01 * std::sin(angle), 0.012 * std::cos(1.7 * angle), 0.005),
                             glm::angleAxis(0.2 * away * std::sin(0.9 * angle), Vec3(0, 0, 1))});
        }
        times_s.push_back(begin_s + 18.0);
        poses.emplace_back();
    }
    return {times_s, poses};
}

class TickSoak : public testing::Test {
  protected:
    TickSoak() {
        // As in prepare_process(). Some users may not lock memory; the pages must then stay untouched by anything else.
        mallopt(M_TRIM_THRESHOLD, -1);
        mallopt(M_MMAP_MAX, 0);
        (void)mlockall(MCL_CURRENT | MCL_FUTURE);
        rig.tick.show_on(&probes);
        rig.tick.record_to(&recorder);
        frame = floor_frame(0.0, 400.0, 0);
        frame.proxy_count = 37;
        for (std::size_t i = 0; i < frame.proxy_count; ++i) {
            ProxyContact& particle = frame.proxies[i];
            particle = frame.proxies[0];
            particle.rest_offset[0] = 4e-4 * static_cast<double>(i) - 0.007;
            particle.plane_count = 3;
            particle.planes[1].normal[0] = 1.0;
            particle.planes[1].offset = -0.02;
            particle.planes[2].normal[2] = -1.0;
            particle.planes[2].offset = -0.02;
        }
    }

    void run(std::int64_t ticks) {
        for (std::int64_t i = 0; i < ticks; ++i, ++tick_) {
            const std::int64_t in_phase = tick_ % kPhaseTicks;
            if (in_phase == 0) {
                rig.tick.arm();
            } else if (in_phase == kPhaseTicks - kStopTicks) {
                rig.tick.stop();
            }
            // For half a second of each phase the simulation is silent.
            if (tick_ % 10 == 0 && (in_phase < 10'000 || in_phase > 10'500)) {
                frame.plane_time_ns = rig.now_ns;
                frame.publish_time_ns = rig.now_ns;
                rig.frames_out.publish(frame, rig.now_ns);
            }
            rig.step();
        }
    }

    TickRig rig{restless_hand()};
    Recorder recorder{1024};  // never drained: dropping must not allocate either
    ContactFrame frame{};
    std::unique_ptr<FakeWire> tick_wire = std::make_unique<FakeWire>();
    std::unique_ptr<FakeWire> frame_wire = std::make_unique<FakeWire>();
    TickProbes probes{Probe(std::make_unique<FakeOutput>(*tick_wire), "tick", &test::still_clock),
                      Probe(std::make_unique<FakeOutput>(*frame_wire), "frame", &test::still_clock)};
    std::int64_t tick_ = 0;
};

TEST_F(TickSoak, TenMillionTicksNeitherAllocateNorTakeAPageFault) {
    run(kWarmTicks);
    const ThreadUsage before = thread_usage();
    std::size_t calls = 0;
    {
        const AllocationGuard guard;
        run(kTicks);
        calls = guard.calls();
    }
    const ThreadUsage after = thread_usage();
    EXPECT_EQ(calls, 0u);
    EXPECT_EQ(after.page_faults - before.page_faults, 0);

    // Guard: most ticks were in the intended state.
    const Instruments& m = rig.tick.instruments();
    EXPECT_EQ(m.ticks, static_cast<std::uint64_t>(kTicks + kWarmTicks));
    EXPECT_GT(m.contact_ticks, static_cast<std::uint64_t>(kTicks / 5));
    EXPECT_GT(m.stale_ticks, static_cast<std::uint64_t>(kTicks / 100));
    EXPECT_GT(m.frames_received, static_cast<std::uint64_t>(kTicks / 12));
    EXPECT_EQ(m.failed_exchanges, 0u);
    EXPECT_EQ(probes.tick.edges(), 2 * m.ticks);
    EXPECT_EQ(rig.tick.faults() & ~std::uint32_t{HAPTIC_FAULT_STOP}, 0u);
}

}  // namespace
}  // namespace haptic::rt
