// Takes the real-time process's part: publishes a device state, runs the simulator, and checks the frame that came.
#include <haptic/haptic.h>
#include <unistd.h>

#include <cstdlib>
#include <exception>
#include <haptic/clock.hpp>
#include <haptic/ring.hpp>
#include <iostream>
#include <memory>
#include <string>

namespace {

int listen_to(const std::string& simulator) {
    const std::string session = "consumer-" + std::to_string(getpid());
    haptic::RingWriter<haptic::DeviceState> states(session);
    haptic::RingReader<haptic::ContactFrame> contacts(session);
    haptic::DeviceState state{};
    state.position[1] = 0.125;
    states.publish(state, haptic::monotonic_now_ns());

    if (std::system(("\"" + simulator + "\" " + session).c_str()) != 0) {
        std::cerr << "the simulator failed\n";
        return 1;
    }
    auto frame = std::make_unique<haptic::ContactFrame>();
    if (!contacts.read_newest(*frame)) {
        std::cerr << "no frame came\n";
        return 1;
    }
    const bool as_sent = frame->sequence == 10 && haptic::find_defect(*frame) == haptic::FrameDefect::None &&
                         frame->state_sequence == 1 && frame->proxies[0].planes[0].offset == 0.125 &&
                         contacts.peer().closed;
    std::cout << "haptic " << haptic_version() << ": frame " << frame->sequence
              << (as_sent ? " as sent\n" : " differs\n");
    return as_sent ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
    if (argc != 2) {
        std::cerr << "usage: " << argv[0] << " SIMULATOR\n";
        return 2;
    }
    try {
        return listen_to(argv[1]);
    } catch (const std::exception& error) {
        std::cerr << error.what() << '\n';
        return 1;
    }
}
