/* Pushes ten frames with one plane to the session that it is given, in answer to the newest device state. */
#include <haptic/haptic.h>
#include <stdio.h>

static haptic_contact_frame frame;

int main(int argc, char** argv) {
    if (argc != 2) {
        fprintf(stderr, "usage: %s SESSION\n", argv[0]);
        return 2;
    }
    haptic_state_reader* const states = haptic_state_reader_open(argv[1]);
    haptic_contact_writer* const contacts = haptic_contact_writer_open(argv[1]);
    if (states == NULL || contacts == NULL) {
        fprintf(stderr, "%s\n", haptic_last_error());
        return 1;
    }
    haptic_device_state state;
    if (haptic_state_reader_read(states, &state) != 1) {
        fprintf(stderr, "no device state\n");
        return 1;
    }
    frame.step_ns = 1000000;
    frame.stiffness = 500.0;
    frame.proxy_count = 1;
    frame.proxies[0].plane_count = 1;
    frame.proxies[0].planes[0].normal[1] = 1.0;
    frame.proxies[0].planes[0].offset = state.position[1];
    for (int i = 0; i < 10; ++i) {
        frame.state_sequence = state.sequence;
        frame.plane_time_ns = haptic_now_ns();
        if (haptic_contact_writer_publish(contacts, &frame, haptic_now_ns()) == 0) {
            fprintf(stderr, "%s\n", haptic_last_error());
            return 1;
        }
    }
    haptic_contact_writer_close(contacts);
    haptic_state_reader_close(states);
    return 0;
}
