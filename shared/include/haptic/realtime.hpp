// The real-time contract, written so that the compiler can hold us to it.
//
// Every function that the tick of rt-core reaches carries HAPTIC_RT. To every compiler it says noexcept; clang 20 and
// newer also check that such a function neither allocates, locks, throws nor calls anything that might
// (-Wfunction-effects), and the real-time sanitizer checks the same while it runs (presets clang-rt and rtsan).
//
// HAPTIC_RT_EXCEPTION_BEGIN(reason) ... HAPTIC_RT_EXCEPTION_END bracket a block with a call that the compiler cannot
// see through and that we know to be bounded; the sanitizer leaves it alone too. The reason names the bound. There are
// few; `git grep HAPTIC_RT_EXCEPTION` lists them all.
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
