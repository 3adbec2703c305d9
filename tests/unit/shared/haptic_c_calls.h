/* C part of the test of the C interface: each function returns 0 or the line of the first failed expectation. */
#ifndef HAPTIC_TEST_C_CALLS_H
#define HAPTIC_TEST_C_CALLS_H

#ifdef __cplusplus
extern "C" {
#endif

/* Opens both ends, reads state 1 of the C++ side (latch_time_ns 111), publishes one plane in response, closes. */
int haptic_c_pushes_a_frame(const char* session);
/* Publishes frames and states as `session`'s writers; an observer of each ring returns them once, in order. */
int haptic_c_observes(const char* session);
/* Every misuse must return its error value and set a message. */
int haptic_c_refuses_misuse(const char* session);

#ifdef __cplusplus
}
#endif

#endif
