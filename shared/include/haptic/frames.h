/* What the two processes say to one another: the slots of the two rings, in C, so that any simulator can fill them.
 *
 * haptic_contact_frame goes from the simulation to the real-time process: the contact planes that the hand may feel
 * until the next frame comes. haptic_device_state goes the other way. Both are in the device's frame (right-handed, y
 * up, origin at the centre of the frame of strings) and in SI units; times are nanoseconds of CLOCK_MONOTONIC;
 * quaternions are (w, x, y, z). A change of layout or meaning raises HAPTIC_ABI_VERSION, and the ring refuses the other
 * version.
 */
#ifndef HAPTIC_FRAMES_H
#define HAPTIC_FRAMES_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define HAPTIC_ABI_VERSION 3u
#define HAPTIC_MAX_PROXIES 64u
#define HAPTIC_MAX_PLANES 3u
#define HAPTIC_STRINGS 8u

/* A half-space in which the centre of a proxy may be: dot(normal, x) >= offset + velocity * (t - plane_time_ns) * 1e-9.
 * The radius of the proxy is already in the offset (configuration-space obstacle, Ruspini et al. 1997). */
typedef struct haptic_plane {
    double normal[3]; /* unit, out of the surface */
    double offset;    /* m */
    double velocity;  /* m/s, of the surface along its normal */
} haptic_plane;

/* One sphere of the haptic tool. A tool of one sphere has one, with rest_offset 0. */
typedef struct haptic_proxy {
    double rest_offset[3];      /* m, grip frame: where the particle is while nothing touches it */
    double position[3];         /* m, where the simulation has it at plane_time_ns */
    double surface_velocity[3]; /* m/s, at which what it touches takes it along if it sticks; only what lies in the
                                   planes counts. 0 for a simulation without friction */
    uint32_t in_contact;        /* HAPTIC_PROXY_* bits of what the simulation found; 0 if it touches nothing */
    uint32_t plane_count;       /* 0..HAPTIC_MAX_PLANES; planes of surfaces in reach are sent before they touch */
    haptic_plane planes[HAPTIC_MAX_PLANES];
} haptic_proxy;

/* Bits of haptic_proxy.in_contact. */
enum {
    HAPTIC_PROXY_TOUCHES = 1u << 0,
    HAPTIC_PROXY_STICKS = 1u << 1 /* friction holds it to what it touches: position goes with surface_velocity */
};

/* Bits of haptic_contact_frame.flags. With d_i from the goal of particle i (where the grip has it) to its local proxy,
 * those particles that touch make F = k sum d_i / N, T = k_t sum r_i x d_i / N, with N the number of all and r_i
 * from the grip to the goal (thesis, section 5.2.2), unless a bit says otherwise. */
enum {
    HAPTIC_FRAME_SQUEEZED = 1u << 0, /* the surfaces leave some proxy no room; its position is the least bad one */
    HAPTIC_FRAME_CLUTCHED = 1u << 1, /* the grip is uncoupled from the scene: no force */
    HAPTIC_FRAME_SERIES_SPRINGS = 1u << 2, /* springs of the particles in series with those of the grip: the force does
                                              not fall with their number (haptic/series_springs.hpp) */
    HAPTIC_FRAME_HOLD_POSITIONS = 1u << 3  /* particles that touch are held at position, planes are not looked at: the
                                              thesis' multi-rate scheme (5.4.1), with its dragging force */
};

typedef struct haptic_contact_frame {
    uint64_t sequence;         /* written by the ring: 1, 2, 3, ... over all sessions of the ring */
    uint64_t session;          /* written by the ring: differs each time a writer attaches */
    uint64_t state_sequence;   /* of the device state that this frame answers; 0 if there was none yet */
    int64_t state_time_ns;     /* its encoder latch time */
    int64_t plane_time_ns;     /* the time at which the planes' offsets hold */
    int64_t publish_time_ns;   /* when the frame was handed to the ring */
    int64_t step_ns;           /* how long the simulation expects until its next frame */
    double stiffness;          /* N/m, coupling as felt at the hand */
    double torque_stiffness;   /* N/m, of the particles' springs where they make the torque; 0: stiffness */
    double damping;            /* N*s/m */
    double rotational_damping; /* N*m*s/rad */
    double static_friction;    /* coefficient up to which a proxy sticks to its planes; 0: smooth */
    double dynamic_friction;   /* coefficient while it slides, at most static_friction */
    uint32_t proxy_count;      /* 0..HAPTIC_MAX_PROXIES */
    uint32_t flags;
    haptic_proxy proxies[HAPTIC_MAX_PROXIES];
} haptic_contact_frame;

/* States of the safety machine (haptic_device_state.safety_state). */
enum {
    HAPTIC_DISARMED = 0,    /* motors carry zero */
    HAPTIC_TENSIONING = 1,  /* ramp to minimum tension */
    HAPTIC_CALIBRATING = 2, /* grip at the centre, lengths are set */
    HAPTIC_RUNNING = 3,
    HAPTIC_FAULTED = 4 /* force faded out; a fault bit says why */
};

/* Faults, latched until the process is armed again (haptic_device_state.faults). */
enum {
    HAPTIC_FAULT_EXCHANGE = 1u << 0,  /* transfer failed, short or late */
    HAPTIC_FAULT_JUMP = 1u << 1,      /* an encoder moved faster than a hand can */
    HAPTIC_FAULT_SLACK = 1u << 2,     /* a string reads longer than the other ones explain: it lost its tension */
    HAPTIC_FAULT_RESIDUAL = 1u << 3,  /* the eight lengths contradict each other */
    HAPTIC_FAULT_OVERRUN = 1u << 4,   /* too many ticks in a row were late */
    HAPTIC_FAULT_NONFINITE = 1u << 5, /* a value was not a number */
    HAPTIC_FAULT_STOP = 1u << 6,      /* stop input or signal */
    HAPTIC_FAULT_THERMAL = 1u << 7,   /* a motor has carried more than it bears for longer than it bears it */
    HAPTIC_FAULT_WATCHDOG = 1u << 8   /* no tick ended for too long: zeros were sent over the loop's head */
};

/* What one tick dropped or limited (haptic_device_state.tick_flags). Bits 24 to 31: strings 0 to 7 of which one is at
 * fault where the eight lengths contradict each other; more than one where the lengths cannot tell them apart. */
#define HAPTIC_TICK_SUSPECTS_SHIFT 24u
enum {
    HAPTIC_TICK_OVERRUN = 1u << 0,            /* woke after the next deadline had passed */
    HAPTIC_TICK_FRAME_STALE = 1u << 1,        /* no fresh contact frame: the force fades */
    HAPTIC_TICK_FRAME_REJECTED = 1u << 2,     /* a frame failed validation and was ignored */
    HAPTIC_TICK_FORCE_LIMITED = 1u << 3,      /* the wrench met its limit of size */
    HAPTIC_TICK_SLEW_LIMITED = 1u << 4,       /* the wrench met its limit of rate */
    HAPTIC_TICK_WRENCH_UNREACHABLE = 1u << 5, /* strings within bounds cannot make the wrench; the closest was sent */
    HAPTIC_TICK_EXCHANGE_FAILED = 1u << 6,    /* no encoder packet: the last pose was kept */
    HAPTIC_TICK_DERATED = 1u << 7,            /* a warm motor may pull less than usual */
    HAPTIC_TICK_STIFFNESS_LIMITED = 1u << 8,  /* the frame's stiffness was lowered: rate and damping allow no more */
    HAPTIC_TICK_PASSIVITY_LIMITED = 1u << 9,  /* the wrench was changed so that it gives no energy that never came in */
    HAPTIC_TICK_PROBE_OFF = 1u << 10          /* the kernel refused an edge of a GPIO probe: it makes no more of them */
};

typedef struct haptic_device_state {
    uint64_t sequence;              /* written by the ring */
    uint64_t session;               /* written by the ring */
    int64_t latch_time_ns;          /* when the encoders were latched */
    uint64_t frame_sequence;        /* of the contact frame that this tick rendered; 0 if none */
    double position[3];             /* m, of the grip in the device frame */
    double orientation[4];          /* device_from_grip (w, x, y, z) */
    double linear_velocity[3];      /* m/s */
    double angular_velocity[3];     /* rad/s */
    double force[3];                /* N, that the strings really make */
    double torque[3];               /* N*m, likewise */
    double proxy_position[3];       /* m, local proxy of the first proxy particle */
    double tension[HAPTIC_STRINGS]; /* N, sent to the motors */
    uint32_t safety_state;
    uint32_t faults;
    uint32_t tick_flags;
    uint32_t buttons; /* bit k: button k is held */
} haptic_device_state;

#ifdef __cplusplus
}
#endif

#endif /* HAPTIC_FRAMES_H */
