// Benchmark of a whole tick: counters in, pose, proxies of the prepared frame, wrench, tensions, motors out, state
// published, record kept. The board's packets are prepared beforehand, so that the device's emulation is not measured.
#include <benchmark/benchmark.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "boards/sh4_board.hpp"
#include "codecs/sh4_codec.hpp"
#include "emulated/sh4_firmware.hpp"
#include "haptic/clock.hpp"
#include "haptic/denormals.hpp"
#include "haptic/device/emulated_device.hpp"
#include "haptic/histogram.hpp"
#include "haptic/ring.hpp"
#include "tick/tick.hpp"

namespace haptic::rt {
namespace {

constexpr std::int64_t kTickNs = 1'000'000;
constexpr int kPackets = 4000;  // ticks of the hand's motion, which repeats

/// Hand moving on a small circle at 0.25 m/s and rotating back and forth.
PoseTrack moving_hand() {
    std::vector<double> times_s;
    std::vector<Pose> poses;
    for (int i = 0; i <= kPackets; ++i) {
        const double t = 1e-3 * i;
        const double angle = 2.0 * 3.14159265358979323846 * 4.0 * t;
        times_s.push_back(t);
        poses.push_back({Vec3(0.01 * (std::cos(angle) - 1.0), 0.01 * std::sin(angle), 0.0),
                         glm::angleAxis(0.2 * std::sin(angle), Vec3(0, 0, 1))});
    }
    return {times_s, poses};
}

/// Packets that an emulated board would send.
class PreparedTransport final : public device::Transport {
  public:
    PreparedTransport() : packets_(kPackets) {
        device::EmulatedDevice grip({.geometry = device::spidar_g6_x3r(), .hand = moving_hand()});
        device::Sh4Firmware firmware(grip);
        device::Sh4Packet out{};
        device::encode(device::Sh4Command{}, out);
        for (int i = 0; i < kPackets; ++i) {
            firmware.receive(out, i * kTickNs);
            firmware.reply(packets_[static_cast<std::size_t>(i)], i * kTickNs);
        }
    }
    device::ExchangeStatus exchange(device::PacketExchange& packets, std::int64_t now_ns) HAPTIC_RT override {
        benchmark::DoNotOptimize(packets.out[0].data());
        // The answer echoes the DAC codes of the last command, in this exchange or in an earlier one.
        if (!packets.out[0].empty()) {
            std::copy_n(packets.out[0].begin() + 2, echo_.size(), echo_.begin());
        }
        if (!packets.in.empty()) {
            device::Sh4Packet& packet = packets_[moving ? static_cast<std::size_t>(now_ns / kTickNs % kPackets) : 0];
            std::copy(echo_.begin(), echo_.end(), packet.begin());
            std::copy(packet.begin(), packet.end(), packets.in.begin());
            packets.received = packet.size();
        }
        return device::ExchangeStatus::Ok;
    }
    void send_last(std::span<const std::byte> /*out*/, std::int64_t /*now_ns*/) HAPTIC_RT override {}
    void drain() override {}

    bool moving = false;

  private:
    std::vector<device::Sh4Packet> packets_;
    std::array<std::byte, 2 * kStrings> echo_{};
};

/// Tool of a frame, by what its compliance contains.
enum Tool : std::int64_t {
    kLimp = 0,    // none: each particle has its own spring
    kElastic = 1  // the springs of translation and rotation, and each particle yields by itself besides
};

void make_elastic(ContactFrame& frame) {
    // Centre of the rest offsets and mean square of their distances from it: with k_t = k, the rotational springs.
    Vec3 centre(0.0);
    for (std::uint32_t i = 0; i < frame.proxy_count; ++i) {
        centre += to_vec3(frame.proxies[i].rest_offset) / static_cast<double>(frame.proxy_count);
    }
    double mean_square = 0.0;
    for (std::uint32_t i = 0; i < frame.proxy_count; ++i) {
        const Vec3 arm = to_vec3(frame.proxies[i].rest_offset) - centre;
        mean_square += glm::dot(arm, arm) / static_cast<double>(frame.proxy_count);
    }
    // Rows: direction and moment about the centre.
    std::vector<Vec3> normals;
    std::vector<Vec3> moments;
    std::vector<std::uint32_t> owners;
    for (std::uint32_t i = 0; i < frame.proxy_count; ++i) {
        for (std::uint32_t k = 0; k < frame.proxies[i].plane_count; ++k) {
            normals.push_back(to_vec3(frame.proxies[i].planes[k].normal));
            moments.push_back(glm::cross(to_vec3(frame.proxies[i].rest_offset) - centre, normals.back()));
            owners.push_back(i);
        }
    }
    frame.compliance_rows = static_cast<std::uint32_t>(normals.size());
    for (std::size_t r = 0; r < normals.size(); ++r) {
        for (std::size_t s = 0; s <= r; ++s) {
            const double translation = (owners[r] == owners[s] ? 1.2 : 1.0) * glm::dot(normals[r], normals[s]);
            const double rotation = glm::dot(moments[r], moments[s]) / mean_square;
            const double share = r == s ? 1.0 : 1.0 - kSurfaceShare;
            frame.compliance[compliance_index(r, s)] = static_cast<float>(share * (translation + rotation));
        }
    }
}

/// Frame in which each particle has three planes, about half of them active at any time.
ContactFrame frame_of(std::uint32_t proxies, std::int64_t tool) {
    ContactFrame frame{};
    frame.step_ns = 10 * kTickNs;
    frame.stiffness = 100.0;
    frame.proxy_count = proxies;
    for (std::uint32_t i = 0; i < proxies; ++i) {
        ProxyContact& particle = frame.proxies[i];
        const double angle = 0.7 * i;
        store(Vec3(0.01 * std::cos(angle), 0.0, 0.01 * std::sin(angle)), particle.rest_offset);
        particle.plane_count = kMaxPlanes;
        store(Vec3(0, 1, 0), particle.planes[0].normal);
        store(glm::normalize(Vec3(1, 1, 0)), particle.planes[1].normal);
        store(glm::normalize(Vec3(0, 1, 1)), particle.planes[2].normal);
        particle.planes[0].offset = 0.0;
        particle.planes[1].offset = -0.003;
        particle.planes[2].offset = -0.003;
        particle.planes[0].velocity = 0.001;
    }
    if (tool == kElastic) {
        make_elastic(frame);
    }
    return frame;
}

/// In place of rt-core's frame thread: prepares frames between the ticks, so that a tick only takes them.
class FramesBetweenTicks final : public FrameIntake {
  public:
    explicit FramesBetweenTicks(FrameSource& source) : source_(source) {}
    void prepare() {
        if (source_.take(next_, 0)) {
            previewer_.preview_ahead(*next_, start_);
            is_new_ = true;
        }
    }
    void expect(const FrameStart& start) HAPTIC_RT override { start_ = start; }
    [[nodiscard]] bool take(PreparedFrame*& inbox, std::int64_t /*deadline_ns*/) HAPTIC_RT override {
        if (!is_new_) {
            return false;
        }
        std::swap(inbox, next_);
        is_new_ = false;
        return true;
    }

  private:
    FrameIntakeInTick source_;
    std::unique_ptr<PreparedFrame> owned_ = std::make_unique<PreparedFrame>();
    PreparedFrame* next_ = owned_.get();
    FrameStart start_;
    ToolContact previewer_;
    bool is_new_ = false;
};

/// Stand-in for a GPIO line: one system call, the cost of an edge without the driver's register write. The full cost on
/// a machine is probes.edge_us in the report of a run with probes.
class EmptyCall final : public OutputLine {
  public:
    int set(bool /*up*/) HAPTIC_RT override {
        HAPTIC_RT_EXCEPTION_BEGIN("reads a number of the process and does not wait")
        benchmark::DoNotOptimize(syscall(SYS_getppid));
        HAPTIC_RT_EXCEPTION_END
        return 0;
    }
};

void probe_edge(benchmark::State& state) {
    Probe probe(std::make_unique<EmptyCall>(), "probe", &monotonic_now_ns);
    for ([[maybe_unused]] auto unused : state) {  // NOLINT(clang-analyzer-deadcode.DeadStores)
        probe.toggle();
    }
}
BENCHMARK(probe_edge);

/// Of the ticks of the hand's motion, each done kRepeats times and taken at its median: the p99.9. What the ticks
/// themselves cost, without interrupts and other guests of the host, which hit another tick each time.
template <class Step>
double work_tail_us(const Step& step) {
    constexpr std::size_t kRepeats = 7;
    std::vector<std::array<std::int64_t, kRepeats>> taken_ns(kPackets);
    for (std::size_t repeat = 0; repeat < kRepeats; ++repeat) {
        for (std::array<std::int64_t, kRepeats>& tick : taken_ns) {
            tick[repeat] = step();
        }
    }
    std::vector<std::int64_t> medians_ns;
    for (std::array<std::int64_t, kRepeats>& tick : taken_ns) {
        const auto middle = tick.begin() + kRepeats / 2;
        std::nth_element(tick.begin(), middle, tick.end());
        medians_ns.push_back(*middle);
    }
    const auto tail = medians_ns.end() - kPackets / 1000 - 1;
    std::nth_element(medians_ns.begin(), tail, medians_ns.end());
    return 1e-3 * static_cast<double>(*tail);
}

/// Arguments: number of proxy particles, ticks per frame, Tool, probes (0 or 1).
void tick(benchmark::State& state) {
    const FlushDenormals flush;
    const std::string session = "tick-bench-" + std::to_string(getpid());
    const TickSettings settings;
    PreparedTransport packets;
    device::Sh4Board board(packets);
    RingReader<ContactFrame> frames_in(session);
    RingWriter<DeviceState> states_out(session);
    RingWriter<ContactFrame> frames_out(session);
    RingFrames frames(frames_in);
    FramesBetweenTicks intake(frames);
    const auto subject = std::make_unique<Tick>(settings, board, frames, states_out, &monotonic_now_ns);
    subject->take_frames_from(intake);
    TickProbes probes{Probe(std::make_unique<EmptyCall>(), "tick", &monotonic_now_ns),
                      Probe(std::make_unique<EmptyCall>(), "frame", &monotonic_now_ns)};
    subject->show_on(state.range(3) != 0 ? &probes : nullptr);
    ContactFrame frame = frame_of(static_cast<std::uint32_t>(state.range(0)), state.range(2));
    std::int64_t now_ns = kPackets * kTickNs;
    std::int64_t ticks = 0;
    const auto step = [&] {
        if (ticks++ % state.range(1) == 0) {
            frame.plane_time_ns = now_ns;
            frame.publish_time_ns = now_ns;
            frames_out.publish(frame, now_ns);
            intake.prepare();
        }
        const std::int64_t begin_ns = monotonic_now_ns();
        subject->run({now_ns, now_ns});
        const std::int64_t taken_ns = monotonic_now_ns() - begin_ns;
        now_ns += kTickNs;
        return taken_ns;
    };
    subject->arm();
    while (subject->safety_state() != SafetyState::Running) {
        step();
    }
    while (now_ns / kTickNs % kPackets != 0) {
        step();
    }
    packets.moving = true;

    const auto histogram = std::make_unique<Histogram>();
    for ([[maybe_unused]] auto unused : state) {  // NOLINT(clang-analyzer-deadcode.DeadStores)
        const std::int64_t taken_ns = step();
        histogram->record(taken_ns);
        state.SetIterationTime(1e-9 * static_cast<double>(taken_ns));
    }
    if (subject->safety_state() != SafetyState::Running || subject->instruments().contact_ticks == 0) {
        state.SkipWithError("the tick was not running in contact");
    }
    state.counters["p50_us"] = 1e-3 * static_cast<double>(histogram->percentile_ns(0.5));
    state.counters["p99.9_us"] = 1e-3 * static_cast<double>(histogram->percentile_ns(0.999));
    state.counters["work_p99.9_us"] = work_tail_us(step);
}

BENCHMARK(tick)
    ->ArgNames({"proxies", "ticks_per_frame", "tool", "probes"})
    ->Args({1, 10, kLimp, 0})
    ->Args({37, 10, kLimp, 0})
    ->Args({37, 10, kLimp, 1})
    ->Args({64, 10, kLimp, 0})
    ->Args({64, 1, kLimp, 0})
    ->Args({37, 10, kElastic, 0})
    ->Args({64, 10, kElastic, 0})
    ->Args({64, 1, kElastic, 0})
    ->UseManualTime()
    ->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace haptic::rt

BENCHMARK_MAIN();
