/* The gateway between Haptic.m and libhaptic.so: haptic_mex(FUNCTION, ...) calls haptic.h, and copies between
 * structures of C and of MATLAB, field by field as the tables list them. Haptic.m documents functions and fields.
 * Compile it with
 *
 *     mex haptic_mex.c -lhaptic                 (MATLAB)
 *     mkoctfile --mex haptic_mex.c -lhaptic     (GNU Octave)
 */
#include <haptic/haptic.h>
#include <math.h>
#include <mex.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#define COUNT(array) (sizeof(array) / sizeof((array)[0]))

/* A field of a structure: in C `rows` numbers, in MATLAB an array whose columns are those of the structures. */
typedef struct Field {
    const char* name;
    mxClassID type;
    size_t rows;
    size_t at; /* bytes from the beginning of the structure */
} Field;

/* Fields of structures that lie in C as arrays of `inner` structures in each of any number of outer ones. */
typedef struct Group {
    const Field* fields;
    size_t count;
    size_t inner, inner_bytes, outer_bytes;
} Group;

#define STATE(name, type, rows) {#name, type, rows, offsetof(haptic_device_state, name)}
static const Field kStateFields[] = {
    STATE(sequence, mxUINT64_CLASS, 1),        STATE(session, mxUINT64_CLASS, 1),
    STATE(latch_time_ns, mxINT64_CLASS, 1),    STATE(frame_sequence, mxUINT64_CLASS, 1),
    STATE(position, mxDOUBLE_CLASS, 3),        STATE(orientation, mxDOUBLE_CLASS, 4),
    STATE(linear_velocity, mxDOUBLE_CLASS, 3), STATE(angular_velocity, mxDOUBLE_CLASS, 3),
    STATE(force, mxDOUBLE_CLASS, 3),           STATE(torque, mxDOUBLE_CLASS, 3),
    STATE(proxy_position, mxDOUBLE_CLASS, 3),  STATE(tension, mxDOUBLE_CLASS, HAPTIC_STRINGS),
    STATE(stiffness, mxDOUBLE_CLASS, 1),       STATE(scale, mxDOUBLE_CLASS, 1),
    STATE(impulse, mxDOUBLE_CLASS, 3),         STATE(angular_impulse, mxDOUBLE_CLASS, 3),
    STATE(safety_state, mxUINT32_CLASS, 1),    STATE(faults, mxUINT32_CLASS, 1),
    STATE(tick_flags, mxUINT32_CLASS, 1),      STATE(buttons, mxUINT32_CLASS, 1),
};
#define PEER(name, type) {#name, type, 1, offsetof(haptic_peer, name)}
static const Field kPeerFields[] = {PEER(session, mxUINT64_CLASS), PEER(heartbeat_ns, mxINT64_CLASS),
                                    PEER(pid, mxUINT32_CLASS), PEER(closed, mxUINT32_CLASS)};
/* Those of a contact frame that libhaptic writes: not copied from MATLAB. */
#define FRAME(name, type) {#name, type, 1, offsetof(haptic_contact_frame, name)}
static const Field kWrittenFields[] = {FRAME(sequence, mxUINT64_CLASS), FRAME(session, mxUINT64_CLASS),
                                       FRAME(publish_time_ns, mxINT64_CLASS)};
static const Field kFrameFields[] = {
    FRAME(state_sequence, mxUINT64_CLASS),  FRAME(state_time_ns, mxINT64_CLASS),
    FRAME(plane_time_ns, mxINT64_CLASS),    FRAME(step_ns, mxINT64_CLASS),
    FRAME(stiffness, mxDOUBLE_CLASS),       FRAME(torque_stiffness, mxDOUBLE_CLASS),
    FRAME(static_friction, mxDOUBLE_CLASS), FRAME(dynamic_friction, mxDOUBLE_CLASS),
    FRAME(body_work, mxDOUBLE_CLASS),       FRAME(flags, mxUINT32_CLASS),
};
#define PROXY(name, type, rows) {#name, type, rows, offsetof(haptic_proxy, name)}
static const Field kProxyFields[] = {
    PROXY(rest_offset, mxDOUBLE_CLASS, 3),      PROXY(rest_velocity, mxDOUBLE_CLASS, 3),
    PROXY(radius, mxDOUBLE_CLASS, 1),           PROXY(position, mxDOUBLE_CLASS, 3),
    PROXY(surface_velocity, mxDOUBLE_CLASS, 3), PROXY(in_contact, mxUINT32_CLASS, 1),
    PROXY(plane_count, mxUINT32_CLASS, 1),
};
#define PLANE(name, rows) {"plane_" #name, mxDOUBLE_CLASS, rows, offsetof(haptic_plane, name)}
static const Field kPlaneFields[] = {PLANE(normal, 3), PLANE(offset, 1), PLANE(velocity, 1)};
static const char* const kCompliance = "compliance";
static const char* const kMisuse = "haptic_mex is called by Haptic.m: see help Haptic";

#define ONE(fields) {fields, COUNT(fields), 1, 0, 0}
static const Group kState = ONE(kStateFields), kPeer = ONE(kPeerFields);
static const Group kWritten = ONE(kWrittenFields), kFrame = ONE(kFrameFields);
static const Group kProxies = {kProxyFields, COUNT(kProxyFields), 1, 0, sizeof(haptic_proxy)};
static const Group kPlanes = {kPlaneFields, COUNT(kPlaneFields), HAPTIC_MAX_PLANES, sizeof(haptic_plane),
                              sizeof(haptic_proxy)};

/* What is open: a session has the first two, an observer the others. */
typedef struct End {
    uint64_t id; /* 0: free */
    haptic_state_reader* states;
    haptic_contact_writer* contacts;
    haptic_state_observer* seen_states;
    haptic_contact_observer* seen_contacts;
} End;
static End ends[32];

/* Too large for the stack: a frame is 89 kB. A ring keeps 8, and may have been replaced by another. */
enum { kMostSeen = 16 };
static haptic_contact_frame frames[kMostSeen];
static haptic_device_state states[kMostSeen];

/* Ends the call with an error of MATLAB: does not return. */
static void refuse(const char* identifier, const char* format, ...) {
    char text[1200];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    mexErrMsgIdAndTxt(identifier, "%s", text);
}

static void close_end(End* end) {
    haptic_contact_writer_close(end->contacts);
    haptic_state_reader_close(end->states);
    haptic_contact_observer_close(end->seen_contacts);
    haptic_state_observer_close(end->seen_states);
    memset(end, 0, sizeof *end);
}

/* When MATLAB ends or unloads this file, as `clear mex` does. */
static void close_all(void) {
    for (size_t i = 0; i < COUNT(ends); ++i) {
        close_end(&ends[i]);
    }
}

static End* find_end(uint64_t id) {
    for (size_t i = 0; i < COUNT(ends); ++i) {
        if (ends[i].id == id) {
            return &ends[i];
        }
    }
    return NULL;
}

/* The id of an argument; 0 if it is none. */
static uint64_t id_of(const mxArray* argument) {
    return mxIsUint64(argument) && mxGetNumberOfElements(argument) == 1 ? *(const uint64_t*)mxGetData(argument) : 0;
}

static End* open_end(const mxArray* argument, bool session) {
    const uint64_t id = id_of(argument);
    End* const end = id != 0 ? find_end(id) : NULL;
    if (end == NULL) {
        refuse("haptic:closed", "this session or observer is closed: open another one with Haptic(name)");
    }
    if (session != (end->contacts != NULL)) {
        refuse("haptic:wrongKind", session
                                       ? "an observer neither reads nor publishes: open a session with Haptic(name)"
                                       : "a session does not observe: open an observer with Haptic(name, 'observe')");
    }
    return end;
}

/* Shapes: rows x outer, or of planes rows x inner x outer without the rows if there is one. Returns the dimensions. */
static mwSize sizes_of(const Group* group, const Field* field, size_t outer, mwSize sizes[3]) {
    mwSize dimensions = 0;
    if (field->rows > 1 || group->inner == 1) {
        sizes[dimensions++] = field->rows;
    }
    if (group->inner > 1) {
        sizes[dimensions++] = group->inner;
    }
    sizes[dimensions++] = outer;
    return dimensions;
}

static char* place_of(const Group* group, const Field* field, void* first, size_t column) {
    return (char*)first + column / group->inner * group->outer_bytes + column % group->inner * group->inner_bytes +
           field->at;
}

static size_t bytes_of(const Field* field) {
    return field->rows * (field->type == mxUINT32_CLASS ? sizeof(uint32_t) : sizeof(uint64_t));
}

static const char* name_of(mxClassID type) {
    switch (type) {
        case mxDOUBLE_CLASS:
            return "double";
        case mxINT64_CLASS:
            return "int64";
        case mxUINT64_CLASS:
            return "uint64";
        default:
            return "uint32";
    }
}

static mxArray* structures(size_t count) {
    return mxCreateStructMatrix(1, count, 0, NULL);
}

/* Names the fields, which are there even if no structure is. */
static void add_fields(mxArray* to, const Group* group) {
    for (size_t i = 0; i < group->count; ++i) {
        mxAddField(to, group->fields[i].name);
    }
}

/* From C to element k of a structure array. */
static void copy_out(mxArray* to, size_t k, const Group* group, void* first, size_t outer) {
    for (const Field* field = group->fields; field < group->fields + group->count; ++field) {
        mwSize sizes[3];
        const mwSize dimensions = sizes_of(group, field, outer, sizes);
        mxArray* const array = mxCreateNumericArray(dimensions, sizes, field->type, mxREAL);
        for (size_t column = 0; column < group->inner * outer; ++column) {
            memcpy((char*)mxGetData(array) + column * bytes_of(field), place_of(group, field, first, column),
                   bytes_of(field));
        }
        mxSetField(to, k, field->name, array);
    }
}

static void write_sizes(char* text, size_t bytes, const mwSize* sizes, mwSize dimensions) {
    size_t used = 0;
    for (mwSize d = 0; d < dimensions && used < bytes; ++d) {
        used += (size_t)snprintf(text + used, bytes - used, "%s%zu", d > 0 ? " x " : "", (size_t)sizes[d]);
    }
}

static const mxArray* present_field(const mxArray* frame, const char* name) {
    const mxArray* const array = mxGetField(frame, 0, name);
    if (array == NULL) {
        refuse("haptic:invalidFrame", "frame.%s is missing: begin with Haptic.frame(proxies)", name);
    }
    return array;
}

/* A field of a contact frame, which must be there, real and of this shape. */
static const mxArray* checked_field(const mxArray* frame, const Group* group, const Field* field, size_t outer) {
    const mxArray* const array = present_field(frame, field->name);
    if (mxIsComplex(array) || mxIsSparse(array) || (field->type == mxDOUBLE_CLASS && !mxIsDouble(array))) {
        refuse("haptic:invalidFrame", "frame.%s should be a real, full array of %s, is %s%s", field->name,
               name_of(field->type), mxGetClassName(array),
               mxIsComplex(array)  ? ", complex"
               : mxIsSparse(array) ? ", sparse"
                                   : "");
    }
    mwSize sizes[3];
    const mwSize dimensions = sizes_of(group, field, outer, sizes);
    if (mxGetM(array) != (size_t)sizes[0] || mxGetNumberOfElements(array) != field->rows * group->inner * outer) {
        char found[64], needed[64];
        write_sizes(found, sizeof found, mxGetDimensions(array), mxGetNumberOfDimensions(array));
        write_sizes(needed, sizeof needed, sizes, dimensions);
        refuse("haptic:invalidFrame",
               "frame.%s is %s, should be %s (frame.position has %zu columns, one for each proxy)", field->name, found,
               needed, outer);
    }
    return array;
}

/* Element k as an integer, of which a uint64 field has the bits; false if it is none, or not of the field's range. */
static bool to_integer(const mxArray* array, size_t k, const Field* field, int64_t* value) {
    const void* const data = mxGetData(array);
    switch (mxGetClassID(array)) {
        case mxDOUBLE_CLASS: {
            /* Doubles are integers up to 2^53; the comparison is false for a NaN. */
            const double number = ((const double*)data)[k];
            if (!(fabs(number) <= 9007199254740992.0) || number != floor(number)) {
                return false;
            }
            *value = (int64_t)number;
            break;
        }
        case mxUINT64_CLASS: {
            const uint64_t number = ((const uint64_t*)data)[k];
            *value = (int64_t)number;
            if (number > INT64_MAX) {
                return field->type == mxUINT64_CLASS;
            }
            break;
        }
        case mxINT64_CLASS:
            *value = ((const int64_t*)data)[k];
            break;
        case mxUINT32_CLASS:
            *value = ((const uint32_t*)data)[k];
            break;
        case mxLOGICAL_CLASS:
            *value = ((const mxLogical*)data)[k];
            break;
        default:
            return false;
    }
    return field->type == mxINT64_CLASS || (*value >= 0 && (field->type == mxUINT64_CLASS || *value <= UINT32_MAX));
}

/* From a contact frame of MATLAB to C. */
static void copy_in(const mxArray* frame, const Group* group, void* first, size_t outer) {
    for (const Field* field = group->fields; field < group->fields + group->count; ++field) {
        const mxArray* const array = checked_field(frame, group, field, outer);
        for (size_t column = 0; column < group->inner * outer; ++column) {
            char* const to = place_of(group, field, first, column);
            int64_t integer = 0;
            if (field->type == mxDOUBLE_CLASS) {
                memcpy(to, (const char*)mxGetData(array) + column * bytes_of(field), bytes_of(field));
            } else if (to_integer(array, column, field, &integer)) {
                /* Little-endian: the low bytes come first. */
                memcpy(to, &integer, bytes_of(field));
            } else {
                refuse("haptic:invalidFrame", "frame.%s(%zu), of class %s, is no %s", field->name, column + 1,
                       mxGetClassName(array), name_of(field->type));
            }
        }
    }
}

/* The lower triangle of a square matrix, row by row. */
static void copy_compliance_in(const mxArray* from, haptic_contact_frame* frame) {
    const mxArray* const array = present_field(from, kCompliance);
    if (!mxIsDouble(array) || mxIsComplex(array) || mxIsSparse(array) || mxGetM(array) != mxGetN(array) ||
        mxGetM(array) > HAPTIC_MAX_COMPLIANCE_ROWS) {
        refuse("haptic:invalidFrame",
               "frame.compliance should be a square matrix of double with at most %u rows, or []",
               HAPTIC_MAX_COMPLIANCE_ROWS);
    }
    const size_t rows = mxGetM(array);
    float* to = frame->compliance;
    for (size_t r = 0; r < rows; ++r) {
        for (size_t s = 0; s <= r; ++s) {
            *to++ = (float)mxGetPr(array)[r + s * rows];
        }
    }
    frame->compliance_rows = (uint32_t)rows;
}

static void copy_compliance_out(mxArray* to, size_t k, const haptic_contact_frame* frame) {
    const size_t rows = frame->compliance_rows;
    mxArray* const array = mxCreateDoubleMatrix(rows, rows, mxREAL);
    const float* from = frame->compliance;
    for (size_t r = 0; r < rows; ++r) {
        for (size_t s = 0; s <= r; ++s, ++from) {
            mxGetPr(array)[r + s * rows] = mxGetPr(array)[s + r * rows] = *from;
        }
    }
    mxSetField(to, k, kCompliance, array);
}

static bool has_field(const Group* group, const char* name) {
    for (size_t i = 0; i < group->count; ++i) {
        if (strcmp(group->fields[i].name, name) == 0) {
            return true;
        }
    }
    return false;
}

/* An assignment to a misspelt field adds it, and would have no other effect. */
static void refuse_unknown_fields(const mxArray* frame) {
    for (int i = 0; i < mxGetNumberOfFields(frame); ++i) {
        const char* const name = mxGetFieldNameByNumber(frame, i);
        if (!has_field(&kFrame, name) && !has_field(&kProxies, name) && !has_field(&kPlanes, name) &&
            !has_field(&kWritten, name) && strcmp(name, kCompliance) != 0) {
            refuse("haptic:invalidFrame", "frame.%s is no field of a contact frame: Haptic.frame(1) shows all", name);
        }
    }
}

/* An id for what will be opened, never given before: it is the time, so that unloading this file forgets none. */
static void new_id(mxArray** result, const mxArray* const* arguments) {
    (void)arguments;
    static uint64_t last_id = 0;
    const uint64_t now = (uint64_t)haptic_now_ns();
    last_id = now > last_id ? now : last_id + 1;
    *result = mxCreateNumericMatrix(1, 1, mxUINT64_CLASS, mxREAL);
    *(uint64_t*)mxGetData(*result) = last_id;
}

static void open_any(const mxArray* const* arguments, bool session) {
    char name[80] = "";
    if (mxGetString(arguments[1], name, sizeof name) != 0) {
        refuse("haptic:notOpened", "a session name is text of 1 to 64 of the characters A-Z a-z 0-9 _ -");
    }
    if (haptic_abi_version() != HAPTIC_ABI_VERSION) {
        refuse("haptic:notLoaded", "libhaptic.so.0 has ABI %u, and haptic_mex was compiled for %u: compile it again",
               haptic_abi_version(), HAPTIC_ABI_VERSION);
    }
    const uint64_t id = id_of(arguments[0]);
    End* const end = find_end(0);
    if (id == 0 || find_end(id) != NULL) {
        refuse("haptic:invalidArgument", "%s", kMisuse);
    }
    if (end == NULL) {
        refuse("haptic:notOpened", "%zu sessions and observers are open: close some", COUNT(ends));
    }
    bool opened = false;
    if (session) {
        opened = (end->states = haptic_state_reader_open(name)) != NULL &&
                 (end->contacts = haptic_contact_writer_open(name)) != NULL;
    } else {
        opened = (end->seen_states = haptic_state_observer_open(name)) != NULL &&
                 (end->seen_contacts = haptic_contact_observer_open(name)) != NULL;
    }
    if (!opened) {
        close_end(end);
        refuse("haptic:notOpened", "%s", haptic_last_error());
    }
    end->id = id;
}

static void open_session(mxArray** result, const mxArray* const* arguments) {
    (void)result;
    open_any(arguments, true);
}

static void open_observer(mxArray** result, const mxArray* const* arguments) {
    (void)result;
    open_any(arguments, false);
}

static void close_one(mxArray** result, const mxArray* const* arguments) {
    (void)result;
    const uint64_t id = id_of(arguments[0]);
    End* const end = id != 0 ? find_end(id) : NULL;
    if (end != NULL) {
        close_end(end);
    }
}

static void read_state(mxArray** result, const mxArray* const* arguments) {
    End* const end = open_end(arguments[0], true);
    const int found = haptic_state_reader_read(end->states, &states[0]);
    if (found == 1) {
        *result = structures(1);
        add_fields(*result, &kState);
        copy_out(*result, 0, &kState, &states[0], 1);
    } else {
        *result = mxCreateDoubleMatrix(0, 0, mxREAL);
    }
}

static void publish_frame(mxArray** result, const mxArray* const* arguments) {
    End* const end = open_end(arguments[0], true);
    const mxArray* const from = arguments[1];
    if (!mxIsStruct(from) || mxGetNumberOfElements(from) != 1) {
        refuse("haptic:invalidFrame", "a frame is one structure: begin with Haptic.frame(proxies)");
    }
    refuse_unknown_fields(from);
    const size_t proxies = mxGetN(present_field(from, "position"));
    if (proxies > HAPTIC_MAX_PROXIES) {
        refuse("haptic:invalidFrame", "frame.position has %zu columns: a frame has at most %u proxies", proxies,
               HAPTIC_MAX_PROXIES);
    }
    haptic_contact_frame* const frame = &frames[0];
    memset(frame, 0, sizeof *frame);
    copy_in(from, &kFrame, frame, 1);
    copy_in(from, &kProxies, frame->proxies, proxies);
    copy_in(from, &kPlanes, frame->proxies[0].planes, proxies);
    copy_compliance_in(from, frame);
    frame->proxy_count = (uint32_t)proxies;
    const uint64_t sequence = haptic_contact_writer_publish(end->contacts, frame, haptic_now_ns());
    if (sequence == 0) {
        refuse("haptic:invalidFrame", "%s", haptic_last_error());
    }
    *result = mxCreateNumericMatrix(1, 1, mxUINT64_CLASS, mxREAL);
    *(uint64_t*)mxGetData(*result) = sequence;
}

static void beat(mxArray** result, const mxArray* const* arguments) {
    (void)result;
    haptic_contact_writer_beat(open_end(arguments[0], true)->contacts, haptic_now_ns());
}

static void read_peer(mxArray** result, const mxArray* const* arguments) {
    haptic_peer peer;
    haptic_state_reader_peer(open_end(arguments[0], true)->states, &peer);
    *result = structures(1);
    add_fields(*result, &kPeer);
    copy_out(*result, 0, &kPeer, &peer, 1);
}

static void seen_states(mxArray** result, const mxArray* const* arguments) {
    End* const end = open_end(arguments[0], false);
    size_t count = 0;
    int found = 1;
    while (count < kMostSeen &&
           (found = haptic_state_observer_next(end->seen_states, &states[count], haptic_now_ns())) == 1) {
        ++count;
    }
    if (found < 0) {
        refuse("haptic:notObserved", "%s", haptic_last_error());
    }
    *result = structures(count);
    add_fields(*result, &kState);
    for (size_t k = 0; k < count; ++k) {
        copy_out(*result, k, &kState, &states[k], 1);
    }
}

static void seen_frames(mxArray** result, const mxArray* const* arguments) {
    End* const end = open_end(arguments[0], false);
    size_t count = 0;
    int found = 1;
    while (count < kMostSeen &&
           (found = haptic_contact_observer_next(end->seen_contacts, &frames[count], haptic_now_ns())) == 1) {
        ++count;
    }
    if (found < 0) {
        refuse("haptic:notObserved", "%s", haptic_last_error());
    }
    *result = structures(count);
    add_fields(*result, &kWritten);
    add_fields(*result, &kFrame);
    add_fields(*result, &kProxies);
    add_fields(*result, &kPlanes);
    mxAddField(*result, kCompliance);
    for (size_t k = 0; k < count; ++k) {
        haptic_contact_frame* const frame = &frames[k];
        copy_out(*result, k, &kWritten, frame, 1);
        copy_out(*result, k, &kFrame, frame, 1);
        copy_out(*result, k, &kProxies, frame->proxies, frame->proxy_count);
        copy_out(*result, k, &kPlanes, frame->proxies[0].planes, frame->proxy_count);
        copy_compliance_out(*result, k, frame);
    }
}

static void now_ns(mxArray** result, const mxArray* const* arguments) {
    (void)arguments;
    *result = mxCreateNumericMatrix(1, 1, mxINT64_CLASS, mxREAL);
    *(int64_t*)mxGetData(*result) = haptic_now_ns();
}

static const struct {
    const char* name;
    int arguments;
    void (*call)(mxArray** result, const mxArray* const* arguments);
} kFunctions[] = {
    {"new_id", 0, new_id},      {"open", 2, open_session}, {"observe", 2, open_observer},
    {"close", 1, close_one},    {"read", 1, read_state},   {"publish", 2, publish_frame},
    {"beat", 1, beat},          {"peer", 1, read_peer},    {"states", 1, seen_states},
    {"frames", 1, seen_frames}, {"now_ns", 0, now_ns},
};

void mexFunction(int nlhs, mxArray** plhs, int nrhs, const mxArray** prhs) {
    char name[16] = "";
    mexAtExit(close_all);
    if (nrhs > 0 && mxGetString(prhs[0], name, sizeof name) == 0 && nlhs <= 1) {
        for (size_t i = 0; i < COUNT(kFunctions); ++i) {
            if (strcmp(kFunctions[i].name, name) == 0 && kFunctions[i].arguments == nrhs - 1) {
                kFunctions[i].call(plhs, prhs + 1);
                return;
            }
        }
    }
    refuse("haptic:invalidArgument", "%s", kMisuse);
}
