#include "haptic_c_calls.h"

#include <math.h>
#include <string.h>

#include "haptic/haptic.h"

#define EXPECT(condition)    \
    do {                     \
        if (!(condition)) {  \
            return __LINE__; \
        }                    \
    } while (0)

static haptic_contact_frame frame;

static void fill_frame(void) {
    memset(&frame, 0, sizeof frame);
    frame.step_ns = 1000000;
    frame.stiffness = 500.0;
    frame.proxy_count = 1;
    frame.proxies[0].plane_count = 1;
    frame.proxies[0].planes[0].normal[1] = 1.0;
    frame.proxies[0].planes[0].offset = 0.25;
}

int haptic_c_pushes_a_frame(const char* session) {
    haptic_state_reader* const states = haptic_state_reader_open(session);
    haptic_contact_writer* const contacts = haptic_contact_writer_open(session);
    EXPECT(states != NULL && contacts != NULL);

    haptic_device_state state;
    EXPECT(haptic_state_reader_read(states, &state) == 1);
    EXPECT(state.sequence == 1 && state.latch_time_ns == 111);
    EXPECT(haptic_state_reader_read(states, &state) == 0);
    EXPECT(state.latch_time_ns == 111);

    haptic_peer peer;
    EXPECT(haptic_state_reader_peer(states, &peer) == 0);
    EXPECT(peer.session == state.session && peer.heartbeat_ns == 222 && peer.pid != 0 && peer.closed == 0);

    fill_frame();
    frame.state_sequence = state.sequence;
    frame.state_time_ns = state.latch_time_ns;
    EXPECT(haptic_contact_writer_publish(contacts, &frame, 333) == 1);
    EXPECT(frame.publish_time_ns == 333 && frame.sequence == 1 && frame.session != 0);
    EXPECT(haptic_contact_writer_beat(contacts, 444) == 0);

    haptic_contact_writer_close(contacts);
    haptic_state_reader_close(states);
    return 0;
}

int haptic_c_observes(const char* session) {
    haptic_contact_observer* const contacts = haptic_contact_observer_open(session);
    haptic_state_observer* const states = haptic_state_observer_open(session);
    EXPECT(contacts != NULL && states != NULL);
    haptic_device_state state;
    EXPECT(haptic_contact_observer_next(contacts, &frame, 0) == 0);
    EXPECT(haptic_state_observer_next(states, &state, 0) == 0);

    haptic_contact_writer* const writer = haptic_contact_writer_open(session);
    haptic_state_reader* const reader = haptic_state_reader_open(session);
    EXPECT(writer != NULL && reader != NULL);
    fill_frame();
    for (int i = 1; i <= 3; ++i) {
        frame.proxies[0].planes[0].offset = i;
        EXPECT(haptic_contact_writer_publish(writer, &frame, i) == (uint64_t)i);
    }
    const int64_t later_ns = 1000000000;
    for (int i = 1; i <= 3; ++i) {
        EXPECT(haptic_contact_observer_next(contacts, &frame, later_ns) == 1);
        EXPECT(frame.sequence == (uint64_t)i && frame.proxies[0].planes[0].offset == i);
    }
    EXPECT(haptic_contact_observer_next(contacts, &frame, later_ns) == 0);
    EXPECT(haptic_state_observer_next(states, &state, later_ns) == 0);

    haptic_state_reader_close(reader);
    haptic_contact_writer_close(writer);
    haptic_state_observer_close(states);
    haptic_contact_observer_close(contacts);
    return 0;
}

static int says(const char* text) {
    return strstr(haptic_last_error(), text) != NULL;
}

int haptic_c_refuses_misuse(const char* session) {
    EXPECT(haptic_abi_version() == HAPTIC_ABI_VERSION);
    EXPECT(strlen(haptic_version()) >= strlen("0.0.0"));
    EXPECT(haptic_now_ns() > 0);

    EXPECT(haptic_contact_writer_open(NULL) == NULL && says("session is NULL"));
    EXPECT(haptic_state_reader_open(NULL) == NULL && says("session is NULL"));
    EXPECT(haptic_contact_writer_open("no/good") == NULL && says("no/good"));
    EXPECT(haptic_state_reader_open("no/good") == NULL && says("no/good"));

    haptic_contact_writer* const writer = haptic_contact_writer_open(session);
    EXPECT(writer != NULL);
    EXPECT(haptic_contact_writer_open(session) == NULL && says("already has its writer"));

    fill_frame();
    EXPECT(haptic_contact_writer_publish(NULL, &frame, 1) == 0 && says("writer is NULL"));
    EXPECT(haptic_contact_writer_publish(writer, NULL, 1) == 0 && says("frame is NULL"));
    frame.proxies[0].planes[0].normal[1] = 0.5;
    EXPECT(haptic_contact_writer_publish(writer, &frame, 1) == 0 && says("unit length"));
    fill_frame();
    frame.stiffness = (double)NAN;
    EXPECT(haptic_contact_writer_publish(writer, &frame, 1) == 0 && says("not finite"));
    fill_frame();
    EXPECT(haptic_contact_writer_publish(writer, &frame, 1) == 1);

    haptic_device_state state;
    haptic_peer peer;
    haptic_state_reader* const reader = haptic_state_reader_open(session);
    EXPECT(reader != NULL);
    EXPECT(haptic_state_reader_read(NULL, &state) == -1 && says("reader is NULL"));
    EXPECT(haptic_state_reader_read(reader, NULL) == -1 && says("state is NULL"));
    EXPECT(haptic_state_reader_read(reader, &state) == 0);
    EXPECT(haptic_state_reader_peer(NULL, &peer) == -1 && says("reader is NULL"));
    EXPECT(haptic_state_reader_peer(reader, NULL) == -1 && says("peer is NULL"));
    EXPECT(haptic_state_reader_peer(reader, &peer) == 0 && peer.session == 0);
    EXPECT(haptic_contact_writer_beat(NULL, 1) == -1 && says("writer is NULL"));

    haptic_contact_writer_close(writer);
    haptic_state_reader_close(reader);
    EXPECT(haptic_state_observer_open("no/good") == NULL && says("no/good"));
    EXPECT(haptic_contact_observer_open(NULL) == NULL && says("session is NULL"));
    EXPECT(haptic_state_observer_next(NULL, &state, 0) == -1 && says("observer is NULL"));
    EXPECT(haptic_contact_observer_next(NULL, &frame, 0) == -1 && says("observer is NULL"));
    haptic_contact_writer_close(NULL);
    haptic_contact_observer_close(NULL);
    haptic_state_observer_close(NULL);
    haptic_state_reader_close(NULL);
    return 0;
}
