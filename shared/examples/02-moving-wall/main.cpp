// A wall that swings to and fro, described only 50 times a second: moving-wall [SESSION [SECONDS]]
#include <haptic/haptic.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <thread>

namespace {

constexpr double kStiffness = 300.0;         // N/m
constexpr double kAmplitude = 0.005;         // m
constexpr double kOmega = 2.0 * 3.14159265;  // rad/s: once a second
constexpr std::int64_t kStepNs = 20'000'000;

/// Closes a handle of the C interface.
struct Close {
    void operator()(haptic_state_reader* states) const { haptic_state_reader_close(states); }
    void operator()(haptic_contact_writer* contacts) const { haptic_contact_writer_close(contacts); }
};

/// The wall's plane: allowed is z >= offset. Its velocity lets rt-core move it on between two frames.
haptic_plane wall_at(std::int64_t time_ns) {
    const double phase = kOmega * 1e-9 * static_cast<double>(time_ns);
    haptic_plane plane{};
    plane.normal[2] = 1.0;
    plane.offset = kAmplitude * std::sin(phase);
    plane.velocity = kAmplitude * kOmega * std::cos(phase);
    return plane;
}

}  // namespace

int main(int argc, char** argv) {
    const char* const session = argc > 1 ? argv[1] : "default";
    const double seconds = argc > 2 ? std::atof(argv[2]) : 10.0;

    const std::unique_ptr<haptic_state_reader, Close> states(haptic_state_reader_open(session));
    const std::unique_ptr<haptic_contact_writer, Close> contacts(haptic_contact_writer_open(session));
    if (!states || !contacts) {
        std::fprintf(stderr, "moving-wall: %s\n", haptic_last_error());
        return 1;
    }

    const auto frame = std::make_unique<haptic_contact_frame>();  // 89 kB of zeros
    frame->step_ns = kStepNs;
    frame->stiffness = kStiffness;
    frame->proxy_count = 1;
    haptic_proxy& proxy = frame->proxies[0];
    proxy.plane_count = 1;

    haptic_device_state state{};
    const auto start = std::chrono::steady_clock::now();
    const auto steps = static_cast<int>(1e9 * seconds / kStepNs);
    for (int step = 0; step < steps; ++step) {
        if (haptic_state_reader_read(states.get(), &state) == 1) {
            frame->state_sequence = state.sequence;
            frame->state_time_ns = state.latch_time_ns;
        }
        const std::int64_t now_ns = haptic_now_ns();
        const haptic_plane wall = wall_at(now_ns);
        proxy.planes[0] = wall;
        frame->plane_time_ns = now_ns;
        const double depth = std::max(0.0, wall.offset - state.position[2]);
        proxy.in_contact = depth > 0.0 ? HAPTIC_PROXY_TOUCHES : 0;
        std::copy_n(state.position, 3, proxy.position);
        proxy.position[2] += depth;
        if (haptic_contact_writer_publish(contacts.get(), frame.get(), now_ns) == 0) {
            std::fprintf(stderr, "moving-wall: %s\n", haptic_last_error());
            return 1;
        }
        if (step % 10 == 0) {
            std::printf("wall at %+.2f mm, hand %.2f mm deep: %.3f N\n", 1e3 * wall.offset, 1e3 * depth,
                        state.force[2]);
            std::fflush(stdout);
        }
        std::this_thread::sleep_until(start + std::chrono::nanoseconds(kStepNs) * (step + 1));
    }
    return 0;
}
