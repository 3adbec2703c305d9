/* The C interface for other simulators: push contact planes to the real-time process, read the device's state.
 *
 * A simulator opens both ends of one session, in any order with the real-time process, and at its own pace reads the
 * newest device state and publishes a contact frame in answer:
 *
 *     haptic_state_reader* states = haptic_state_reader_open("default");
 *     haptic_contact_writer* contacts = haptic_contact_writer_open("default");
 *     if (states == NULL || contacts == NULL) {
 *         fprintf(stderr, "%s\n", haptic_last_error());
 *     }
 *     haptic_device_state state;
 *     static haptic_contact_frame frame;       // 11 kB
 *     while (running) {
 *         if (haptic_state_reader_read(states, &state) == 1) {
 *             frame.state_sequence = state.sequence;
 *             frame.state_time_ns = state.latch_time_ns;
 *         }
 *         frame.plane_time_ns = haptic_now_ns();
 *         frame.step_ns = 1000000;             // the next frame comes in 1 ms
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
 * No function throws or ends the process. Each handle is used by one thread at a time; different handles need no care.
 * After open, nothing here allocates, locks or makes a system call. Link with haptic::shared (find_package(haptic)).
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

/* Of the library, "MAJOR.MINOR.PATCH". */
const char* haptic_version(void);
/* Of the frames and the ring that the library speaks; compare with HAPTIC_ABI_VERSION that you were compiled with. */
uint32_t haptic_abi_version(void);
/* What the last call that failed in this thread says: what is wrong, where, and what to do. Never NULL; valid until the
 * next call that fails in this thread. */
const char* haptic_last_error(void);
/* CLOCK_MONOTONIC in nanoseconds, the clock of every time in a frame. */
int64_t haptic_now_ns(void);

/* Attaches as the session's source of contact frames, creating its shared memory if it is the first. A session name is
 * 1 to 64 of the characters A-Z a-z 0-9 _ -; the programs' own default is "default". NULL on failure: the name is bad,
 * another process has this part, or the segment is not sound. */
haptic_contact_writer* haptic_contact_writer_open(const char* session);
/* Detaches, so that the real-time process knows of it at once; removes the shared memory if nobody is left. NULL is
 * allowed. */
void haptic_contact_writer_close(haptic_contact_writer* writer);
/* Publishes a frame; fills in its sequence, session and publish_time_ns (= now_ns). Returns the sequence, or 0 if the
 * frame is not sound (then it is not published): too many proxies or planes, a number that is not finite, a normal that
 * is not of unit length, a negative coupling, step_ns outside 1 ns to 1 s. Never waits. */
uint64_t haptic_contact_writer_publish(haptic_contact_writer* writer, haptic_contact_frame* frame, int64_t now_ns);
/* Says that the simulation is alive although it has no new frame. Returns 0, or -1 for NULL. */
int haptic_contact_writer_beat(haptic_contact_writer* writer, int64_t now_ns);

/* What the reader can say of the real-time process. */
typedef struct haptic_peer {
    uint64_t session;     /* of the newest writer; 0 before the first */
    int64_t heartbeat_ns; /* when it last published; 0 before it first did */
    uint32_t pid;         /* 0 when none is attached, as far as it said so itself */
    uint32_t closed;      /* 1 after it left in an orderly way */
} haptic_peer;

/* Attaches as the session's reader of device states; as haptic_contact_writer_open. */
haptic_state_reader* haptic_state_reader_open(const char* session);
void haptic_state_reader_close(haptic_state_reader* reader);
/* Copies the newest state. Returns 1 if it was not returned before, 0 if there is nothing newer (then *state is as it
 * was), -1 for NULL. Never waits. */
int haptic_state_reader_read(haptic_state_reader* reader, haptic_device_state* state);
/* Returns 0, or -1 for NULL. */
int haptic_state_reader_peer(const haptic_state_reader* reader, haptic_peer* peer);

#ifdef __cplusplus
}
#endif

#endif /* HAPTIC_HAPTIC_H */
