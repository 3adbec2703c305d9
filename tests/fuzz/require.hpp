// What a fuzz target expects: an input that breaks it ends the process, and libFuzzer keeps the input.
#pragma once

#include <cstdio>
#include <cstdlib>

inline void require(bool held, const char* what) {
    if (!held) {
        std::fprintf(stderr, "broken promise: %s\n", what);
        std::abort();
    }
}
