#include "haptic/denormals.hpp"

#if defined(__x86_64__)
#include <xmmintrin.h>
#endif

namespace haptic {

#if defined(__x86_64__)

namespace {
// Intel SDM volume 1, section 10.2.3: bit 15 flushes results to zero, bit 6 takes denormal operands as zero.
constexpr std::uint32_t kFlushResults = 1u << 15;
constexpr std::uint32_t kFlushOperands = 1u << 6;
}  // namespace

FlushDenormals::FlushDenormals() noexcept : saved_(_mm_getcsr()) {
    _mm_setcsr(static_cast<std::uint32_t>(saved_) | kFlushResults | kFlushOperands);
}

FlushDenormals::~FlushDenormals() {
    _mm_setcsr(static_cast<std::uint32_t>(saved_));
}

bool denormals_are_flushed() noexcept {
    return (_mm_getcsr() & kFlushResults) != 0;
}

#elif defined(__aarch64__)

namespace {
// Arm Architecture Reference Manual, FPCR: bit 24 (FZ) flushes both.
constexpr std::uint64_t kFlush = 1u << 24;
}  // namespace

FlushDenormals::FlushDenormals() noexcept : saved_(0) {
    asm volatile("mrs %0, fpcr" : "=r"(saved_));
    asm volatile("msr fpcr, %0" : : "r"(saved_ | kFlush));
}

FlushDenormals::~FlushDenormals() {
    asm volatile("msr fpcr, %0" : : "r"(saved_));
}

bool denormals_are_flushed() noexcept {
    std::uint64_t control = 0;
    asm volatile("mrs %0, fpcr" : "=r"(control));
    return (control & kFlush) != 0;
}

#else

FlushDenormals::FlushDenormals() noexcept : saved_(0) {}
FlushDenormals::~FlushDenormals() = default;

bool denormals_are_flushed() noexcept {
    return false;
}

#endif

}  // namespace haptic
