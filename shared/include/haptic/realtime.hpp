// Real-time contract as compiler attributes.
//
// Every function reachable from the tick of rt-core carries HAPTIC_RT. All compilers treat it as noexcept. clang 20 and
// newer also check that such a function does not allocate, lock, throw or call a function that might
// (-Wfunction-effects); the real-time sanitizer checks the same at run time (presets clang-rt and rtsan).
//
// HAPTIC_RT_EXCEPTION_BEGIN(reason) ... HAPTIC_RT_EXCEPTION_END enclose a call that the compiler cannot check but that
// is known to be bounded. The sanitizer ignores it, too. The reason states the bound. `git grep HAPTIC_RT_EXCEPTION`
// lists all exceptions.
#pragma once

#if defined(__clang__) && __clang_major__ >= 20
#define HAPTIC_RT noexcept [[clang::nonblocking]]
#define HAPTIC_RT_IGNORE_BEGIN \
    _Pragma("clang diagnostic push") _Pragma("clang diagnostic ignored \"-Wfunction-effects\"")
#define HAPTIC_RT_IGNORE_END _Pragma("clang diagnostic pop")
#if __has_feature(realtime_sanitizer)
#include <sanitizer/rtsan_interface.h>
#define HAPTIC_RT_UNWATCHED const ::__rtsan::ScopedDisabler haptic_rt_unwatched;
#else
#define HAPTIC_RT_UNWATCHED
#endif
#else
#define HAPTIC_RT noexcept
#define HAPTIC_RT_IGNORE_BEGIN
#define HAPTIC_RT_IGNORE_END
#define HAPTIC_RT_UNWATCHED
#endif

#define HAPTIC_RT_EXCEPTION_BEGIN(reason) \
    HAPTIC_RT_IGNORE_BEGIN {              \
        HAPTIC_RT_UNWATCHED
#define HAPTIC_RT_EXCEPTION_END \
    }                           \
    HAPTIC_RT_IGNORE_END
