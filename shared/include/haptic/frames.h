/* Slots of the rings, in C, so that any simulator can exchange data with the real-time process.
 *
 * haptic_contact_frame goes from the simulation to the real-time process: the contact planes to render until the next
 * frame arrives. haptic_device_state goes in the opposite direction. haptic_wrench_overlay goes from a third program,
 * through rt-core relay, to the real-time process. All use the device frame (right-handed, y up, origin at the centre
 * of the device) and SI units. Times are nanoseconds of CLOCK_MONOTONIC; quaternions are (w, x, y, z). Any change of
 * layout or meaning increments HAPTIC_ABI_VERSION, and the ring refuses other versions.
 */
#ifndef HAPTIC_FRAMES_H
#define HAPTIC_FRAMES_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define HAPTIC_ABI_VERSION 6u
#define HAPTIC_MAX_PROXIES 64u
#define HAPTIC_MAX_PLANES 3u
#define HAPTIC_STRINGS 8u
#define HAPTIC_MAX_COMPLIANCE_ROWS 192u
#define HAPTIC_MAX_COMPLIANCES (HAPTIC_MAX_COMPLIANCE_ROWS * (HAPTIC_MAX_COMPLIANCE_ROWS + 1u) / 2u)

/* Half-space of allowed positions x of a proxy's centre:
 * dot(normal, x) >= offset + velocity * (t - plane_time_ns) * 1e-9.
 * The offset includes the radius of the proxy (configuration-space obstacle, Ruspini et al. 1997). Planes describe
 * where the force is: a surface whose contact is damped leads its position by tau v, with v the speed of its approach
 * and tau the time constant of damping and stiffness in parallel. */
typedef struct haptic_plane {
    double normal[3]; /* unit, pointing out of the surface */
    double offset;    /* m */
    double velocity;  /* m/s, of the surface along its normal */
} haptic_plane;

/* One sphere of the haptic tool. A tool with a single sphere has rest_offset 0. */
typedef struct haptic_proxy {
    double rest_offset[3];      /* m, grip frame: position of the particle without contact */
    double rest_velocity[3];    /* m/s, grip frame: velocity of rest_offset, of a hand that closes or opens */
    double radius;              /* m, of a sphere that turns with the tool: friction acts where it touches, this far off
                                   its centre along the normal of its first plane. 0, and without compliance: at its
                                   centre */
    double position[3];         /* m, simulated position at plane_time_ns; of a sphere that sticks and turns, where it
                                   would be if it had turned with the grip alone */
    double surface_velocity[3]; /* m/s, of the touched surface, which carries the proxy along while it sticks;
                                   only the component in the planes is used. 0 without friction */
    uint32_t in_contact;        /* HAPTIC_PROXY_* bits; 0 without contact */
    uint32_t plane_count;       /* 0..HAPTIC_MAX_PLANES; nearby surfaces have planes before they touch */
    haptic_plane planes[HAPTIC_MAX_PLANES];
} haptic_proxy;

/* Bits of haptic_proxy.in_contact. */
enum {
    HAPTIC_PROXY_TOUCHES = 1u << 0,
    HAPTIC_PROXY_STICKS = 1u << 1,  /* static friction: the position moves with surface_velocity */
    HAPTIC_PROXY_TANGENTS = 1u << 2 /* the compliance has two tangential rows for this proxy */
};

/* Bits of haptic_contact_frame.flags. The planes push the particles with the forces of the contact problem of
 * rt-core/docs/forces.md, whose compliance the frame carries. Without compliance the tool is limp: between
 * particles i and j of N it is, relative, (N k / k_t) delta_ij + 1 - k / k_t. For k_t = k each particle is on a spring
 * of its own: F = k sum d_i / N, T = k sum r_i x d_i / N (thesis, section 5.2.2), over the particles in contact. d_i
 * points from the particle's position without contact to the local proxy, r_i from the grip to that position. */
enum {
    HAPTIC_FRAME_SQUEEZED = 1u << 0,      /* a proxy is overconstrained; its position violates the surfaces least */
    HAPTIC_FRAME_CLUTCHED = 1u << 1,      /* the grip is decoupled from the scene: no force */
    HAPTIC_FRAME_HOLD_POSITIONS = 1u << 3 /* particles in contact are fixed at position and planes are ignored: the
                                             thesis' scheme (5.4.1), F = k sum d_i / N, T = k_t sum r_i x d_i / N */
};

typedef struct haptic_contact_frame {
    uint64_t sequence;       /* written by the ring: 1, 2, 3, ... over all sessions of the ring */
    uint64_t session;        /* written by the ring: a new value each time a writer attaches */
    uint64_t state_sequence; /* of the device state that this frame responds to; 0 if none yet */
    int64_t state_time_ns;   /* encoder latch time of that state */
    int64_t plane_time_ns;   /* time at which the planes' offsets are valid */
    int64_t publish_time_ns; /* when the frame was published */
    int64_t step_ns;         /* expected time until the next frame */
    double stiffness;        /* N/m, coupling as felt at the hand */
    double torque_stiffness; /* N/m, k_t of a limp tool (below); 0: same as stiffness */
    double static_friction;  /* coefficient up to which a proxy sticks to its planes; 0: no friction */
    double dynamic_friction; /* coefficient while it slides, at most static_friction */
    double body_work;        /* J at the hand, sum over the session: work that the surfaces have done on the springs of
                                the tool until plane_time_ns + step_ns; negative: they took more than they gave. The
                                hand can be given no more than this. 0: not known; the passivity observer then believes
                                the velocities of the planes, which is too much if the surfaces answer an old pose */
    uint32_t proxy_count;    /* 0..HAPTIC_MAX_PROXIES */
    uint32_t flags;
    uint32_t compliance_rows; /* rows of `compliance`; 0: a limp tool, each particle on a spring of its own */
    uint32_t reserved;        /* 0 */
    haptic_proxy proxies[HAPTIC_MAX_PROXIES];
    /* Relative: `stiffness` times the displacement of row r per newton on row s <= r, at index r (r + 1) / 2 + s; so it
     * stays the same when the coupling fades. Proxy by proxy, the rows are the normals of its planes, then its two
     * tangents (rt-core/docs/forces.md) if HAPTIC_PROXY_TANGENTS is set. */
    float compliance[HAPTIC_MAX_COMPLIANCES];
} haptic_contact_frame;

/* States of the safety machine (haptic_device_state.safety_state). */
enum {
    HAPTIC_DISARMED = 0,    /* zero to all motors */
    HAPTIC_TENSIONING = 1,  /* ramp to minimum tension */
    HAPTIC_CALIBRATING = 2, /* grip at the centre, string lengths are set */
    HAPTIC_RUNNING = 3,
    HAPTIC_FAULTED = 4, /* force faded out; a fault bit gives the reason */
    HAPTIC_PROVING = 5  /* between tensioning and calibrating: each motor in turn pulls slightly */
};

/* Faults, latched until the process is armed again (haptic_device_state.faults). */
enum {
    HAPTIC_FAULT_EXCHANGE = 1u << 0,  /* transfer failed, short or late */
    HAPTIC_FAULT_JUMP = 1u << 1,      /* an encoder moved faster than a hand can move */
    HAPTIC_FAULT_SLACK = 1u << 2,     /* a string reads longer than the others imply: it is slack */
    HAPTIC_FAULT_RESIDUAL = 1u << 3,  /* the eight lengths are inconsistent */
    HAPTIC_FAULT_OVERRUN = 1u << 4,   /* too many consecutive ticks were late */
    HAPTIC_FAULT_NONFINITE = 1u << 5, /* a value was not finite */
    HAPTIC_FAULT_STOP = 1u << 6,      /* stop input or signal */
    HAPTIC_FAULT_THERMAL = 1u << 7,   /* a motor exceeded its thermal rating */
    HAPTIC_FAULT_WATCHDOG = 1u << 8,  /* no tick completed for too long: the watchdog zeroed the motors */
    HAPTIC_FAULT_WIRING = 1u << 9,    /* a motor's pull was answered by another string, by none, or the wrong way */
    HAPTIC_FAULT_POSE = 1u << 10,     /* the grip was not at the centre or not level when the lengths were set */
    HAPTIC_FAULT_BUDGET = 1u << 11,   /* a limit of the session was used up: energy or time under force */
    HAPTIC_FAULT_GUARD = 1u << 12     /* the guard zeroed the motors of a frozen loop, or a supervisor was lost */
};

/* Data that one tick dropped or limited (haptic_device_state.tick_flags). Bits 24 to 31: strings 0 to 7 that may be
 * faulty when the eight lengths are inconsistent; several if the lengths cannot distinguish them. */
#define HAPTIC_TICK_SUSPECTS_SHIFT 24u
enum {
    HAPTIC_TICK_OVERRUN = 1u << 0,            /* woke after the next deadline had passed */
    HAPTIC_TICK_FRAME_STALE = 1u << 1,        /* no recent contact frame: the force fades */
    HAPTIC_TICK_FRAME_REJECTED = 1u << 2,     /* a frame failed validation and was ignored */
    HAPTIC_TICK_FORCE_LIMITED = 1u << 3,      /* the wrench was limited in magnitude */
    HAPTIC_TICK_SLEW_LIMITED = 1u << 4,       /* the wrench was limited in rate of change */
    HAPTIC_TICK_WRENCH_UNREACHABLE = 1u << 5, /* tensions within limits cannot exert the wrench; the closest was sent */
    HAPTIC_TICK_EXCHANGE_FAILED = 1u << 6,    /* no encoder packet: the previous pose was used */
    HAPTIC_TICK_DERATED = 1u << 7,            /* a warm motor has a reduced tension limit */
    HAPTIC_TICK_STIFFNESS_LIMITED = 1u << 8,  /* the stiffness was reduced to what rate and damping allow */
    HAPTIC_TICK_PASSIVITY_LIMITED = 1u << 9,  /* the wrench was modified so that it does not generate energy */
    HAPTIC_TICK_PROBE_OFF = 1u << 10,         /* the kernel refused an edge of a GPIO probe, which is now off */
    HAPTIC_TICK_UNPROVEN = 1u << 11,          /* movement has not yet proved the pose: the force is limited */
    HAPTIC_TICK_COMMISSIONING = 1u << 12,     /* the device has no signed protocol: the force is limited to 1 N */
    HAPTIC_TICK_WORKSPACE_EDGE = 1u << 13,    /* the soft wall of the workspace pushes the grip back */
    HAPTIC_TICK_ARM_AWAITED = 1u << 14,       /* disarmed until a person arms the device */
    HAPTIC_TICK_BUDGET_LOW = 1u << 15,        /* most of the session's energy or time is used */
    HAPTIC_TICK_OVERLAY = 1u << 16            /* a wrench overlay pushes beside the contact */
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
    double force[3];                /* N, actually exerted by the strings */
    double torque[3];               /* N*m, as above */
    double proxy_position[3];       /* m, local proxy of the first particle */
    double tension[HAPTIC_STRINGS]; /* N, sent to the motors */
    double stiffness;               /* N/m, of the frame's coupling after the limits of rate, device and passivity */
    double scale;                   /* 0..1, part of the frame's wrench that is rendered: fade, blend, passivity */
    double impulse[3];              /* N*s, integral since the process started of the part of `force` due to frames: */
    double angular_impulse[3];      /* N*m*s, of `torque`: without what idle strings exert here, and without rounding */
    uint32_t safety_state;
    uint32_t faults;
    uint32_t tick_flags;
    uint32_t buttons; /* bit k: button k is pressed */
} haptic_device_state;

/* A wrench to add to that of the contact, which comes through rt-core relay. The real-time process takes none unless
 * its settings allow some; then it bounds its size and its rate, and lets it fade when none has arrived for a while. */
typedef struct haptic_wrench_overlay {
    uint64_t sequence;       /* written by the ring */
    uint64_t session;        /* written by the ring */
    int64_t arrival_time_ns; /* when it arrived on the machine of the real-time process */
    double force[3];         /* N, on the grip */
    double torque[3];        /* N*m, on the grip about its position */
} haptic_wrench_overlay;

#ifdef __cplusplus
}
#endif

#endif /* HAPTIC_FRAMES_H */
