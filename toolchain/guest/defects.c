/* Plants one defect into rt-core's loop, which the negative control of toolchain/vm must find. Preloaded:
 *   HAPTIC_DEFECT=none|page-fault|priority-inversion LD_PRELOAD=defects.so rt-core measure ...
 *
 * It acts in the thread of priority kLoopPriority, which is the loop, at the kRead-th reading of the clock after it has
 * slept until its deadline: after the exchange. The first reading is that of the wake-up. Other threads are left alone.
 *   page-fault          each tick uses memory that is not locked, and that the kernel takes away four times a second
 *   priority-inversion  each tick takes a lock without priority inheritance. Four times a second an ordinary thread
 *                       ("holder") holds it, when a thread of middle priority ("middle") takes the processor from it
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <pthread.h>
#include <sched.h>
#include <semaphore.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>

enum { kLoopPriority = 80, kMiddlePriority = 40, kRead = 4, kPages = 2048, kPageBytes = 4096 };
enum { kEveryNs = 250000000, kBurnNs = 3000000 };

typedef int SleepUntil(clockid_t clock, int flags, const struct timespec* until, struct timespec* left);
typedef int ReadClock(clockid_t clock, struct timespec* now);

static SleepUntil* sleep_until; /* the C library's */
static ReadClock* read_clock;   /* the C library's */
static volatile char* pages;    /* page-fault: what a tick uses */
static int inverts;             /* priority-inversion is wanted */
static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static sem_t held; /* the holder has the lock */

static void die(const char* what) {
    fprintf(stderr, "defects: %s\n", what);
    abort();
}

static void rest(void) {
    const struct timespec interval = {0, kEveryNs};
    if (sleep_until(CLOCK_MONOTONIC, 0, &interval, NULL) != 0) {
        die("a thread cannot sleep");
    }
}

/* Takes the memory away: the next access of each page is a page fault. */
static void* take_away(void* unused) {
    for (;;) {
        rest();
        if (munlock((void*)pages, kPages * kPageBytes) != 0 ||
            madvise((void*)pages, kPages * kPageBytes, MADV_DONTNEED) != 0) {
            die("the kernel keeps the memory");
        }
    }
    return unused;
}

static void* hold(void* unused) {
    pthread_setname_np(pthread_self(), "holder");
    for (;;) {
        rest();
        pthread_mutex_lock(&lock);
        sem_post(&held); /* the middle thread takes the processor here */
        pthread_mutex_unlock(&lock);
    }
    return unused;
}

static void* burn(void* unused) {
    pthread_setname_np(pthread_self(), "middle");
    const struct sched_param middle = {.sched_priority = kMiddlePriority};
    if (pthread_setschedparam(pthread_self(), SCHED_FIFO, &middle) != 0) {
        die("the middle thread needs CAP_SYS_NICE");
    }
    for (;;) {
        struct timespec begin;
        struct timespec now;
        sem_wait(&held);
        read_clock(CLOCK_THREAD_CPUTIME_ID, &begin);
        do {
            read_clock(CLOCK_THREAD_CPUTIME_ID, &now);
        } while ((now.tv_sec - begin.tv_sec) * 1000000000L + now.tv_nsec - begin.tv_nsec < kBurnNs);
    }
    return unused;
}

static void start(void* (*entry)(void*)) {
    pthread_t thread;
    if (pthread_create(&thread, NULL, entry, NULL) != 0) {
        die("no thread");
    }
    pthread_detach(thread);
}

__attribute__((constructor)) static void plant(void) {
    const char* defect = getenv("HAPTIC_DEFECT");
    sleep_until = (SleepUntil*)dlsym(RTLD_NEXT, "clock_nanosleep");
    read_clock = (ReadClock*)dlsym(RTLD_NEXT, "clock_gettime");
    unsetenv("LD_PRELOAD"); /* the guard is a process of its own */
    if (defect == NULL || sleep_until == NULL || read_clock == NULL) {
        die("HAPTIC_DEFECT is none, page-fault or priority-inversion");
    }
    if (strcmp(defect, "page-fault") == 0) {
        void* memory = mmap(NULL, kPages * kPageBytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
        if (memory == MAP_FAILED) {
            die("no memory");
        }
        madvise(memory, kPages * kPageBytes, MADV_NOHUGEPAGE); /* refused by kernels that have none, as PREEMPT_RT */
        pages = memory;
        start(take_away);
    } else if (strcmp(defect, "priority-inversion") == 0) {
        inverts = 1;
        sem_init(&held, 0, 0);
        start(hold);
        start(burn);
    } else if (strcmp(defect, "none") != 0) {
        die("HAPTIC_DEFECT is none, page-fault or priority-inversion");
    }
}

/* True in the loop's thread, once it has its priority. */
static int in_loop(void) {
    static __thread int known;
    if (!known) {
        struct sched_param present;
        known = sched_getscheduler(0) == SCHED_FIFO && sched_getparam(0, &present) == 0 &&
                present.sched_priority == kLoopPriority;
    }
    return known;
}

static __thread int reads; /* of the clock, since the thread slept */

int clock_nanosleep(clockid_t clock, int flags, const struct timespec* until, struct timespec* left) {
    const int error = sleep_until(clock, flags, until, left);
    if ((flags & TIMER_ABSTIME) != 0) {
        reads = 0;
    }
    return error;
}

int clock_gettime(clockid_t clock, struct timespec* now) {
    if (++reads == kRead && in_loop()) {
        for (int page = 0; pages != NULL && page < kPages; ++page) {
            pages[page * kPageBytes] = 1;
        }
        if (inverts) {
            pthread_mutex_lock(&lock);
            pthread_mutex_unlock(&lock);
        }
    }
    return read_clock(clock, now);
}
