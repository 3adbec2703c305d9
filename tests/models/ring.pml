/* The ring's protocol (shared/src/ring_memory.cpp, shared/src/ring.cpp) for the model checker Spin.
 *
 * Every store and load of the program is one statement here, in the program's order. That is the whole truth and not a
 * simplification: all stores are release stores by one writer, all loads acquire loads, so the reader sees the stores in
 * the order in which they stand (see ring_memory.hpp).
 *
 * The writer may be killed before any statement; the next one takes over with nothing but what is in the segment. The
 * reader may be replaced by a new one as well. Frame n by writer w has the value (n, w) in each of its words, so that a
 * word of another frame, and a word of the same frame by a killed writer, both show. Frames have different lengths.
 *
 * Proved for every interleaving:
 *   whole      a frame that is returned has all its words from one writing of that very frame
 *   rising     each reader gets rising sequences; head never goes back
 *   found      a read during which the writer does nothing (it is dead, stopped or busy elsewhere) returns the newest
 *              frame if it is new: a dead writer never takes the last good frame with it
 *   announced  what is read had been announced complete
 *
 * Each -DWRONG_... below breaks the protocol in one place, and the checker must find the error: tests/models/check_ring.sh.
 */

#ifndef SLOTS
#define SLOTS 2    /* the fewest that can work; the program has 8 so that a reader is hardly ever overtaken */
#endif
#ifndef FRAMES
#define FRAMES 5   /* twice round the ring, and on */
#endif
#define WORDS 2
#define WRITERS 3  /* of which all but the last may be killed */
#define READERS 2
#define ATTEMPTS 2

#define LENGTH(n) (1 + (n) % WORDS)
#define VALUE(n, w) ((n) * 4 + (w))

typedef Slot {
    byte stamp;       /* 2n-1: frame n is being written; 2n: it is complete */
    byte words;       /* how many words frame n has */
    byte word[WORDS]
};
Slot slot[SLOTS];
byte head;            /* the newest complete frame */

/* Not of the program, for the assertions only. */
byte announced[FRAMES + 1];  /* which writer's frame n was announced */
bool quiet;                  /* the writer has done nothing since the read began */

/* One store of the writer; or its death before it. */
#define STORE(statement)                       \
    if                                         \
    :: d_step { statement; quiet = false }     \
    :: w < WRITERS - 1 -> goto killed          \
    fi

active proctype Writer() {
    byte w;     /* which writer this is */
    byte n;     /* the frame that it writes */
    byte i;

start:
    n = head + 1;
#ifdef WRONG_TAKEOVER_STARTS_AGAIN
    n = 1;
#endif
#ifdef WRONG_TAKEOVER_TRUSTS_SLOT
    /* "The slot is stamped for the next frame, so my predecessor was at it: announce it." */
    if
    :: n <= FRAMES && slot[n % SLOTS].stamp == 2 * n - 1 ->
        STORE(slot[n % SLOTS].stamp = 2 * n);
        STORE(head = n; announced[n] = w);
        n++
    :: else
    fi;
#endif
    do
    :: n <= FRAMES ->
#ifdef WRONG_HEAD_FIRST
        STORE(head = n; announced[n] = w);
#endif
#ifndef WRONG_NO_ODD_STAMP
        STORE(slot[n % SLOTS].stamp = 2 * n - 1);
#endif
#ifdef WRONG_WORDS_LAST
        /* What a compiler or processor may make of stores without an order. The stamp alone, before the words, would do
         * no harm: head still says that the frame is not there yet. */
        STORE(slot[n % SLOTS].stamp = 2 * n);
        STORE(head = n; announced[n] = w);
#endif
        STORE(slot[n % SLOTS].words = LENGTH(n));
        i = 0;
        do
        :: i < LENGTH(n) -> STORE(slot[n % SLOTS].word[i] = VALUE(n, w)); i++
        :: else -> break
        od;
#ifndef WRONG_WORDS_LAST
        STORE(slot[n % SLOTS].stamp = 2 * n);
#endif
#if !defined(WRONG_HEAD_FIRST) && !defined(WRONG_WORDS_LAST)
        STORE(assert(n > head); head = n; announced[n] = w);
#endif
        n++
    :: else -> goto done
    od;

killed:
    atomic { w++; n = 0; i = 0 };
    goto start;
done:
    skip
}

active proctype Reader() {
    byte readers = 1;
    byte last;          /* the sequence that this reader returned last */
    byte attempt;
    byte newest;
    byte count;
    byte i;
    byte word[WORDS];   /* its copy */

    do
    :: readers < READERS -> d_step { readers++; last = 0 }    /* the next reader attaches */
    :: true ->
        d_step { attempt = 0; quiet = true };
        do
        :: attempt == ATTEMPTS ->
            assert(!quiet);                                    /* found */
            break
        :: else ->
            newest = head;
            if
            :: newest <= last -> break                         /* nothing new */
            :: else
            fi;
            if
            :: slot[newest % SLOTS].stamp == 2 * newest ->
                count = slot[newest % SLOTS].words;
                i = 0;
                do
                :: i < count && i < WORDS -> word[i] = slot[newest % SLOTS].word[i]; i++
                :: else -> break
                od;
                if
#ifdef WRONG_NO_SECOND_LOOK
                :: true ->
#else
                :: slot[newest % SLOTS].stamp == 2 * newest ->
#endif
                    d_step {
                        assert(newest > last);                 /* rising */
                        assert(count == LENGTH(newest));       /* whole ... */
                        i = 0;
                        do
                        :: i < count -> assert(word[i] == VALUE(newest, announced[newest])); i++
                        :: else -> break
                        od;
                        last = newest
                    };
                    break
#ifndef WRONG_NO_SECOND_LOOK
                :: else
#endif
                fi
            :: else
            fi;
            attempt++                                          /* overtaken: again with the newest */
        od;
        atomic { newest = 0; count = 0; i = 0; word[0] = 0; word[1] = 0 }
    od
}
