/* A floor through the centre of the device, felt as a spring: push-a-plane [SESSION [SECONDS]] */
#include <haptic/haptic.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

static const double stiffness = 500.0;  /* N/m */
static const double floor_height = 0.0; /* m, device frame: y is up */

int main(int argc, char** argv) {
    const char* const session = argc > 1 ? argv[1] : "default";
    const double seconds = argc > 2 ? atof(argv[2]) : 10.0;

    /* Join the session. Either process may start first. */
    haptic_state_reader* const states = haptic_state_reader_open(session);
    haptic_contact_writer* const contacts = haptic_contact_writer_open(session);
    if (states == NULL || contacts == NULL) {
        fprintf(stderr, "push-a-plane: %s\n", haptic_last_error());
        return 1;
    }

    /* What stays the same in every frame: one proxy, a single point at the grip, and its one plane. Static, because a
     * frame is 89 kB. */
    static haptic_contact_frame frame;
    frame.step_ns = 1000000; /* the next frame follows in 1 ms */
    frame.stiffness = stiffness;
    frame.proxy_count = 1;
    frame.proxies[0].plane_count = 1;
    frame.proxies[0].planes[0].normal[1] = 1.0; /* allowed is what lies above: y >= offset */
    frame.proxies[0].planes[0].offset = floor_height;

    haptic_device_state state = {0};
    const int64_t start_ns = haptic_now_ns();
    int64_t print_ns = start_ns;
    for (int64_t now_ns = start_ns; (double)(now_ns - start_ns) < 1e9 * seconds; now_ns = haptic_now_ns()) {
        /* Answer the newest state of the device. */
        if (haptic_state_reader_read(states, &state) == 1) {
            frame.state_sequence = state.sequence;
            frame.state_time_ns = state.latch_time_ns;
        }
        const double below = floor_height - state.position[1];
        const double depth = below > 0.0 ? below : 0.0;
        frame.proxies[0].in_contact = depth > 0.0 ? HAPTIC_PROXY_TOUCHES : 0;
        for (int i = 0; i < 3; ++i) {
            frame.proxies[0].position[i] = state.position[i];
        }
        frame.proxies[0].position[1] += depth; /* the proxy stays on the floor */
        frame.plane_time_ns = now_ns;
        if (haptic_contact_writer_publish(contacts, &frame, now_ns) == 0) {
            fprintf(stderr, "push-a-plane: %s\n", haptic_last_error());
            return 1;
        }

        if (now_ns >= print_ns) {
            if (state.sequence == 0) {
                printf("no device yet: rt-core run --session %s\n", session);
            } else {
                printf("%.2f mm deep: %.3f N felt, %.3f N expected\n", 1e3 * depth, state.force[1], stiffness * depth);
            }
            fflush(stdout);
            print_ns += 500000000;
        }
        nanosleep(&(struct timespec){.tv_nsec = 1000000}, NULL);
    }
    haptic_contact_writer_close(contacts);
    haptic_state_reader_close(states);
    return 0;
}
