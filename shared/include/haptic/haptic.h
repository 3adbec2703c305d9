/* C interface for other simulators: publish contact planes to the real-time process, read the device's state.
 *
 * A simulator opens both ends of one session, before or after the real-time process does. At its own rate it then reads
 * the newest device state and publishes a contact frame in response:
 *
 *     haptic_state_reader* states = haptic_state_reader_open("default");
 *     haptic_contact_writer* contacts = haptic_contact_writer_open("default");
 *     if (states == NULL || contacts == NULL) {
 *         fprintf(stderr, "%s\n", haptic_last_error());
 *     }
 *     haptic_device_state state;
 *     static haptic_contact_frame frame;       // 89 kB
 *     while (running) {
 *         if (haptic_state_reader_read(states, &state) == 1) {
 *             frame.state_sequence = state.sequence;
 *             frame.state_time_ns = state.latch_time_ns;
 *         }
 *         frame.plane_time_ns = haptic_now_ns();
 *         frame.step_ns = 1000000;             // the next frame follows in 1 ms
 *         frame.stiffness = 500.0;             // N/m
 *         frame.proxy_count = 1;               // a floor at y = 0:
 *         frame.proxies[0].plane_count = 1;
 *         frame.proxies[0].planes[0].normal[1] = 1.0;
 *         if (haptic_contact_writer_publish(contacts, &frame, haptic_now_ns()) == 0) {
 *             fprintf(stderr, "%s\n", haptic_last_error());
 *         }
 *     }
 *     haptic_contact_writer_close(contacts);
 *     haptic_state_reader_close(states);
 *
 * No function throws or ends the process. One thread at a time may use a handle; different handles are independent.
 * After open, no function of a writer or a reader allocates, locks or makes a system call. The library is libhaptic.so:
 * find_package(haptic) and haptic::haptic in CMake, `pkg-config --cflags --libs haptic`, or dlopen("libhaptic.so.0").
 */
#ifndef HAPTIC_HAPTIC_H
#define HAPTIC_HAPTIC_H

#include <stdint.h>

#include "haptic/frames.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct haptic_contact_writer haptic_contact_writer;
typedef struct haptic_state_reader haptic_state_reader;
typedef struct haptic_contact_observer haptic_contact_observer;
typedef struct haptic_state_observer haptic_state_observer;

/* Version of the library, "MAJOR.MINOR.PATCH". */
const char* haptic_version(void);
/* ABI version of the library's frames and ring; compare with HAPTIC_ABI_VERSION of your build. */
uint32_t haptic_abi_version(void);
/* Message of the last failed call in this thread: the problem, its place, and a remedy. Never NULL; valid until the
 * next failed call in this thread. */
const char* haptic_last_error(void);
/* CLOCK_MONOTONIC in nanoseconds, the clock of every time in a frame. */
int64_t haptic_now_ns(void);

/* Attaches as the session's writer of contact frames and creates the shared memory if necessary. A session name has 1
 * to 64 of the characters A-Z a-z 0-9 _ -; the programs' default is "default". NULL on failure: invalid name, another
 * process has this role, or an invalid segment. */
haptic_contact_writer* haptic_contact_writer_open(const char* session);
/* Detaches and informs the real-time process immediately; the last one to detach removes the shared memory. NULL is
 * allowed. */
void haptic_contact_writer_close(haptic_contact_writer* writer);
/* Publishes a frame and sets its sequence, session and publish_time_ns (= now_ns). Returns the sequence, or 0 without
 * publishing if the frame is invalid: too many proxies or planes, a number that is not finite, a normal that is not of
 * unit length, a radius outside 0 to 10 m, a negative coupling, step_ns outside 1 ns to 1 s, compliance_rows that are
 * neither 0 nor the number of planes and tangents, a compliance of no elastic tool, a reserved field that is not 0.
 * Never waits. */
uint64_t haptic_contact_writer_publish(haptic_contact_writer* writer, haptic_contact_frame* frame, int64_t now_ns);
/* Signals that the simulation is alive without a new frame. Returns 0, or -1 for NULL. */
int haptic_contact_writer_beat(haptic_contact_writer* writer, int64_t now_ns);

/* State of the real-time process as the reader sees it. */
typedef struct haptic_peer {
    uint64_t session;     /* of the latest writer; 0 before the first */
    int64_t heartbeat_ns; /* last publication; 0 before the first */
    uint32_t pid;         /* as the process itself stored it; 0 when none is attached */
    uint32_t closed;      /* 1 after it detached in an orderly way */
} haptic_peer;

/* Attaches as the session's reader of device states; fails like haptic_contact_writer_open. */
haptic_state_reader* haptic_state_reader_open(const char* session);
void haptic_state_reader_close(haptic_state_reader* reader);
/* Copies the newest state. Returns 1 if it was not returned before, 0 if there is nothing newer (*state is unchanged),
 * -1 for NULL. Never waits. */
int haptic_state_reader_read(haptic_state_reader* reader, haptic_device_state* state);
/* Returns 0, or -1 for NULL. */
int haptic_state_reader_peer(const haptic_state_reader* reader, haptic_peer* peer);

/* Observers see what the two processes exchange without being one of them, to record or display it. A session may have
 * any number, neither process can detect them, and none of them creates the shared memory: an observer may be opened
 * before the session exists, and follows it when it is created again. NULL for an invalid name. */
haptic_state_observer* haptic_state_observer_open(const char* session);
/* NULL is allowed. */
void haptic_state_observer_close(haptic_state_observer* observer);
/* Copies the oldest state that was not returned before. A ring keeps the last 8; a gap in `sequence` is a state that
 * was overwritten before it was read. Returns 1, or 0 if there is none yet, or -1 on an error: NULL, or shared memory
 * that cannot be observed. Without 1 *state is unspecified. Four times a second (by now_ns, which must not decrease) it
 * makes system calls to look for the shared memory. Never waits. */
int haptic_state_observer_next(haptic_state_observer* observer, haptic_device_state* state, int64_t now_ns);

/* The same for contact frames, which are checked like those that are published; an invalid one is an error. */
haptic_contact_observer* haptic_contact_observer_open(const char* session);
void haptic_contact_observer_close(haptic_contact_observer* observer);
int haptic_contact_observer_next(haptic_contact_observer* observer, haptic_contact_frame* frame, int64_t now_ns);

#ifdef __cplusplus
}
#endif

#endif /* HAPTIC_HAPTIC_H */
