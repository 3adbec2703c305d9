// Counts what the calling thread allocates and frees while a guard lives. Link allocation_guard.cpp into a test's
// executable: it takes the place of the C library's allocator, and with it of operator new.
#pragma once

#include <cstddef>

namespace haptic::test {

class AllocationGuard {
  public:
    AllocationGuard() noexcept;
    AllocationGuard(const AllocationGuard&) = delete;
    AllocationGuard& operator=(const AllocationGuard&) = delete;
    ~AllocationGuard();

    /// Calls of malloc, calloc, realloc, free, aligned_alloc, memalign and posix_memalign by this thread so far.
    [[nodiscard]] std::size_t calls() const noexcept;
};

}  // namespace haptic::test
