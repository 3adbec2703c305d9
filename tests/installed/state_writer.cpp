// Publishes a device state of any bytes as rt-core would: state_writer SESSION < STATE. Stays until the end of its
// input.

#include <array>
#include <cstdio>
#include <cstring>

#include "haptic/clock.hpp"
#include "haptic/frames.hpp"
#include "haptic/ring.hpp"

int main(int argc, char** argv) {
    std::array<char, sizeof(haptic::DeviceState)> bytes{};
    if (argc != 2 || std::fread(bytes.data(), bytes.size(), 1, stdin) != 1) {
        std::fputs("usage: state_writer SESSION < STATE\n", stderr);
        return 2;
    }
    haptic::DeviceState state{};
    std::memcpy(&state, bytes.data(), bytes.size());
    haptic::RingWriter<haptic::DeviceState> states(argv[1]);
    states.publish(state, haptic::monotonic_now_ns());
    std::puts("published");
    std::fflush(stdout);
    while (std::getchar() != EOF) {
    }
}
