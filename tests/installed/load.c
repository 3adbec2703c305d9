/* Loads libhaptic as a plugin would, uses both sides of a session, and unloads it, twice: load LIBRARY SESSION */
#include <dlfcn.h>
#include <haptic/haptic.h>
#include <stdio.h>
#include <string.h>

#define EXPECT(condition)                                                 \
    do {                                                                  \
        if (!(condition)) {                                               \
            fprintf(stderr, "load.c:%d: not %s\n", __LINE__, #condition); \
            return 1;                                                     \
        }                                                                 \
    } while (0)

/* POSIX lets dlsym return functions, ISO C does not know of it. */
#define FIND(name)                                    \
    __typeof__(&haptic_##name) name;                  \
    *(void**)&name = dlsym(library, "haptic_" #name); \
    EXPECT((name) != NULL)

static haptic_contact_frame frame;

static int use(const char* file, const char* session) {
    void* const library = dlopen(file, RTLD_NOW | RTLD_LOCAL);
    if (library == NULL) {
        fprintf(stderr, "%s\n", dlerror());
        return 1;
    }
    FIND(abi_version);
    FIND(last_error);
    FIND(now_ns);
    FIND(contact_writer_open);
    FIND(contact_writer_publish);
    FIND(contact_writer_close);
    FIND(contact_observer_open);
    FIND(contact_observer_next);
    FIND(contact_observer_close);
    EXPECT(abi_version() == HAPTIC_ABI_VERSION);

    /* An exception is thrown inside and stays inside. */
    EXPECT(contact_writer_open("no/good") == NULL && strstr(last_error(), "no/good") != NULL);

    haptic_contact_writer* const writer = contact_writer_open(session);
    haptic_contact_observer* const observer = contact_observer_open(session);
    EXPECT(writer != NULL && observer != NULL);
    memset(&frame, 0, sizeof frame);
    frame.step_ns = 1000000;
    frame.proxy_count = 1;
    frame.proxies[0].plane_count = 1;
    frame.proxies[0].planes[0].normal[1] = 1.0;
    frame.proxies[0].planes[0].offset = 0.125;
    EXPECT(contact_writer_publish(writer, &frame, now_ns()) == 1);
    memset(&frame, 0, sizeof frame);
    EXPECT(contact_observer_next(observer, &frame, now_ns()) == 1);
    EXPECT(frame.sequence == 1 && frame.proxies[0].planes[0].offset == 0.125);
    contact_observer_close(observer);
    contact_writer_close(writer);

    EXPECT(dlclose(library) == 0);
    EXPECT(dlopen(file, RTLD_NOW | RTLD_NOLOAD) == NULL); /* nothing keeps it in memory */
    return 0;
}

int main(int argc, char** argv) {
    if (argc != 3) {
        fprintf(stderr, "usage: %s LIBRARY SESSION\n", argv[0]);
        return 2;
    }
    return use(argv[1], argv[2]) != 0 || use(argv[1], argv[2]) != 0;
}
